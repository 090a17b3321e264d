//! Access to the registers.
//!
//! `unsafe` here because the register crate hands its peripherals out once, to one owner; main loop
//! and interrupts need the same timers.

use avr_device::atmega328p as chip;

macro_rules! peripheral {
    ($($(#[$doc:meta])* $name:ident: $type:ident;)*) => {$(
        $(#[$doc])*
        #[inline(always)]
        pub fn $name() -> &'static <chip::$type as core::ops::Deref>::Target {
            // SAFETY: a register block lives at a fixed address for ever, its cells are volatile,
            // and there is one core. Registers that main loop and interrupts both change are
            // changed by the main loop with interrupts disabled only.
            unsafe { &*chip::$type::ptr() }
        }
    )*};
}

peripheral! {
    /// Timer0: the LED's output.
    tc0: TC0;
    /// Timer1: laser, camera, EXPOSE, and the clock.
    tc1: TC1;
    /// Timer2: wakes the arming of the LED.
    tc2: TC2;
    /// Serial line.
    usart: USART0;
    /// D8 to D13.
    portb: PORTB;
    /// D0 to D7.
    portd: PORTD;
    /// External interrupts.
    exint: EXINT;
    /// Watchdog.
    wdt: WDT;
}

/// Write a register whose every bit is ours to choose.
macro_rules! set {
    ($register:expr, $bits:expr) => {{
        let bits = $bits;
        // SAFETY: any value is allowed in our registers; `bits` is unsafe for those of them that
        // have no description of their fields.
        #[allow(unused_unsafe)]
        $register.write(|w| unsafe { w.bits(bits) })
    }};
}

/// Change some bits of a register.
macro_rules! change {
    ($register:expr, $clear:expr, $set:expr) => {{
        let (clear, set) = ($clear, $set);
        // SAFETY: as in `set!`.
        #[allow(unused_unsafe)]
        $register.modify(|r, w| unsafe { w.bits((r.bits() & !clear) | set) })
    }};
}

pub(crate) use {change, set};

/// From here on interrupts come.
pub fn enable_interrupts() {
    // SAFETY: called outside of any critical section: by the main loop, and by an interrupt that is
    // done with what it shares.
    unsafe { avr_device::interrupt::enable() }
}
