//! The pins by their Arduino names, and edges on them.

use std::fmt;
use std::str::FromStr;

/// A pin of the Uno.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Pin {
    D0,
    D1,
    D2,
    D3,
    D4,
    D5,
    D6,
    D7,
    D8,
    D9,
    D10,
    D11,
    D12,
    D13,
    A0,
    A1,
    A2,
    A3,
    A4,
    A5,
}

impl Pin {
    /// All of them.
    pub const ALL: [Self; 20] = [
        Self::D0,
        Self::D1,
        Self::D2,
        Self::D3,
        Self::D4,
        Self::D5,
        Self::D6,
        Self::D7,
        Self::D8,
        Self::D9,
        Self::D10,
        Self::D11,
        Self::D12,
        Self::D13,
        Self::A0,
        Self::A1,
        Self::A2,
        Self::A3,
        Self::A4,
        Self::A5,
    ];
}

impl fmt::Display for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

impl FromStr for Pin {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let matches = |pin: &Self| pin.to_string().eq_ignore_ascii_case(name);
        Self::ALL.into_iter().find(matches).ok_or_else(|| format!("no pin is called {name}"))
    }
}

/// A change of the level on a pin's wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinEdge {
    /// The first cycle with the new level.
    pub cycle: u64,
    /// Where.
    pub pin: Pin,
    /// The new level.
    pub level: bool,
}
