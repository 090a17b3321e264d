//! Retinas of speckle whose surfaces are known.

use super::*;
use std::f64::consts::PI;

/// A layer: depth behind the IS/OS, mean intensity, full thickness, pixels.
type Slab = (f64, f64, f64);

/// NFL, IPL, ELM, IS/OS, tips, RPE; the last is the brightest.
const RETINA: [Slab; 6] = [
    (-40.0, 0.7, 1.5),
    (-24.0, 0.25, 6.0),
    (-4.5, 0.15, 0.7),
    (0.0, 1.0, 0.8),
    (5.5, 0.8, 0.8),
    (8.2, 1.3, 1.2),
];

struct Scene {
    shape: [usize; 3],
    layers: Vec<Slab>,
    /// Depth of the IS/OS at the centre.
    depth: f64,
    /// Tilt over the field in y and x, and depth of the curvature, pixels.
    tilt: [f64; 2],
    curvature: f64,
    /// Mean noise intensity relative to the IS/OS.
    noise: f64,
    /// A fringe at a constant depth, relative to the IS/OS.
    ghost: f64,
    /// Independent speckle patterns.
    patterns: usize,
    /// Change of the outer segments' length over the field, pixels.
    stretch: f64,
    /// Depth by which the layers before the ELM bend at the centre, pixels.
    pit: f64,
    /// Share of the light under vessels and at the corners.
    shade: f64,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            shape: [128, 96, 144],
            layers: RETINA.to_vec(),
            depth: 62.3,
            tilt: [3.0, 5.0],
            curvature: 4.0,
            noise: 0.02,
            ghost: 0.0,
            patterns: 6,
            stretch: 0.0,
            pit: 0.0,
            shade: 1.0,
        }
    }
}

fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// A complex number of unit mean square.
fn gaussian(state: &mut u64) -> [f32; 2] {
    let radius = (-(1.0 - uniform(state)).ln()).sqrt();
    let angle = 2.0 * PI * uniform(state);
    [(radius * angle.cos()) as f32, (radius * angle.sin()) as f32]
}

/// Amplitude of the Hann window in depth.
fn spread(u: f64) -> f64 {
    if u.abs() < 1e-9 {
        1.0
    } else if (u.abs() - 1.0).abs() < 1e-9 {
        0.5
    } else {
        (PI * u).sin() / (PI * u) / (1.0 - u * u)
    }
}

impl Scene {
    fn isos(&self, y: usize, x: usize) -> f64 {
        let along = |at: usize, count: usize| at as f64 / (count - 1) as f64 - 0.5;
        let (v, u) = (along(y, self.shape[1]), along(x, self.shape[2]));
        let bowl = 2.0 * (u * u + v * v);
        self.depth + self.tilt[0] * v + self.tilt[1] * u + self.curvature * bowl
    }

    fn tips(&self, y: usize, x: usize) -> f64 {
        let u = x as f64 / (self.shape[2] - 1) as f64 - 0.5;
        self.isos(y, x) + self.layers[4].0 + self.stretch * u
    }

    /// Depth of a layer that lies `behind` the IS/OS on average.
    fn layer(&self, behind: f64, y: usize, x: usize) -> f64 {
        let [u, v] = [(x, self.shape[2]), (y, self.shape[1])]
            .map(|(at, count)| at as f64 / (count - 1) as f64 - 0.5);
        if behind >= self.layers[4].0 {
            self.tips(y, x) + behind - self.layers[4].0
        } else if behind < -10.0 {
            self.isos(y, x) + behind + self.pit * (-(u * u + v * v) / 0.02).exp()
        } else {
            self.isos(y, x) + behind
        }
    }

    /// Two vessels across the field, and darker corners.
    fn light(&self, y: usize, x: usize) -> f64 {
        let vessel = |at: usize| (x + y / 4) % at > at - 8;
        let bowl = ((2 * x) as f64 / self.shape[2] as f64 - 1.0).powi(2)
            + ((2 * y) as f64 / self.shape[1] as f64 - 1.0).powi(2);
        let corner = 1.0 - (1.0 - self.shade) * 0.5 * bowl;
        if vessel(60) { corner * self.shade } else { corner }
    }

