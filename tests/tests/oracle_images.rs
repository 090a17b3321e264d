//! Phase images, of the library and of the program, against the dense oracle in every pixel.

use phasewalk::io::Shape;
use phasewalk::lanes::Path;
use phasewalk::method::{Depths, Method, Plan};
use phasewalk_core::weights::Weighting;
use phasewalk_tests::library::{Images, Settings, phase_images};
use phasewalk_tests::npy;
use phasewalk_tests::oracle::{self, Pairs, PhaseImages};
use phasewalk_tests::program::Bench;
use phasewalk_tests::recording::Recording;
use phasewalk_tests::tolerance::{
    EXACT_TIE_RAD, ORACLE_RAD, SIGMA_IMAGE_RELATIVE, THRESHOLD_TIE, TIE_RAD, TIE_SHARE,
};

const FRAMES: usize = 20;

fn plane(height: usize, width: usize) -> Shape {
    Shape { frames: FRAMES, depth: 1, height, width }
}

/// A recording with what the oracle makes of its ensemble averages.
struct Case {
    name: &'static str,
    recording: Recording,
    depths: Depths,
    sigma_px: f64,
    pairs: Vec<Pairs>,
}

impl Case {
    fn new(name: &'static str, recording: Recording, sigma_px: f64) -> Self {
        let pairs = oracle::gaussian_mean(&recording.layer(0), sigma_px);
        Self { name, recording, depths: Depths::single(), sigma_px, pairs }
    }

    /// Speckle that loses itself, under a phase of several turns.
    fn moving() -> Self {
        Self::new("moving", Recording::moving(plane(37, 29), 0.95, 1), 3.0)
    }

    /// Odd and flat, quickly lost.
    fn quick() -> Self {
        Self::new("quick", Recording::moving(plane(8, 16), 0.85, 2), 1.5)
    }

    /// Nothing but chance: phases far beyond wrapping.
    fn random() -> Self {
        Self::new("random", Recording::random(plane(16, 8), 3), 1.5)
    }

    /// Depths 0 and 1 against 3.
    fn layers() -> Self {
        let shape = Shape { depth: 4, ..plane(11, 13) };
        let recording = Recording::moving(shape, 0.96, 4);
        let layers = recording.layers();
        let pairs = oracle::gaussian_mean_of(FRAMES, 11, 13, 1.5, |t, lag| {
            oracle::layer_difference(&layers, &[0, 1], &[3], t, lag)
        });
        Self {
            name: "layers",
            recording,
            depths: "0..1,3..3".parse().unwrap(),
            sigma_px: 1.5,
            pairs,
        }
    }

    fn all() -> Vec<Self> {
        vec![Self::moving(), Self::quick(), Self::random(), Self::layers()]
    }

    fn plan(&self, method: Method, lags: usize) -> Plan {
        Plan::new(method, FRAMES, Some(lags), None, self.depths.clone()).unwrap()
    }

    /// Looks of the weights: the paper's, and so many that pairs of pure chance count as well.
    fn looks(&self) -> [f64; 2] {
        [oracle::gaussian_looks(self.sigma_px), 1e4]
    }
}

/// How images differ from the oracle's.
#[derive(Clone, Debug, Default)]
struct Tally {
    /// Pixels times frames.
    compared: usize,
    /// Of those, beyond the tolerance.
    beyond: usize,
    /// Of those, in pixels without a near-tie: there must be none.
    unexcused: usize,
    /// The largest of them, in words.
    worst: Option<(f64, String)>,
    /// Pixels that were left out for an exact tie.
    tied: usize,
}

impl Tally {
    fn add(&mut self, other: Tally) {
        self.compared += other.compared;
        self.beyond += other.beyond;
        self.tied += other.tied;
        self.unexcused += other.unexcused;
        if let Some((size, text)) = other.worst {
            self.note(size, || text);
        }
    }

