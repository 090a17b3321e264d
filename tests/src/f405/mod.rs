//! A board with an STM32F405, emulated instruction by instruction.
//!
//! [`F405`] loads the very image that is flashed and executes it. Arithmetic and jumps are those of
//! the library armagnac; loads and stores, floating point, exceptions and peripherals are this
//! project's own, because the library knows no floating point and no priorities, and QEMU's model of
//! the chip has neither pins nor compare outputs, capture, external interrupts or watchdog.
//!
//! | file | what it holds |
//! |---|---|
//! | [`board`] | the board: run, wires, faults, serial line, memory, figures |
//! | [`pin`], `wires` | the names of the pins; levels and edges on them |
//! | [`image`] | ELF |
//! | `chip`, `memory` | what is at which address, and what happens when |
//! | `processor`, `cache`, `instruction`, `fault` | fetch, decode, carry out; ways into and out of exceptions |
//! | `access`, `float`, `dsp`, `shift`, `special` | the instructions that are not the library's |
//! | `exceptions`, `system_registers`, `systick` | interrupt controller and registers of the core |
//! | `timer`, `serial`, `ports`, `external`, `clocks`, `watchdog` | the peripherals |
//!
//! Time: an instruction takes a fixed number of cycles, one unless told otherwise, the entry of an
//! exception 12 and its return 10. The chip always runs at 168 MHz and its timers at 84 MHz, whatever
//! the clock registers say. Edges that a timer makes are stamped with the tick of the match; the
//! tick of a program's own write is that of its instruction.
//!
//! Not modelled: wait states of the flash and its programming, memory protection, bit-banding, DMA,
//! tail-chaining, sub-tick delays of synchronisers and filters, and every peripheral that is not
//! named above: its registers read 0, and accesses to them are told by
//! [`F405::unknown_registers`]. So are those to a peripheral whose clock is off.

mod access;
pub mod board;
mod cache;
mod chip;
mod clocks;
mod dsp;
mod exceptions;
mod external;
mod fault;
mod float;
pub mod image;
mod instruction;
mod memory;
pub mod pin;
mod ports;
mod processor;
mod serial;
mod shift;
mod special;
mod system_registers;
mod systick;
mod timer;
mod watchdog;
mod wires;

#[cfg(test)]
mod tests;

pub use board::{F405, Hang, Happened, Latency, State};
pub use chip::Unknown;
pub use clocks::Reset;
pub use image::{Image, ImageError};
pub use pin::{Pin, PinEdge};
pub use serial::SentByte;

/// Cycles of the processor per second.
pub const CLOCK: u64 = 168_000_000;

/// Ticks of the timers per second.
pub const TICKS_PER_SECOND: u64 = 84_000_000;

/// Cycles of the processor in a tick of the timers.
pub const CYCLES_PER_TICK: u64 = 2;

/// DBGMCU_IDCODE of an STM32F405, revision 1.
pub const IDENTITY: u32 = 0x1000_6413;
