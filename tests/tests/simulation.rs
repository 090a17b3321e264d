//! The simulated scene through the estimators: errors, decorrelation and real-valuedness as reported.

use num_complex::{Complex32, Complex64};
use phasewalk::io::Shape;
use phasewalk::method::{Depths, Method, Plan};
use phasewalk::progress::Progress;
use phasewalk::simulate::{SpeckleScene, coherence_at_lags};
use phasewalk_core::weights::Weighting;
use phasewalk_tests::library::phase_curve;
use phasewalk_tests::program::Bench;
use phasewalk_tests::recording::Recording;
use phasewalk_tests::tolerance::{AUTOCORRELATION, LEAK_RAD, RMS_FACTOR, STANDARD_SCORE};

const SEEDS: std::ops::Range<u64> = 1..9;

fn scene(sigma_wavelengths: f64, seed: u64) -> SpeckleScene {
    SpeckleScene { width: 160, height: 92, sigma_wavelengths, seed, ..SpeckleScene::default() }
}

fn record(scene: &SpeckleScene) -> Recording {
    let mut field = Vec::new();
    let keep = |_, frame: &[Complex32]| {
        field.extend_from_slice(frame);
        Ok(())
    };
    scene.for_each_frame(&Progress::hidden(), keep).unwrap();
    let SpeckleScene { frames, height, width, .. } = *scene;
    Recording { shape: Shape { frames, depth: 1, height, width }, field }
}

/// Root mean square, over the seeds, of the error at the last frame: direct, one-step, paper.
fn rms_errors(sigma_wavelengths: f64) -> [f64; 3] {
    let mut squares = [0.0; 3];
    for seed in SEEDS {
        let scene = scene(sigma_wavelengths, seed);
        let (recording, mask) = (record(&scene), scene.mask());
        let truth = scene.true_phase_rad()[scene.frames - 1];
        let pixels = mask.iter().filter(|inside| **inside).count() as f64;
        let methods = [Method::Direct, Method::OneStep, Method::Paper(Weighting::Paper)];
        for (method, square) in methods.into_iter().zip(&mut squares) {
            let plan = Plan::new(method, scene.frames, None, None, Depths::single()).unwrap();
            let rows = phase_curve(&recording, &mask, &plan, pixels);
            *square += (rows[scene.frames - 1].phase_rad - truth).powi(2);
        }
    }
    let runs = SEEDS.count() as f64;
    squares.map(|square| (square / runs).sqrt())
}

fn are_as_reported(got: [f64; 3], reported: [f64; 3]) {
    for (got, reported) in got.iter().zip(reported) {
        let factor = got / reported;
        assert!((1.0 / RMS_FACTOR..RMS_FACTOR).contains(&factor), "{got} rad for {reported} rad");
    }
    assert!(
        got[0] > 3.0 * got[1] && got[0] > 3.0 * got[2],
        "the direct difference is lost: {got:?}"
    );
}

#[test]
fn errors_of_slow_decorrelation_are_as_reported() {
    are_as_reported(rms_errors(1.0 / 32.0), [1.75, 0.16, 0.15]);
}

#[test]
fn errors_of_fast_decorrelation_are_as_reported() {
    are_as_reported(rms_errors(1.0 / 16.0), [12.9, 0.26, 0.42]);
}

fn autocorrelation(sigma_wavelengths: f64, lags: &[usize]) -> Vec<f64> {
    let scene = scene(sigma_wavelengths, 1);
    let outside: Vec<bool> = scene.mask().iter().map(|inside| !inside).collect();
    coherence_at_lags(&record(&scene).field, scene.pixels(), lags, Some(&outside)).unwrap()
}

#[test]
fn the_field_decorrelates_as_reported() {
    for (sigma, reported) in
        [(1.0 / 32.0, [0.92, 0.86, 0.67, 0.46]), (1.0 / 16.0, [0.73, 0.54, 0.20, 0.03])]
    {
        let got = autocorrelation(sigma, &[1, 2, 5, 10]);
        for (got, reported) in got.iter().zip(reported) {
            assert!((got - reported).abs() < AUTOCORRELATION, "{got} instead of {reported}");
        }
    }
}