    fn note(&mut self, size: f64, text: impl FnOnce() -> String) {
        if self.worst.as_ref().is_none_or(|(worst, _)| size > *worst) {
            self.worst = Some((size, text()));
        }
    }

    /// Every number within the promise, but for the pixels whose `tie(pixel)` is below `least`.
    fn of(
        what: &str,
        got: &[f32],
        expected: &[f64],
        double: bool,
        tie: impl Fn(usize) -> f64,
    ) -> Self {
        assert_eq!(got.len(), expected.len(), "{what}");
        let pixels = got.len() / FRAMES;
        let mut tally = Self::default();
        for pixel in 0..pixels {
            let exact = tie(pixel) < EXACT_TIE_RAD;
            tally.tied += usize::from(exact);
            if double && exact {
                continue;
            }
            for t in 0..FRAMES {
                let (got, expected) = (got[t * pixels + pixel], expected[t * pixels + pixel]);
                let error = (f64::from(got) - expected).abs();
                tally.compared += 1;
                // Written so that NaN is beyond.
                if error <= ORACLE_RAD {
                    continue;
                }
                tally.beyond += 1;
                if double || tie(pixel) >= TIE_RAD {
                    tally.unexcused += 1;
                    tally.note(error, || {
                        format!("{what}: pixel {pixel}, frame {t}: {got} instead of {expected}")
                    });
                }
            }
        }
        tally
    }

    fn of_images(
        what: &str,
        got: &Images,
        expected: &PhaseImages,
        fisher: bool,
        double: bool,
    ) -> Self {
        let tie = |pixel: usize| {
            // The Fisher weight jumps at its threshold: a tie of its own, on the scale of TIE_RAD.
            let at_threshold = expected.threshold_distance[pixel] * (TIE_RAD / THRESHOLD_TIE);
            let margin = expected.margin[pixel];
            if fisher { margin.min(at_threshold) } else { margin }
        };
        Self::of(what, &got.phases, &expected.phase, double, tie)
    }

    fn is_within_the_promise(&self) {
        assert_eq!(self.unexcused, 0, "no near-tie explains these: {self:?}");
        assert_eq!(self.tied, 0, "these inputs have no exact tie: {self:?}");
        assert!(self.beyond as f64 <= self.compared as f64 * TIE_SHARE, "{self:?}");
    }
}

/// All lags and weightings of all cases, with `settings` changed from the nominal ones.
fn compare_least_squares(change: impl Fn(Settings) -> Settings) {
    let mut tally = Tally::default();
    for case in Case::all() {
        for (weighting, of_oracle) in [
            (Weighting::Paper, oracle::Weighting::Paper),
            (Weighting::Fisher, oracle::Weighting::Fisher),
        ] {
            for (lags, looks) in
                [1, 5, FRAMES - 1].into_iter().flat_map(|l| case.looks().map(|looks| (l, looks)))
            {
                let what = format!("{}, {weighting:?}, lags {lags}, looks {looks}", case.name);
                let expected = oracle::images_from_pairs(&case.pairs, lags, of_oracle, looks);
                let settings = change(Settings { looks, ..Settings::new(case.sigma_px) });
                let plan = case.plan(Method::Paper(weighting), lags);
                let got = phase_images(&case.recording, &plan, &settings);
                let fisher = weighting == Weighting::Fisher;
                tally.add(Tally::of_images(&what, &got, &expected, fisher, settings.double));
            }
        }
    }
    tally.is_within_the_promise();
}

#[test]
fn double_precision_is_the_oracle_in_every_pixel() {
    compare_least_squares(Settings::in_double);
}

#[test]
fn portable_lanes_are_the_oracle_but_for_near_ties() {
    compare_least_squares(|settings| settings);
}

#[test]
fn vector_lanes_are_the_oracle_but_for_near_ties() {
    for path in Path::available() {
        compare_least_squares(|settings| Settings { path, ..settings });
    }
}

