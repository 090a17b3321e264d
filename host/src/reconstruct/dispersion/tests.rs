//! Speckle A-lines of six layers, with known dispersion, shot noise and fixed fringes.

use super::*;
use crate::simulate::philox::{key, philox4x32};
use std::f64::consts::PI;

/// Depths of the layers, and their amplitudes against the brightest.
const LAYERS: [(f64, f64); 6] =
    [(0.20, 0.7), (0.26, 0.4), (0.33, 0.5), (0.42, 0.35), (0.62, 1.0), (0.69, 0.9)];
/// Scatterers of a layer: enough for speckle.
const SCATTERERS: u32 = 8;

/// A retina without a name.
#[derive(Clone, Copy)]
struct Scene {
    lines: u32,
    images: usize,
    dispersion: Dispersion,
    /// Root mean square fringe amplitude of the brightest layer.
    fringe: f64,
    /// Standard deviation per sample.
    noise: f64,
    /// Amplitude of fixed fringes.
    fixed: f64,
    /// a2 gains that much per pixel of depth from the fifth layer on.
    chirp: f64,
    seed: u64,
}

const SCENE: Scene = Scene {
    lines: 400,
    images: 256,
    dispersion: Dispersion { a2: 8.0, a3: 2.0 },
    fringe: 16.0,
    noise: 20.0,
    fixed: 0.0,
    chirp: 0.0,
    seed: 1,
};

/// Two uniform numbers in (0, 1).
fn uniform(counter: [u32; 4], seed: u64) -> [f64; 2] {
    let words = philox4x32(counter, key(seed));
    [words[0], words[1]].map(|word| (f64::from(word) + 0.5) / 4_294_967_296.0)
}

/// Normal numbers of unit variance.
fn normal(counter: [u32; 4], seed: u64) -> [f64; 2] {
    let [u, v] = uniform(counter, seed);
    let radius = (-2.0 * u.ln()).sqrt();
    [radius * (2.0 * PI * v).cos(), radius * (2.0 * PI * v).sin()]
}

impl Scene {
    /// Surface of a layer in pixels: curved and tilted over the lines.
    fn depth(&self, line: u32, layer: usize) -> f64 {
        let x = f64::from(line) / f64::from(self.lines) - 0.5;
        LAYERS[layer].0 * 0.5 * self.images as f64 + 6.0 * x + 8.0 * x * x
    }

    fn spectra(&self) -> Vec<f32> {
        (0..self.lines).flat_map(|line| self.line(line)).collect()
    }

    fn line(&self, line: u32) -> Vec<f32> {
        let mut spectrum = vec![0.0_f64; self.images];
        let coordinates: Vec<f64> =
            (0..self.images).map(|m| band_coordinate(m, self.images)).collect();
        for (layer, (_, brightness)) in LAYERS.iter().enumerate() {
            for scatterer in 0..SCATTERERS {
                let counter = [line, layer as u32, scatterer, 0];
                let [phase, place] = uniform(counter, self.seed);
                let depth = self.depth(line, layer) + 1.5 * (place - 0.5);
                let amplitude = self.fringe * brightness * (2.0 / f64::from(SCATTERERS)).sqrt();
                let chirp = self.chirp * (depth - self.depth(line, 4));
                for (value, q) in spectrum.iter_mut().zip(&coordinates) {
                    let bend = self.dispersion.phase(*q) + chirp * q * q;
                    *value += amplitude * (2.0 * PI * phase + PI * depth * q + bend).cos();
                }
            }
        }
        let [phase, _] = uniform([line, 0, 0, 1], self.seed);
        for (m, (value, q)) in spectrum.iter_mut().zip(&coordinates).enumerate() {
            let fixed = [0.15, 0.4].map(|d| (phase * 2.0 + PI * d * self.images as f64 * q).cos());
            *value += self.fixed * (fixed[0] + 0.6 * fixed[1]);
            *value += self.noise * normal([line, m as u32, 0, 2], self.seed)[0];
        }
        spectrum.iter().map(|&value| value as f32).collect()
    }

    fn estimate(&self) -> Estimate {
        let depths = 4..self.images / 2 - 4;
        estimate(&self.spectra(), self.images, &hann(self.images), depths, None).unwrap()
    }
}

fn hann(images: usize) -> Vec<f32> {
    let weight = |m| (0.5 + 0.5 * (PI * band_coordinate(m, images)).cos()) as f32;
    (0..images).map(weight).collect()
}

/// Distances from the truth, rad.
fn errors(scene: &Scene, found: Dispersion) -> [f64; 2] {
    [found.a2 - scene.dispersion.a2, found.a3 - scene.dispersion.a3]
}

fn assert_found(scene: &Scene, tolerance: f64) {
    let found = scene.estimate();
    let within = errors(scene, found.dispersion).iter().all(|error| error.abs() < tolerance);
    assert!(within && found.is_reliable(), "{:?}: {found:?}", scene.dispersion);
    assert!(found.evaluations < 450, "{found:?}");
    assert!(found.sharpness_after >= found.sharpness_before, "{found:?}");
}

