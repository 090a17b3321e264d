//! How fast the speckle of each part of the image forgets, how much of it never does, and how much is noise:
//! the tiles' fitted coherence as images.
//!
//! Scatterers that walk at random along the beam by a standard deviation sigma per unit of time (optical path per
//! double pass halved) give the coherence exp(-(2 k sigma)^2 tau / 2), k = 2 pi / lambda, so
//!
//! r = (2 k sigma)^2 / 2,   sigma = lambda sqrt(2 r) / (4 pi),   D = sigma^2 / 2 = r / (2 k)^2
//!
//! with the diffusion coefficient D along the beam, as dynamic light scattering has it.

use super::{Tile, Tiles};
use std::f64::consts::PI;

/// The fewest frames that have more than one lag.
const LEAST_FRAMES: usize = 3;

/// What an image of the map shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// r: one over the time after which the moving part has fallen to 1/e, per unit of the times.
    DecayRate,
    /// c_0: the share that does not decorrelate.
    Static,
    /// 1 - sum of c_k: what is lost between any two frames.
    Noise,
}

impl Quantity {
    /// All of them, with the name of their array.
    pub const ALL: [(Self, &'static str); 3] = [
        (Self::DecayRate, "decay_rate"),
        (Self::Static, "static_share"),
        (Self::Noise, "noise_share"),
    ];

    /// Its image, (y, x): each pixel has the value of its tile.
    #[must_use]
    pub fn image(self, tiles: &Tiles) -> Vec<f32> {
        tiles.image(|tile| self.of(tile) as f32)
    }

    /// Its value in a tile: NaN where no coherence was found, or where fewer than three frames cannot tell decay, static
    /// part and noise apart.
    fn of(self, tile: &Tile) -> f64 {
        if !tile.coherent || tile.quality.len() < LEAST_FRAMES {
            return f64::NAN;
        }
        match self {
            Self::DecayRate => tile.mixture.decay_rate(),
            Self::Static => tile.mixture.floor(),
            Self::Noise => tile.mixture.noise(),
        }
    }
}

/// sigma in nm per square root of the unit of time, for a decay rate r per unit of time: how far the optical
/// path to a scatterer walks.
#[must_use]
pub fn walk_nm(decay_rate: f64, wavelength_nm: f64) -> f64 {
    wavelength_nm * (2.0 * decay_rate).sqrt() / (4.0 * PI)
}

/// D in um^2 per unit of time.
#[must_use]
pub fn diffusion_um2(decay_rate: f64, wavelength_nm: f64) -> f64 {
    let sigma_um = walk_nm(decay_rate, wavelength_nm) / 1000.0;
    sigma_um * sigma_um / 2.0
}
