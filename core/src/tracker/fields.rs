//! Fields in, phases out: a tracker that keeps the fields of its nodes.

use super::{Absorb, COSINES, Estimate, Tracker, TrackerSettings};
use crate::cross_spectrum::{dark_if_not_finite, times_conjugate};
use crate::error::Error;
use crate::linking::turn;
use crate::scalar::Real;
use heapless::{Deque, Vec};
use num_complex::Complex;

/// Sum of squares below which a field is dark: the smallest normal `f32`.
const DARK: f64 = f32::MIN_POSITIVE as f64;

type Field<T, const PIXELS: usize> = Vec<Complex<T>, PIXELS>;

/// A [`Tracker`] over up to `PIXELS` pixels.
///
/// Memory: that of the tracker and `NODES` complex fields. A frame costs `NODES` complex multiply-adds per
/// pixel, and the tracker's own work, which does not depend on the pixels.
#[derive(Clone, Debug)]
pub struct FieldTracker<T, const PIXELS: usize, const NODES: usize, const M: usize = COSINES> {
    tracker: Tracker<T, NODES, M>,
    /// A; empty before there is one.
    anchor: Field<T, PIXELS>,
    /// Oldest first.
    window: Deque<Field<T, PIXELS>, NODES>,
}

impl<T: Real, const PIXELS: usize, const NODES: usize, const M: usize>
    FieldTracker<T, PIXELS, NODES, M>
{
    /// No frames yet.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(settings: TrackerSettings) -> Result<Self, Error> {
        let tracker = Tracker::new(settings)?;
        Ok(Self { tracker, anchor: Vec::new(), window: Deque::new() })
    }

    /// The tracker: its coherence model, how many frames it has seen.
    #[must_use]
    pub const fn tracker(&self) -> &Tracker<T, NODES, M> {
        &self.tracker
    }

    /// Take the next frame, acquired at `time`, and say where the phase is now; the final, smoothed estimate of the
    /// frame that leaves the window, if one does, goes to `smoothed`.
    ///
    /// Its brightness does not matter. Pixels beyond `PIXELS` are left out; pixels that are not finite, or
    /// that this frame has not and others have, are dark. A frame that is dark altogether has quality 0.
    ///
    /// # Errors
    /// A time that is not above that of the frame before; nothing has changed then.
    pub fn push(
        &mut self,
        field: &[Complex<T>],
        time: f64,
        smoothed: impl FnOnce(Estimate<T>),
    ) -> Result<Estimate<T>, Error> {
        self.tracker.check_time(time)?;
        let absorb = self.tracker.absorb();
        self.follow(&absorb);
        if let Some(estimate) = absorb.smoothed() {
            smoothed(estimate);
        }
        let field = unit_power(field);
        let mut correlations = Vec::<_, NODES>::new();
        let anchor = (!self.anchor.is_empty()).then_some(&self.anchor);
        for node in anchor.into_iter().chain(&self.window) {
            // Cannot fail: there are not more nodes.
            let _ = correlations.push(correlation(&field, node));
        }
        let power = correlation(&field, &field).re;
        let estimate = self.tracker.push(&correlations, power, time)?;
        // Cannot fail: the tracker has found room as well.
        let _ = self.window.push_back(field);
        Ok(estimate)
    }

    /// Smoothed estimates of the frames still in the window, oldest first.
    pub fn finish(&self, each: impl FnMut(Estimate<T>)) {
        self.tracker.finish(each);
    }

    /// Do with the fields as the tracker has done with their cross-spectra.
    fn follow(&mut self, absorb: &Absorb<T>) {
        if matches!(absorb, Absorb::Nothing) {
            return;
        }
        let Some(oldest) = self.window.pop_front() else { return };
        match *absorb {
            Absorb::Nothing | Absorb::Drop { .. } => {}
            Absorb::Found { factor, .. } => {
                self.anchor = oldest;
                // An empty field would pass for none.
                if self.anchor.is_empty() {
                    let _ = self.anchor.push(Complex { re: T::zero(), im: T::zero() });
                }
                for pixel in &mut self.anchor {
                    *pixel = turn(factor, *pixel);
                }
            }
            Absorb::Merge { anchor_factor, oldest_factor, .. } => {
                let zero = Complex { re: T::zero(), im: T::zero() };
                if self.anchor.len() < oldest.len() {
                    // Cannot fail: both have the same room.
                    let _ = self.anchor.resize(oldest.len(), zero);
                }
                let old = oldest.iter().copied().chain(core::iter::repeat(zero));
                for (pixel, old) in self.anchor.iter_mut().zip(old) {
                    let (a, k) = (turn(anchor_factor, *pixel), turn(oldest_factor, old));
                    *pixel = Complex { re: a.re + k.re, im: a.im + k.im };
                }
            }
        }
    }
}

