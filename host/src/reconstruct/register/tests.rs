//! Registration of a small synthetic retina whose motion is known.

use super::eye::{Eye, Scene};
use super::*;
use rustfft::num_complex::Complex32;

const SIZE: [usize; 3] = [32, 64, 80];

fn eye(seed: u64) -> Eye {
    Eye {
        size: SIZE,
        margin: 24,
        rho: 0.85,
        snr: 5.0,
        tilt: [3.0, 2.0],
        sag: 2.0,
        vignetting: 0.2,
        fixed: 0.05,
        aperture: 0.24,
        seed,
    }
}

fn registration() -> Registration {
    let [depth, height, width] = SIZE;
    Registration::new(depth, height, width)
}

fn motion(z: f64, y: f64, x: f64, rotation_rad: f64) -> Motion {
    Motion { shift: [z, y, x], rotation_rad }
}

/// Largest difference of the shifts, px.
fn off(found: Motion, truth: Motion) -> f64 {
    (0..3).map(|i| (found.shift[i] - truth.shift[i]).abs()).fold(0.0, f64::max)
}

/// Sweeps compared one after the other, each of the field that `field` gives.
fn matches(
    seed: u64,
    motions: &[Motion],
    field: impl Fn(&Scene, usize) -> Vec<Complex32>,
) -> Matches {
    let mut scene = Scene::new(eye(seed));
    let mut sequence = Sequence::new(registration());
    let mut matches = Matches::default();
    for sweep in 0..motions.len() {
        if sweep > 0 {
            scene.advance();
        }
        let amplitude = scene.detect(field(&scene, sweep));
        sequence.push(&amplitude, &mut matches);
    }
    matches
}

#[test]
fn a_pair_far_apart_is_found_without_a_guess() {
    let registration = registration();
    let mut scene = Scene::new(eye(1));
    let earlier = registration.feature(&scene.amplitude(Motion::default()));
    scene.advance();
    let truth = motion(-2.3, 17.4, -12.8, 0.005);
    let later = registration.feature(&scene.amplitude(truth));
    let pair = registration.pair(&earlier, &later, None);
    assert!(pair.quality > 2.0 * MATCHED, "{}", pair.quality);
    assert!(off(pair.motion, truth) < 0.1, "{:?}", pair.motion);
    assert!((pair.motion.rotation_rad - 0.005).abs() < 0.002, "{:?}", pair.motion);
}

#[test]
fn saccades_and_blinks_are_left_out_and_the_rest_lines_up() {
    let mut truth: Vec<Motion> = (0..9)
        .map(f64::from)
        .map(|t| {
            motion(1.7 * (1.3 * t).sin(), 0.4 * t, 1.1 * (2.1 * t).sin(), 0.003 * (0.9 * t).sin())
        })
        .collect();
    truth[4..].iter_mut().for_each(|m| m.shift[1] -= 15.0);
    let (smeared, closed) = (3, 6);
    let matches = matches(2, &truth, |scene, sweep| {
        if sweep == closed {
            vec![Complex32::ZERO; SIZE.iter().product()]
        } else if sweep == smeared {
            smear(scene, truth[sweep - 1], truth[sweep + 1])
        } else {
            scene.field(truth[sweep])
        }
    });
    let members: Vec<usize> = matches.members.iter().map(|member| member.0).collect();
    let expected: Vec<usize> =
        (0..truth.len()).filter(|s| ![smeared, closed].contains(s)).collect();
    assert_eq!(members, expected);
    let found = solve(truth.len(), &matches.pairs);
    for (sweep, found) in found.iter().enumerate() {
        assert_eq!(found.is_some(), expected.contains(&sweep));
        if let Some(found) = found {
            let relative = truth[0].to(truth[sweep]);
            assert!(off(*found, relative) < 0.1, "sweep {sweep}: {found:?}, not {relative:?}");
        }
    }
}

/// The field of an eye that moves from one place to another during the sweep.
fn smear(scene: &Scene, from: Motion, to: Motion) -> Vec<Complex32> {
    const STEPS: usize = 10;
    let mut sum = vec![Complex32::ZERO; SIZE.iter().product()];
    for step in 0..STEPS {
        let t = step as f64 / (STEPS - 1) as f64;
        let shift = std::array::from_fn(|i| from.shift[i] * (1.0 - t) + to.shift[i] * t);
        let phase = Complex32::from_polar(1.0 / (STEPS as f32).sqrt(), 2.4 * step as f32);
        let field = scene.field(Motion { shift, rotation_rad: 0.0 });
        sum.iter_mut().zip(field).for_each(|(s, f)| *s += f * phase);
    }
    sum
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let scene = Scene::new(eye(3));
    let amplitudes = [Motion::default(), motion(0.4, 2.6, -1.2, 0.0)].map(|m| scene.amplitude(m));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let registration = registration();
            let [earlier, later] = [0, 1].map(|i| registration.feature(&amplitudes[i]));
            registration.pair(&earlier, &later, None)
        })
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one.motion, three.motion);
    assert_eq!(one.quality.to_bits(), three.quality.to_bits());
}

#[test]
fn a_feature_of_the_largest_volume_is_small() {
    assert!(Registration::new(512, 368, 640).bytes_per_feature() < 25_000_000);
}

#[test]
fn an_empty_volume_matches_nothing() {
    let registration = registration();
    let dark = registration.feature(&vec![0.0; SIZE.iter().product()]);
    let pair = registration.pair(&dark, &dark, None);
    assert!(pair.quality < MATCHED && pair.motion.shift.iter().all(|s| s.is_finite()), "{pair:?}");
}
