//! Phase curves, of the library and of the program, against the dense oracle.

use phasewalk::io::{CurveRow, Shape};
use phasewalk::method::{Depths, Method, Plan};
use phasewalk_core::weights::Weighting;
use phasewalk_tests::library::phase_curve;
use phasewalk_tests::npy;
use phasewalk_tests::oracle::{self, Pairs};
use phasewalk_tests::program::Bench;
use phasewalk_tests::random::Random;
use phasewalk_tests::recording::Recording;
use phasewalk_tests::tolerance::{DOUBLE_RAD, EXACT_TIE_RAD, ORACLE_RAD, SIGMA_RELATIVE};

const FRAMES: usize = 30;

fn plane(height: usize, width: usize) -> Shape {
    Shape { frames: FRAMES, depth: 1, height, width }
}

/// Inputs of every kind: odd sizes, speckle that loses itself slowly and quickly, and pure chance.
fn recordings() -> Vec<Recording> {
    vec![
        Recording::moving(plane(37, 29), 0.95, 1),
        Recording::moving(plane(16, 8), 0.8, 2),
        Recording::random(plane(37, 29), 3),
        Recording::random(plane(5, 3), 4),
        jumping(plane(13, 11), 5),
    ]
}

/// Lasting speckle under a phase that is random over several turns in each frame.
fn jumping(shape: Shape, seed: u64) -> Recording {
    let mut random = Random::new(seed);
    let phase: Vec<f64> = (0..shape.frames).map(|_| 5.0 * random.phase()).collect();
    Recording::decorrelating(shape, 0.98, seed, |t, _| phase[t])
}

/// About two thirds of the pixels.
fn mask(recording: &Recording, seed: u64) -> Vec<bool> {
    let mut random = Random::new(seed);
    (0..recording.pixels()).map(|_| random.uniform() < 0.65).collect()
}

fn count(mask: &[bool]) -> f64 {
    mask.iter().filter(|inside| **inside).count() as f64
}

fn oracle_weighting(weighting: Weighting) -> oracle::Weighting {
    match weighting {
        Weighting::Paper => oracle::Weighting::Paper,
        Weighting::Fisher => oracle::Weighting::Fisher,
    }
}

fn phases(rows: &[CurveRow]) -> Vec<f64> {
    rows.iter().map(|row| row.phase_rad).collect()
}

#[track_caller]
fn assert_close(got: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(got.len(), expected.len());
    for (t, (got, expected)) in got.iter().zip(expected).enumerate() {
        assert!((got - expected).abs() <= tolerance, "frame {t}: {got} instead of {expected}");
    }
}

/// Phase and standard deviation of the least squares; `looks` of both.
fn check_least_squares(
    rows: &[CurveRow],
    pairs: &Pairs,
    lags: usize,
    weighting: oracle::Weighting,
    looks: f64,
) {
    let solution = oracle::phase_from_pairs(pairs, lags, weighting, looks);
    assert!(solution.margin > EXACT_TIE_RAD, "no test without a tie: {}", solution.margin);
    assert_close(&phases(rows), &solution.phase, DOUBLE_RAD);
    let pairs = pairs.up_to_lag(lags);
    let regularisation = oracle::Regularisation::paper(pairs.frames);
    let (coherence, weights) = (&pairs.coherence, &solution.weights);
    let sigmas =
        oracle::phase_sigma(pairs.frames, lags, coherence, weights, looks, &regularisation);
    for (row, sigma) in rows.iter().zip(sigmas) {
        // Both are infinite where no reference frame was measured.
        let close = (row.sigma_rad - sigma).abs() <= SIGMA_RELATIVE * sigma;
        assert!(close || row.sigma_rad == sigma, "{row:?}: {sigma}");
    }
}

#[test]
fn the_librarys_curves_are_the_oracles() {
    for recording in recordings() {
        let mask = mask(&recording, 9);
        let pairs = oracle::mask_mean(&recording.layer(0), &mask);
        for lags in [1, 5, FRAMES - 1] {
            for weighting in [Weighting::Paper, Weighting::Fisher] {
                // Many looks let pairs of pure chance count, too.
                for looks in [count(&mask), 1e4] {
                    let method = Method::Paper(weighting);
                    let plan = Plan::new(method, FRAMES, Some(lags), None, Depths::single());
                    let rows = phase_curve(&recording, &mask, &plan.unwrap(), looks);
                    check_least_squares(&rows, &pairs, lags, oracle_weighting(weighting), looks);
                }
            }
        }
    }
}

