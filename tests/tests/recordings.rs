//! Repeated recordings of one scene: one ensemble, more looks, one curve, one set of images.

use num_complex::Complex32;
use phasewalk::io::Shape;
use phasewalk_tests::npy;
use phasewalk_tests::program::Bench;
use phasewalk_tests::random::Random;
use phasewalk_tests::recording::Recording;
use phasewalk_tests::tolerance::{
    DOUBLE_RAD, SIGMA_RATIO, SINGLE_STORED_RAD, STANDARD_SCORES, STANDARD_SCORES_OF_LAYERS,
};
use phasewalk_tests::volumes::Volumes;
use serde_json::json;
use std::fs;

const NAMES: [&str; 3] = ["A.npy", "B.npy", "C.npy"];
const ALL: &str = "A.npy B.npy C.npy";
const FRAMES: usize = 16;
const SIDE: usize = 72;
const PIXELS: usize = SIDE * SIDE;

/// Side of the regions whose errors are counted.
const PATCH: usize = 12;

/// What the stimulus does to the first of two layers, or to the only one.
fn truth(t: usize) -> f64 {
    0.2 * t.saturating_sub(4) as f64
}

/// What is expected of a reported phase: against the mean of the first five frames.
fn reported(t: usize) -> f64 {
    truth(t) - (0..5).map(truth).sum::<f64>() / 5.0
}

/// Three recordings of `depth` depths with speckle of their own; of several depths those of the second half stay
/// where they are, and the sample as a whole moves at random, otherwise in every recording. A single depth has one phase
/// in all its frames.
fn recordings(depth: usize, seed: u64) -> [Recording; 3] {
    let shape = Shape { frames: FRAMES, depth, height: SIDE, width: SIDE };
    [0, 1, 2].map(|number| {
        let mut random = Random::new(seed + 100 + number);
        let bulk: Vec<f64> = (0..FRAMES).map(|_| random.phase()).collect();
        Recording::decorrelating(shape, 0.93, seed + number, |t, [z, ..]| {
            if depth == 1 {
                bulk[0] + truth(t)
            } else {
                bulk[t] + if z < depth / 2 { truth(t) } else { 0.0 }
            }
        })
    })
}

fn bench(recordings: &[Recording; 3]) -> Bench {
    let bench = Bench::new();
    for (name, recording) in NAMES.iter().zip(recordings) {
        recording.save(&bench.path(name));
    }
    npy::save_mask(&bench.path("M.npy"), &[SIDE, SIDE], &[true; PIXELS]);
    bench
}

/// Time, phase and standard deviation of every frame.
fn curve(bench: &Bench, series: &str, options: &str) -> Vec<[f64; 3]> {
    let _ = bench.succeed(&format!("phase {series} {options} -o curve.csv"));
    bench.table("curve.csv").1.iter().map(|row| [row[1], row[2], row[3]]).collect()
}

/// Phases and standard deviations, (time, y, x).
fn images(bench: &Bench, series: &str, options: &str) -> [Vec<f32>; 2] {
    let _ = bench.succeed(&format!("phase {series} --gaussian 3 {options} -o images.npy"));
    ["images.npy", "images.sigma.npy"].map(|name| npy::load_f32(&bench.path(name)).1)
}

fn rms(numbers: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = numbers.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
    f64::sqrt(sum / count)
}

#[track_caller]
fn assert_close(got: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((got / expected - 1.0).abs() < tolerance, "{what}: {got} instead of {expected}");
}

/// Rms of error over sigma and of sigma at all frames behind the stimulus, of 36 regions.
fn errors_of_curves(bench: &Bench, series: &str, options: &str) -> [f64; 2] {
    let (mut scores, mut sigmas) = (vec![], vec![]);
    for patch in 0..(SIDE / PATCH).pow(2) {
        let (top, left) = (patch / (SIDE / PATCH), patch % (SIDE / PATCH));
        let inside = |i: usize| (i / SIDE / PATCH, i % SIDE / PATCH) == (top, left);
        let mask: Vec<bool> = (0..PIXELS).map(inside).collect();
        npy::save_mask(&bench.path("patch.npy"), &[SIDE, SIDE], &mask);
        let rows = curve(bench, series, &format!("--mask patch.npy {options}"));
        for (t, [_, phase, sigma]) in rows.into_iter().enumerate().skip(5) {
            scores.push((phase - reported(t)) / sigma);
            sigmas.push(sigma);
        }
    }
    [rms(scores.into_iter()), rms(sigmas.into_iter())]
}

