//! The first instructions after reset, and the watchdog.

use crate::registers::{set, wdt};
use phasewalk_firmware::fault::ResetCause;

// Before anything else: all outputs low. The timers may still be as a boot loader left them, so
// the pins are taken from them. Then the reason of the reset is kept, and the watchdog stopped,
// which after a reset by it is still running with its shortest period.
core::arch::global_asm!(
    ".section .init0,\"ax\",@progbits",
    "eor r1, r1",
    "sts 0x80, r1",       // TCCR1A: laser, camera
    "out 0x24, r1",       // TCCR0A: LED
    "out 0x05, r1",       // PORTB
    "out 0x0b, r1",       // PORTD
    "ldi r24, 0x06",
    "out 0x04, r24",      // DDRB: D9, D10
    "ldi r24, 0xe0",
    "out 0x0a, r24",      // DDRD: D5, D6, D7
    "in r24, 0x34",       // MCUSR
    "sts {cause}, r24",
    "out 0x34, r1",
    "wdr",
    "ldi r24, 0x18",
    "sts 0x60, r24",      // WDTCSR: change
    "sts 0x60, r1",       // off
    ".text",
    cause = sym MCUSR_AT_START,
);

/// MCUSR, written before memory is initialised: so it must not be initialised.
#[unsafe(link_section = ".noinit")]
static mut MCUSR_AT_START: core::mem::MaybeUninit<u8> = core::mem::MaybeUninit::uninit();

/// Why the board started.
pub fn cause() -> ResetCause {
    // SAFETY: written once, before `main`, by the instructions above.
    let flags = unsafe { core::ptr::read_volatile(&raw const MCUSR_AT_START).assume_init() };
    // Power-on may set brown-out and external too; a watchdog's reset sets its own alone.
    match flags {
        _ if flags & 0b0001 != 0 => ResetCause::PowerOn,
        _ if flags & 0b1000 != 0 => ResetCause::Watchdog,
        _ if flags & 0b0100 != 0 => ResetCause::BrownOut,
        _ if flags & 0b0010 != 0 => ResetCause::External,
        _ => ResetCause::Unknown,
    }
}

/// The watchdog resets the board unless it is fed every 125 ms, by its own oscillator (±10 %).
pub fn start_watchdog() {
    avr_device::interrupt::free(|_| {
        avr_device::asm::wdr();
        set!(wdt().wdtcsr, 0b0001_1000);
        set!(wdt().wdtcsr, 0b0000_1011);
    });
}
