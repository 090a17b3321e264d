//! The whole recording against what it was made from.

use super::axial::{Axial, LANES};
use super::field::{Appearance, Field, ROWS};
use super::motion::{Motion, Piece};
use super::pose::Pose;
use super::presets::Preset;
use super::record::Plan;
use super::retina::{ISOS, Layer, TIPS};
use super::scene::{FULL_SCALE, OctScene};
use super::schedule::Event;
use super::sweep::Sweep;
use super::tissue::Tissue;
use crate::error::Result;
use crate::progress::Progress;
use num_complex::{Complex32, Complex64};
use std::f64::consts::{PI, TAU};

/// Two thin layers, 12 depth pixels apart, in small images.
fn small() -> OctScene {
    let layer = |name: &str, offset_px, elongates| Layer {
        name: name.to_owned(),
        offset_px,
        thickness_px: 0.5,
        brightness: 1.0,
        elongates,
    };
    OctScene {
        sweeps: 8,
        images: 96,
        height: 40,
        width: 56,
        layers: vec![layer(ISOS, 0.0, false), layer(TIPS, 12.0, true)],
        ..OctScene::default()
    }
}

fn plan(scene: OctScene) -> Plan {
    Plan::new(scene).unwrap()
}

/// The piece of sweep `t` without a saccade.
fn still(plan: &Plan, t: usize) -> Appearance {
    let (scene, motion) = (&plan.scene, &plan.motions[t]);
    let shift = motion.path[0].shift_px;
    Appearance {
        pose: Pose::new([scene.height, scene.width], shift, motion.rotation_rad),
        tilt_turns: [0.001, -0.002],
        elongation_turns: plan.phase_rad[t] / TAU,
        conjugate: scene.down_sweep,
    }
}

/// Spectra of all pixels without camera, shape (y, x, image).
fn spectra(plan: &Plan, tissue: &Tissue, t: usize, look: &Appearance) -> Vec<Vec<f32>> {
    let OctScene { height, width, images, .. } = plan.scene;
    let mut field = Field::new(&plan.scene, &plan.geometry).unwrap();
    field.compute(tissue, look).unwrap();
    let axial = Axial::new(&plan.geometry);
    let samples = axial.samples(&Sweep::new(&plan.scene, &plan.motions[t]), 0..images);
    let mut scratch = axial.scratch();
    let [left, field_width] = field.columns_of_image();
    let mut all = Vec::new();
    for first in (0..height).step_by(ROWS) {
        let rows = ROWS.min(height - first);
        let mut planes = vec![Complex32::ZERO; rows * axial.planes() * field_width];
        field.rows(first, &mut planes);
        for row in planes.chunks_exact(axial.planes() * field_width) {
            for x in (0..width).step_by(LANES) {
                let columns = x..(x + LANES).min(width);
                let shifted = columns.start + left..columns.end + left;
                axial.transform(row, field_width, shifted, &mut scratch);
                let fringes: Vec<_> = samples.iter().map(|s| s.fringe(&scratch)).collect();
                let lanes = 0..columns.len();
                all.extend(lanes.map(|lane| fringes.iter().map(|f| f[lane]).collect::<Vec<_>>()));
            }
        }
    }
    all
}

/// Fourier transform of a spectrum at depth `d` (a real number of pixels), about the band's middle.
fn at_depth(spectrum: &[f32], d: f64) -> Complex64 {
    let half = spectrum.len() as f64 / 2.0;
    let wave = |m: usize| Complex64::from_polar(1.0, -PI * d * (m as f64 - half + 0.5) / half);
    spectrum.iter().enumerate().map(|(m, &s)| wave(m) * f64::from(s)).sum::<Complex64>() / half
}

/// Leave scatterers out unless `keep(strip, scatterer)`.
fn thin_out(tissue: &mut Tissue, keep: impl Fn(usize, usize) -> bool) {
    for (row, strip) in tissue.strips.iter_mut().enumerate() {
        for (i, amplitude) in strip.amplitude.iter_mut().enumerate() {
            *amplitude = if keep(row, i) { *amplitude } else { 0.0 };
        }
    }
}

