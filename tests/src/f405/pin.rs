//! The pins by their names on the chip, and edges on them.

use std::fmt;
use std::str::FromStr;

/// A pin of ports A to D.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pin(u8);

impl Pin {
    /// Trigger of the laser: compare output 1.
    pub const LASER: Self = Self::new(0, 0);
    /// Trigger of the camera: compare output 2.
    pub const CAMERA: Self = Self::new(0, 1);
    /// The stimulus: compare output 3.
    pub const STIMULUS: Self = Self::new(0, 2);
    /// The camera's exposure: capture input 4.
    pub const EXPOSE: Self = Self::new(0, 3);
    /// Frame clock of the camera.
    pub const FRAMES: Self = Self::new(0, 6);
    /// The safety loop, at the end where it is read: low when closed.
    pub const INTERLOCK: Self = Self::new(2, 0);
    /// The safety loop's far end.
    pub const LOOP_END: Self = Self::new(2, 1);
    /// The camera is ready.
    pub const READY: Self = Self::new(2, 2);
    /// The start input.
    pub const START: Self = Self::new(2, 3);

    /// How many there are.
    pub(super) const COUNT: usize = 64;

    /// Number 0 to 15 of a port: 0 for A.
    ///
    /// # Panics
    /// When there is no such pin.
    #[must_use]
    pub const fn new(port: u8, number: u8) -> Self {
        assert!(port < 4 && number < 16, "ports A to D have 16 pins each");
        Self(port * 16 + number)
    }

    /// Its port: 0 for A.
    #[must_use]
    pub const fn port(self) -> usize {
        (self.0 / 16) as usize
    }

    /// Its number in the port.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0 % 16
    }

    pub(super) const fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "P{}{}", char::from(b'A' + self.0 / 16), self.number())
    }
}

impl fmt::Debug for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for Pin {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let matches = |pin: &Self| pin.to_string().eq_ignore_ascii_case(name);
        (0..Self::COUNT as u8)
            .map(Self)
            .find(matches)
            .ok_or_else(|| format!("no pin is called {name}"))
    }
}

/// A change of the level on a pin's wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinEdge {
    /// The first tick with the new level.
    pub tick: u64,
    /// Where.
    pub pin: Pin,
    /// The new level.
    pub high: bool,
}
