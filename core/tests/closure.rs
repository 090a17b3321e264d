//! Closure of linked phases: calibrated on speckle for which the model holds, small where it does not.

mod series;

use num_complex::{Complex, Complex64};
use phasewalk_core::closure::Closure;
use series::link;

const N: usize = 40;

/// Scatterers that share a motion: of coherence rho^|i - j|, with the phase `velocity` per frame.
#[derive(Clone, Copy)]
struct Population {
    share: f64,
    rho: f64,
    velocity: f64,
}

/// What moves with the phase that is measured.
const VELOCITY: f64 = 0.05;

/// Random walk of lambda/32 and of lambda/16 per frame (coherence of one frame to the next).
const SLOW: f64 = 0.9258;
const FAST: f64 = 0.7346;

const fn moving(share: f64, rho: f64) -> Population {
    Population { share, rho, velocity: VELOCITY }
}

/// A static reflection.
const fn resting(share: f64) -> Population {
    Population { share, rho: 1.0, velocity: 0.0 }
}

/// Normal random numbers (Box & Muller) from splitmix64.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Circular, of variance 1.
    fn normal(&mut self) -> Complex64 {
        let radius = (-(1.0 - self.uniform()).ln()).sqrt();
        Complex::from_polar(radius, std::f64::consts::TAU * self.uniform())
    }
}

/// ⟨U_i conj U_j⟩ over so many looks; frames of `outliers` are speckle of their own.
fn cross(
    populations: &[Population],
    outliers: &[usize],
    looks: usize,
    random: &mut Random,
) -> Vec<Complex64> {
    let mut cross = vec![Complex64::default(); N * N];
    for _ in 0..looks {
        let mut fields = [Complex64::default(); N];
        for population in populations {
            let Population { share, rho, velocity } = *population;
            let mut speckle = random.normal();
            for (i, field) in fields.iter_mut().enumerate() {
                *field += Complex::from_polar(share.sqrt(), velocity * i as f64) * speckle;
                speckle = speckle * rho + random.normal() * (1.0 - rho * rho).sqrt();
            }
        }
        for &frame in outliers {
            fields[frame] = random.normal();
        }
        for i in 0..N {
            for j in 0..=i {
                cross[i * N + j] += fields[i] * fields[j].conj();
            }
        }
    }
    for i in 0..N {
        for j in 0..i {
            cross[j * N + i] = cross[i * N + j].conj();
        }
    }
    cross
}

fn closures(
    populations: &[Population],
    outliers: &[usize],
    looks: usize,
    count: u64,
) -> Vec<Closure> {
    let times: Vec<f64> = (0..N).map(|i| i as f64).collect();
    let one = |seed: u64| {
        let cross = cross(populations, outliers, looks, &mut Random(seed << 32));
        link::<f64>(&cross, &times, looks as f64).1.closure
    };
    (0..count).map(one).collect()
}

fn share_below(closures: &[Closure], p: f64) -> f64 {
    closures.iter().filter(|closure| closure.p < p).count() as f64 / closures.len() as f64
}

fn mean_misfit(closures: &[Closure]) -> f64 {
    closures.iter().map(|closure| closure.misfit).sum::<f64>() / closures.len() as f64
}

/// Walks, noise as strong as the speckle and six decibels stronger, outliers, a static part that shares the phase;
/// few looks and many.
#[test]
fn p_is_uniform_and_the_misfit_one_where_the_model_holds() {
    const COUNT: u64 = 150;
    let still = Population { share: 0.2, rho: 1.0, velocity: VELOCITY };
    let cases: [(&str, Vec<Population>, &[usize]); 6] = [
        ("slow", vec![moving(1.0, SLOW)], &[]),
        ("fast", vec![moving(1.0, FAST)], &[]),
        ("0 dB", vec![moving(0.5, SLOW), moving(0.5, 0.0)], &[]),
        ("-6 dB", vec![moving(0.2, SLOW), moving(0.8, 0.0)], &[]),
        ("outliers", vec![moving(1.0, SLOW)], &[11, 25, 26]),
        ("floor", vec![moving(0.8, SLOW), still], &[]),
    ];
    let mut all = Vec::new();
    for looks in [23, 200] {
        // With few looks most of the series at -6 dB are not coherent at all.
        let cases = cases.iter().filter(|(name, ..)| looks > 100 || *name != "-6 dB");
        for (name, populations, outliers) in cases {
            let closures = closures(populations, outliers, looks, COUNT);
            let (misfit, tenth) = (mean_misfit(&closures), share_below(&closures, 0.1));
            println!("{looks} looks, {name}: misfit {misfit:.3}, p < 0.1 in {tenth:.3}");
            // A single one scatters by sqrt(2 / 741) = 0.05; second order in 1/L is what else there is.
            assert!((misfit - 1.0).abs() < 0.03, "{name}: {misfit}");
            // Four standard deviations of a share of 0.1 of 150.
            assert!((tenth - 0.1).abs() < 0.1, "{name}: {tenth}");
            all.extend(closures);
        }
    }
    let (half, tenth, rare) =
        (share_below(&all, 0.5), share_below(&all, 0.1), share_below(&all, 1e-3));
    println!("all: p < 0.5 in {half:.3}, < 0.1 in {tenth:.3}, < 0.001 in {rare:.4}");
    // Four standard deviations for 1650 draws are 0.049 and 0.030; 0.001 is exceeded four times at the most.
    assert!((half - 0.5).abs() < 0.05 && (tenth - 0.1).abs() < 0.03 && rare < 0.003);
}