/// Distance of the wrapped phases of a pixel from the cut at pi: there the baselines have their ties.
fn distance_from_the_cut(pairs: &Pairs, used: impl Fn(usize, usize) -> bool) -> f64 {
    let all = oracle::pair_list(pairs.frames, pairs.max_lag);
    let phases = all.iter().zip(&pairs.phase).filter(|((t, lag), _)| used(*t, *lag));
    phases.map(|(_, phase)| std::f64::consts::PI - phase.abs()).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_baselines_are_the_oracles() {
    let mut tally = Tally::default();
    for case in [Case::moving(), Case::quick(), Case::random()] {
        let series = case.recording.layer(0);
        let direct = oracle::direct_images(&series, case.sigma_px, 4);
        let walked = oracle::one_step_images(&series, case.sigma_px);
        for double in [true, false] {
            for path in Path::available() {
                let settings = Settings { double, path, ..Settings::new(case.sigma_px) };
                let images = |method| {
                    let plan = Plan::new(method, FRAMES, None, None, Depths::single()).unwrap();
                    phase_images(&case.recording, &plan, &settings).phases
                };
                let what = format!("{}, {settings:?}", case.name);
                let cut = |pixel: usize| {
                    distance_from_the_cut(&case.pairs[pixel], |t, lag| t == 4 || t + lag == 4)
                };
                tally.add(Tally::of(&what, &images(Method::Direct), &direct, double, cut));
                let cut =
                    |pixel: usize| distance_from_the_cut(&case.pairs[pixel], |_, lag| lag == 1);
                tally.add(Tally::of(&what, &images(Method::OneStep), &walked, double, cut));
            }
        }
    }
    tally.is_within_the_promise();
}

#[test]
fn standard_deviations_are_the_oracles() {
    let case = Case::quick();
    let lags = 5;
    let plan = case.plan(Method::Paper(Weighting::Fisher), lags);
    let looks = oracle::gaussian_looks(case.sigma_px);
    let settings = Settings { sigma: true, ..Settings::new(case.sigma_px) };
    let double = phase_images(&case.recording, &plan, &settings.in_double());
    let single = phase_images(&case.recording, &plan, &settings);
    for (pixel, pairs) in case.pairs.iter().enumerate() {
        let pairs = pairs.up_to_lag(lags);
        let weights = oracle::weights(&pairs, oracle::Weighting::Fisher, looks);
        let regularisation = oracle::Regularisation::paper(FRAMES);
        let expected =
            oracle::phase_sigma(FRAMES, lags, &pairs.coherence, &weights, looks, &regularisation);
        for (t, sigma) in expected.into_iter().enumerate() {
            let place = t * case.pairs.len() + pixel;
            for got in [double.sigmas[place], single.sigmas[place]] {
                let error = (f64::from(got) - sigma).abs();
                assert!(error <= SIGMA_IMAGE_RELATIVE * sigma, "{pixel}, {t}: {got} for {sigma}");
            }
        }
    }
}

// ---- what must not matter ------------------------------------------------------------------

fn bits(phases: &[f32]) -> Vec<u32> {
    phases.iter().map(|phase| phase.to_bits()).collect()
}

/// A pixel's arithmetic knows nothing of threads and strips: the same bits.
#[test]
fn threads_and_strips_change_no_bit() {
    let case = Case::moving();
    let plan = case.plan(Method::Paper(Weighting::Paper), FRAMES - 1);
    for path in Path::available() {
        for double in [false, true] {
            let settings = Settings { path, double, sigma: true, ..Settings::new(case.sigma_px) };
            let whole = phase_images(&case.recording, &plan, &settings);
            let mut heights = vec![whole.memory.strip_rows];
            let mut memory = whole.memory.bytes - 1;
            while heights[heights.len() - 1] > 1 {
                let threads = 1 + heights.len() % 2;
                let small = Settings { memory: memory * threads as u64, threads, ..settings };
                let got = phase_images(&case.recording, &plan, &small);
                assert!(got.memory.bytes <= small.memory, "{:?}", got.memory);
                assert_eq!(bits(&got.phases), bits(&whole.phases), "{small:?}");
                assert_eq!(bits(&got.sigmas), bits(&whole.sigmas), "{small:?}");
                heights.push(got.memory.strip_rows);
                memory = got.memory.bytes / threads as u64 - 1;
            }
            assert!(heights.len() >= 4, "several heights of strips were tried: {heights:?}");
            let threads = Settings { threads: 2, ..settings };
            let got = phase_images(&case.recording, &plan, &threads);
            assert_eq!(bits(&got.phases), bits(&whole.phases), "two threads");
        }
    }
}

// ---- unusable pixels -----------------------------------------------------------------------

const LOST: [usize; 3] = [0, 77, 100];

/// One pixel with a NaN, one with an infinity, one that is always zero.
fn damaged() -> Recording {
    let mut recording = Recording::moving(plane(16, 8), 0.95, 7);
    recording.image_mut(3, 0)[LOST[0]].re = f32::NAN;
    recording.image_mut(19, 0)[LOST[1]].im = f32::INFINITY;
    recording.fill_pixel(LOST[2], Default::default());
    recording
}

/// What the oracle sees where the unusable pixels are dark.
fn damaged_as_zero() -> PhaseImages {
    let mut zeroed = damaged();
    for pixel in LOST {
        zeroed.fill_pixel(pixel, Default::default());
    }
    let weighting = oracle::Weighting::Paper;
    oracle::paper_phase_images(&zeroed.layer(0), 1.5, FRAMES - 1, weighting, None)
}

fn check_damaged(phases: &[f32]) {
    let expected = damaged_as_zero();
    for (i, (&got, &expected_phase)) in phases.iter().zip(&expected.phase).enumerate() {
        let pixel = i % 128;
        if LOST.contains(&pixel) {
            assert!(got.is_nan(), "pixel {pixel}");
        } else {
            let near = (f64::from(got) - expected_phase).abs() <= ORACLE_RAD;
            let tied = expected.margin[pixel] < TIE_RAD;
            assert!(near || tied, "pixel {pixel}: {got} instead of {expected_phase}");
        }
    }
    let tied = expected.margin.iter().filter(|margin| **margin < TIE_RAD).count();
    assert!(tied <= 2, "{tied} pixels were excused");
}

#[test]
fn unusable_pixels_are_nan_and_dark_to_their_neighbours() {
    let plan = Plan::new(Method::Paper(Weighting::Paper), FRAMES, None, None, Depths::single());
    let plan = plan.unwrap();
    for path in Path::available() {
        let settings = Settings { path, ..Settings::new(1.5) };
        check_damaged(&phase_images(&damaged(), &plan, &settings).phases);
    }
    check_damaged(&phase_images(&damaged(), &plan, &Settings::new(1.5).in_double()).phases);
}

#[test]
fn the_program_counts_unusable_pixels() {
    let bench = Bench::new();
    damaged().save(&bench.path("F.npy"));
    let summary = bench.summary("phase F.npy --method paper --gaussian 1.5 -o P.npy");
    assert_eq!(summary["pixels_not_finite"], 2);
    assert_eq!(summary["pixels_dark"], 1);
    check_damaged(&npy::load_f32(&bench.path("P.npy")).1);
}

// ---- the program ---------------------------------------------------------------------------

fn name_of(path: Path) -> &'static str {
    match path {
        Path::Avx512 => "avx512",
        Path::Avx2 => "avx2",
        Path::Portable => "portable",
    }
}