/// The same of the pixels of images.
fn errors_of_images(bench: &Bench, series: &str, options: &str) -> [f64; 2] {
    let [phases, sigmas] = images(bench, series, options);
    let late = 5 * PIXELS..FRAMES * PIXELS;
    let score = |i: usize| (f64::from(phases[i]) - reported(i / PIXELS)) / f64::from(sigmas[i]);
    let sigma = |i: usize| f64::from(sigmas[i]);
    [rms(late.clone().map(score)), rms(late.map(sigma))]
}

// ---- errors ----------------------------------------------------------------------------------

#[test]
fn errors_fall_with_the_number_of_recordings_and_sigma_knows() {
    let bench = bench(&recordings(1, 1));
    let summary = bench.summary(&format!("phase {ALL} --mask M.npy -o curve.csv"));
    assert_eq!(summary["series"], json!(NAMES));
    let amount = summary["independent_recordings"].as_f64().unwrap();
    assert_close(amount, 3.0, SIGMA_RATIO, "independent recordings");
    for method in ["linked", "one-step"] {
        let option = format!("--method {method}");
        let [_, one] = errors_of_curves(&bench, "A.npy", &option);
        let [score, three] = errors_of_curves(&bench, ALL, &option);
        assert_close(one / three, 3_f64.sqrt(), SIGMA_RATIO, &option);
        assert_close(score, 1.0, STANDARD_SCORES, &option);
    }
    let [_, one] = errors_of_images(&bench, "A.npy", "");
    let [score, three] = errors_of_images(&bench, ALL, "");
    assert_close(one / three, 3_f64.sqrt(), SIGMA_RATIO, "sigma of images");
    assert_close(score, 1.0, STANDARD_SCORES, "score of images");
}

/// Every recording moves in its own way; the product of the layers does not see it.
#[test]
fn the_layers_of_each_recording_are_compared_before_the_mean() {
    let bench = bench(&recordings(4, 21));
    let option = "--layers 0..1,2..3";
    let [_, one] = errors_of_curves(&bench, "A.npy", option);
    let [score, three] = errors_of_curves(&bench, ALL, option);
    assert_close(one / three, 3_f64.sqrt(), SIGMA_RATIO, "sigma of curves");
    assert_close(score, 1.0, STANDARD_SCORES_OF_LAYERS, "score of curves");
    let [_, one] = errors_of_images(&bench, "A.npy", option);
    let [score, three] = errors_of_images(&bench, ALL, option);
    assert_close(one / three, 3_f64.sqrt(), SIGMA_RATIO, "sigma of images");
    assert_close(score, 1.0, STANDARD_SCORES_OF_LAYERS, "score of images");
}

// ---- what the ensemble is --------------------------------------------------------------------

/// A mean over recordings and pixels is the mean over the pixels of the recordings side by side.
#[test]
fn recordings_are_as_one_that_lies_side_by_side() {
    for (depth, layers, methods) in [
        (1, "", &["direct", "one-step", "paper", "linked"][..]),
        (2, "--layers 0..0,1..1", &["direct", "one-step", "paper"][..]),
    ] {
        let three = recordings(depth, 41);
        let shape = Shape { width: 3 * SIDE, ..three[0].shape };
        let rows = three[0].field.len() / SIDE;
        let row = |r: usize| three.iter().flat_map(move |one| &one.field[r * SIDE..][..SIDE]);
        let side_by_side = Recording { shape, field: (0..rows).flat_map(row).copied().collect() };
        let bench = bench(&three);
        side_by_side.save(&bench.path("W.npy"));
        npy::save_mask(&bench.path("MMM.npy"), &[SIDE, 3 * SIDE], &[true; 3 * PIXELS]);
        for method in methods {
            let options = format!("{layers} --method {method} --looks 900");
            let together = curve(&bench, ALL, &format!("--mask M.npy {options}"));
            let wide = curve(&bench, "W.npy", &format!("--mask MMM.npy {options}"));
            for (t, (a, b)) in together.iter().zip(&wide).enumerate() {
                let error = (a[1] - b[1]).abs();
                assert!(error < DOUBLE_RAD, "{options}, frame {t}: {a:?} {b:?}");
            }
        }
    }
}

