//! An Arduino Uno, emulated cycle by cycle.
//!
//! [`Uno`] loads the very image that is flashed and executes it. The instructions are simavr's; the
//! timers, pins, serial port, watchdog and interrupt entry are this project's own (`shim/*.c`),
//! because simavr 1.6 departs from the data sheet there:
//!
//! | simavr 1.6 | here |
//! |---|---|
//! | entering an interrupt takes no time | 4 cycles, 8 from sleep |
//! | an interrupt that is enabled after its flag was set is lost | it is served |
//! | timers drive the inverse level when OCRnx is written and at overflow | a match or a force alone moves an output |
//! | an edge is stamped at the end of the instruction | in the cycle of the match |
//! | a write to TIFRn clears all flags; SBI on PINx or a flag register acts on all bits | only the bits written as one; only its own bit |
//! | TEMP of the 16-bit registers, GTCCR, FOCnx, writes of ICR1: none | as the data sheet says |
//! | TCNTn is read at the first cycle of any instruction | in the cycle of the access: `lds` reads one later than `in` |
//! | a byte on the serial line takes 11 bits; the receiver holds 64 | 10 bits; the receiver holds two and one in the shift register |
//! | a pin is read without its synchroniser | a program reads the level of the cycle before |
//!
//! | file | what it holds |
//! |---|---|
//! | [`uno`] | the board: run, wires, faults, serial line, memory |
//! | [`pin`] | the names of the pins, and edges on them |
//! | [`image`] | ELF and Intel HEX |
//! | [`vector`] | the names of the interrupts |
//! | [`trace`] | files of edges: VCD and CSV |
//! | [`console`] | commands to a running board |
//! | [`port`] | the serial line as a pseudo-terminal |
//! | `simavr` | the calls into C |
//!
//! Not modelled: the delay of start-up and of the boot loader after a reset, the power-reduction
//! register, external and asynchronous clocks of the timers, and the 2.5 to 3.5 cycles of the
//! synchroniser before the input capture and the external interrupts.

pub mod console;
pub mod image;
pub mod pin;
pub mod port;
mod simavr;
pub mod trace;
pub mod uno;
pub mod vector;

pub use image::{Image, ImageError};
pub use pin::{Pin, PinEdge};
pub use port::Port;
pub use trace::{write_csv, write_vcd};
pub use uno::{Reset, SentByte, State, Uno};
pub use vector::{Latency, Vector};

/// Cycles per second.
pub const CLOCK: u64 = 16_000_000;