    /// Mean intensity of a few speckle patterns.
    fn make(&self, seed: u64) -> Vec<f32> {
        let [depths, rows, columns] = self.shape;
        let mut mean = vec![0.0_f32; depths * rows * columns];
        let patterns: Vec<Vec<f32>> = (0..self.patterns)
            .into_par_iter()
            .map(|pattern| self.pattern(seed * 1000 + pattern as u64))
            .collect();
        for pattern in &patterns {
            for (sum, value) in mean.iter_mut().zip(pattern) {
                *sum += value / self.patterns as f32;
            }
        }
        mean
    }

    /// Scatterers of one pattern, blurred over 2 to 3 pixels of the field.
    fn pattern(&self, seed: u64) -> Vec<f32> {
        let [depths, rows, columns] = self.shape;
        let mut state = seed.wrapping_mul(0xD134_2543_DE82_EF95);
        // (y, x, z, re/im), depth fastest as the lateral blur wants it.
        let mut field = vec![0.0_f32; rows * columns * depths * 2];
        for (at, line) in field.chunks_exact_mut(2 * depths).enumerate() {
            let (y, x) = (at / columns, at % columns);
            for &(behind, intensity, thickness) in &self.layers {
                for _ in 0..4 {
                    let depth = self.layer(behind, y, x) + thickness * (uniform(&mut state) - 0.5);
                    let amplitude = gaussian(&mut state);
                    let scale = (self.light(y, x) * intensity / 4.0).sqrt();
                    for z in (depth as usize).saturating_sub(3)..(depth as usize + 5).min(depths) {
                        let weight = (scale * spread(z as f64 - depth)) as f32;
                        line[2 * z] += weight * amplitude[0];
                        line[2 * z + 1] += weight * amplitude[1];
                    }
                }
            }
        }
        let sigma = 1.0;
        lateral::smooth(&mut field, rows, columns, sigma);
        // The blur keeps 1 / (4πσ²) of the power.
        let gain = (4.0 * PI * sigma * sigma) as f32;
        let mut intensity = vec![0.0; depths * rows * columns];
        for (at, line) in field.chunks_exact(2 * depths).enumerate() {
            for (z, value) in line.chunks_exact(2).enumerate() {
                let mut re = gain.sqrt() * value[0];
                let mut im = gain.sqrt() * value[1];
                let noise = gaussian(&mut state).map(|part| part * self.noise.sqrt() as f32);
                if z == 48 {
                    re += self.ghost.sqrt() as f32;
                }
                re += noise[0];
                im += noise[1];
                intensity[z * rows * columns + at] = re * re + im * im;
            }
        }
        intensity
    }

    /// rms errors of IS/OS and tips, and their means.
    fn errors(&self, found: &Surfaces) -> [f64; 4] {
        let columns = self.shape[2];
        let error = |surface: &[f32], truth: &dyn Fn(usize, usize) -> f64| {
            let each =
                |(at, depth): (usize, &f32)| f64::from(*depth) - truth(at / columns, at % columns);
            let count = surface.len() as f64;
            let square: f64 = surface.iter().enumerate().map(|at| each(at).powi(2)).sum();
            let mean: f64 = surface.iter().enumerate().map(each).sum();
            [(square / count).sqrt(), mean / count]
        };
        let a = error(&found.isos, &|y, x| self.isos(y, x));
        let b = error(&found.ost, &|y, x| self.tips(y, x));
        [a[0], b[0], a[1], b[1]]
    }

    #[track_caller]
    fn is_found(&self, what: &str, limit: f64) {
        for seed in 1..=2 {
            let volume = self.make(seed);
            let found = segment(&volume, self.shape, 5.1, &Hints::default())
                .unwrap_or_else(|error| panic!("{what}: {error}"));
            let errors = self.errors(&found);
            println!("{what}, seed {seed}: {errors:.3?} {}", found.reason);
            assert!(errors[0] < limit && errors[1] < limit, "{what} {seed}: {errors:.3?}");
        }
    }
}

#[test]
fn tilted_and_curved() {
    Scene::default().is_found("plain", 0.06);
}

#[test]
fn strong_tilt() {
    Scene { tilt: [8.0, 16.0], ..Scene::default() }.is_found("steep", 0.06);
    Scene { tilt: [-16.0, 8.0], ..Scene::default() }.is_found("steep", 0.06);
}