/// Response of the pixel (y, x) to a scatterer at `place`: all frequencies of the field inside the
/// aperture.
fn response(plan: &Plan, pixel: [usize; 2], place: [f64; 2]) -> f64 {
    let [height, width] = plan.geometry.field.map(|n| n as isize);
    let cutoff = plan.scene.aperture_cycles_per_pixel;
    let distance = [0, 1].map(|axis| pixel[axis] as f64 - place[axis]);
    let mut sum = 0.0;
    for ky in -height / 2..=height / 2 {
        for kx in -width / 2..=width / 2 {
            let [fy, fx] = [ky as f64 / height as f64, kx as f64 / width as f64];
            if fx * fx + fy * fy <= cutoff * cutoff {
                sum += (TAU * (fy * distance[0] + fx * distance[1])).cos();
            }
        }
    }
    sum / (height * width) as f64
}

/// The spectra as their definition has them, in double precision.
fn direct(plan: &Plan, tissue: &Tissue, t: usize, look: &Appearance) -> Vec<Vec<f64>> {
    let scene = &plan.scene;
    let sweep = Sweep::new(scene, &plan.motions[t]);
    let mut all = vec![vec![0.0; scene.images]; scene.pixels()];
    for strip in &tissue.strips {
        for i in (0..strip.x.len()).filter(|&i| strip.amplitude[i] != 0.0) {
            let place = look.pose.place([strip.y[i].into(), strip.x[i].into()]);
            let from_middle = look.pose.offset(place);
            let mut turns =
                look.tilt_turns[0] * from_middle[0] + look.tilt_turns[1] * from_middle[1];
            turns += if strip.moves[i] { look.elongation_turns } else { 0.0 };
            let depth = f64::from(strip.depth[i]) + turns * scene.depth_px_per_turn();
            let phase = TAU * (f64::from(strip.phase[i]) / 2f64.powi(32) + turns);
            let phase = if look.conjugate { -phase } else { phase };
            let wave: Vec<f64> = (0..scene.images)
                .map(|m| {
                    let q = sweep.band_coordinate(m);
                    let angle = phase + sweep.common_phase(q) + PI * depth * sweep.wavenumber(q);
                    f64::from(strip.amplitude[i]) * angle.cos()
                })
                .collect();
            for (pixel, spectrum) in all.iter_mut().enumerate() {
                let here = [pixel / scene.width, pixel % scene.width];
                let strength = response(plan, here, place);
                spectrum.iter_mut().zip(&wave).for_each(|(s, w)| *s += strength * w);
            }
        }
    }
    all
}

/// Everything that can act on a spectrum, against the definition: the error is below 10⁻³ of the
/// signal.
#[test]
fn gridding_agrees_with_the_direct_sum() {
    let scene = OctScene {
        images: 128,
        height: 12,
        width: 16,
        lateral_px: 2.0,
        axial_px: 3.0,
        doppler_px: 2.0,
        chirp_rad: 1.0,
        torsion_deg: 2.0,
        start_jitter_images: 1.0,
        surface_tilt_px: [3.0, 5.0],
        micro_motion_wavelengths: [0.03, 0.05],
        dispersion_rad: [-22.0, 9.0],
        nonlinearity: 0.02,
        ..small()
    };
    for down_sweep in [false, true] {
        let plan = plan(OctScene { down_sweep, ..scene.clone() });
        let mut tissue = Tissue::start(&plan.scene, &plan.geometry).unwrap();
        (1..=7).for_each(|t| tissue.walk(t).unwrap());
        thin_out(&mut tissue, |_, i| i % 397 == 0);
        let look = still(&plan, 7);
        // Scatterers near the edge of the field reach around it or are left out: not our subject.
        let (height, width) = (plan.scene.height as f64, plan.scene.width as f64);
        let near = |[y, x]: [f64; 2]| {
            (-8.0..height + 8.0).contains(&y) && (-8.0..width + 8.0).contains(&x)
        };
        for strip in &mut tissue.strips {
            for i in 0..strip.x.len() {
                if !near(look.pose.place([strip.y[i].into(), strip.x[i].into()])) {
                    strip.amplitude[i] = 0.0;
                }
            }
        }
        let got = spectra(&plan, &tissue, 7, &look);
        let want = direct(&plan, &tissue, 7, &look);
        let (mut error, mut power) = (0.0, 0.0);
        for (got, want) in got.iter().flatten().zip(want.iter().flatten()) {
            error += (f64::from(*got) - want).powi(2);
            power += want * want;
        }
        let relative = (error / power).sqrt();
        println!("gridding error {relative:e}");
        assert!(power > 0.0 && relative < 1e-3, "relative error {relative:e}");
    }
}