#[test]
fn bright_and_medium_retinas_within_a_third_of_a_radian() {
    for (images, fringe, a2, a3) in
        [(256, 30.0, 8.0, 2.0), (256, 16.0, -22.0, 9.0), (512, 16.0, 18.0, -6.0)]
    {
        for seed in 1..=3 {
            let dispersion = Dispersion { a2, a3 };
            assert_found(&Scene { images, fringe, dispersion, seed, ..SCENE }, 0.3);
        }
    }
}

#[test]
fn strong_dispersion_is_found() {
    for a2 in [-45.0, 45.0] {
        assert_found(&Scene { dispersion: Dispersion { a2, a3: 5.0 }, ..SCENE }, 0.3);
    }
}

#[test]
fn no_dispersion_is_found_too() {
    for fixed in [0.0, 10.0] {
        assert_found(&Scene { dispersion: Dispersion::default(), fixed, ..SCENE }, 0.3);
    }
}

#[test]
fn fixed_fringes_do_not_pass_for_the_sample() {
    // The fringes are four times the sample: sharpest at zero, yet the sample is found.
    let scene = Scene { images: 512, fringe: 5.0, fixed: 20.0, ..SCENE };
    let found = scene.estimate();
    let distance = errors(&scene, found.dispersion);
    assert!(distance.iter().all(|error| error.abs() < 0.6) && found.is_reliable(), "{found:?}");
    // With nothing beneath, zero is found and doubted.
    let found = Scene { fringe: 0.0, ..scene }.estimate();
    assert!(found.dispersion.a2.abs() < 1.0 && found.fixed_fringes, "{found:?}");
    assert!(!found.is_reliable());
}

#[test]
fn noise_alone_is_doubted() {
    for seed in 1..=5 {
        let found = Scene { fringe: 0.0, seed, ..SCENE }.estimate();
        assert!(found.significance < 4.5, "{found:?}");
    }
}

#[test]
fn a_start_saves_the_grid() {
    let scene = Scene { fringe: 5.0, ..SCENE };
    let (window, depths) = (hann(scene.images), 4..scene.images / 2 - 4);
    let start = Some(Dispersion { a2: 6.0, a3: 4.0 });
    let found = estimate(&scene.spectra(), scene.images, &window, depths, start).unwrap();
    assert!(found.evaluations < 60, "{found:?}");
    assert!(errors(&scene, found.dispersion).iter().all(|e| e.abs() < 0.6), "{found:?}");
}

#[test]
fn at_a_layer_the_chirp_of_the_others_does_not_count() {
    let scene = Scene { images: 512, fringe: 30.0, chirp: 0.03, ..SCENE };
    let spectra = scene.spectra();
    let start = scene.estimate().dispersion;
    // Under `start` a layer appears where the linear part of a3 q^3 puts it.
    let shift = (scene.dispersion.a3 - start.a3) * 0.3 / PI;
    let centres: Vec<f64> = (0..scene.lines).map(|line| scene.depth(line, 4) + shift).collect();
    let window = hann(scene.images);
    let found = estimate_at(&spectra, scene.images, &window, &centres, 6, start).unwrap();
    assert!(errors(&scene, found.dispersion).iter().all(|e| e.abs() < 0.3), "{found:?}");
    // Layers at the edge and lines without a layer are left out.
    let mut some = centres.clone();
    some[..100].fill(f64::NAN);
    some[100..200].fill(3.0);
    let found = estimate_at(&spectra, scene.images, &window, &some, 6, start).unwrap();
    assert!(errors(&scene, found.dispersion).iter().all(|e| e.abs() < 0.5), "{found:?}");
}

#[test]
fn the_result_does_not_depend_on_scale_or_threads() {
    let scene = Scene { lines: 100, ..SCENE };
    let (window, depths) = (hann(scene.images), 4..100);
    let run = |factor: f32, threads: usize| {
        let spectra: Vec<f32> = scene.spectra().iter().map(|value| value * factor).collect();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let estimate = || estimate(&spectra, scene.images, &window, depths.clone(), None);
        pool.install(estimate).unwrap().dispersion
    };
    assert_eq!(run(1.0, 1), run(1.0, 2));
    assert_eq!(run(1.0, 1), run(0.25, 1));
}

#[test]
fn what_cannot_be_used_is_refused() {
    let (spectra, window) = (vec![1.0_f32; 256], vec![1.0_f32; 64]);
    let start = Dispersion::default();
    let refused = |spectra: &[f32], window: &[f32], depths| {
        estimate(spectra, 64, window, depths, None).unwrap_err().to_string()
    };
    assert!(refused(&spectra[..250], &window, 0..32).contains("250 samples"));
    assert!(refused(&spectra, &window[..63], 0..32).contains("window of 63"));
    assert!(refused(&spectra, &window, 0..33).contains("0..32"));
    assert!(refused(&[0.0; 256], &window, 0..32).contains("no light"));
    assert!(refused(&[f32::NAN; 256], &window, 0..32).contains("NaN"));
    let at = |centres: &[f64]| estimate_at(&spectra, 64, &window, centres, 4, start).unwrap_err();
    assert!(at(&[1.0]).to_string().contains("1 centres for 4 lines"));
    assert!(at(&[1.0; 4]).to_string().contains("no A-line"));
}
