//! Simulated speckle, the same on every run.

use crate::scalar::Real;
use crate::tracker::{FieldTracker, NODES, TrackerSettings};
use num_complex::Complex;

/// Circular Gaussian speckle of `P` independent pixels that falls apart by a factor `rho` per frame.
pub(crate) struct Speckle<const P: usize> {
    state: u64,
    rho: f64,
    pattern: [Complex<f64>; P],
}

impl<const P: usize> Speckle<P> {
    pub(crate) fn new(seed: u64, rho: f64) -> Self {
        let zero = Complex::new(0.0, 0.0);
        let state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1;
        let mut speckle = Self { state, rho, pattern: [zero; P] };
        speckle.pattern = speckle.noise();
        speckle
    }

    /// The next pattern, turned by `phase`, and additive noise of the power `noise`.
    pub(crate) fn frame<T: Real>(&mut self, phase: f64, noise: f64) -> [Complex<T>; P] {
        let fresh = self.noise();
        let (old, new) = (self.rho, libm::sqrt(1.0 - self.rho * self.rho));
        for (u, fresh) in self.pattern.iter_mut().zip(fresh) {
            *u = *u * old + fresh * new;
        }
        let (turn, added) = (Complex::from_polar(1.0, phase), self.noise());
        core::array::from_fn(|p| {
            let u = self.pattern[p] * turn + added[p] * libm::sqrt(noise);
            Complex { re: T::from_f64(u.re), im: T::from_f64(u.im) }
        })
    }

    /// From now on the pattern falls apart by a factor `rho` per frame.
    pub(crate) fn decay(&mut self, rho: f64) {
        self.rho = rho;
    }

    /// A pattern that has nothing to do with the one before.
    pub(crate) fn replace(&mut self) {
        self.pattern = self.noise();
    }

    fn noise(&mut self) -> [Complex<f64>; P] {
        core::array::from_fn(|_| {
            let radius = libm::sqrt(-libm::log(1.0 - self.uniform()));
            Complex::from_polar(radius, core::f64::consts::TAU * self.uniform())
        })
    }

    /// 0..1, xorshift.
    fn uniform(&mut self) -> f64 {
        self.state ^= self.state << 13;
        self.state ^= self.state >> 7;
        self.state ^= self.state << 17;
        (self.state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Frames of a series that is scored.
pub(crate) const FRAMES: usize = 70;

/// Phase of a frame of such a series, rad.
pub(crate) fn truth(frame: usize) -> f64 {
    0.1 * frame as f64 + 0.3 * libm::sin(0.2 * frame as f64)
}

/// Rms error of the last phase against the first frame, rad, and of all phases over what is said of them; the fields come
/// from `series`, one function of the frame for each seed.
pub(crate) fn errors<const LOOKS: usize, F: FnMut(usize) -> [Complex<f64>; LOOKS]>(
    settings: TrackerSettings,
    runs: u64,
    series: impl Fn(u64) -> F,
) -> (f64, f64) {
    let settings = TrackerSettings { reference_frames: 1, ..settings };
    let (mut error, mut z) = (0.0, 0.0);
    for seed in 0..runs {
        let mut field = series(seed);
        let mut tracker = FieldTracker::<f64, LOOKS, NODES>::new(settings).unwrap();
        for frame in 0..FRAMES {
            let newest = tracker.push(&field(frame), frame as f64, |_| ()).unwrap();
            let off = newest.phase_rad - truth(frame) + truth(0);
            if frame > 0 {
                z += (off / newest.sigma_rad).powi(2);
            }
            if frame + 1 == FRAMES {
                error += off * off;
            }
        }
    }
    let runs = runs as f64;
    (libm::sqrt(error / runs), libm::sqrt(z / runs / (FRAMES - 1) as f64))
}