/// A scatterer at depth d makes the bin d, with the phase 2k₀z; it follows a shift of the tissue.
#[test]
fn one_scatterer_is_where_it_should_be() {
    let scene = OctScene { axial_px: 3.0, lateral_px: 3.0, ..small() };
    let plan = plan(scene);
    let mut tissue = Tissue::start(&plan.scene, &plan.geometry).unwrap();
    let row = tissue.strips.len() / 2;
    let chosen = (tissue.columns / 2) * tissue.per_cell + 5;
    thin_out(&mut tissue, |r, i| (r, i) == (row, chosen));
    let strip = &tissue.strips[row];
    let [y, x, depth] = [strip.y[chosen], strip.x[chosen], strip.depth[chosen]].map(f64::from);
    for t in [0, 3] {
        let look = Appearance { tilt_turns: [0.0; 2], ..still(&plan, t) };
        let [dz, dy, dx] = plan.motions[t].shift_px;
        let spectra = spectra(&plan, &tissue, t, &look);
        let strength = |pixel: usize, d: f64| at_depth(&spectra[pixel], d).norm();
        let brightest = |count: usize, of: &dyn Fn(usize) -> f64| {
            (0..count).max_by(|&a, &b| of(a).total_cmp(&of(b))).unwrap()
        };
        let pixel = brightest(spectra.len(), &|p| strength(p, depth + dz));
        let width = plan.scene.width;
        assert!(((pixel / width) as f64 - y - dy).abs() <= 0.5 + 1e-6);
        assert!(((pixel % width) as f64 - x - dx).abs() <= 0.5 + 1e-6);
        let fine = brightest(4800, &|i| strength(pixel, i as f64 * 0.01));
        assert!((fine as f64 * 0.01 - depth - dz).abs() < 0.05, "{fine}, {}", depth + dz);
        let turns = f64::from(tissue.strips[row].phase[chosen]) / 2f64.powi(32)
            + dz * plan.scene.wavelength_nm / plan.scene.bandwidth_nm;
        let phase =
            at_depth(&spectra[pixel], depth + dz) * Complex64::from_polar(1.0, -TAU * turns);
        assert!(phase.arg().abs() < 0.03, "{}", phase.arg());
    }
}

/// Complex field of one layer without camera, one value per pixel.
fn layer_field(plan: &Plan, tissue: &Tissue, t: usize, offset: f64) -> Vec<Complex64> {
    let look = Appearance { tilt_turns: [0.0; 2], ..still(plan, t) };
    let depths = plan.geometry.surface.image(offset);
    let spectra = spectra(plan, tissue, t, &look);
    spectra.iter().zip(&depths).map(|(s, &d)| at_depth(s, f64::from(d))).collect()
}

