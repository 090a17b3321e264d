//! The host's own solution of what the board solves: the same code, in the board's arithmetic and in a
//! better one.

use crate::error::Result;
use crate::trigger::speckles::Speckles;
use num_complex::{Complex, Complex32};
use phasewalk_core::online::{OnlineTracker, SPECKLES};
use phasewalk_core::tracker::Estimate;

/// The core's on-line solver twice.
#[derive(Debug, Clone)]
pub struct Twin {
    single: OnlineTracker<f32>,
    double: OnlineTracker<f64>,
}

/// What both say of a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// In `f32`: bit for bit what the board must say.
    pub single: Estimate<f32>,
    /// In `f64`.
    pub double: Estimate<f64>,
}

impl Twin {
    /// Before the first volume.
    ///
    /// # Errors
    /// When the core does not take so many speckles or looks.
    pub fn new(speckles: &Speckles) -> Result<Self> {
        let (count, looks) = (speckles.count(), speckles.looks.into());
        Ok(Self {
            single: OnlineTracker::new(count, looks)?,
            double: OnlineTracker::new(count, looks)?,
        })
    }

    /// Solve the next volume.
    pub fn push(&mut self, volume: &[Complex32]) -> Expected {
        let wide = |u: &Complex32| Complex { re: f64::from(u.re), im: f64::from(u.im) };
        let double: Vec<_> = volume.iter().take(SPECKLES).map(wide).collect();
        Expected { single: self.single.push(volume), double: self.double.push(&double) }
    }
}
