//! The simple pins, as embedded-hal sees them; and what each pin is for.

use crate::registers::{change, exti, gpioa, gpioc, set, syscfg};
use core::convert::Infallible;
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

/// An input of port C.
pub struct Input<const BIT: u8>;

/// An output of port C.
pub struct Output<const BIT: u8>;

/// Interlock: low = closed. With its pull-up, so that a broken wire reads open.
pub type Interlock = Input<0>;
/// The far end of the safety loop in "pulsed" mode: low but for the test.
pub type LoopEnd = Output<1>;
/// Camera READY: high = ready. With its pull-down, so that a broken wire reads "not ready".
pub type Ready = Input<2>;
/// Dynamic enable.
pub type Enable = Output<4>;
/// High: the phase is beyond its limit.
pub type PhaseLine = Output<5>;

// Two bits of MODER or PUPDR for a pin.
const INPUT: u32 = 0b00;
const OUTPUT: u32 = 0b01;
const ALTERNATE: u32 = 0b10;
const UP: u32 = 0b01;
const DOWN: u32 = 0b10;

/// The interlock's and the start input's external interrupts: bits in the registers of EXTI.
pub const INTERLOCK: u32 = 1 << 0;
pub const START: u32 = 1 << 3;
/// The supply's: at no pin, and always on.
pub const SUPPLY: u32 = 1 << 16;

/// Inputs with their pulls, the serial line, and the timers' outputs if `connected`. Outputs are low since
/// the reset.
pub fn start(connected: bool) {
    // EXPOSE and start input: low without a wire.
    change!(gpioa().pupdr(), 0b11 << 6, DOWN << 6);
    // The line rests high, also without a cable.
    let pulls = UP | DOWN << 4 | DOWN << 6 | UP << 14;
    change!(gpioc().pupdr(), 0b11 | 0b11 << 4 | 0b11 << 6 | 0b11 << 14, pulls);
    mode_c(1 | 1 << 2 | 1 << 3, INPUT);
    // PA0 to PA3 are TIM2's (1), PA6 is TIM3's (2), PC6 and PC7 are USART6's (8).
    // The light outputs in some 20 ns rather than 100 ns.
    let fast = both_bits(0x47, 0b01);
    change!(gpioa().ospeedr(), both_bits(0x47, 0b11), fast);
    change!(gpioa().afrl(), 0x0F00_FFFF, 0x0200_1111);
    change!(gpioc().afrl(), 0xFF00_0000, 0x8800_0000);
    mode_a(1 << 3, ALTERNATE);
    mode_c(0xC0, ALTERNATE);
    if connected {
        mode_a(0x47, ALTERNATE);
    }
    start_interrupts();
}

/// Both external interrupts at port C, on their rising edge, and none yet; that of the supply falling
/// below its limit, which is a rising edge too.
fn start_interrupts() {
    change!(syscfg().exticr1(), 0xF00F, 0x2002);
    change!(exti().rtsr(), 0, INTERLOCK | START | SUPPLY);
    set!(exti().pr(), INTERLOCK | START | SUPPLY);
    set!(exti().imr(), SUPPLY);
}

/// The light outputs are pins of their own again, low.
pub fn disconnect() {
    mode_a(0x47, OUTPUT);
}

fn mode_a(pins: u32, mode: u32) {
    change!(gpioa().moder(), both_bits(pins, 0b11), both_bits(pins, mode));
}

fn mode_c(pins: u32, mode: u32) {
    change!(gpioc().moder(), both_bits(pins, 0b11), both_bits(pins, mode));
}

/// `mode` at the two bits of each of the pins 0 to 7.
const fn both_bits(pins: u32, mode: u32) -> u32 {
    let mut bits = 0;
    let mut pin = 0;
    while pin < 8 {
        if pins & 1 << pin != 0 {
            bits |= mode << (2 * pin);
        }
        pin += 1;
    }
    bits
}

impl<const BIT: u8> ErrorType for Input<BIT> {
    type Error = Infallible;
}

impl<const BIT: u8> InputPin for Input<BIT> {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(gpioc().idr().read().bits() & 1 << BIT != 0)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

impl<const BIT: u8> ErrorType for Output<BIT> {
    type Error = Infallible;
}

// One write each, so no interrupt can come between.
impl<const BIT: u8> OutputPin for Output<BIT> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        set!(gpioc().bsrr(), 1 << (BIT + 16));
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        set!(gpioc().bsrr(), 1 << BIT);
        Ok(())
    }
}
