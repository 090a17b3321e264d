//! The edges of the number range: dim pixels, numbers that are none, and series that measure nothing.

use num_complex::Complex;
use phasewalk::io::Shape;
use phasewalk::lanes::Path;
use phasewalk::method::{Depths, Method, Plan};
use phasewalk_core::Params;
use phasewalk_core::walk::Walk;
use phasewalk_core::weights::{Weighting, Weights};
use phasewalk_tests::library::{Settings, phase_images};
use phasewalk_tests::recording::Recording;
use phasewalk_tests::tolerance::ORACLE_RAD;

const SLOPE_RAD: f64 = 0.1;
const SHAPE: Shape = Shape { frames: 12, depth: 1, height: 20, width: 24 };

/// A rigid ramp of 0.1 rad per frame whose amplitude at (t, pixel) is multiplied by `dim`.
fn ramp(dim: impl Fn(usize, usize) -> f32) -> Recording {
    let mut recording = Recording::decorrelating(SHAPE, 1.0, 7, |t, _| SLOPE_RAD * t as f64);
    let pixels = recording.pixels();
    for (i, u) in recording.field.iter_mut().enumerate() {
        *u *= dim(i / pixels, i % pixels);
    }
    recording
}

fn follows_the_ramp(recording: &Recording) {
    let paper = Method::Paper(Weighting::Paper);
    let plan = Plan::new(paper, SHAPE.frames, None, None, Depths::single()).unwrap();
    for path in Path::available() {
        let settings = Settings { path, ..Settings::new(2.0) };
        let images = phase_images(recording, &plan, &settings).phases;
        for (i, &phase) in images.iter().enumerate() {
            // Against the mean of the first five frames, that is of frame 2.
            let truth = SLOPE_RAD * (i / recording.pixels()) as f64 - 2.0 * SLOPE_RAD;
            let error = (f64::from(phase) - truth).abs();
            assert!(error < ORACLE_RAD, "{path:?}, value {i}: {phase} for {truth}");
        }
    }
}

#[test]
fn dim_frames_count_like_others() {
    follows_the_ramp(&ramp(|t, _| if t == 3 || t == 7 { 1e-10 } else { 1.0 }));
}

#[test]
fn dim_pixels_do_not_harm_their_neighbours() {
    follows_the_ramp(&ramp(|_, pixel| if pixel % 31 == 5 { 1e-10 } else { 1.0 }));
    follows_the_ramp(&ramp(|_, pixel| if pixel % 17 == 3 { 3e-20 } else { 1.0 }));
}

/// A walk over 16 pixels of the ramp, `spoil` changing fields on the way.
fn walk(spoil: impl Fn(usize, &mut [Complex<f32>; 16])) -> Vec<(f32, f32)> {
    let weights = Weights::new(Weighting::Paper, 16.0, 0.999_99);
    let mut walk = Walk::<f32, 16, 4, 5>::new(Params::paper(4), weights, 16.0).unwrap();
    let estimate = |t: usize| {
        let turned = |pixel: usize| Complex::from_polar(1.0, pixel as f32 + 0.1 * t as f32);
        let mut field = std::array::from_fn(turned);
        spoil(t, &mut field);
        let estimate = walk.push(&field);
        (estimate.phase_rad, estimate.sigma_rad)
    };
    (0..30).map(estimate).collect()
}

#[test]
fn a_walk_survives_pixels_that_are_not_numbers() {
    let spoiled = walk(|t, field| {
        if t == 3 || t == 9 {
            field[5].re = f32::NAN;
            field[6].im = f32::INFINITY;
        }
    });
    let (last, sigma) = spoiled[29];
    assert!((f64::from(last) - (2.9 - 0.2)).abs() < ORACLE_RAD, "{last}");
    assert!(sigma.is_finite(), "{sigma}");
}

#[test]
fn a_walk_in_the_dark_knows_nothing() {
    for (phase, sigma) in walk(|_, field| field.fill(Complex::default())) {
        assert_eq!((phase, sigma), (0.0, f32::INFINITY));
    }
}
