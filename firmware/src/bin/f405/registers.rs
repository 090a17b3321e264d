//! Access to the registers.
//!
//! `unsafe` here because the register crate hands its peripherals out once, to one owner; passes and
//! interrupts need the same timers.

use stm32f4::stm32f405 as chip;

macro_rules! peripheral {
    ($($(#[$doc:meta])* $name:ident: $type:ident;)*) => {$(
        $(#[$doc])*
        #[inline(always)]
        pub fn $name() -> &'static <chip::$type as core::ops::Deref>::Target {
            // SAFETY: a register block lives at a fixed address for ever, its cells are volatile,
            // and there is one core. Registers that passes and interrupts both change are changed
            // with interrupts disabled only.
            unsafe { &*chip::$type::ptr() }
        }
    )*};
}

peripheral! {
    /// Laser, camera, LED, EXPOSE, and the clock.
    tim2: TIM2;
    /// Frame clock.
    tim3: TIM3;
    /// Serial line.
    usart6: USART6;
    /// PA0 to PA15.
    gpioa: GPIOA;
    /// PC0 to PC15.
    gpioc: GPIOC;
    /// External interrupts.
    exti: EXTI;
    /// Which port an external interrupt is at.
    syscfg: SYSCFG;
    /// Watchdog.
    iwdg: IWDG;
    /// Clocks, and the cause of the reset.
    rcc: RCC;
    /// Wait states.
    flash: FLASH;
    /// Supply.
    pwr: PWR;
    /// Which chip this is.
    dbgmcu: DBGMCU;
}

/// Write a register whose every bit is ours to choose.
macro_rules! set {
    ($register:expr, $bits:expr) => {{
        let bits = $bits;
        // SAFETY: any value is allowed in our registers.
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
