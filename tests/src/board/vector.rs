//! The interrupts of the ATmega328P.

/// An interrupt, by its number: the lower, the sooner it is served.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Vector {
    Int0 = 1,
    Int1,
    PinChange0,
    PinChange1,
    PinChange2,
    Watchdog,
    Timer2CompareA,
    Timer2CompareB,
    Timer2Overflow,
    Timer1Capture,
    Timer1CompareA,
    Timer1CompareB,
    Timer1Overflow,
    Timer0CompareA,
    Timer0CompareB,
    Timer0Overflow,
    Spi,
    SerialReceived,
    SerialEmpty,
    SerialSent,
}

impl Vector {
    /// All that are modelled.
    pub const ALL: [Self; 20] = [
        Self::Int0,
        Self::Int1,
        Self::PinChange0,
        Self::PinChange1,
        Self::PinChange2,
        Self::Watchdog,
        Self::Timer2CompareA,
        Self::Timer2CompareB,
        Self::Timer2Overflow,
        Self::Timer1Capture,
        Self::Timer1CompareA,
        Self::Timer1CompareB,
        Self::Timer1Overflow,
        Self::Timer0CompareA,
        Self::Timer0CompareB,
        Self::Timer0Overflow,
        Self::Spi,
        Self::SerialReceived,
        Self::SerialEmpty,
        Self::SerialSent,
    ];
}

/// How long an interrupt waited at worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latency {
    /// Which.
    pub vector: Vector,
    /// Cycles from the moment it was both flagged and enabled to the first instruction of its
    /// vector, at worst. While I is clear, as in another interrupt, the time counts too.
    pub worst: u64,
    /// How often it was served.
    pub served: u64,
}
