//! Phase linking frame by frame, in fixed memory: near the Cramer-Rao bound like [`crate::linking`], without the
//! series.
//!
//! The likelihood of [`crate::linking`] is factorised, each frame given its predecessors:
//! p(U_i | anchor, B predecessors). The predecessors are a window of frames and one compressed *anchor*, the aligned
//! sum of all frames older than the window, which keeps the coherence over long times. With the
//! modelled coherences Gamma of the predecessors p and of the new frame i with them,
//!
//! ```text
//! regression   a = (Gamma_pp + ridge/L)^-1 Gamma_pi,   d = max(1 - a^T Gamma_pi, 0.01)
//! start        phi_i = arg sum over j of a_j gamma_ij exp(i phi_j), next to where it is expected
//! quality      s_i from the coherences with the window (`quality::quality_of_one`)
//! clock        was the frame before bad, or did the pattern jump before it?
//! coherence    h fitted to the window and to what is remembered of all frames before
//! weights      Q <- Q + v v^T / d,   v = (-a, 1)
//! scoring      phi <- phi + H^-1 g, `passes` times: all phases of the window move
//! ```
//! which makes an information filter of a frame's phase when it arrives, and a fixed-lag smoother when
//! it leaves the window. No phase is unwrapped inside; only the integer of a new one is chosen, by the
//! phase of the frame before, across gaps by the velocity. This needs less than pi of change per shortest
//! interval.
//!
//! Two frames that agree with each other and with nothing before are a new start after a total loss of coherence (a new
//! *lock*): the phase goes on from where it was, with a standard deviation of 1 rad more. Before the fifth
//! frame, when little is known of the coherence, such a loss may go unnoticed.
//!
//! **Standard deviation.** Phases are reported against the mean of the first N_0 frames. That mean is what the filter
//! holds at 0, so its covariance is that of the reported difference, and later frames sharpen it as
//! long as the reference frames are in the window (N_0 is at most the window). While there are
//! fewer than N_0 frames it is the mean of the usable ones so far; N_0 = 1 refers to the first
//! frame. The figure is that of the fitted model; where the decorrelation rate grows along the series, it would
//! be half of what it should be without the jumps of the clock ([`TrackerSettings::jumps`]). At perfect coherence the
//! model's noise of 0.5 % leaves a few mrad.
//!
//! **Coherence that comes back**, as with a pulse or a vibration, is followed by cosines beside the decays
//! ([`TrackerSettings::periodic`]). Errors still are up to twice the bound: cosines are used from where they gain more than
//! they could by chance or with a rate that varies, and the anchor averages periodic parts away. Decays alone lose more,
//! with short periods much more.
//!
//! **Long runs.** In `f32` the anchor takes no more frames in after 2^24 (`anchor_memory` below 1 keeps it
//! young), and phases beyond 1000 rad have lost the fourth decimal.

mod anchor;
mod arrival;
mod clock;
mod equations;
mod fields;
mod filter;
mod gauge;
mod lock;
mod matrices;
mod memory;
mod nodes;
mod settings;
mod start;
mod terms;
#[cfg(test)]
pub(crate) mod testing;

pub use fields::FieldTracker;
pub use settings::TrackerSettings;
pub use terms::{COSINES, DECAYS};

use crate::coherence::Mixture;
use crate::error::Error;
use crate::quality::usable_above;
use crate::scalar::Real;
use crate::square::Square;
use crate::storage::Matrix;
use anchor::Anchor;
use filter::Filter;
use memory::Memory;
use nodes::{Node, Nodes, conjugate};
use num_complex::Complex;

/// Nodes of a tracker with the window of 16 frames that the method was tried with.
pub const NODES: usize = 17;

/// What is known of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<T> {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// Its phase against the mean of the reference frames, radians.
    pub phase_rad: T,
    /// Standard deviation of that, radians; infinite as long as there is no usable reference frame.
    pub sigma_rad: T,
    /// s, 0..=1: what the frame has in common with its neighbours.
    pub quality: T,
}

impl<T: Real> Estimate<T> {
    /// Is the phase worth reporting, with so many independent looks? See [`usable_above`].
    #[must_use]
    pub fn is_usable(&self, looks: f64) -> bool {
        self.quality > T::from_f64(usable_above(looks))
    }
}

