//! What all runs of one σ say together.

use super::methods::ByMethod;
use super::run::Run;
use super::settings::{Settings, label};
use super::store::Store;

/// Mean and standard deviation over the runs, one value per frame.
#[derive(Clone, Debug, Default)]
pub struct Spread {
    /// The mean.
    pub mean: Vec<f64>,
    /// The standard deviation (n - 1); 0 of one run.
    pub deviation: Vec<f64>,
}

/// The runs of one σ.
#[derive(Clone, Debug)]
pub struct Statistics {
    /// Its name, such as `σ = λ/32`.
    pub label: String,
    /// How many they are.
    pub runs: usize,
    /// The phase put in, radians, one per frame.
    pub truth_rad: Vec<f64>,
    /// Phase by each method, radians.
    pub phases: ByMethod<Spread>,
    /// Root mean square over the runs of phase − truth by each method, radians, one per frame.
    pub errors: ByMethod<Vec<f64>>,
    /// Amplitude of the autocorrelation by lag.
    pub autocorrelation: Spread,
}

impl Statistics {
    /// Of the runs that the settings ask for, as far as they are there.
    #[must_use]
    pub fn of(settings: &Settings, store: &Store, sigma: usize) -> Self {
        let runs: Vec<&Run> =
            (0..settings.runs).filter_map(|number| store.get((sigma, number))).collect();
        let truth_rad = settings.scene(sigma, 0).true_phase_rad();
        let phases = |method: usize| -> Vec<&[f64]> {
            runs.iter().map(|run| run.phases[method].as_slice()).collect()
        };
        let by_place = |method: usize| Spread::of(&phases(method));
        let autocorrelations: Vec<&[f64]> =
            runs.iter().map(|run| run.autocorrelation.as_slice()).collect();
        Self {
            label: label(sigma),
            runs: runs.len(),
            phases: std::array::from_fn(by_place),
            errors: std::array::from_fn(|method| errors(&phases(method), &truth_rad)),
            autocorrelation: Spread::of(&autocorrelations),
            truth_rad,
        }
    }

    /// Error at the end, radians, by each method.
    #[must_use]
    pub fn last_errors(&self) -> ByMethod<f64> {
        std::array::from_fn(|method| last(&self.errors[method]))
    }

    /// The phase put in, in the last frame, radians.
    #[must_use]
    pub fn last_truth(&self) -> f64 {
        last(&self.truth_rad)
    }

    /// `mean ± deviation` of phase − truth in the last frame, radians, by each method; of one run the error alone.
    #[must_use]
    pub fn last_words(&self) -> ByMethod<String> {
        let words = |method: usize| {
            let Spread { mean, deviation } = &self.phases[method];
            let error = last(mean) - self.last_truth();
            let deviation = (self.runs > 1).then(|| format!(" ± {:.3}", last(deviation)));
            format!("{error:+.3}{}", deviation.unwrap_or_default()).replace('-', "\u{2212}")
        };
        std::array::from_fn(words)
    }
}

impl Spread {
    /// Of curves of the same length.
    #[must_use]
    pub fn of(curves: &[&[f64]]) -> Self {
        let frames = curves.first().map_or(0, |curve| curve.len());
        let count = curves.len() as f64;
        let at = |frame: usize| curves.iter().map(move |curve| curve[frame]);
        let mean: Vec<f64> = (0..frames).map(|t| at(t).sum::<f64>() / count).collect();
        let deviation = |t: usize| {
            let square: f64 = at(t).map(|value| (value - mean[t]).powi(2)).sum();
            (square / (count - 1.0).max(1.0)).sqrt()
        };
        Self { deviation: (0..frames).map(deviation).collect(), mean }
    }
}

/// Root mean square over the curves of curve − truth.
fn errors(curves: &[&[f64]], truth: &[f64]) -> Vec<f64> {
    let at = |(frame, truth): (usize, &f64)| {
        let squares = curves.iter().map(|curve| (curve[frame] - truth).powi(2));
        (squares.sum::<f64>() / curves.len() as f64).sqrt()
    };
    truth.iter().enumerate().map(at).collect()
}

fn last(values: &[f64]) -> f64 {
    values.last().copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_deviation_and_error() {
        let (a, b) = ([0.0, 1.0], [0.0, 3.0]);
        let spread = Spread::of(&[&a, &b]);
        assert_eq!(spread.mean, [0.0, 2.0]);
        assert_eq!(spread.deviation, [0.0, 2.0_f64.sqrt()]);
        assert_eq!(errors(&[&a, &b], &[0.0, 2.0]), [0.0, 1.0]);
        assert_eq!(Spread::of(&[&a]).deviation, [0.0, 0.0]);
    }
}