/// One run of the program, with every path of its vector arithmetic.
fn run_paths(bench: &Bench, line: &str, mut each: impl FnMut(&str, Vec<f32>)) {
    for path in Path::available() {
        let mut command = bench.command(&format!("{line} -o P.npy"));
        command.env("PHASEWALK_SIMD", name_of(path));
        let output = command.output().unwrap();
        assert!(output.status.success(), "{output:?}");
        let (shape, phases) = npy::load_f32(&bench.path("P.npy"));
        assert_eq!(shape[0], FRAMES);
        each(&format!("{line}, {path:?}"), phases);
    }
}

#[test]
fn the_programs_images_are_the_oracles() {
    let mut tally = Tally::default();
    let bench = Bench::new();
    for case in Case::all() {
        case.recording.save(&bench.path("F.npy"));
        let layers = if case.name == "layers" { "--layers 0..1,3..3" } else { "" };
        for lags in [1, 5, FRAMES - 1] {
            let common = format!(
                "phase F.npy --method paper --gaussian {} {layers} --max-lag {lags}",
                case.sigma_px
            );
            let nominal = oracle::gaussian_looks(case.sigma_px);
            let expected =
                oracle::images_from_pairs(&case.pairs, lags, oracle::Weighting::Paper, nominal);
            run_paths(&bench, &common, |what, phases| {
                let tie = |pixel: usize| expected.margin[pixel];
                tally.add(Tally::of(what, &phases, &expected.phase, false, tie));
            });
            let summary =
                bench.summary(&format!("{common} --weights fisher --precision f64 -o P.npy"));
            let looks = summary["looks"].as_f64().unwrap();
            let expected =
                oracle::images_from_pairs(&case.pairs, lags, oracle::Weighting::Fisher, looks);
            let (_, phases) = npy::load_f32(&bench.path("P.npy"));
            let tie = |pixel: usize| expected.margin[pixel];
            tally.add(Tally::of(&common, &phases, &expected.phase, true, tie));
        }
    }
    tally.is_within_the_promise();
}