/// What becomes of the oldest frame's field when the window is full.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Absorb<T> {
    /// There is room.
    Nothing,
    /// It is deleted.
    Drop {
        /// The frame's final estimate.
        smoothed: Estimate<T>,
    },
    /// It becomes the anchor, in its place as the first node: A = factor * X_oldest.
    Found {
        /// The frame's final estimate.
        smoothed: Estimate<T>,
        /// exp(-i phi).
        factor: Complex<T>,
    },
    /// It joins the anchor, and is deleted: A <- anchor_factor * A + oldest_factor * X_oldest.
    Merge {
        /// The frame's final estimate.
        smoothed: Estimate<T>,
        /// Of the anchor.
        anchor_factor: Complex<T>,
        /// Of the oldest frame.
        oldest_factor: Complex<T>,
    },
}

impl<T: Copy> Absorb<T> {
    /// The final estimate of the frame that has left the window.
    #[must_use]
    pub const fn smoothed(&self) -> Option<Estimate<T>> {
        match *self {
            Self::Nothing => None,
            Self::Drop { smoothed }
            | Self::Found { smoothed, .. }
            | Self::Merge { smoothed, .. } => Some(smoothed),
        }
    }
}

/// Frame-by-frame estimator with a window of B = `NODES` - 1 frames, and the anchor.
///
/// The fields stay with the caller ([`FieldTracker`] is one): X = the anchor, if there is one, then the frames of the
/// window, oldest first. For each frame call [`Self::absorb`], do with the fields as it says, then
/// [`Self::push`].
///
/// Its model of the coherence has `M` cosines beside the [`DECAYS`]: [`COSINES`], or 0, which needs less memory.
///
/// Memory: 3 NODES^2 + 5 NODES + 128 + M (M + 14) numbers, and two times and a flag per node: in `f32` at B = 16 6.1 kB, or
/// 4.9 kB without cosines. A frame needs two more matrices, 2 NODES^2 numbers, and some rows on the stack.
#[derive(Clone, Debug)]
pub struct Tracker<T, const NODES: usize, const M: usize = COSINES> {
    settings: TrackerSettings,
    frames: usize,
    /// Has there been a usable reference frame?
    referred: bool,
    nodes: Nodes<T, NODES>,
    filter: Filter<T, NODES>,
    memory: Memory<T, M>,
    anchor: Anchor<T, M>,
}

impl<T: Real, const NODES: usize, const M: usize> Tracker<T, NODES, M> {
    /// B: frames of the window.
    pub const WINDOW: usize = NODES - 1;

