//! Which chip this is, its clocks, the watchdog, the cause of the reset.

use crate::registers::{change, dbgmcu, flash, iwdg, pwr, rcc, set};
use phasewalk_firmware::fault::ResetCause;
use phasewalk_firmware::limits::Limits;

/// Device identifier of the STM32F405 and its siblings (407, 415, 417). Their first revision says
/// another chip's by mistake, and is taken for that.
const IDENTIFIER: u32 = 0x413;

/// The processor's clock.
pub const PROCESSOR_HZ: u32 = 168_000_000;

/// Of the serial line's clock.
pub const APB2_HZ: u32 = PROCESSOR_HZ / 2;

/// QEMU's timers count at 1 GHz instead of 84 MHz.
const EMULATED_PRESCALER: u32 = 1_000_000_000 / Limits::F405.ticks_per_second;

/// A clock that has not come after so many looks will not come.
const PATIENCE: u32 = 20_000;

/// Of the crystal, in MHz, from the build; none: the chip's own oscillator, good to 1 %.
const CRYSTAL_MHZ: Option<u32> = match option_env!("PHASEWALK_CRYSTAL_MHZ") {
    Some(text) => match u32::from_str_radix(text, 10) {
        Ok(mhz @ 4..=26) => Some(mhz),
        _ => panic!("PHASEWALK_CRYSTAL_MHZ must be 4 to 26"),
    },
    None => None,
};

/// What was found at the start.
#[derive(Clone, Copy)]
pub struct Chip {
    /// It is the chip that the image is made for. If not, as on QEMU's board, whose pins do not exist,
    /// no output is ever connected, and the board calls itself a rehearsal.
    pub real: bool,
    /// Why it started.
    pub reset: ResetCause,
}

impl Chip {
    /// What TIM2 divides its clock by, less 1, so that it counts 84 MHz.
    pub fn prescaler(self) -> u32 {
        if self.real { 0 } else { EMULATED_PRESCALER }
    }
}

/// Clocks up, watchdog on. Without its clocks a real chip stays here, outputs low, and the watchdog
/// starts it again and again.
pub fn start() -> Chip {
    let real = dbgmcu().idcode().read().bits() & 0xFFF == IDENTIFIER;
    let reset = reset_cause();
    start_watchdog();
    let running = start_clocks();
    while real && !running {
        cortex_m::asm::nop();
    }
    enable_peripherals();
    Chip { real, reset }
}

/// 168 MHz from the crystal or the chip's own 16 MHz.
fn start_clocks() -> bool {
    change!(rcc().apb1enr(), 0, 1 << 28); // PWR
    // Supply for full speed; and below 2.9 V an interrupt, since full speed needs 2.7 V.
    change!(pwr().cr(), 0, 1 << 14 | 0b111 << 5 | 1 << 4);
    set!(flash().acr(), 0b111 << 8 | 5); // caches, prefetch, 5 wait states
    let (megahertz, source) = match CRYSTAL_MHZ {
        Some(megahertz) => {
            // Its failure later is an NMI, which stops everything.
            change!(rcc().cr(), 0, 1 << 16 | 1 << 19);
            if !comes(|| rcc().cr().read().bits() & 1 << 17 != 0) {
                return false;
            }
            (megahertz, 1 << 22)
        }
        None => (16, 0),
    };
    // 1 MHz · 336 / 2; the 48 MHz output is not used.
    set!(rcc().pllcfgr(), megahertz | 336 << 6 | 7 << 24 | source);
    change!(rcc().cr(), 0, 1 << 24);
    if !comes(|| rcc().cr().read().bits() & 1 << 25 != 0) {
        return false;
    }
    // AHB 168 MHz, APB1 42 MHz (its timers 84 MHz), APB2 84 MHz.
    set!(rcc().cfgr(), 0b101 << 10 | 0b100 << 13 | 0b10);
    comes(|| rcc().cfgr().read().bits() >> 2 & 0b11 == 0b10)
}

fn comes(is_there: impl Fn() -> bool) -> bool {
    (0..PATIENCE).any(|_| is_there())
}

fn enable_peripherals() {
    change!(rcc().ahb1enr(), 0, 1 | 1 << 2); // GPIOA, GPIOC
    change!(rcc().apb1enr(), 0, 0b11); // TIM2, TIM3
    change!(rcc().apb2enr(), 0, 1 << 5 | 1 << 14); // USART6, SYSCFG
    // One read, so that they are awake before they are used.
    let _ = rcc().apb2enr().read().bits();
}

/// The watchdog resets the board unless it is fed every 25 ms, by its own oscillator of 17 to 47 kHz:
/// every 17 to 47 ms. Nothing but a reset stops it.
fn start_watchdog() {
    set!(iwdg().kr(), 0xCCCC);
    set!(iwdg().kr(), 0x5555);
    set!(iwdg().pr(), 0); // 32 kHz / 4
    set!(iwdg().rlr(), 200);
    // It counts with its own oscillator: it has taken both over after some periods of that.
    let _ = comes(|| iwdg().sr().read().bits() == 0);
    feed_watchdog();
}

/// The watchdog starts anew.
pub fn feed_watchdog() {
    set!(iwdg().kr(), 0xAAAA);
}

/// Why the chip started; forgotten for the next time.
fn reset_cause() -> ResetCause {
    let flags = rcc().csr().read().bits();
    change!(rcc().csr(), 0, 1 << 24);
    // Power-on sets brown-out and the reset line too, the watchdog the reset line.
    match flags {
        _ if flags & 1 << 27 != 0 => ResetCause::PowerOn,
        _ if flags & 0b11 << 29 != 0 => ResetCause::Watchdog,
        _ if flags & 1 << 25 != 0 => ResetCause::BrownOut,
        _ if flags & 1 << 26 != 0 => ResetCause::External,
        _ => ResetCause::Unknown,
    }
}