#[test]
fn the_librarys_baselines_are_the_oracles() {
    for recording in recordings() {
        let (mask, series) = (mask(&recording, 10), recording.layer(0));
        for reference in [0, 4, 17, FRAMES - 1] {
            let depths = Depths::single();
            let plan = Plan::new(Method::Direct, FRAMES, None, Some(reference), depths).unwrap();
            let rows = phase_curve(&recording, &mask, &plan, count(&mask));
            let expected = oracle::direct_curve(&series, &mask, reference);
            assert_close(&phases(&rows), &expected, DOUBLE_RAD);
        }
        let plan = Plan::new(Method::OneStep, FRAMES, None, None, Depths::single()).unwrap();
        let rows = phase_curve(&recording, &mask, &plan, count(&mask));
        assert_close(&phases(&rows), &oracle::one_step_curve(&series, &mask), DOUBLE_RAD);
    }
}

// ---- the program ---------------------------------------------------------------------------

/// The rows of a curve's table, after its header has been checked.
fn read_table(bench: &Bench, name: &str) -> Vec<CurveRow> {
    let (header, rows) = bench.table(name);
    assert_eq!(header, "frame,time_s,phase_rad,sigma_rad");
    let row = |row: Vec<f64>| {
        let [frame, time_s, phase_rad, sigma_rad] = row[..] else { panic!("{row:?}") };
        CurveRow { phase_rad, sigma_rad, ..CurveRow::missing(frame as usize, time_s) }
    };
    rows.into_iter().map(row).collect()
}

fn save(bench: &Bench, recording: &Recording, mask: &[bool]) {
    let Shape { height, width, .. } = recording.shape;
    recording.save(&bench.path("F.npy"));
    npy::save_mask(&bench.path("M.npy"), &[height, width], mask);
}

#[test]
fn the_programs_curves_are_the_oracles() {
    let bench = Bench::new();
    for recording in recordings() {
        let mask = mask(&recording, 11);
        save(&bench, &recording, &mask);
        let pairs = oracle::mask_mean(&recording.layer(0), &mask);
        for lags in [1, 5, FRAMES - 1] {
            for (name, weighting) in
                [("paper", oracle::Weighting::Paper), ("fisher", oracle::Weighting::Fisher)]
            {
                let line = format!(
                    "phase F.npy --method paper --mask M.npy --max-lag {lags} --weights {name} -o C.csv"
                );
                if count(&mask) < 12.0 {
                    bench.run(&line).refused(2, &["--mask", "looks"]);
                    continue;
                }
                let summary = bench.summary(&line);
                let looks = summary["looks"].as_f64().unwrap();
                if name == "paper" {
                    assert_eq!(looks, count(&mask), "nominal looks for the paper's weights");
                } else {
                    assert_eq!(summary["looks"], summary["effective_looks"]);
                }
                let solution = oracle::phase_from_pairs(&pairs, lags, weighting, looks);
                assert!(solution.margin > EXACT_TIE_RAD, "{}", solution.margin);
                let rows = read_table(&bench, "C.csv");
                assert_close(&phases(&rows), &solution.phase, ORACLE_RAD);
            }
        }
    }
}

#[test]
fn the_programs_baselines_are_the_oracles() {
    let bench = Bench::new();
    for recording in recordings() {
        let (mask, series) = (mask(&recording, 12), recording.layer(0));
        save(&bench, &recording, &mask);
        let curve = |line: &str| {
            let _ = bench.succeed(&format!("phase F.npy --mask M.npy {line} -o C.csv"));
            phases(&read_table(&bench, "C.csv"))
        };
        let direct = curve("--method direct");
        assert_close(&direct, &oracle::direct_curve(&series, &mask, 4), ORACLE_RAD);
        let direct = curve("--method direct --reference-frame 21");
        assert_close(&direct, &oracle::direct_curve(&series, &mask, 21), ORACLE_RAD);
        let walked = curve("--method one-step");
        assert_close(&walked, &oracle::one_step_curve(&series, &mask), ORACLE_RAD);
    }
}

