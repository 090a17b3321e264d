//! The simple pins, as embedded-hal sees them.

use crate::registers::{change, portd};
use core::convert::Infallible;
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

/// An input of port D.
pub struct Input<const BIT: u8>;

/// An output of port D.
pub struct Output<const BIT: u8>;

/// Interlock: low = closed. With its pull-up, so that a broken wire reads open.
pub type Interlock = Input<2>;
/// Camera READY: high = ready. Needs a pull-down outside, so that a broken wire reads "not ready".
pub type Ready = Input<4>;
/// The far end of the safety loop in "pulsed" mode: low but for the test.
pub type LoopEnd = Output<5>;
/// Dynamic enable.
pub type Enable = Output<7>;

/// Directions and the pull-up. D3, the start input, is watched by its interrupt; it needs a
/// pull-down outside.
pub fn start() {
    change!(portd().portd, 1 << 3 | 1 << 4, 1 << 2);
    change!(portd().ddrd, 1 << 2 | 1 << 3 | 1 << 4, 0);
}

impl<const BIT: u8> ErrorType for Input<BIT> {
    type Error = Infallible;
}

impl<const BIT: u8> InputPin for Input<BIT> {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(portd().pind.read().bits() & 1 << BIT != 0)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

impl<const BIT: u8> ErrorType for Output<BIT> {
    type Error = Infallible;
}

// One instruction each (sbi, cbi), so no interrupt can come between.
impl<const BIT: u8> OutputPin for Output<BIT> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        avr_device::interrupt::free(|_| change!(portd().portd, 1 << BIT, 0));
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        avr_device::interrupt::free(|_| change!(portd().portd, 0, 1 << BIT));
        Ok(())
    }
}
