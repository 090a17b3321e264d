//! Registration (paper lines 707-709): where the retina lies in each sweep, by the speckle of its
//! amplitude.
//!
//! ```text
//! |U|(z, y, x) ── plan (blocks, cells) ── feature (soft logarithm, half-whitened)
//! feature ── sequence (the last members; saccades and blinks stay apart) ── two features
//! two features ── search (3-D FFT, no guess) ── lags (sums per cell) ── fit ── PairMotion
//! pairs ── judge (which hang together) ── solve (weighted robust least squares) ── Motion per sweep
//! ```
//!
//! Every sweep is compared with several before it. The amplitude serves, not the field: phases of
//! neighbouring sweeps differ across the retina, and a complex correlation finds wrong depths.

mod banded;
#[cfg(test)]
mod eye;
mod feature;
mod fit;
mod judge;
mod kernel;
mod lags;
mod motion;
mod pair;
mod plan;
mod search;
mod sequence;
mod solve;
#[cfg(test)]
mod tests;
mod whiten;

pub use feature::Feature;
pub use motion::Motion;
pub use pair::PairMotion;
pub use sequence::{Matches, NEIGHBOURS, Place, Sequence};
pub use solve::solve;

use plan::Plan;
use search::Search;
use whiten::Whiten;

/// A pair whose [`PairMotion::quality`] reaches this shows the same retina.
///
/// Measured: the best of all positions of unrelated sweeps stays below 6 sigmas; retinas six sweeps
/// apart whose field keeps 0.82 from sweep to sweep reach 16 and more.
pub const MATCHED: f64 = 7.0;

/// A candidate of this quality needs no comparison with others.
const SURE: f64 = 2.0 * MATCHED;

/// Sizes and transforms for volumes of one size.
pub struct Registration {
    plan: Plan,
    whiten: Whiten,
    search: Search,
}

impl Registration {
    /// For volumes of `depth` × `height` × `width`.
    #[must_use]
    pub fn new(depth: usize, height: usize, width: usize) -> Self {
        let plan = Plan::new(depth, height, width);
        let whiten = Whiten::new(plan.block);
        let search = Search::new(plan.kept, plan.block);
        Self { plan, whiten, search }
    }

    /// What is compared of a volume: `amplitude` is |U| (z, y, x).
    #[must_use]
    pub fn feature(&self, amplitude: &[f32]) -> Feature {
        Feature::of(&self.plan, &self.whiten, amplitude)
    }

    /// Memory of one [`Feature`].
    #[must_use]
    pub fn bytes_per_feature(&self) -> u64 {
        (self.plan.voxels() * size_of::<i16>()) as u64
    }

    /// Motion of `later` relative to `earlier`.
    ///
    /// With a `guess` (good to about 1 px) only its surroundings are looked at; without one, shifts
    /// up to half a block are searched, which takes about three times as long.
    #[must_use]
    pub fn pair(&self, earlier: &Feature, later: &Feature, guess: Option<Motion>) -> PairMotion {
        let refine = |start| pair::refine(&self.plan, earlier, later, start);
        if let Some(guess) = guess {
            return refine(guess);
        }
        let mut best = PairMotion::default();
        for start in self.search.candidates(earlier, later) {
            let pair = refine(start);
            if pair.quality >= best.quality {
                best = pair;
            }
            if best.quality >= SURE {
                break;
            }
        }
        best
    }
}