/// The field scaled so that its squares sum to 1.
fn unit_power<T: Real, const PIXELS: usize>(pixels: &[Complex<T>]) -> Field<T, PIXELS> {
    let mut field = Field::new();
    for &pixel in pixels.iter().take(PIXELS) {
        // Cannot fail: there are not more.
        let _ = field.push(dark_if_not_finite(pixel));
    }
    let power = correlation(&field, &field).re;
    let lit = power > T::from_f64(DARK);
    let scale = if lit { power.inverse_sqrt() } else { T::zero() };
    for pixel in &mut field {
        *pixel = Complex { re: pixel.re * scale, im: pixel.im * scale };
    }
    field
}

/// Sum of u conj v over the pixels that both have.
fn correlation<T: Real>(u: &[Complex<T>], v: &[Complex<T>]) -> Complex<T> {
    let mut sum = Complex { re: T::zero(), im: T::zero() };
    for (&u, &v) in u.iter().zip(v) {
        let c = times_conjugate(u, v);
        sum.re += c.re;
        sum.im += c.im;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::testing::Speckle;
    use super::*;
    use crate::bound::{cramer_rao, reported_variance};
    use crate::square::Square;

    const LOOKS: usize = 200;

    /// lambda/32 per frame.
    const WALK: f64 = 0.9258;

    type Walk<T> = FieldTracker<T, LOOKS, 17>;

    fn tracker<T: Real>() -> Walk<T> {
        FieldTracker::new(TrackerSettings::for_looks(LOOKS as f64, 1.0)).unwrap()
    }

    /// A phase that turns more than once, and back.
    fn truth(frame: usize) -> f64 {
        20.0 * libm::sin(0.02 * frame as f64)
    }

    /// Smoothed estimates of all frames.
    fn smoothed<T: Real, const FRAMES: usize>(
        field: impl FnMut(usize) -> [Complex<T>; LOOKS],
    ) -> [Estimate<T>; FRAMES] {
        smoothed_by(tracker(), field)
    }

    fn smoothed_by<T: Real, const FRAMES: usize>(
        mut walk: Walk<T>,
        mut field: impl FnMut(usize) -> [Complex<T>; LOOKS],
    ) -> [Estimate<T>; FRAMES] {
        let nothing =
            Estimate { frame: 0, phase_rad: T::zero(), sigma_rad: T::zero(), quality: T::zero() };
        let mut all = [nothing; FRAMES];
        let mut done = 0;
        let mut keep = |estimate: Estimate<T>| {
            assert_eq!(estimate.frame, done);
            all[done] = estimate;
            done += 1;
        };
        for frame in 0..FRAMES {
            let newest = walk.push(&field(frame), frame as f64, &mut keep).unwrap();
            assert_eq!(newest.frame, frame);
        }
        walk.finish(keep);
        assert_eq!(done, FRAMES);
        all
    }

    /// Frames of the runs whose errors are counted, and those looked at.
    const RUN: usize = 70;
    const LOOKED_AT: [usize; 3] = [2, 10, RUN - 1];

    /// Errors against the mean of the first five phases, rad, and their standard deviations.
    fn errors(seed: u64) -> [(f64, f64); 3] {
        let mut speckle = Speckle::new(seed, WALK);
        let all = smoothed::<f64, RUN>(|frame| speckle.frame(truth(frame), 0.3));
        let reference: f64 = (0..5).map(truth).sum::<f64>() / 5.0;
        LOOKED_AT
            .map(|frame| (all[frame].phase_rad - (truth(frame) - reference), all[frame].sigma_rad))
    }

    /// The bounds for what is reported of as many frames as a frame is smoothed with.
    fn bounds() -> [f64; 3] {
        LOOKED_AT.map(|frame| {
            let frames = RUN.min(frame + 16);
            let mut data = [[0.0; RUN * RUN]; 3];
            let [gamma, covariance, scratch] = &mut data;
            let mut gamma = Square::new(gamma, frames);
            gamma.fill_with(
                |i, j| {
                    if i == j { 1.0 } else { libm::pow(WALK, i.abs_diff(j) as f64) / 1.3 }
                },
            );
            let mut covariance = Square::new(covariance, frames);
            cramer_rao(&gamma, LOOKS as f64, &mut covariance, &mut Square::new(scratch, frames));
            libm::sqrt(reported_variance(&covariance, &[1.0; RUN], 5, frame))
        })
    }

    #[test]
    fn phases_are_known_as_well_as_can_be_and_it_says_so() {
        const RUNS: u64 = 100;
        let (mut square, mut score, mut sigmas) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for seed in 0..RUNS {
            for (k, (error, sigma)) in errors(seed).into_iter().enumerate() {
                square[k] += error * error / RUNS as f64;
                score[k] += (error / sigma) * (error / sigma) / RUNS as f64;
                sigmas[k] += sigma / RUNS as f64;
            }
        }
        for (k, bound) in bounds().into_iter().enumerate() {
            let (rms, score) = (libm::sqrt(square[k]) / bound, libm::sqrt(score[k]));
            let sigma = sigmas[k] / bound;
            std::println!("rms {rms:.3} and sigma {sigma:.3} of the bound, z-score {score:.3}");
            assert!((0.75..1.25).contains(&rms) && (0.75..1.25).contains(&score), "{rms} {score}");
            assert!((0.88..1.12).contains(&sigma), "{sigma}");
        }
    }

    /// What is held at 0 shifts all phases alike, and a mean of several frames is known better than one.
    #[test]
    fn the_reference_frames_change_the_zero_only() {
        let run = |reference_frames| {
            let settings = TrackerSettings::for_looks(LOOKS as f64, 1.0);
            let settings = TrackerSettings { reference_frames, ..settings };
            let mut speckle = Speckle::new(2, WALK);
            smoothed_by::<f64, RUN>(FieldTracker::new(settings).unwrap(), |frame| {
                let noise = if frame == 3 { 1e6 } else { 0.3 };
                speckle.frame(truth(frame), noise)
            })
        };
        let (one, five) = (run(1), run(5));
        let shift = one[RUN - 1].phase_rad - five[RUN - 1].phase_rad;
        for (a, b) in one.iter().zip(&five) {
            // Frames that have left the window do not follow the reference any more.
            assert!((a.phase_rad - b.phase_rad - shift).abs() < 0.01, "{a:?} {b:?} {shift}");
        }
        assert!((shift - 0.8).abs() < 0.2, "mean of the four good ones: {shift}");
        assert!(five[2].sigma_rad < one[2].sigma_rad);
        assert!(five[RUN - 1].sigma_rad < one[RUN - 1].sigma_rad);
    }

    /// 300 frames with outliers and a gap in brightness.
    #[test]
    fn single_precision_follows_double_precision() {
        const FRAMES: usize = 300;
        fn run<T: Real>() -> [Estimate<T>; FRAMES] {
            let mut speckle = Speckle::new(7, WALK);
            smoothed(|frame| {
                let noise = if frame % 90 == 60 { 1e6 } else { 0.5 };
                speckle.frame(truth(frame), noise)
            })
        }
        let (double, single) = (run::<f64>(), run::<f32>());
        let mut most = (0.0, 0.0);
        for (a, b) in double.iter().zip(&single) {
            // An outlier has no phase of its own.
            if a.quality > 0.3 {
                most.0 = f64::max(most.0, (a.phase_rad - f64::from(b.phase_rad)).abs());
            }
            let ratio = f64::from(b.sigma_rad) / a.sigma_rad;
            most.1 = f64::max(most.1, (ratio - 1.0).abs());
        }
        std::println!("phases {:.1e} rad, standard deviations {:.1e}", most.0, most.1);
        assert!(most.0 < 1e-3 && most.1 < 0.01, "{most:?}");
        assert!([60, 150, 240].iter().all(|&frame| double[frame].quality < 0.3));
        let error = double[FRAMES - 1].phase_rad - truth(FRAMES - 1);
        assert!(error.abs() < 4.0 * double[FRAMES - 1].sigma_rad, "{error}");
    }

    /// Ten times as long, with a static part that the anchor keeps.
    #[test]
    fn single_precision_does_not_wear_out() {
        let mut speckle = Speckle::<LOOKS>::new(11, WALK);
        let still = Speckle::<LOOKS>::new(12, WALK).frame::<f64>(0.0, 0.0);
        let (mut double, mut single) = (tracker::<f64>(), tracker::<f32>());
        let mut most = (0.0, 0.0);
        for frame in 0..3000 {
            let (phase, time) = (truth(frame), frame as f64);
            let mut field = speckle.frame::<f64>(phase, 0.3);
            for (u, still) in field.iter_mut().zip(&still) {
                *u += Complex::from_polar(0.5, phase) * still;
            }
            let short = field.map(|u| Complex::new(u.re as f32, u.im as f32));
            let a = double.push(&field, time, |_| {}).unwrap();
            let b = single.push(&short, time, |_| {}).unwrap();
            most.0 = f64::max(most.0, (a.phase_rad - f64::from(b.phase_rad)).abs());
            let ratio = f64::from(b.sigma_rad) / a.sigma_rad;
            most.1 = f64::max(most.1, if frame == 0 { 0.0 } else { (ratio - 1.0).abs() });
            assert!(b.phase_rad.is_finite() && b.sigma_rad.is_finite());
        }
        std::println!("phases {:.1e} rad, standard deviations {:.1e}", most.0, most.1);
        assert!(most.0 < 1e-3 && most.1 < 0.05, "{most:?}");
    }

    #[test]
    fn brightness_does_not_matter() {
        let (mut one, mut other) = (Speckle::new(3, WALK), Speckle::new(3, WALK));
        let plain = smoothed::<f32, 40>(|frame| one.frame(truth(frame), 0.0));
        let scaled = smoothed::<f32, 40>(|frame| {
            let gain = libm::exp2f((frame % 5) as f32 * 3.0 - 8.0);
            other.frame(truth(frame), 0.0).map(|u| u * gain)
        });
        assert_eq!(plain, scaled);
    }

    #[test]
    fn dark_and_broken_fields_are_left_out() {
        for bad in [0.0, f32::NAN, f32::INFINITY, 1e30] {
            let mut speckle = Speckle::new(4, WALK);
            let all = smoothed::<f32, 80>(|frame| {
                let field = speckle.frame(truth(frame), 0.0);
                match frame {
                    0 | 2 | 20..23 | 50 => [Complex::new(bad, 0.0); LOOKS],
                    _ => field,
                }
            });
            let reference = (truth(1) + truth(3) + truth(4)) / 3.0;
            for estimate in &all {
                let dark = matches!(estimate.frame, 0 | 2 | 20..23 | 50);
                assert!(estimate.phase_rad.is_finite(), "{bad}: {estimate:?}");
                assert_eq!(estimate.quality < 0.3, dark, "{bad}: {estimate:?}");
                let error = f64::from(estimate.phase_rad) - truth(estimate.frame) + reference;
                let sigma = f64::from(estimate.sigma_rad);
                assert!(dark || error.abs() < 4.0 * sigma + 0.02, "{bad}: {error} {estimate:?}");
                // Five outliers in a row would be another matter.
                assert!(dark || sigma < 0.5, "{bad}: {estimate:?}");
            }
        }
    }

    #[test]
    fn nothing_but_darkness_does_no_harm() {
        let all = smoothed::<f32, 60>(|_| [Complex::new(0.0, 0.0); LOOKS]);
        for estimate in &all {
            assert_eq!(estimate.quality, 0.0);
            assert!(estimate.phase_rad == 0.0 && estimate.sigma_rad > 1.0, "{estimate:?}");
        }
        let mut speckle = Speckle::new(5, WALK);
        let late = smoothed::<f32, 80>(|frame| match frame {
            0..30 => [Complex::new(0.0, 0.0); LOOKS],
            _ => speckle.frame(truth(frame), 0.0),
        });
        assert!(late.iter().skip(30).all(|estimate| estimate.quality > 0.9));
        let change = f64::from(late[79].phase_rad - late[30].phase_rad);
        assert!((change - truth(79) + truth(30)).abs() < 0.4, "{change}");
    }

    /// Another pattern, all at once or after three dark frames: phases go on, what comes after is right in itself,
    /// and the step has the standard deviation of a guess.
    #[test]
    fn after_a_total_loss_of_coherence_it_locks_again() {
        for (at, dark) in [(6, 0), (8, 0), (17, 0), (40, 0), (40, 3)] {
            let mut speckle = Speckle::new(6, WALK);
            let is_dark = |frame| (at - dark..at).contains(&frame);
            let all = smoothed::<f64, 120>(|frame| {
                if frame == at {
                    speckle.replace();
                }
                let field = speckle.frame(truth(frame), 0.0);
                if is_dark(frame) { [Complex::new(0.0, 0.0); LOOKS] } else { field }
            });
            let before = at - dark - 1;
            let change = all[119].phase_rad - all[at + 4].phase_rad;
            let error = change - truth(119) + truth(at + 4);
            assert!(error.abs() < 0.6, "{at}: {error}");
            let step = all[at].phase_rad - all[before].phase_rad;
            let expected = if dark > 0 { truth(at) - truth(before) } else { 0.0 };
            assert!((step - expected).abs() < 0.3, "{at}: {step}, expected {expected}");
            assert!(all[before].sigma_rad < 0.2, "{:?}", all[before]);
            let lost = all[119].sigma_rad;
            assert!((1.0..1.1).contains(&lost), "{at}: {lost}");
            let good = all.iter().filter(|estimate| estimate.quality > 0.9);
            assert_eq!(good.count(), 120 - dark, "{at}");
        }
    }

    #[test]
    fn frames_of_other_lengths_are_dark_where_they_end() {
        let mut speckle = Speckle::<LOOKS>::new(8, 0.98);
        let mut walk = tracker::<f32>();
        for frame in 0..60 {
            let field = speckle.frame(truth(frame), 0.0);
            let pixels = [LOOKS, 180, 150][frame % 3];
            let estimate = walk.push(&field[..pixels], frame as f64, |_| {}).unwrap();
            assert!(estimate.quality > 0.3, "{estimate:?}");
        }
        let last = walk.push(&[], 60.0, |_| {}).unwrap();
        assert_eq!(last.quality, 0.0);
    }

    #[test]
    fn times_that_do_not_ascend_are_refused_and_change_nothing() {
        let (mut speckle, mut walk) = (Speckle::<LOOKS>::new(9, WALK), tracker::<f32>());
        let fields: [[_; LOOKS]; 40] = core::array::from_fn(|f| speckle.frame(truth(f), 0.0));
        let mut undisturbed = tracker::<f32>();
        for (frame, field) in fields.iter().enumerate() {
            let time = frame as f64;
            for wrong in [time - 1.0, f64::NAN, f64::INFINITY].iter().skip(usize::from(frame == 0))
            {
                let error = walk.push(field, *wrong, |_| panic!("retired")).unwrap_err();
                assert_eq!(error.parameter, "time of the frame");
            }
            let expected = undisturbed.push(field, time, |_| {}).unwrap();
            assert_eq!(walk.push(field, time, |_| {}).unwrap(), expected);
        }
    }
}