#[test]
fn the_autocorrelation_halves_in_fewer_than_ten_and_in_about_two_frames() {
    let lags: Vec<usize> = (1..=10).collect();
    let halved = |sigma| 1 + autocorrelation(sigma, &lags).iter().filter(|a| **a >= 0.5).count();
    assert!((6..10).contains(&halved(1.0 / 32.0)), "{}", halved(1.0 / 32.0));
    assert!((2..4).contains(&halved(1.0 / 16.0)), "{}", halved(1.0 / 16.0));
}

// ---- <C_H> is real -------------------------------------------------------------------------

/// Mean over t of arg <C(t,lag)> over some pixels, with its standard error.
fn mean_argument(recording: &Recording, chosen: &[bool], lag: usize) -> (f64, f64) {
    let wide = |u: Complex32| Complex64::new(f64::from(u.re), f64::from(u.im));
    let frames: Vec<&[Complex32]> = recording.field.chunks(recording.pixels()).collect();
    // Steps that do not overlap are independent.
    let arguments: Vec<f64> = (0..frames.len() - lag)
        .step_by(lag)
        .map(|t| {
            let pairs = frames[t].iter().zip(frames[t + lag]).zip(chosen);
            let inside = pairs.filter(|(_, chosen)| **chosen);
            inside.map(|((&u, &v), _)| wide(u) * wide(v).conj()).sum::<Complex64>().arg()
        })
        .collect();
    let count = arguments.len() as f64;
    let mean = arguments.iter().sum::<f64>() / count;
    let variance = arguments.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (mean, (variance / count).sqrt())
}

/// Pixels farther than `distance` rows or columns from every pixel of the mask, periodically.
fn far_from(mask: &[bool], width: usize, distance: usize) -> Vec<bool> {
    let height = mask.len() / width;
    let near = |i: usize| {
        let (y, x) = (i / width + height - distance, i % width + width - distance);
        (0..=2 * distance).any(|dy| {
            (0..=2 * distance).any(|dx| mask[(y + dy) % height * width + (x + dx) % width])
        })
    };
    (0..mask.len()).map(|i| !near(i)).collect()
}

/// Paper lines 955-968: random motion alone does not turn <C>, as long as the field still
/// resembles itself; the systematic motion inside the x does.
#[test]
fn the_cross_spectrum_of_random_motion_is_real_at_small_lags() {
    for (sigma, lags) in [(1.0 / 32.0, [1, 3, 5]), (1.0 / 16.0, [1, 2, 3])] {
        let scene = scene(sigma, 11);
        let (recording, mask) = (record(&scene), scene.mask());
        let outside = far_from(&mask, scene.width, 10);
        assert!(outside.iter().filter(|far| **far).count() > 3000);
        let truth = scene.true_phase_rad()[scene.frames - 1];
        for lag in lags {
            let (argument, error) = mean_argument(&recording, &outside, lag);
            let allowed = STANDARD_SCORE * error + LEAK_RAD * lag as f64;
            assert!(argument.abs() < allowed, "sigma {sigma}, lag {lag}: {argument} +- {error}");
            let (argument, error) = mean_argument(&recording, &mask, lag);
            let moved = -truth * lag as f64 / (scene.frames - 1) as f64;
            let allowed = STANDARD_SCORE * error + LEAK_RAD * lag as f64;
            assert!((argument - moved).abs() < allowed, "inside: {argument} +- {error}, {moved}");
            assert!(argument < -allowed, "the motion of the x is seen");
        }
    }
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let bench = Bench::new();
    let line = "simulate speckle --width 61 --height 43 --frames 9 --sigma 1/16";
    for (threads, name) in [(1, "A"), (2, "B")] {
        let _ = bench.succeed(&format!("{line} --threads {threads} -o {name}.npy"));
        let _ = bench.succeed(&format!(
            "phase {name}.npy --mask {name}.mask.npy --threads {threads} -o {name}.csv"
        ));
        let _ = bench.succeed(&format!(
            "phase {name}.npy --gaussian 2 --sigma --threads {threads} -o {name}.image.npy"
        ));
    }
    for suffix in ["npy", "mask.npy", "phase.npy", "csv", "image.npy", "image.sigma.npy"] {
        let bytes = |name: &str| std::fs::read(bench.path(&format!("{name}.{suffix}"))).unwrap();
        assert!(bytes("A") == bytes("B"), "{suffix}");
    }
}