/// The same speckle once more tells nothing: same phases, same standard deviations.
#[test]
fn a_copy_adds_nothing() {
    for (depth, layers) in [(1, ""), (4, "--layers 0..1,2..3")] {
        let bench = bench(&recordings(depth, 61));
        fs::copy(bench.path("A.npy"), bench.path("D.npy")).unwrap();
        for method in ["linked", "paper --weights fisher --sigma"] {
            let options = format!("--method {method} {layers}");
            let (one, two) =
                (images(&bench, "A.npy", &options), images(&bench, "A.npy D.npy", &options));
            for (one, two) in one.iter().zip(&two) {
                let differences = one.iter().zip(two).map(|(a, b)| f64::from((a - b).abs()));
                let largest = differences.fold(0.0, f64::max);
                assert!(largest < SINGLE_STORED_RAD, "{options}: {largest}");
            }
        }
        let line = format!("phase A.npy D.npy --mask M.npy {layers} -o curve.csv");
        let amount = bench.summary(&line)["independent_recordings"].as_f64().unwrap();
        assert!((amount - 1.0).abs() < SINGLE_STORED_RAD, "{amount}");
    }
}

#[test]
fn a_phase_of_a_whole_recording_changes_nothing() {
    let mut three = recordings(1, 81);
    let before = bench(&three);
    for (recording, angle) in three.iter_mut().zip([0.0, 2.0, -1.1]) {
        let turn = Complex32::from_polar(1.0, angle);
        recording.field.iter_mut().for_each(|u| *u *= turn);
    }
    let after = bench(&three);
    for method in ["direct", "one-step", "paper", "linked"] {
        let options = format!("--mask M.npy --method {method}");
        let pairs = curve(&before, ALL, &options).into_iter().zip(curve(&after, ALL, &options));
        for ([_, phase, sigma], [_, other, its]) in pairs {
            assert!((phase - other).abs() < SINGLE_STORED_RAD, "{method}: {phase} {other}");
            assert!((sigma - its).abs() < SINGLE_STORED_RAD, "{method}: {sigma} {its}");
        }
    }
}

// ---- bad frames, and recordings that do not fit ----------------------------------------------

const TIPS: [usize; 2] = [0, 1];
const JUNCTION: [usize; 2] = [2, 3];

/// A bench with `A.zarr` and `B.zarr`, the second as `change` leaves it.
fn groups(change: impl Fn(&mut Volumes)) -> Bench {
    let [first, second, _] = recordings(4, 101);
    let bench = bench(&[first.clone(), second.clone(), second.clone()]);
    let volumes = |recording: Recording| Volumes {
        times_s: Some((0..FRAMES).map(|t| 0.5 * t as f64).collect()),
        attributes: json!({
            "wavelength_nm": 841.0,
            "stimulus_sweep": 5,
            "layer_ost_z": TIPS,
            "layer_isos_z": JUNCTION,
        }),
        ..Volumes::new(recording)
    };
    volumes(first).save(&bench.path("A.zarr"));
    let mut second = volumes(second);
    change(&mut second);
    second.save(&bench.path("B.zarr"));
    bench
}