/// A static reflection under a moving phase; scatterers that drift faster.
#[test]
fn populations_that_move_differently_are_found() {
    let other = Population { share: 0.3, rho: 0.7, velocity: VELOCITY + 0.1 };
    let cases = [
        ("reflection", vec![moving(0.8, SLOW), resting(0.2)]),
        ("two velocities", vec![moving(0.7, SLOW), other]),
    ];
    for (name, populations) in cases {
        let closures = closures(&populations, &[], 1000, 20);
        let found = share_below(&closures, 1e-3);
        println!("{name}: misfit {:.3}, p < 0.001 in {found:.2}", mean_misfit(&closures));
        assert!(found > 0.9, "{name}: {found}");
    }
}

/// Twice as many looks as there are: the misfit says so, p does not care.
#[test]
fn p_does_not_depend_on_the_looks() {
    let times: Vec<f64> = (0..N).map(|i| i as f64).collect();
    let mut compared = 0;
    for seed in 0..10 {
        let cross = cross(&[moving(1.0, SLOW)], &[], 200, &mut Random(seed << 32));
        let of = |looks: f64| link::<f64>(&cross, &times, looks).1.closure;
        let (right, wrong) = (of(200.0), of(400.0));
        // The qualities of frames, and with them Gamma, depend on the looks a little.
        assert!((wrong.misfit / right.misfit - 2.0).abs() < 0.1, "{right:?} {wrong:?}");
        assert!((wrong.p - right.p).abs() < 0.1, "{right:?} {wrong:?}");
        compared += 1;
    }
    assert_eq!(compared, 10);
}

/// Two halves of the same decay with a phase that differs by up to 2 rad: their mean has no closure, only less
/// coherence. What cannot be seen is not reported either.
#[test]
fn equal_halves_cannot_be_seen() {
    let half =
        |sign: f64| Population { share: 0.5, rho: SLOW, velocity: VELOCITY + sign / N as f64 };
    let closures = closures(&[half(1.0), half(-1.0)], &[], 1000, 40);
    let found = share_below(&closures, 0.01);
    println!("p < 0.01 in {found:.3}");
    assert!(found < 0.1, "{found}");
}

/// Three frames leave nothing to scale by, two have no closure at all; darkness none either.
#[test]
fn too_few_frames_have_no_p() {
    let populations = [moving(1.0, SLOW)];
    let cross = cross(&populations, &[], 50, &mut Random(1));
    let first = |n: usize| {
        let pairs = (0..n).flat_map(|i| (0..n).map(move |j| i * N + j));
        let cross: Vec<Complex64> = pairs.map(|place| cross[place]).collect();
        let times: Vec<f64> = (0..n).map(|i| i as f64).collect();
        link::<f64>(&cross, &times, 50.0).1.closure
    };
    assert!(first(2).misfit.is_nan() && first(2).p.is_nan());
    assert!(first(3).misfit > 0.0 && first(3).p.is_nan(), "{:?}", first(3));
    assert!((0.0..=1.0).contains(&first(4).p), "{:?}", first(4));
    let times: Vec<f64> = (0..N).map(|i| i as f64).collect();
    let dark = link::<f64>(&vec![Complex64::default(); N * N], &times, 50.0).1.closure;
    assert!(dark.misfit.is_nan() && dark.p.is_nan());
}

/// Coherences without noise, and a closure of a few mrad that rounding or a filter may leave: not taken for motion.
#[test]
fn no_noise_is_no_misfit() {
    let times: Vec<f64> = (0..N).map(|i| i as f64).collect();
    let element = |place: usize| {
        let (i, j) = ((place / N) as f64, (place % N) as f64);
        let coherence = SLOW.powf((i - j).abs());
        let psi = |i: f64| 2e-3 * i / N as f64;
        let phase = VELOCITY * (i - j) + (psi(i) - psi(j)) * coherence.ln();
        Complex::from_polar(coherence, phase)
    };
    let cross: Vec<Complex64> = (0..N * N).map(element).collect();
    let closure = link::<f64>(&cross, &times, 1000.0).1.closure;
    assert!(closure.misfit < 1e-3 && closure.p > 0.5, "{closure:?}");
}