#[test]
fn the_programs_baselines_are_the_oracles() {
    let mut tally = Tally::default();
    let bench = Bench::new();
    let case = Case::moving();
    case.recording.save(&bench.path("F.npy"));
    let series = case.recording.layer(0);
    let direct = oracle::direct_images(&series, 3.0, 7);
    let line = "phase F.npy --gaussian 3 --method direct --reference-frame 7";
    run_paths(&bench, line, |what, phases| {
        let cut = |pixel: usize| {
            distance_from_the_cut(&case.pairs[pixel], |t, lag| t == 7 || t + lag == 7)
        };
        tally.add(Tally::of(what, &phases, &direct, false, cut));
    });
    let walked = oracle::one_step_images(&series, 3.0);
    run_paths(&bench, "phase F.npy --gaussian 3 --method one-step", |what, phases| {
        let cut = |pixel: usize| distance_from_the_cut(&case.pairs[pixel], |_, lag| lag == 1);
        tally.add(Tally::of(what, &phases, &walked, false, cut));
    });
    tally.is_within_the_promise();
}

#[test]
fn little_memory_changes_no_byte_of_the_programs_images() {
    let bench = Bench::new();
    Recording::moving(plane(48, 61), 0.95, 8).save(&bench.path("F.npy"));
    let strips = |ran: phasewalk_tests::program::Ran| {
        ran.stdout.split_whitespace().next().unwrap().parse::<usize>().unwrap()
    };
    let line = "phase F.npy --method paper --gaussian 1.5 --sigma";
    let whole = strips(bench.succeed(&format!("{line} --threads 2 -o A.npy")));
    let many = strips(bench.succeed(&format!("{line} --threads 1 --memory 2 -o B.npy")));
    assert!(many > whole, "{many} strips against {whole}");
    for suffix in ["npy", "sigma.npy"] {
        let bytes = |name: &str| std::fs::read(bench.path(&format!("{name}.{suffix}"))).unwrap();
        assert!(bytes("A") == bytes("B"), "{suffix}");
    }
}
