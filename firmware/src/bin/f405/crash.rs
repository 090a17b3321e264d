//! What no program expects: memory that is not there, an instruction that is none, a crystal or a supply
//! that fails.

use crate::chip::feed_watchdog;
use crate::{pins, timers};
use cortex_m_rt::exception;
use stm32f4::stm32f405::interrupt;

// The stack may be what is wrong: its end is the end of the memory. So begin again at its start, before
// anything is put onto it.
core::arch::global_asm!(
    ".section .HardFault.user,\"ax\"",
    ".global HardFault",
    ".type HardFault,%function",
    ".thumb_func",
    "HardFault:",
    "ldr r0, =_stack_start",
    "mov sp, r0",
    "b {halt}",
    ".ltorg",
    ".text",
    halt = sym halt,
);

/// The supply is too low: what the processor does next is anybody's guess.
#[interrupt]
fn PVD() {
    halt()
}

/// The crystal has failed: the chip goes on with another clock, and time is wrong.
#[exception]
unsafe fn NonMaskableInt() {
    halt()
}

/// All outputs low until the watchdog starts the board again.
extern "C" fn halt() -> ! {
    timers::all_low();
    pins::disconnect();
    feed_watchdog();
    loop {
        cortex_m::asm::nop();
    }
}