#[test]
fn other_brightness() {
    for (what, place, intensity) in [("IS/OS", 3, 2.5), ("ILM", 0, 4.0), ("tips", 4, 1.5)] {
        let mut scene = Scene::default();
        scene.layers[place].1 = intensity;
        scene.is_found(what, 0.06);
    }
}

#[test]
fn tips_close_to_the_epithelium() {
    let mut scene = Scene::default();
    scene.layers[4].0 = 4.0;
    scene.layers[5].0 = 6.6;
    scene.is_found("close", 0.06);
    scene.layers[5].0 = 7.0;
    scene.is_found("close", 0.06);
}

#[test]
fn little_light() {
    // 16 counts of fringes over 20 counts of shot noise, 256 samples with a Hann window.
    Scene { noise: 0.036, ..Scene::default() }.is_found("16 DN", 0.06);
    Scene { noise: 0.5, ..Scene::default() }.is_found("4 DN", 0.08);
}

#[test]
fn ghost_of_fixed_fringes() {
    Scene { ghost: 0.3, ..Scene::default() }.is_found("ghost", 0.06);
}

#[test]
fn diffuse_choroid() {
    let mut scene = Scene::default();
    for at in 0..12 {
        scene.layers.push((12.0 + 2.0 * f64::from(at), 0.5, 2.0));
    }
    scene.is_found("choroid", 0.06);
}

#[test]
fn outer_segments_of_varying_length() {
    Scene { stretch: 1.5, ..Scene::default() }.is_found("stretch", 0.06);
}

#[test]
fn pit_and_shadows() {
    let scene = || Scene { pit: 12.0, ..Scene::default() };
    scene().is_found("pit", 0.06);
    Scene { shade: 0.2, ..scene() }.is_found("shade", 0.08);
}

#[test]
fn nearly_flat_and_noiseless() {
    let scene = || Scene { tilt: [0.2, 0.3], curvature: 0.3, ..Scene::default() };
    scene().is_found("nearly flat", 0.12);
    Scene { noise: 0.0, ..scene() }.is_found("noiseless", 0.12);
}

#[test]
fn hints_decide() {
    let scene = Scene::default();
    let volume = scene.make(1);
    let hints = Hints { isos_px: Some(58.5), outer_segment_um: None };
    let found = segment(&volume, scene.shape, 5.1, &hints).unwrap();
    let offset = f64::from(found.isos[48 * 144 + 72]) - scene.isos(48, 72);
    assert!((offset - scene.layers[2].0).abs() < 0.3, "{offset} {}", found.reason);
    let hints = Hints { isos_px: None, outer_segment_um: Some(8.2 * 5.1) };
    let found = segment(&volume, scene.shape, 5.1, &hints).unwrap();
    let length = f64::from(found.ost[48 * 144 + 72] - found.isos[48 * 144 + 72]);
    assert!((length - 8.2).abs() < 0.2, "{length} {}", found.reason);
    let hints = Hints { isos_px: Some(10.0), outer_segment_um: None };
    assert!(segment(&volume, scene.shape, 5.1, &hints).is_err());
}

#[test]
fn small_field() {
    Scene {
        shape: [64, 32, 32],
        depth: 48.0,
        tilt: [2.0, 3.0],
        curvature: 1.0,
        ..Scene::default()
    }
    .is_found("small", 0.1);
}

#[test]
fn flat_surface() {
    Scene { tilt: [0.0; 2], curvature: 0.0, ..Scene::default() }.is_found("flat", 0.15);
}

#[test]
fn nothing_to_find_is_said() {
    let scene = Scene { layers: Vec::new(), noise: 1.0, ..Scene::default() };
    for seed in 1..=3 {
        let error = segment(&scene.make(seed), scene.shape, 5.1, &Hints::default()).unwrap_err();
        assert!(error.to_string().contains("nothing stands out"), "{error}");
    }
    let shape = scene.shape;
    let empty = vec![0.0; shape.iter().product()];
    assert!(segment(&empty, shape, 5.1, &Hints::default()).is_err());
    assert!(segment(&empty, [1, 2, 3], 5.1, &Hints::default()).is_err());
    assert!(segment(&[], [0, 0, 0], 5.1, &Hints::default()).is_err());
}
