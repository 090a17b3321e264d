//! What is tried: coherence, phase and times of a series.

use phasewalk_core::bound::{cramer_rao, reported_variance};
use phasewalk_core::square::Square;

/// Frames of every series, as the paper has them.
const FRAMES: usize = 70;

/// sigma of the scatterers' walk, in wavelengths per frame.
const SLOW: f64 = 1.0 / 32.0;
const FAST: f64 = 1.0 / 16.0;

/// Is the estimator made for it?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Yes.
    Target,
    /// The model leaves it out: what it costs is shown.
    BeyondModel,
}

/// A series of known coherence.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// What it is called.
    pub name: &'static str,
    /// Is the estimator made for it?
    pub kind: Kind,
    /// When the frames are taken.
    pub times: Vec<f64>,
    /// Gamma, N x N.
    pub gamma: Vec<f64>,
    /// The true phase, radians.
    pub phase: Vec<f64>,
}

impl Scenario {
    fn new(name: &'static str, times: Vec<f64>, gamma: impl Fn(usize, usize) -> f64) -> Self {
        let n = times.len();
        let entry = |place: usize| {
            let (i, j) = (place / n, place % n);
            if i == j { 1.0 } else { gamma(i, j) }
        };
        let phase = times.iter().map(|&t| stimulus(t)).collect();
        let gamma = (0..n * n).map(entry).collect();
        Self { name, kind: Kind::Target, times, gamma, phase }
    }

    fn with_phase(mut self, phase: impl Fn(f64) -> f64) -> Self {
        self.phase = self.times.iter().map(|&t| phase(t)).collect();
        self
    }

    fn beyond_model(self) -> Self {
        Self { kind: Kind::BeyondModel, ..self }
    }

    /// Lower triangular root of Gamma, row after row: Cholesky's, with 1e-9 on the diagonal for the
    /// scenarios whose matrix is nearly singular.
    #[must_use]
    pub fn root(&self) -> Vec<f64> {
        let n = self.times.len();
        let mut root = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| root[i * n + k] * root[j * n + k]).sum();
                let rest = self.gamma[i * n + j] - known;
                root[i * n + j] =
                    if i == j { (rest + 1e-9).max(0.0).sqrt() } else { rest / root[j * n + j] };
            }
        }
        root
    }

    /// Cramer-Rao bound of the standard deviation of phi_{N-1} - phi_0, radians.
    #[must_use]
    pub fn bound(&self, looks: f64) -> f64 {
        let n = self.times.len();
        let [mut gamma, mut bound, mut scratch] = [0; 3].map(|_| vec![0.0; n * n]);
        gamma.copy_from_slice(&self.gamma);
        for i in 0..n {
            gamma[i * n + i] += 1e-9;
        }
        let mut covariance = Square::new(&mut bound, n);
        let gamma = Square::new(&mut gamma, n);
        cramer_rao(&gamma, looks, &mut covariance, &mut Square::new(&mut scratch, n));
        reported_variance(&covariance, &vec![1.0; n], 1, n - 1).sqrt()
    }
}

/// The paper's elongation in phase: dz = lambda/400 + lambda/800 sin(0.1 (t - t_0)) per frame from t_0 = 5 on
/// (paper lines 635-643), as the phase 4 pi / lambda times it in radians; between frames as at the frame before.
fn stimulus(t: f64) -> f64 {
    const ONSET: i64 = 5;
    let step = |frame: i64| {
        let angle = 0.1 * (frame - ONSET) as f64;
        4.0 * std::f64::consts::PI * (1.0 / 400.0 + angle.sin() / 800.0)
    };
    (ONSET..=t.floor() as i64).map(step).sum()
}

/// Scatterers that walk by sigma wavelengths a frame: exp(-(2 k sigma)^2 tau / 2).
fn walk(sigma: f64, tau: f64) -> f64 {
    (-0.5 * (4.0 * std::f64::consts::PI * sigma).powi(2) * tau).exp()
}