    /// No frames yet.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(settings: TrackerSettings) -> Result<Self, Error> {
        const { assert!(NODES > 5, "a window of at least five frames") };
        settings.validate(Self::WINDOW)?;
        Ok(Self {
            settings,
            frames: 0,
            referred: false,
            nodes: Nodes::new(),
            filter: Filter::new(),
            memory: Memory::new(settings.interval, settings.longest_for(Self::WINDOW)),
            anchor: Anchor::new(),
        })
    }

    /// How many frames have been taken.
    #[must_use]
    pub const fn frames(&self) -> usize {
        self.frames
    }

    /// How many cross-spectra the next frame needs, if nothing is to be absorbed before.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.nodes.count()
    }

    /// The decays of h, as learnt so far; if cosines are used, as they would be without.
    #[must_use]
    pub const fn mixture(&self) -> &Mixture<T, DECAYS> {
        &self.memory.coherence.mixture
    }

    /// Would a frame at this time be accepted?
    ///
    /// # Errors
    /// Times ascend strictly, and are finite.
    pub fn check_time(&self, time: f64) -> Result<(), Error> {
        let before = self.nodes.window().last().map_or(f64::NEG_INFINITY, |node| node.time);
        if time > before && time.is_finite() {
            return Ok(());
        }
        let allowed = "finite, and above that of the frame before";
        Err(Error { parameter: "time of the frame", value: time, allowed })
    }

    /// Before each frame: if the window is full, retire its oldest frame.
    pub fn absorb(&mut self) -> Absorb<T> {
        if self.nodes.window().len() < Self::WINDOW {
            return Absorb::Nothing;
        }
        let oldest = self.nodes.oldest();
        let mut data = Matrix::<T, NODES, NODES>::filled(T::zero());
        let gamma = self.model(&mut data);
        let smoothed = self.estimate(oldest, self.filter.variance(&gamma, oldest));
        let aligned = self.nodes.aligned();
        self.memory.keep_oldest(&self.nodes, &aligned, T::from_f64(self.settings.forget));
        self.filter.freeze(|i| i <= oldest, &gamma, &aligned);
        if !self.settings.anchor {
            self.filter.eliminate(oldest);
            self.nodes.remove(oldest);
            return Absorb::Drop { smoothed };
        }
        let leaves = self.nodes.window().first();
        let (time, weight) = leaves.map_or((0.0, T::zero()), |node| (node.clock, node.weight()));
        let factor = conjugate(unit(smoothed.phase_rad));
        if !self.nodes.is_anchored() {
            self.nodes.found_anchor(factor);
            self.anchor.found(weight, time);
            return Absorb::Found { smoothed, factor };
        }
        let (anchor_factor, oldest_factor) = self.join_anchor(factor, weight, time);
        Absorb::Merge { smoothed, anchor_factor, oldest_factor }
    }

    fn join_anchor(
        &mut self,
        factor: Complex<T>,
        weight: T,
        time: f64,
    ) -> (Complex<T>, Complex<T>) {
        let memory = T::from_f64(self.settings.anchor_memory);
        let anchor = self.nodes.all().first().map_or(unit(T::zero()), Node::unit);
        let kept = if self.anchor.take_stale() { T::zero() } else { memory };
        let times = |z: Complex<T>, by: T| Complex { re: z.re * by, im: z.im * by };
        let anchor_factor = times(conjugate(anchor), kept);
        let oldest_factor = times(factor, weight);
        self.nodes.join_anchor(anchor_factor, oldest_factor);
        let beta = self.anchor.join(&self.memory.coherence, memory, weight, time);
        self.filter.merge(beta);
        (anchor_factor, oldest_factor)
    }

    /// Take the next frame U, acquired at `time`, and say where the phase is now: `correlations` are ⟨U conj X_j⟩ with
    /// all nodes X_j, `power` is ⟨|U|²⟩. All frames are to have about the same power, best 1; one below
    /// 1e-12, above 1e12 or NaN counts as dark, of quality 0.
    ///
    /// # Errors
    /// A time that is not above that of the frame before, a number of correlations other than that of the
    /// nodes, or a full window ([`Self::absorb`] makes room). Nothing has changed then.
    pub fn push(
        &mut self,
        correlations: &[Complex<T>],
        power: T,
        time: f64,
    ) -> Result<Estimate<T>, Error> {
        self.check_time(time)?;
        self.check_room(correlations.len())?;
        let newest = self.nodes.count();
        self.release_references();
        self.nodes.push(correlations, power, time);
        self.filter.add_node();
        self.frames += 1;
        if newest == 0 {
            self.hold_references();
            return Ok(self.estimate(newest, T::zero()));
        }
        self.begin(newest);
        if self.settings.jumps {
            self.reconsider(newest);
        }
        if self.is_lock_lost(newest) {
            self.lock_again(newest);
        }
        self.hold_references();
        let variance = self.link(newest);
        self.keep_anchor(newest);
        Ok(self.estimate(newest, variance))
    }

    /// Smoothed estimates of the frames still in the window, oldest first.
    pub fn finish(&self, mut each: impl FnMut(Estimate<T>)) {
        if self.frames == 1 {
            return each(self.estimate(0, T::zero()));
        }
        let mut data = Matrix::<T, NODES, NODES>::filled(T::zero());
        let gamma = self.model(&mut data);
        for i in self.nodes.oldest()..self.nodes.count() {
            each(self.estimate(i, self.filter.variance(&gamma, i)));
        }
    }

    fn check_room(&self, correlations: usize) -> Result<(), Error> {
        let fail = |parameter, value: usize, allowed| {
            Err(Error { parameter, value: value as f64, allowed })
        };
        let (window, nodes) = (self.nodes.window().len(), self.nodes.count());
        if window >= Self::WINDOW {
            return fail("frames in the window", window, "fewer than it holds: absorb first");
        }
        if correlations != nodes {
            return fail("number of correlations", correlations, "the number of nodes");
        }
        Ok(())
    }

    /// What is known of node i, whose phase has the variance `variance` / 2 L.
    fn estimate(&self, i: usize, variance: T) -> Estimate<T> {
        let frame = (self.frames + i).saturating_sub(self.nodes.count());
        let variance = variance * T::from_f64(0.5 / self.settings.looks);
        let unknown = T::from_f64(f64::INFINITY);
        let sigma_rad = if self.referred { variance.max(T::zero()).sqrt() } else { unknown };
        let node = self.nodes.all().get(i);
        let (phase_rad, quality) = node.map_or((T::zero(), T::zero()), |n| (n.phase(), n.quality));
        Estimate { frame, phase_rad, sigma_rad, quality }
    }

    /// Gamma of all nodes.
    fn model<'a>(&self, data: &'a mut Matrix<T, NODES, NODES>) -> Square<'a, T> {
        let mut gamma = Square::with_stride(data.as_mut(), self.nodes.count(), NODES);
        self.memory.fill_model(&self.nodes, &self.anchor, &mut gamma);
        gamma
    }
}

