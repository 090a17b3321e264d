//! Recordings with every fault, whose starts are known.

use super::*;
use std::f64::consts::PI;

/// What happens to one sweep of the made recording.
#[derive(Clone, Copy)]
enum Fault {
    Short(usize),
    Dark,
    Bright,
}

/// A made recording.
struct Scene {
    period: usize,
    sweeps: usize,
    faults: Vec<(usize, Fault)>,
    /// 1: the spectrum falls to nothing at the ends; 0: flat.
    hump: f64,
    /// rms of the shot noise and of the sample's fringes in the groups, DN.
    noise: f64,
    /// Largest delay of the camera in images.
    jitter: f64,
    /// Slow change of the power from sweep to sweep.
    drift: f64,
    /// Amplitude of fixed fringes from the largest depths, nearly half a turn per image, DN.
    deep: f64,
    bits: u32,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            period: 128,
            sweeps: 24,
            faults: Vec::new(),
            hump: 0.8,
            noise: 3.0,
            jitter: 0.0,
            drift: 0.03,
            deep: 0.0,
            bits: 12,
        }
    }
}

const CHANNELS: usize = 12;

/// A uniform number in 0 .. 1 for a counter (SplitMix64).
fn uniform(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

fn normal(state: &mut u64) -> f64 {
    let radius = (-2.0 * (1.0 - uniform(state)).ln()).sqrt();
    radius * (2.0 * PI * uniform(state)).cos()
}

impl Scene {
    /// Mean of `channel` at image `m` (fractional) of a sweep, DN.
    fn level(&self, channel: usize, m: f64) -> f64 {
        let q = m / self.period as f64 - 0.5;
        let source = 1.0 - self.hump + self.hump * (PI * q).cos().powi(2);
        let phase = channel as f64;
        let fringe = 12.0 * (2.0 * PI * 3.3 * q + phase).cos()
            + 8.0 * (2.0 * PI * 8.7 * q + 2.0 * phase).cos()
            + self.deep * (PI * 0.47 * m + 1.3 * phase).cos()
            + self.deep * (PI * 0.82 * m + 0.7 * phase).cos();
        let vignette = 1.0 - 0.5 * (phase / CHANNELS as f64 - 0.5).abs();
        vignette * source * 1900.0 + source.sqrt() * fringe
    }

    /// The trace, and start and length of every sweep.
    fn make(&self, seed: u64) -> (Trace, Vec<(usize, usize)>) {
        let mut state = seed;
        let mut trace = Trace::new(CHANNELS, self.bits).unwrap();
        let full = f64::from(trace.full_scale());
        let mut spans = Vec::new();
        for sweep in 0..self.sweeps {
            let fault = self.faults.iter().find(|(at, _)| *at == sweep).map(|(_, fault)| *fault);
            let images = if let Some(Fault::Short(images)) = fault { images } else { self.period };
            spans.push((trace.images(), images));
            let power = 1.0 + self.drift * (sweep as f64 / 7.0).sin();
            let delay = self.jitter * uniform(&mut state);
            let tone: Vec<[f64; 2]> = (0..CHANNELS)
                .map(|_| [10.0 + 30.0 * uniform(&mut state), uniform(&mut state)])
                .collect();
            for m in 0..images {
                let pixels: Vec<u16> = (0..CHANNELS)
                    .flat_map(|channel| {
                        let sample = (PI * tone[channel][0] * m as f64 / self.period as f64
                            + 2.0 * PI * tone[channel][1])
                            .cos();
                        let mut mean = power * self.level(channel, m as f64 + delay)
                            + self.noise * 0.7 * (normal(&mut state) + 1.4 * sample);
                        match fault {
                            Some(Fault::Dark) => mean = 20.0 + normal(&mut state),
                            Some(Fault::Bright) => mean *= 4.0,
                            _ => {}
                        }
                        // Two pixels that keep the fraction of a count.
                        let half = mean.clamp(0.0, full);
                        [half.floor() as u16, (2.0 * half - half.floor()).round() as u16]
                    })
                    .map(|pixel| pixel.min(trace.full_scale()))
                    .collect();
                trace.push(&pixels);
            }
        }
        (trace, spans)
    }

    /// Checks that all starts and lengths are found, for some seeds.
    #[track_caller]
    fn is_found(&self, what: &str) {
        self.is_found_with(what, 1..=2);
    }

    #[track_caller]
    fn is_found_with(&self, what: &str, seeds: std::ops::RangeInclusive<u64>) {
        for seed in seeds {
            let (trace, spans) = self.make(seed);
            let sweeps =
                find(&trace, self.period).unwrap_or_else(|error| panic!("{what}: {error}"));
            let found: Vec<(usize, usize)> =
                sweeps.iter().map(|sweep| (sweep.first_image, sweep.images)).collect();
            assert_eq!(found, spans, "{what}, seed {seed}");
            for (at, sweep) in sweeps.iter().enumerate() {
                let fault =
                    self.faults.iter().find(|(place, _)| *place == at).map(|(_, fault)| fault);
                let right = match fault {
                    None => sweep.verdict == Verdict::Ok,
                    Some(Fault::Short(images)) => {
                        sweep.verdict == Verdict::Short { images: *images, of: self.period }
                    }
                    Some(Fault::Dark) => sweep.verdict == Verdict::Dark,
                    Some(Fault::Bright) => matches!(sweep.verdict, Verdict::Saturated { .. }),
                };
                assert!(right, "{what}, seed {seed}, sweep {at}: {}", sweep.verdict);
            }
        }
    }
}

use Fault::{Bright, Dark, Short};

fn cases() -> Vec<(&'static str, Vec<(usize, Fault)>)> {
    vec![
        ("nothing wrong", vec![]),
        ("37 of 128", vec![(9, Short(37))]),
        ("one image lost", vec![(9, Short(127))]),
        ("five images lost", vec![(14, Short(123))]),
        ("short first", vec![(0, Short(37))]),
        ("nearly nothing first", vec![(0, Short(4))]),
        ("one lost first", vec![(0, Short(127))]),
        ("half first, short second", vec![(0, Short(70)), (1, Short(60))]),
        ("two in sequence", vec![(9, Short(37)), (10, Short(100))]),
        ("end cut off", vec![(23, Short(50))]),
        ("end cut by one", vec![(23, Short(127))]),
        ("dark", vec![(5, Dark)]),
        ("dark first", vec![(0, Dark)]),
        ("bright", vec![(5, Bright)]),
        ("bright first, short second", vec![(0, Bright), (1, Short(77))]),
        ("dark, short", vec![(5, Dark), (6, Short(90))]),
        ("short, dark", vec![(5, Short(90)), (6, Dark)]),
        ("bright, short", vec![(5, Bright), (6, Short(90))]),
        ("short, bright", vec![(5, Short(90)), (6, Bright)]),
        (
            "all of them",
            vec![(2, Bright), (7, Dark), (12, Short(37)), (17, Short(125)), (23, Short(9))],
        ),
        ("dark, bright, short", vec![(10, Dark), (11, Bright), (12, Short(64))]),
        ("last dark", vec![(23, Dark)]),
    ]
}

#[test]
fn humped_spectrum() {
    for (what, faults) in cases() {
        Scene { faults, ..Scene::default() }.is_found(what);
    }
}

#[test]
fn spectrum_that_falls_to_nothing() {
    for (what, faults) in cases() {
        Scene { faults, hump: 1.0, ..Scene::default() }.is_found(what);
    }
}

#[test]
fn flat_spectrum_with_fixed_fringes() {
    for (what, faults) in cases() {
        Scene { faults, hump: 0.0, ..Scene::default() }.is_found(what);
    }
}

#[test]
fn noisy_groups() {
    for (what, faults) in cases() {
        Scene { faults, noise: 12.0, ..Scene::default() }.is_found(what);
    }
}

#[test]
fn camera_that_starts_up_to_one_image_late() {
    for (what, faults) in cases() {
        Scene { faults, jitter: 0.9, ..Scene::default() }.is_found(what);
    }
}

#[test]
fn faults_anywhere() {
    for seed in 1..=24 {
        let mut state = seed;
        let mut choose = |count: usize| (uniform(&mut state) * count as f64) as usize;
        let period = 64;
        let mut faults: Vec<(usize, Fault)> = Vec::new();
        for _ in 0..1 + choose(5) {
            let fault = match choose(4) {
                0 => Dark,
                1 => Bright,
                _ => Short(5 + choose(period - 5)),
            };
            faults.push((choose(40), fault));
        }
        let hump = [0.0, 0.5, 1.0][choose(3)];
        let scene = Scene { period, sweeps: 40, faults, hump, ..Scene::default() };
        scene.is_found_with("anywhere", seed..=seed);
    }
}

/// As in the simulated recordings.
fn like_a_retina() -> Scene {
    Scene { period: 256, hump: 0.4, noise: 6.5, drift: 0.01, deep: 16.0, ..Scene::default() }
}

/// No third of the sweeps in sequence is without a bad one.
#[test]
fn bad_sweeps_that_leave_no_long_quiet_run() {
    for short in [1, 37, 255] {
        let faults = vec![(6, Dark), (11, Short(short)), (18, Bright)];
        Scene { faults, ..like_a_retina() }.is_found("dark, short, bright");
    }
    let faults =
        vec![(3, Bright), (7, Dark), (8, Dark), (12, Short(37)), (16, Short(200)), (20, Bright)];
    Scene { faults, ..like_a_retina() }.is_found("six of 24");
}

#[test]
fn bad_sweeps_anywhere() {
    let mut state = 11;
    for _ in 0..30 {
        let mut free: Vec<usize> = (0..23).collect();
        let mut place = || free.swap_remove((uniform(&mut state) * free.len() as f64) as usize);
        let places = [place(), place(), place()];
        let faults = vec![(places[0], Dark), (places[1], Short(37)), (places[2], Bright)];
        let what = format!("dark, short, bright at {places:?}");
        Scene { period: 96, faults, ..like_a_retina() }.is_found(&what);
    }
}

#[test]
fn late_starts_do_not_cut_sweeps() {
    for sweeps in [12, 24, 40] {
        for faults in [vec![], vec![(7, Short(37))], vec![(4, Dark), (8, Short(20)), (10, Bright)]]
        {
            let late = Scene { sweeps, faults, period: 128, jitter: 1.0, ..like_a_retina() };
            late.is_found("late starts");
        }
    }
}

#[test]
fn few_and_many_sweeps() {
    for sweeps in [2, 3, 5, 40] {
        Scene { sweeps, ..Scene::default() }.is_found("few");
    }
    for sweeps in [4, 6, 70] {
        let faults = vec![(1, Short(37))];
        Scene { sweeps, faults, ..Scene::default() }.is_found("few, one short");
    }
}

#[test]
fn wrong_number_of_images_is_named_with_the_right_one() {
    for hump in [0.0, 0.8] {
        let (trace, _) = Scene { hump, ..Scene::default() }.make(3);
        for wrong in [64, 100, 127, 129, 150, 256, 384, 125] {
            let error = find(&trace, wrong).unwrap_err().to_string();
            assert!(error.contains("repeat every 128,"), "{hump} {wrong}: {error}");
        }
    }
}