/// Frame 3 is bad in one, frame 8 has no numbers: both are left out of both, and the rest is as without them.
#[test]
fn a_frame_that_is_bad_in_one_recording_is_left_out_of_all() {
    let bench = groups(|volumes| {
        volumes.recording.image_mut(8, 1).fill(Complex32::new(f32::NAN, 0.0));
        volumes.sweep_ok = Some((0..FRAMES).map(|t| t != 3).collect());
    });
    let summary = bench.summary("phase A.zarr B.zarr --mask M.npy -o curve.zarr");
    assert_eq!(summary["frames_left_out"], json!([3, 8]));
    assert_eq!(summary["layers"], "0..1,2..3");
    let attributes = fs::read_to_string(bench.path("curve.zarr/zarr.json")).unwrap();
    for name in ["A.zarr", "B.zarr"] {
        assert!(attributes.contains(name), "{name}: {attributes}");
    }
    let rows = curve(&bench, "A.zarr B.zarr", "--mask M.npy");
    for (t, [time, phase, sigma]) in rows.into_iter().enumerate() {
        assert_eq!(time, 0.5 * t as f64);
        assert_eq!(phase.is_nan(), t == 3 || t == 8, "frame {t}: {phase}");
        assert!(phase.is_nan() || sigma < 0.1, "frame {t}: {sigma}");
    }
    let [phases, _] = images(&bench, "A.zarr B.zarr", "");
    for (t, image) in phases.chunks_exact(PIXELS).enumerate() {
        assert_eq!(image.iter().all(|phase| phase.is_nan()), t == 3 || t == 8, "frame {t}");
    }
    let line = "phase A.zarr B.zarr --mask M.npy -o curve.csv --figure F.svg";
    let ran = bench.succeed(line);
    assert!(ran.stdout.contains("14 frames of 2 recordings ("), "{ran:?}");
    assert!(fs::read_to_string(bench.path("F.svg")).unwrap().contains("A.zarr and 1 more"));
    let shown = "--gaussian 3 -o P.zarr --figure P.svg --at 9,12 --decorrelation D.svg";
    let _ = bench.succeed(&format!("phase A.zarr B.zarr {shown}"));
    assert!(bench.path("P.svg").is_file() && bench.path("D.svg").is_file());
}

#[test]
fn layers_are_those_of_each_recording() {
    let bench = groups(|volumes| {
        volumes.attributes["layer_ost_z"] = json!(JUNCTION);
        volumes.attributes["layer_isos_z"] = json!(TIPS);
        let shape = volumes.recording.shape;
        let mut turned = volumes.recording.clone();
        for t in 0..shape.frames {
            for z in 0..shape.depth {
                let plane = volumes.recording.image_mut(t, (z + 2) % shape.depth).to_vec();
                turned.image_mut(t, z).copy_from_slice(&plane);
            }
        }
        volumes.recording = turned;
    });
    let summary = bench.summary("phase A.zarr B.zarr --mask M.npy -o curve.csv");
    assert_eq!(summary["layers"], "0..1,2..3; 2..3,0..1");
    let own = curve(&bench, "A.zarr B.zarr", "--mask M.npy");
    let same = curve(&bench, "A.npy B.npy", "--mask M.npy --layers 0..1,2..3");
    for (own, same) in own.iter().zip(&same) {
        assert!((own[1] - same[1]).abs() < DOUBLE_RAD, "{own:?} {same:?}");
    }
}

#[test]
fn recordings_that_do_not_fit_are_refused_by_name() {
    let line = "phase A.zarr B.zarr --mask M.npy -o curve.csv";
    let refused = |change: &dyn Fn(&mut Volumes), words: &[&str]| {
        let bench = groups(change);
        let before = bench.names();
        bench.run(line).refused(1, &[&["A.zarr", "B.zarr"], words].concat());
        assert_eq!(bench.names(), before);
    };
    refused(&|volumes| *volumes = volumes.without(&[7]), &["15 frames", "16"]);
    refused(&|volumes| volumes.attributes["wavelength_nm"] = json!(850.0), &["850", "841"]);
    refused(&|volumes| volumes.attributes["stimulus_sweep"] = json!(6), &["stimulus_sweep is 6"]);
    refused(&|volumes| volumes.times_s = None, &["B.zarr: has no times", "--times"]);
    let late = |volumes: &mut Volumes| volumes.times_s.as_mut().unwrap()[9] += 0.1;
    refused(&late, &["frame 9", "0.6", "0.5", "--times"]);

    let bench = groups(late);
    let times: Vec<String> = (0..FRAMES).map(|t| t.to_string()).collect();
    fs::write(bench.path("T.txt"), times.join("\n")).unwrap();
    assert_eq!(curve(&bench, "A.zarr B.zarr", "--mask M.npy --times T.txt")[9][0], 9.0);
    bench.run("phase A.zarr A.zarr --mask M.npy -o D.csv").refused(2, &["A.zarr", "twice"]);
    bench.run("phase A.zarr N.zarr --mask M.npy -o D.csv").refused(1, &["N.zarr"]);
    bench.run("phase --mask M.npy -o D.csv").refused(2, &["SERIES"]);
    let line = "phase A.zarr B.npy --layers 0..1,2..3 --mask M.npy -o B.npy";
    bench.run(line).refused(2, &["-o", "B.npy"]);
}