#[test]
fn layers_are_compared_as_the_oracle_does() {
    let shape = Shape { frames: FRAMES, depth: 5, height: 12, width: 9 };
    let recording = Recording::moving(shape, 0.95, 21);
    let mask = mask(&recording, 13);
    let bench = Bench::new();
    save(&bench, &recording, &mask);
    let layers = recording.layers();
    for (argument, z1, z2) in
        [("0..1,3..4", vec![0, 1], vec![3, 4]), ("4..4,0..2", vec![4], vec![0, 1, 2])]
    {
        let pairs = oracle::mask_mean_of(FRAMES, &mask, |t, lag| {
            oracle::layer_difference(&layers, &z1, &z2, t, lag)
        });
        for lags in [1, 5, FRAMES - 1] {
            let plan = Plan::new(
                Method::Paper(Weighting::Fisher),
                FRAMES,
                Some(lags),
                None,
                argument.parse::<Depths>().unwrap(),
            );
            let rows = phase_curve(&recording, &mask, &plan.unwrap(), 40.0);
            check_least_squares(&rows, &pairs, lags, oracle::Weighting::Fisher, 40.0);
            let line = format!(
                "phase F.npy --method paper --mask M.npy --layers {argument} --max-lag {lags} --weights fisher --looks 40 -o C.csv"
            );
            let _ = bench.succeed(&line);
            let expected =
                oracle::phase_from_pairs(&pairs, lags, oracle::Weighting::Fisher, 40.0).phase;
            assert_close(&phases(&read_table(&bench, "C.csv")), &expected, ORACLE_RAD);
        }
    }
}

#[test]
fn one_layer_is_the_sum_over_its_depths() {
    let shape = Shape { frames: FRAMES, depth: 4, height: 12, width: 9 };
    let recording = Recording::moving(shape, 0.95, 22);
    let mask = mask(&recording, 14);
    let bench = Bench::new();
    save(&bench, &recording, &mask);
    let layers = recording.layers();
    let pairs = oracle::mask_mean_of(FRAMES, &mask, |t, lag| {
        let spectra = [1, 2].map(|z| oracle::cross_spectrum(&layers[z], t, lag));
        spectra[0].iter().zip(&spectra[1]).map(|(a, b)| a + b).collect()
    });
    let _ = bench.succeed("phase F.npy --method paper --mask M.npy --layers 1..2 -o C.csv");
    let weighting = oracle::Weighting::Paper;
    let expected = oracle::phase_from_pairs(&pairs, FRAMES - 1, weighting, count(&mask)).phase;
    assert_close(&phases(&read_table(&bench, "C.csv")), &expected, ORACLE_RAD);
}

#[test]
fn a_simulated_scene_is_evaluated_as_the_oracle_does() {
    let bench = Bench::new();
    let _ = bench.succeed(
        "simulate speckle --width 37 --height 29 --frames 30 --scatterers 10 --seed 5 -o F.npy",
    );
    let (shape, field) = npy::load_complex(&bench.path("F.npy"));
    assert_eq!(shape, [FRAMES, 29, 37]);
    let recording = Recording { shape: plane(29, 37), field };
    let (_, mask) = npy::load_mask(&bench.path("F.mask.npy"));
    let _ = bench.succeed("phase F.npy --method paper --mask F.mask.npy -o C.csv");
    let weighting = oracle::Weighting::Paper;
    let expected =
        oracle::paper_phase_curve(&recording.layer(0), &mask, FRAMES - 1, weighting, None);
    assert_close(&phases(&read_table(&bench, "C.csv")), &expected, ORACLE_RAD);
}

#[test]
fn unusable_pixels_are_left_out_of_the_mask_and_counted() {
    let mut recording = Recording::moving(plane(16, 8), 0.95, 6);
    recording.image_mut(3, 0)[17].re = f32::NAN;
    recording.image_mut(29, 0)[40].im = f32::NEG_INFINITY;
    recording.fill_pixel(90, Default::default());
    let bench = Bench::new();
    save(&bench, &recording, &[true; 128]);
    let summary = bench.summary("phase F.npy --method paper --mask M.npy -o C.csv");
    assert_eq!((&summary["pixels"], &summary["pixels_left_out"]), (&125.into(), &3.into()));
    assert_eq!(summary["pixels_not_finite"], 2);
    assert_eq!(summary["pixels_dark"], 1);
    let mut usable = [true; 128];
    for pixel in [17, 40, 90] {
        usable[pixel] = false;
    }
    let series = recording.layer(0);
    let weighting = oracle::Weighting::Paper;
    let expected = oracle::paper_phase_curve(&series, &usable, FRAMES - 1, weighting, None);
    assert_close(&phases(&read_table(&bench, "C.csv")), &expected, ORACLE_RAD);
}