/// Σ a b* over some pixels, over the root of the powers.
fn coherence(a: &[Complex64], b: &[Complex64], mask: &[bool]) -> Complex64 {
    let inside = || (0..mask.len()).filter(|&i| mask[i]);
    let power = |u: &[Complex64]| inside().map(|i| u[i].norm_sqr()).sum::<f64>();
    inside().map(|i| a[i] * b[i].conj()).sum::<Complex64>() / (power(a) * power(b)).sqrt()
}

/// Each layer decorrelates by its own motion, exp(−(2kσ)²/2) a step. An image of 40 × 56 pixels has
/// 400 speckles: one pair of sweeps has a standard deviation of (1 − ρ²)/√800, 0.01 and less.
#[test]
fn layers_decorrelate_as_the_random_walk_says() {
    let scene = OctScene { micro_motion_wavelengths: [0.03, 0.05], ..small() };
    let plan = plan(scene);
    let mut tissue = Tissue::start(&plan.scene, &plan.geometry).unwrap();
    let fields = |tissue: &Tissue| [0.0, 12.0].map(|z| layer_field(&plan, tissue, 0, z));
    let everywhere = vec![true; plan.scene.pixels()];
    let mut before = fields(&tissue);
    let mut sums = [0.0; 2];
    for t in 1..8 {
        tissue.walk(t).unwrap();
        let now = fields(&tissue);
        for layer in 0..2 {
            sums[layer] += coherence(&now[layer], &before[layer], &everywhere).norm() / 7.0;
        }
        before = now;
    }
    for (got, sigma) in sums.into_iter().zip([0.03, 0.05]) {
        let want = (-(4.0 * PI * sigma).powi(2) / 2.0f64).exp();
        assert!((got - want).abs() < 0.02, "sigma {sigma}: {got}, theory {want}");
    }
}

/// Without random motion the field of the tips turns by the true phase inside the x, towards plus
/// in an up-sweep, and nothing else turns.
#[test]
fn elongation_has_its_sign_and_size() {
    for down_sweep in [false, true] {
        let plan = plan(OctScene { down_sweep, lateral_px: 1.0, ..small() });
        let still = Plan { motions: vec![plan.motions[0].clone(); 8], ..plan };
        let tissue = Tissue::start(&still.scene, &still.geometry).unwrap();
        let mask = super::elongation::mask(56, 40);
        let control = super::elongation::control(&mask, 56, 40);
        let [isos, tips] = [0.0, 12.0].map(|z| [0, 6].map(|t| layer_field(&still, &tissue, t, z)));
        let sign = if down_sweep { -1.0 } else { 1.0 };
        let inside = coherence(&tips[1], &tips[0], &mask).arg();
        assert!((sign * inside - still.phase_rad[6]).abs() < 0.1, "{inside} {:?}", still.phase_rad);
        assert!(coherence(&tips[1], &tips[0], &control).arg().abs() < 0.05);
        assert!(coherence(&isos[1], &isos[0], &mask).arg().abs() < 0.02);
    }
}

/// All images of a recording.
fn record(plan: &Plan) -> Vec<Vec<u16>> {
    let mut images = Vec::new();
    let keep = |image: &[u16]| -> Result<()> {
        images.push(image.to_vec());
        Ok(())
    };
    plan.record(&Progress::hidden(), keep).unwrap();
    images
}

/// Small images, but everything that happens in the presets.
fn eventful() -> OctScene {
    OctScene {
        sweeps: 20,
        images: 96,
        height: 40,
        width: 56,
        layers: small().layers,
        doppler_peak_px: 4.0,
        drift_px: [3.0, 5.0],
        saccade_px: [5.0, 8.0],
        saturated_sweeps: 1,
        missing_sweeps: 1,
        short_sweeps: 1,
        dead_pixel_fraction: 0.005,
        ..Preset::Human.scene()
    }
}

#[test]
fn counts_do_not_depend_on_the_number_of_threads() {
    let plan = plan(OctScene { sweeps: 16, ..eventful() });
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| record(&plan))
    };
    let expected = on(1);
    assert!(on(2) == expected && on(3) == expected);
}

