//! The three outputs, and what they do: edges at ticks.

use serde::{Deserialize, Serialize};

/// An output of the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Channel {
    /// Sweep trigger of the laser (Uno: D9).
    Laser,
    /// Trigger of the camera, once per sweep (Uno: D10).
    Camera,
    /// The stimulation LED (Uno: D6).
    Stimulus,
}

impl Channel {
    /// All of them, in the order of [`Channel::index`].
    pub const ALL: [Self; 3] = [Self::Laser, Self::Camera, Self::Stimulus];

    /// Position in arrays with one entry per channel.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// One change of one output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Edge {
    /// Which output.
    pub channel: Channel,
    /// What it becomes.
    pub high: bool,
    /// When, in ticks of the board's clock.
    pub tick: u64,
}

impl Edge {
    /// The output turns on.
    #[must_use]
    pub const fn rise(channel: Channel, tick: u64) -> Self {
        Self { channel, high: true, tick }
    }

    /// The output turns off.
    #[must_use]
    pub const fn fall(channel: Channel, tick: u64) -> Self {
        Self { channel, high: false, tick }
    }
}
