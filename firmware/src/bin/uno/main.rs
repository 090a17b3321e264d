//! Trigger board on an Arduino Uno (ATmega328P at 16 MHz).
//!
//! ```text
//! main loop (Device) ── offer ──► near edges ── interrupts ──► compare registers ──► pins
//!                    ◄── made ───     ▲  read back in the interrupt of the match
//! ```
//!
//! | pin | use | made by |
//! |---|---|---|
//! | D9 OC1A | laser | Timer1, clk/1 |
//! | D10 OC1B | camera | Timer1, clk/1 |
//! | D6 OC0A | stimulus LED | Timer0, clk/1, armed by Timer2 |
//! | D8 ICP1 | camera EXPOSE, captured | Timer1 |
//! | D2 INT0 | interlock loop: low = closed | |
//! | D3 INT1 | start input | |
//! | D4 | camera READY: high = ready | |
//! | D5 | far end of the loop in "pulsed" mode | main loop |
//! | D7 | dynamic enable | main loop |
//!
//! ```text
//! main.rs       start, main loop
//! uno.rs        the Board: what the main loop asks
//! near.rs       state shared with the interrupts: near edges, edges made
//! interrupts.rs the interrupts, each a few lines
//! timers.rs     Timer0, 1 and 2: phases, time, registers of the outputs
//! serial.rs     USART at 250,000 baud
//! pins.rs       the simple pins as embedded-hal sees them
//! reset.rs      the first instructions after reset, the watchdog
//! memory.rs     stack canary, hash of the program memory
//! registers.rs  access to the registers
//! shared.rs     variables shared with interrupts
//! ```
#![no_std]
#![no_main]
#![feature(abi_avr_interrupt, asm_experimental_arch)]

mod interrupts;
mod memory;
mod near;
mod pins;
mod registers;
mod reset;
mod serial;
mod shared;
mod timers;
mod uno;

use phasewalk_firmware::device::Device;
use uno::Uno;

#[avr_device::entry]
fn main() -> ! {
    reset::start_watchdog();
    memory::paint_stack();
    let mut device = start();
    registers::enable_interrupts();
    loop {
        device.pass();
    }
}

/// Apart from `main`, whose frame is there for ever, so that what is needed only now is given back.
#[inline(never)]
fn start() -> Device<Uno> {
    Device::new(Uno::start())
}

/// Nothing here can panic; if something does, the outputs go low and the watchdog restarts.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    avr_device::interrupt::disable();
    timers::all_low();
    loop {
        avr_device::asm::nop();
    }
}