/// exp(i phi).
fn unit<T: Real>(phase: T) -> Complex<T> {
    let (im, re) = phase.sin_cos();
    Complex { re, im }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::mem::size_of;

    #[test]
    fn a_window_of_sixteen_frames_takes_few_kilobytes() {
        let (single, double) = (size_of::<Tracker<f32, NODES>>(), size_of::<Tracker<f64, NODES>>());
        let without = size_of::<Tracker<f32, NODES, 0>>();
        std::println!("{single} bytes in f32, {double} in f64, {without} in f32 without cosines");
        assert!(single < 6200, "{single}");
        assert!(double < 11800, "{double}");
        assert!(without < 4900, "{without}");
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let settings = TrackerSettings::for_looks(100.0, 1.0);
        let mut tracker = Tracker::<f32, 6>::new(settings).unwrap();
        let half = [Complex::new(0.5, 0.0); 6];
        for frame in 0..5 {
            let refused = tracker.push(&half[..frame + 1], 1.0, frame as f64).unwrap_err();
            assert_eq!(refused.parameter, "number of correlations");
            assert_eq!(tracker.nodes(), frame);
            assert_eq!(tracker.absorb(), Absorb::Nothing);
            tracker.push(&half[..frame], 1.0, frame as f64).unwrap();
        }
        let refused = tracker.push(&half[..5], 1.0, 5.0).unwrap_err();
        assert_eq!((refused.parameter, tracker.frames()), ("frames in the window", 5));
        assert!(matches!(tracker.absorb(), Absorb::Found { .. }));
        assert_eq!(tracker.absorb(), Absorb::Nothing);
        tracker.push(&half[..5], 1.0, 5.0).unwrap();
        assert!(matches!(tracker.absorb(), Absorb::Merge { .. }));
        assert!(Tracker::<f32, 6>::new(TrackerSettings { passes: 0, ..settings }).is_err());
    }

    #[test]
    fn the_first_frame_is_finished_without_others() {
        let mut tracker = Tracker::<f64, 8>::new(TrackerSettings::for_looks(9.0, 1.0)).unwrap();
        tracker.finish(|_| panic!("there is none"));
        let first = tracker.push(&[], 1.0, 3.0).unwrap();
        assert_eq!((first.phase_rad, first.sigma_rad, first.quality), (0.0, 0.0, 1.0));
        tracker.finish(|estimate| assert_eq!(estimate, first));
    }

    /// Numbers that no fields give: nothing but finite phases comes of them.
    #[test]
    fn garbage_stays_finite() {
        fn run<T: Real>() {
            let strange = [0.3, -2.0, 1e38, f64::NAN, 1e-38, f64::INFINITY, 0.0, -0.9, 1e13, 0.7];
            let mut tracker = Tracker::<T, 9>::new(TrackerSettings::for_looks(20.0, 1.0)).unwrap();
            let mut seed = 1_u32;
            let mut next = || {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                strange[(seed >> 16) as usize % strange.len()]
            };
            let mut time = 0.0;
            for _ in 0..20000 {
                time += if next() > 0.5 { 1e6 } else { 1e-6 };
                let left = tracker.absorb().smoothed();
                let power = T::from_f64(if next() > 0.0 { next() } else { 1.0 });
                let garbage: [_; 9] = core::array::from_fn(|_| Complex {
                    re: T::from_f64(next()),
                    im: T::from_f64(next()),
                });
                let correlations = &garbage[..tracker.nodes()];
                let newest = tracker.push(correlations, power, time).unwrap();
                for estimate in [Some(newest), left].into_iter().flatten() {
                    assert!(estimate.phase_rad.to_f64().is_finite());
                    assert!(estimate.sigma_rad >= T::zero());
                    assert!((0.0..=1.0).contains(&estimate.quality.to_f64()));
                }
            }
        }
        run::<f32>();
        run::<f64>();
    }
}
