//! Agreement of `linking::link_series` with an independent estimator in numpy, on the same cross-spectra
//! (`data/linking`, made by `make.py` there).

mod series;

use num_complex::Complex;
use phasewalk_core::Real;
use series::link;
use std::path::Path;

const N: usize = 70;

/// What the numpy estimator was given and found.
struct Case {
    /// N x N.
    cross: Vec<Complex<f64>>,
    times: Vec<f64>,
    phases: Vec<f64>,
    sigmas: Vec<f64>,
    quality: Vec<f64>,
}

fn numbers<const SIZE: usize>(name: &str, convert: impl Fn([u8; SIZE]) -> f64) -> Vec<f64> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/linking").join(name);
    let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    bytes.as_chunks::<SIZE>().0.iter().map(|&chunk| convert(chunk)).collect()
}

fn case(name: &str) -> Case {
    let lower = numbers::<4>(&format!("{name}.f32"), |b| f64::from(f32::from_le_bytes(b)));
    let mut pairs = lower.as_chunks::<2>().0.iter();
    let mut cross = vec![Complex::default(); N * N];
    for i in 0..N {
        for j in 0..=i {
            let &[re, im] = pairs.next().expect("N (N + 1) / 2 numbers");
            cross[i * N + j] = Complex::new(re, im);
            cross[j * N + i] = Complex::new(re, -im);
        }
    }
    let found = numbers::<8>(&format!("{name}.f64"), f64::from_le_bytes);
    let column = |i: usize| found[i * N..(i + 1) * N].to_vec();
    Case { cross, times: column(0), phases: column(1), sigmas: column(2), quality: column(3) }
}

/// Phases, standard deviations and qualities of ours, against the first frame.
fn ours<T: Real>(case: &Case, looks: f64) -> [Vec<f64>; 3] {
    link::<T>(&case.cross, &case.times, looks).0
}

fn agrees<T: Real>(name: &str, looks: f64, phase_error: f64, sigma_error: f64) {
    let case = case(name);
    let [phases, sigmas, quality] = ours::<T>(&case, looks);
    let mut compared = 0;
    for i in 0..N {
        assert!((quality[i] - case.quality[i]).abs() < 0.02, "{name} {i}: quality {}", quality[i]);
        if case.quality[i] <= 0.3 {
            assert!(phases[i].is_nan() && sigmas[i] == f64::INFINITY, "{name} {i}");
            continue;
        }
        compared += 1;
        let (phase, sigma) = (phases[i] - case.phases[i], sigmas[i] - case.sigmas[i]);
        assert!(phase.abs() < phase_error, "{name} {i}: phase differs by {phase:e}");
        assert!(sigma.abs() <= sigma_error * case.sigmas[i], "{name} {i}: sigma by {sigma:e}");
    }
    assert!(compared >= 67, "{name}: {compared} frames");
}

const SCENARIOS: [(&str, f64); 7] = [
    ("slow", 1000.0),
    ("fast", 100.0),
    ("noise_outliers", 1000.0),
    ("floor", 100.0),
    ("periodic", 1000.0),
    ("steep", 1000.0),
    ("pairs", 1000.0),
];

/// The same arithmetic in another order. The rows of outlier frames in the sandwich are nearly singular: that is
/// the most that standard deviations differ by.
#[test]
fn double_precision_agrees() {
    for (name, looks) in SCENARIOS {
        agrees::<f64>(name, looks, 1e-6, 1e-3);
    }
}

/// Asked: 1e-3 rad and 5 % (f32 keeps 7 digits of a phase of up to 138 rad: 1e-5 rad).
#[test]
fn single_precision_agrees() {
    for (name, looks) in SCENARIOS {
        agrees::<f32>(name, looks, 1e-3, 0.05);
    }
}

/// Without coherence there is no phase, and no number pretends that there is.
#[test]
fn darkness_has_no_phase() {
    let [phases, sigmas, _] = ours::<f64>(&case("dark"), 100.0);
    assert!(phases.iter().all(|phase| phase.is_nan()));
    assert!(sigmas.iter().all(|&sigma| sigma == f64::INFINITY));
    let nothing = Case { cross: vec![Complex::default(); N * N], ..case("dark") };
    let [phases, sigmas, quality] = ours::<f32>(&nothing, 100.0);
    assert!(phases.iter().all(|phase| phase.is_nan()));
    assert!(sigmas.iter().all(|&sigma| sigma == f64::INFINITY));
    assert!(quality.iter().all(|&s| s < 0.3));
}