/// Every scenario, in the order of the table.
#[must_use]
pub fn scenarios() -> Vec<Scenario> {
    let even: Vec<f64> = (0..FRAMES).map(|t| t as f64).collect();
    let lag = |i: usize, j: usize| i.abs_diff(j) as f64;
    let series =
        |name, gamma: &dyn Fn(usize, usize) -> f64| Scenario::new(name, even.clone(), gamma);
    let slow = |i, j| walk(SLOW, lag(i, j));
    let fast = |i, j| walk(FAST, lag(i, j));
    let without = |frames: &'static [usize]| {
        move |i: usize, j: usize| f64::from(!frames.contains(&i) && !frames.contains(&j))
    };
    let (three, two) = (without(&[11, 30, 52]), without(&[30, 31]));
    let period = |i, j| 0.5 + 0.5 * (std::f64::consts::TAU * lag(i, j) / 20.0).cos();
    let mut all = vec![
        series("λ/32", &slow),
        series("λ/16", &fast),
        series("λ/32, 0 dB", &|i, j| 0.5 * slow(i, j)),
        series("λ/16, 0 dB", &|i, j| 0.5 * fast(i, j)),
        series("λ/32, -6 dB", &|i, j| 0.2 * slow(i, j)),
        series("3 outliers", &|i, j| three(i, j) * slow(i, j)),
        series("2 consecutive outliers", &|i, j| two(i, j) * slow(i, j)),
        series("outliers + 0 dB", &|i, j| 0.5 * three(i, j) * slow(i, j)),
        series("floor 0.2, λ/32", &|i, j| 0.2 + 0.8 * slow(i, j)),
        series("floor 0.2, λ/16", &|i, j| 0.2 + 0.8 * fast(i, j)),
        series("40 % periodic, period 20", &|i, j| 0.6 * slow(i, j) + 0.4 * period(i, j)),
        series("0.43 rad/frame", &slow).with_phase(|t| 0.43 * t),
        series("2.0 rad/frame", &slow).with_phase(|t| 2.0 * t),
        series("2.5 rad step", &slow).with_phase(|t| if t < 35.0 { 0.0 } else { 2.5 }),
    ];
    all.extend(bursts());
    all.extend(non_stationary(&even));
    all
}

/// Pairs and triples of frames with a gap of ten intervals.
fn bursts() -> [Scenario; 2] {
    let times = |burst: usize| -> Vec<f64> {
        (0..FRAMES).map(|i| (i / burst * (burst + 9) + i % burst) as f64).collect()
    };
    let series = |name, burst| {
        let times = times(burst);
        let gamma = |i: usize, j: usize| walk(SLOW, (times[i] - times[j]).abs());
        Scenario::new(name, times.clone(), gamma)
    };
    [
        series("pairs, gap 10", 2).with_phase(|t| 0.01 * t),
        series("triples, gap 10, 0.43 rad/dt", 3).with_phase(|t| 0.43 * t),
    ]
}

/// What a coherence that depends on the lag alone cannot follow.
fn non_stationary(even: &[f64]) -> [Scenario; 3] {
    // The speed of the walk swings by a factor of ten, with a period of half the series.
    let speed = |t: f64| 10_f64.powf(0.5 * (std::f64::consts::TAU * t / 35.0).sin());
    let clock: Vec<f64> =
        even.iter().map(|&t| (0..t as usize).map(|s| speed(s as f64)).sum()).collect();
    let side = |i: usize| usize::from(i >= 23) + usize::from(i >= 47);
    let breaks = |i: usize, j: usize| 0.5_f64.powi(side(i).abs_diff(side(j)) as i32);
    // The share of the signal in a frame's light, 0.3 ... 1.
    let share = |i: usize| (0.65 + 0.35 * (2.4 * (i * i) as f64).sin()).sqrt();
    let slow = |i: usize, j: usize| walk(SLOW, i.abs_diff(j) as f64);
    let series = |name, gamma: &dyn Fn(usize, usize) -> f64| {
        Scenario::new(name, even.to_vec(), gamma).beyond_model()
    };
    [
        series("decorrelation rate varies 10x", &|i, j| walk(SLOW, (clock[i] - clock[j]).abs())),
        series("2 partial breaks", &|i, j| breaks(i, j) * slow(i, j)),
        series("SNR varies per frame", &|i, j| share(i) * share(j) * slow(i, j)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bounds that are known in closed form: (N - 1)(1 - rho^2) / (2 L rho^2).
    #[test]
    fn bounds_of_the_walks() {
        let all = scenarios();
        for (scenario, expected) in all.iter().zip([0.0758, 0.1716]) {
            assert!((scenario.bound(1000.0) - expected).abs() < 1e-4, "{}", scenario.name);
        }
    }

    #[test]
    fn every_matrix_is_a_coherence() {
        for scenario in scenarios() {
            let n = scenario.times.len();
            let root = scenario.root();
            for i in 0..n {
                for j in 0..=i {
                    let product: f64 = (0..n).map(|k| root[i * n + k] * root[j * n + k]).sum();
                    let error = (product - scenario.gamma[i * n + j]).abs();
                    assert!(error < 1e-6, "{} ({i}, {j}): {error:e}", scenario.name);
                }
            }
        }
    }
}