#[test]
fn the_seed_changes_everything() {
    let first = |seed| record(&plan(OctScene { seed, sweeps: 2, ..small() }))[0].clone();
    assert_ne!(first(1), first(2));
}

fn mean(images: &[Vec<u16>]) -> f64 {
    let count = (images.len() * images[0].len()) as f64;
    images.iter().flatten().map(|&c| f64::from(c)).sum::<f64>() / count
}

/// Sweeps with faults are what they are called, and all others are well exposed.
#[test]
fn faulty_sweeps_are_what_they_claim() {
    let plan = plan(eventful());
    let images = record(&plan);
    let scene = &plan.scene;
    let dead = super::camera::Camera::new(scene).unwrap().dead_mask();
    let mut first = 0;
    for event in &plan.events {
        let sweep = &images[first..first + event.images(scene)];
        first += event.images(scene);
        let mean = mean(sweep);
        let alive = |image: &[u16]| -> Vec<u16> {
            image.iter().zip(&dead).filter(|(_, dead)| !**dead).map(|(&c, _)| c).collect()
        };
        let highest = sweep.iter().flat_map(|image| alive(image)).max().unwrap();
        match event {
            Event::Missing => assert!((mean - scene.offset_dn).abs() < 15.0 && highest < 60),
            Event::Saturated => {
                let clipped = sweep.iter().flatten().filter(|&&c| c == FULL_SCALE).count();
                assert!(clipped as f64 > 0.8 * (sweep.len() * scene.pixels()) as f64);
            }
            Event::Short => assert_eq!(sweep.len(), 37),
            _ => assert!((mean - 1900.0).abs() < 60.0 && highest < FULL_SCALE, "{event:?} {mean}"),
        }
    }
    assert_eq!(first, images.len());
    assert_eq!(plan.images(), images.len());
    let wanted = (0.005 * scene.pixels() as f64).round() as usize;
    assert_eq!(dead.iter().filter(|&&d| d).count(), wanted);
    for pixel in (0..dead.len()).filter(|&p| dead[p]) {
        assert!(images.iter().all(|image| image[pixel] == images[0][pixel]));
    }
}

/// The fringes of the retina are gone in a blink and there otherwise: power at the IS/OS, without
/// the fixed fringes.
#[test]
fn a_blink_hides_the_retina() {
    let scene = OctScene { fixed_fringes: 0, saccades: 0, isos_fringe_dn: 40.0, ..eventful() };
    let plan = plan(OctScene { saturated_sweeps: 0, short_sweeps: 0, missing_sweeps: 0, ..scene });
    let images = record(&plan);
    let k = plan.scene.images;
    let power = |t: usize| {
        let depth = plan.geometry.surface.centre_px + plan.motions[t].shift_px[0];
        let depth = depth + plan.motions[t].doppler_px;
        let sweep = &images[t * k..(t + 1) * k];
        let hann = |m: usize| 1.0 - (TAU * (m as f64 + 0.5) / k as f64).cos();
        let near = [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0].map(|d| depth + d);
        let pixels = (0..plan.scene.pixels()).step_by(7);
        let spectra = pixels.map(|p| {
            let counts = sweep.iter().enumerate();
            counts.map(|(m, image)| (f64::from(image[p]) * hann(m)) as f32).collect::<Vec<_>>()
        });
        spectra.map(|s| near.map(|d| at_depth(&s, d).norm_sqr()).iter().sum::<f64>()).sum::<f64>()
    };
    let blink = plan.events.iter().position(|&e| e == Event::Blink).unwrap();
    assert!(power(0) > 4.0 * power(blink), "{} {}", power(0), power(blink));
}

#[test]
fn a_still_path_is_one_piece() {
    let plan = plan(small());
    let motion: &Motion = &plan.motions[3];
    assert_eq!(motion.path, [Piece { images: 0..96, shift_px: [0.0; 2] }]);
}
