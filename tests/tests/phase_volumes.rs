//! `phasewalk phase` of reconstructed volumes: layers, bad sweeps, control region, path lengths,
//! phasors, figures, and what is refused.

use num_complex::{Complex, Complex32};
use phasewalk::io::Shape;
use phasewalk_tests::npy;
use phasewalk_tests::oracle::{self, Pairs};
use phasewalk_tests::program::Bench;
use phasewalk_tests::random::Random;
use phasewalk_tests::recording::Recording;
use phasewalk_tests::tolerance::{DOUBLE_RAD, EXACT_TIE_RAD, ORACLE_RAD, TIE_RAD};
use phasewalk_tests::volumes::Volumes;
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::fs;

const FRAMES: usize = 16;
const HEIGHT: usize = 22;
const WIDTH: usize = 26;
const PIXELS: usize = HEIGHT * WIDTH;
const WAVELENGTH_NM: f64 = 841.0;
/// Tips and IS/OS junction among the six depths.
const TIPS: [usize; 2] = [3, 4];
const JUNCTION: [usize; 1] = [1];

/// Left of this column the layers draw apart.
const EDGE: usize = 14;

fn elongation(t: usize) -> f64 {
    0.18 * t.saturating_sub(5) as f64
}

/// Outer segments that lengthen on the left from sweep 5 on, under a bulk motion of any phase.
fn volumes() -> Volumes {
    let shape = Shape { frames: FRAMES, depth: 6, height: HEIGHT, width: WIDTH };
    let mut random = Random::new(7);
    let bulk: Vec<f64> = (0..FRAMES).map(|_| random.phase()).collect();
    let recording = Recording::decorrelating(shape, 0.94, 11, |t, [z, _, x]| {
        let lengthens = z >= TIPS[0] && x < EDGE;
        bulk[t] + if lengthens { elongation(t) } else { 0.0 }
    });
    Volumes {
        times_s: Some((0..FRAMES).map(|t| 0.2 * t as f64 + 0.01 * (t % 3) as f64).collect()),
        attributes: json!({
            "wavelength_nm": WAVELENGTH_NM,
            "layer_ost_z": TIPS,
            "layer_isos_z": [JUNCTION[0], JUNCTION[0]],
            "pixel_pitch_um": 4.0,
            "stimulus_s": 1.0,
        }),
        ..Volumes::new(recording)
    }
}

fn mask_of(inside: impl Fn(usize) -> bool) -> Vec<bool> {
    (0..PIXELS).map(|pixel| inside(pixel % WIDTH)).collect()
}

/// A folder with the volumes `V.zarr`, the mask of what lengthens `M.npy` and that of the rest `R.npy`.
fn bench(volumes: &Volumes) -> Bench {
    let bench = Bench::new();
    volumes.save(&bench.path("V.zarr"));
    npy::save_mask(&bench.path("M.npy"), &[HEIGHT, WIDTH], &mask_of(|x| x < EDGE));
    npy::save_mask(&bench.path("R.npy"), &[HEIGHT, WIDTH], &mask_of(|x| x >= EDGE + 2));
    bench
}

/// Column `n` of a table written by the program.
fn column(bench: &Bench, name: &str, n: usize) -> Vec<f64> {
    bench.table(name).1.iter().map(|row| row[n]).collect()
}

#[track_caller]
fn assert_close(got: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(got.len(), expected.len());
    for (t, (got, expected)) in got.iter().zip(expected).enumerate() {
        assert!((got - expected).abs() <= tolerance, "frame {t}: {got} instead of {expected}");
    }
}

/// C^{Z1-Z2}(t, lag) of the volumes, (y, x).
fn spectrum(layers: &[oracle::Series], t: usize, lag: usize) -> Vec<Complex<f64>> {
    oracle::layer_difference(layers, &TIPS, &JUNCTION, t, lag)
}

/// The same with every pixel's modulus 1.
fn phasors(layers: &[oracle::Series], t: usize, lag: usize) -> Vec<Complex<f64>> {
    spectrum(layers, t, lag).into_iter().map(|c| c / c.norm()).collect()
}

fn solved(pairs: &Pairs, looks: f64) -> Vec<f64> {
    let weighting = oracle::Weighting::Paper;
    let solution = oracle::phase_from_pairs(pairs, pairs.frames - 1, weighting, looks);
    assert!(solution.margin > EXACT_TIE_RAD, "no test without a tie: {}", solution.margin);
    solution.phase
}

// ---- layers --------------------------------------------------------------------------------

#[test]
fn the_layers_are_the_groups_and_elongation_is_positive() {
    let volumes = volumes();
    let bench = bench(&volumes);
    let summary = bench.summary("phase V.zarr --method paper --mask M.npy -o C.csv");
    assert_eq!(summary["layers"], "3..4,1..1");
    let _ = bench.succeed("phase V.zarr --method paper --mask M.npy --layers 3..4,1..1 -o D.csv");
    assert_eq!(fs::read(bench.path("C.csv")).unwrap(), fs::read(bench.path("D.csv")).unwrap());
    let (layers, mask) = (volumes.recording.layers(), mask_of(|x| x < EDGE));
    let pairs = oracle::mask_mean_of(FRAMES, &mask, |t, lag| spectrum(&layers, t, lag));
    let phase = column(&bench, "C.csv", 2);
    assert_close(&phase, &solved(&pairs, (EDGE * HEIGHT) as f64), ORACLE_RAD);
    let grown = elongation(FRAMES - 1);
    assert!(phase[FRAMES - 1] > 0.7 * grown, "{phase:?} of {grown}");
    let ran = bench.succeed("phase V.zarr --mask M.npy -o C.csv");
    assert!(ran.stdout.contains("layers 3..4,1..1"), "{ran:?}");
}

#[test]
fn layers_that_the_group_does_not_name_are_asked_for() {
    let mut volumes = volumes();
    for missing in ["layer_ost_z", "layer_isos_z"] {
        volumes.attributes.as_object_mut().unwrap().remove(missing);
        let bench = bench(&volumes);
        bench.run("phase V.zarr --mask M.npy -o C.csv").refused(2, &["6 depth pixels", "--layers"]);
    }
}

#[test]
fn layers_outside_the_volume_are_refused() {
    for wrong in [json!([3, 6]), json!([4, 3]), json!([-1, 2]), json!("3..4"), json!([3])] {
        let mut volumes = volumes();
        volumes.attributes["layer_ost_z"] = wrong;
        let bench = bench(&volumes);
        let words = ["V.zarr", "layer_ost_z", "0 ..= 5"];
        bench.run("phase V.zarr --mask M.npy -o C.csv").refused(1, &words);
        let _ = bench.succeed("phase V.zarr --mask M.npy --layers 3..4,1..1 -o C.csv");
    }
    let mut volumes = volumes();
    volumes.attributes["layer_ost_z"] = json!([1, 1]);
    let line = "phase V.zarr --mask M.npy -o C.csv";
    bench(&volumes).run(line).refused(1, &["V.zarr", "same depths"]);
}

// ---- bad sweeps ----------------------------------------------------------------------------

const BAD: [usize; 3] = [2, 9, 10];

/// Every result of the good sweeps is that of the series without the bad ones.
#[test]
fn bad_sweeps_are_left_out_and_say_nan() {
    let mut volumes = volumes();
    volumes.lose(&BAD);
    let bench = bench(&volumes);
    volumes.without(&BAD).save(&bench.path("W.zarr"));
    for method in ["direct", "one-step", "paper", "paper --max-lag 4 --weights fisher"] {
        let line = format!("--mask M.npy --method {method}");
        let summary = bench.summary(&format!("phase V.zarr {line} -o V.csv"));
        assert_eq!((&summary["frames_left_out"], &summary["pixels"]), (&json!(BAD), &308.into()));
        let _ = bench.succeed(&format!("phase W.zarr {line} -o W.csv"));
        let (header, all) = bench.table("V.csv");
        assert_eq!(header, "frame,time_s,phase_rad,sigma_rad,opl_nm,sigma_nm");
        assert_eq!(all.len(), FRAMES);
        let times = volumes.times_s.as_ref().unwrap();
        assert!(
            all.iter()
                .zip(times)
                .enumerate()
                .all(|(t, (row, time))| { row[0] == t as f64 && row[1] == *time })
        );
        let text = fs::read_to_string(bench.path("V.csv")).unwrap();
        assert_eq!(text.matches("nan,inf,nan,inf\n").count(), BAD.len(), "{text}");
        let good = all.iter().enumerate().filter(|(t, _)| !BAD.contains(t)).map(|(_, row)| row);
        for (got, expected) in good.zip(bench.table("W.csv").1) {
            assert_eq!(got[1..], expected[1..], "{method}");
        }
    }
    let ran = bench.succeed("phase V.zarr --mask M.npy -o V.csv");
    assert!(ran.stdout.contains("3 of 16 frames left out"), "{ran:?}");
    assert!(ran.stdout.contains(": 2, 9, 10"), "{ran:?}");
}

#[test]
fn images_of_bad_sweeps_have_no_value() {
    let mut volumes = volumes();
    volumes.lose(&BAD);
    let bench = bench(&volumes);
    volumes.without(&BAD).save(&bench.path("W.zarr"));
    for name in ["V", "W"] {
        let line = format!("phase {name}.zarr --gaussian 2 --sigma -o {name}.npy");
        let ran = bench.succeed(&line);
        assert!(!ran.stdout.contains("not finite and"), "{ran:?}");
    }
    for suffix in ["npy", "sigma.npy"] {
        let (shape, all) = npy::load_f32(&bench.path(&format!("V.{suffix}")));
        assert_eq!(shape, [FRAMES, HEIGHT, WIDTH]);
        let mut expected = npy::load_f32(&bench.path(&format!("W.{suffix}"))).1.into_iter();
        for (t, image) in all.chunks(PIXELS).enumerate() {
            if BAD.contains(&t) {
                let missing = |value: &f32| match suffix {
                    "npy" => value.is_nan(),
                    _ => *value == f32::INFINITY,
                };
                assert!(image.iter().all(missing), "{suffix}: {t}");
                continue;
            }
            assert!(image.iter().all(|&value| expected.next() == Some(value)), "{suffix}: {t}");
        }
    }
    let _ = bench.succeed("phase V.zarr --gaussian 2 -o P.zarr");
    let text = bench.succeed("info P.zarr").stdout;
    assert!(text.contains("float32 (time 16, y 22, x 26)"), "{text}");
}

/// Frames of an .npy file that hold no number are bad sweeps, too; a pixel of one frame is a bad pixel.
#[test]
fn frames_without_numbers_are_left_out_unasked() {
    let mut volumes = volumes();
    volumes.lose(&[5]);
    volumes.recording.image_mut(7, TIPS[0])[3] = Complex32::new(f32::NAN, 0.0);
    let bench = bench(&volumes);
    volumes.recording.save(&bench.path("V.npy"));
    let line = "phase V.npy --mask M.npy --layers 3..4,1..1 -o C.csv";
    let summary = bench.summary(line);
    assert_eq!(summary["frames_left_out"], json!([5]));
    assert_eq!(
        (&summary["times_from"], &summary["time_unit"]),
        (&json!("numbers of the frames"), &json!("frame"))
    );
    assert_eq!(
        (&summary["pixels_left_out"], &summary["pixels_not_finite"]),
        (&1.into(), &1.into())
    );
    let (header, rows) = bench.table("C.csv");
    assert_eq!(header, "frame,time_s,phase_rad,sigma_rad,quality", "no wavelength, no length");
    assert_eq!((rows[5][1], rows[6][1]), (5.0, 6.0), "the other frames keep their numbers");
    assert!(rows[5][2].is_nan() && rows[6][2].is_finite());
}

/// Frames count from the first sweep, bad ones included.
#[test]
fn the_reference_frame_counts_all_sweeps() {
    let mut volumes = volumes();
    volumes.lose(&BAD);
    let bench = bench(&volumes);
    let line = "phase V.zarr --mask M.npy --method direct";
    // The good sweeps begin 0, 1, 3, 4, 5: the fifth is number 5.
    let summary = bench.summary(&format!("{line} -o A.csv"));
    assert_eq!(summary["reference_frames"], json!([0, 1, 3, 4, 5]));
    assert_eq!((&summary["times_from"], &summary["time_unit"]), (&json!("V.zarr"), &json!("s")));
    let _ = bench.succeed(&format!("{line} --reference-frame 5 -o B.csv"));
    assert_eq!(fs::read(bench.path("A.csv")).unwrap(), fs::read(bench.path("B.csv")).unwrap());
    let before = bench.names();
    for (frame, words) in [("9", ["--reference-frame 9", "bad sweep"]), ("16", ["16", "0 ..= 15"])]
    {
        bench.run(&format!("{line} --reference-frame {frame} -o C.csv")).refused(2, &words);
    }
    assert_eq!(bench.names(), before);
}

#[test]
fn too_few_good_sweeps_are_refused() {
    for (kept, word) in [(0, "0 of 16"), (1, "1 of 16")] {
        let mut volumes = volumes();
        volumes.lose(&(kept..FRAMES).collect::<Vec<_>>());
        let bench = bench(&volumes);
        for rest in ["--mask M.npy -o C.csv", "--gaussian 2 -o P.npy"] {
            let words = ["V.zarr", word, "at least 2", "sweep_ok"];
            bench.run(&format!("phase V.zarr {rest}")).refused(1, &words);
        }
    }
}

#[test]
fn flags_of_another_length_are_refused() {
    let mut volumes = volumes();
    volumes.sweep_ok = Some(vec![true; FRAMES + 1]);
    let line = "phase V.zarr --mask M.npy -o C.csv";
    bench(&volumes).run(line).refused(1, &["sweep_ok", "[17]", "16 frames"]);
}

/// A lost sweep may lack its time, a good one may not.
#[test]
fn only_a_bad_sweep_may_lack_its_time() {
    let mut volumes = volumes();
    volumes.times_s.as_mut().unwrap()[9] = f64::NAN;
    let line = "phase V.zarr --mask M.npy -o C.csv";
    bench(&volumes).run(line).refused(1, &["time_s", "frame 9"]);
    volumes.lose(&[9]);
    let bench = bench(&volumes);
    let _ = bench.succeed(line);
    assert!(column(&bench, "C.csv", 1)[9].is_nan());
}

// ---- control region ------------------------------------------------------------------------

#[test]
fn the_control_is_subtracted_and_variances_add() {
    let mut volumes = volumes();
    volumes.lose(&[9]);
    let bench = bench(&volumes);
    for method in ["paper", "direct", "one-step"] {
        let line = format!("phase V.zarr --method {method}");
        let _ = bench.succeed(&format!("{line} --mask M.npy -o A.csv"));
        let _ = bench.succeed(&format!("{line} --mask R.npy -o B.csv"));
        let summary = bench.summary(&format!("{line} --mask M.npy --control R.npy -o C.csv"));
        assert_eq!(summary["control_pixels"], 220);
        let tables = ["A.csv", "B.csv", "C.csv"].map(|name| bench.table(name).1);
        for (t, ((a, b), c)) in tables[0].iter().zip(&tables[1]).zip(&tables[2]).enumerate() {
            if t == 9 {
                assert!(c[2].is_nan() && c[3] == f64::INFINITY);
                continue;
            }
            assert_eq!((c[2], c[3]), (a[2] - b[2], a[3].hypot(b[3])), "{method}: frame {t}");
        }
    }
    let ran = bench.succeed("phase V.zarr --mask M.npy --control R.npy -o C.csv");
    assert!(ran.stdout.contains("308 pixels less 220 pixels"), "{ran:?}");
}

#[test]
fn controls_that_are_none_are_refused() {
    let bench = bench(&volumes());
    npy::save_mask(&bench.path("O.npy"), &[HEIGHT, WIDTH], &mask_of(|x| x >= EDGE - 1));
    npy::save_mask(&bench.path("small.npy"), &[4, 4], &[true; 16]);
    npy::save_mask(&bench.path("none.npy"), &[HEIGHT, WIDTH], &[false; PIXELS]);
    npy::save_mask(&bench.path("few.npy"), &[HEIGHT, WIDTH], &{
        let mut few = [false; PIXELS];
        few[EDGE + 3] = true;
        few
    });
    let before = bench.names();
    for (control, status, words) in [
        ("M.npy", 1, ["M.npy", "same region"]),
        ("O.npy", 1, ["O.npy", "22 pixels belong to --mask"]),
        ("small.npy", 1, ["small.npy", "[22, 26]"]),
        ("none.npy", 1, ["none.npy", "no pixel"]),
        ("missing.npy", 1, ["missing.npy", "no such file"]),
        ("few.npy", 2, ["--control", "1.0 looks"]),
    ] {
        let line = format!("phase V.zarr --mask M.npy --control {control} -o C.csv");
        bench.run(&line).refused(status, &words);
    }
    let line = "phase V.zarr --gaussian 2 --control R.npy -o P.npy";
    bench.run(line).refused(2, &["--control", "curves"]);
    let line = "phase V.zarr --mask M.npy --control R.npy -o R.npy";
    bench.run(line).refused(2, &["R.npy", "is the input"]);
    assert_eq!(bench.names(), before);
}

// ---- optical path length -------------------------------------------------------------------

#[test]
fn path_lengths_stand_beside_the_phase() {
    let volumes = volumes();
    let bench = bench(&volumes);
    volumes.recording.save(&bench.path("V.npy"));
    let _ = bench.succeed("phase V.zarr --mask M.npy -o A.csv");
    let line = "phase V.zarr --mask M.npy --wavelength-nm 500 -o B.csv";
    assert_eq!(bench.summary(line)["wavelength_nm"], 500.0);
    let _ =
        bench.succeed("phase V.npy --mask M.npy --layers 3..4,1..1 --wavelength-nm 841 -o C.csv");
    for (name, wavelength) in [("A.csv", WAVELENGTH_NM), ("B.csv", 500.0), ("C.csv", 841.0)] {
        let (header, rows) = bench.table(name);
        assert_eq!(header, "frame,time_s,phase_rad,sigma_rad,opl_nm,sigma_nm,quality");
        for row in rows {
            for (radians, nanometres) in [(row[2], row[4]), (row[3], row[5])] {
                let expected = radians * wavelength / (4.0 * PI);
                assert!((nanometres - expected).abs() <= 1e-12 * expected.abs(), "{row:?}");
            }
        }
    }
    let _ = bench.succeed("phase V.zarr --mask M.npy -o C.zarr");
    let text = bench.succeed("info C.zarr").stdout;
    for array in ["phase_rad", "sigma_rad", "opl_nm", "sigma_nm", "time_s"] {
        assert!(text.contains(&format!("{array}: float64 (time 16)")), "{array}: {text}");
    }
}

#[test]
fn wavelengths_that_are_none_are_refused() {
    let mut volumes = volumes();
    let bench = bench(&volumes);
    for wrong in ["0", "-841", "nan", "inf"] {
        let line = format!("phase V.zarr --mask M.npy --wavelength-nm {wrong} -o C.csv");
        bench.run(&line).refused(2, &["--wavelength-nm", "above 0"]);
    }
    for (n, wrong) in [json!("red"), json!(0), json!([841])].into_iter().enumerate() {
        volumes.attributes["wavelength_nm"] = wrong;
        let name = format!("W{n}.zarr");
        volumes.save(&bench.path(&name));
        let line = format!("phase {name} --mask M.npy -o C.csv");
        bench.run(&line).refused(1, &[&name, "wavelength_nm", "--wavelength-nm"]);
        let _ = bench.succeed(&format!("{line} --wavelength-nm 841"));
    }
}

// ---- phasors -------------------------------------------------------------------------------

/// The curve is that of a cross-spectrum whose pixels all have the modulus 1; with the paper's
/// weights nothing else changes.
#[test]
fn phasors_are_averaged_in_curves() {
    let volumes = volumes();
    let bench = bench(&volumes);
    let (layers, mask) = (volumes.recording.layers(), mask_of(|x| x < EDGE));
    let pairs = oracle::mask_mean_of(FRAMES, &mask, |t, lag| phasors(&layers, t, lag));
    let curve = |rest: &str| {
        let method = if rest.contains("--method") { "" } else { "--method paper" };
        let _ = bench.succeed(&format!("phase V.zarr --mask M.npy {method} {rest} -o C.csv"));
        column(&bench, "C.csv", 2)
    };
    let phasor = curve("--ensemble phasor");
    assert_close(&phasor, &solved(&pairs, (EDGE * HEIGHT) as f64), ORACLE_RAD);
    let field = curve("--ensemble field");
    assert_eq!(field, curve(""), "field is the default");
    assert!(field.iter().zip(&phasor).any(|(a, b)| (a - b).abs() > 10.0 * ORACLE_RAD));
    // Weights stay: those of Fisher use the coherence of C.
    let sigma = |rest: &str| {
        let _ = bench.succeed(&format!("phase V.zarr --method paper --mask M.npy {rest} -o C.csv"));
        column(&bench, "C.csv", 3)
    };
    assert_eq!(sigma("--weights fisher"), sigma("--weights fisher --ensemble phasor"));

    let step = |t: usize| pairs.phase[pairs.index(t - 1, 1).unwrap()];
    let walked: Vec<f64> = (1..FRAMES).map(|t| -(1..=t).map(step).sum::<f64>()).collect();
    assert_close(&differences(&curve("--method one-step --ensemble phasor")), &walked, DOUBLE_RAD);
    let direct = curve("--method direct --reference-frame 0 --ensemble phasor");
    for (t, got) in differences(&direct).iter().enumerate() {
        let turns = (got + pairs.phase[pairs.index(0, t + 1).unwrap()]) / (2.0 * PI);
        assert!((turns - turns.round()).abs() < DOUBLE_RAD, "frame {}: {got}", t + 1);
    }
}

/// phi(t) - phi(0) for t = 1, 2, ...
fn differences(phase: &[f64]) -> Vec<f64> {
    phase[1..].iter().map(|value| value - phase[0]).collect()
}

#[test]
fn phasors_are_averaged_in_images() {
    let volumes = volumes();
    let bench = bench(&volumes);
    let layers = volumes.recording.layers();
    let pairs =
        oracle::gaussian_mean_of(FRAMES, HEIGHT, WIDTH, 2.0, |t, lag| phasors(&layers, t, lag));
    let looks = oracle::gaussian_looks(2.0);
    let expected = oracle::images_from_pairs(&pairs, FRAMES - 1, oracle::Weighting::Paper, looks);
    let line =
        "phase V.zarr --method paper --gaussian 2 --precision f64 --ensemble phasor -o P.npy";
    let _ = bench.succeed(line);
    let (_, images) = npy::load_f32(&bench.path("P.npy"));
    let mut compared = 0;
    for (n, (&got, &expected_phase)) in images.iter().zip(&expected.phase).enumerate() {
        if expected.margin[n % PIXELS] < TIE_RAD {
            continue;
        }
        compared += 1;
        let got = f64::from(got);
        assert!((got - expected_phase).abs() < ORACLE_RAD, "{n}: {got} not {expected_phase}");
    }
    assert!(compared > images.len() / 2, "{compared} of {}", images.len());
    // The methods without weights average phasors as well.
    let direct = "phase V.zarr --gaussian 2 --precision f64 --method direct --reference-frame 0";
    let _ = bench.succeed(&format!("{direct} --ensemble phasor -o D.npy"));
    let (_, images) = npy::load_f32(&bench.path("D.npy"));
    for (pixel, pairs) in pairs.iter().enumerate() {
        for t in 1..FRAMES {
            let got = f64::from(images[t * PIXELS + pixel] - images[pixel]);
            let expected = -pairs.phase[pairs.index(0, t).unwrap()];
            assert!((got - expected).abs() < ORACLE_RAD, "{pixel}, frame {t}: {got}, {expected}");
        }
    }
}

// ---- figures -------------------------------------------------------------------------------

/// How often each text stands in a figure.
#[track_caller]
fn assert_counts(svg: &str, counts: &[(&str, usize)]) {
    for (text, count) in counts {
        assert_eq!(svg.matches(text).count(), *count, "{text}");
    }
}

#[test]
fn a_curve_is_drawn_with_the_direct_difference_beside_it() {
    let mut volumes = volumes();
    volumes.lose(&BAD);
    let bench = bench(&volumes);
    let _ = bench.succeed("phase V.zarr --mask M.npy --control R.npy -o A.csv");
    let line = "phase V.zarr --mask M.npy --control R.npy --figure F.svg -o C.csv";
    assert_eq!(bench.summary(line)["files"], json!(["C.csv", "F.svg"]));
    assert_eq!(fs::read(bench.path("A.csv")).unwrap(), fs::read(bench.path("C.csv")).unwrap());
    let svg = fs::read_to_string(bench.path("F.svg")).unwrap();
    assert_counts(
        &svg,
        &[
            ("linked phases", 1),
            ("direct difference", 1),
            ("stimulus", 1),
            ("time / s", 1),
            ("phase / rad", 1),
            ("optical path length / nm", 1),
            ("V.zarr: 308 pixels less 220 of the control", 1),
        ],
    );
    let _ = bench.succeed("phase V.zarr --mask M.npy --method direct --figure F.png -o C.csv");
    assert!(fs::read(bench.path("F.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn images_are_drawn_as_the_papers_figure_has_them() {
    let mut volumes = volumes();
    volumes.lose(&BAD);
    let bench = bench(&volumes);
    let _ = bench.succeed("phase V.zarr --gaussian 2 -o A.npy");
    let _ = bench.succeed("phase V.zarr --gaussian 2 --figure F.svg -o P.npy");
    assert_eq!(fs::read(bench.path("A.npy")).unwrap(), fs::read(bench.path("P.npy")).unwrap());
    let svg = fs::read_to_string(bench.path("F.svg")).unwrap();
    // Seven columns of four rows, and two colour bars.
    assert_counts(&svg, &[("<image", 30), (">20 \u{b5}m<", 28), (">t = 0.0 s<", 1), (">u<", 1)]);
    for name in ["linked phases", "direct difference", "speckle amplitude"] {
        assert_counts(&svg, &[(&format!(">{name}<"), 1)]);
    }

    let line = "phase V.zarr --gaussian 2 --method direct --at 0,7,15 --figure F.svg -o P.npy";
    let _ = bench.succeed(line);
    let svg = fs::read_to_string(bench.path("F.svg")).unwrap();
    assert_counts(&svg, &[("<image", 7), ("Knox", 0), (">t = \u{2212}1.0 s<", 1)]);

    volumes.recording.save(&bench.path("V.npy"));
    let line = "phase V.npy --layers 3..4,1..1 --gaussian 2 --at 7,15 --figure F.svg -o P.npy";
    let _ = bench.succeed(line);
    let svg = fs::read_to_string(bench.path("F.svg")).unwrap();
    assert_counts(&svg, &[("<image", 10), (">frame 7<", 1), (">frame 15<", 1), ("\u{b5}m", 0)]);
    let _ = bench.succeed("phase V.zarr --gaussian 2 --reference-frame 3 --figure F.png -o P.npy");
    assert!(fs::read(bench.path("F.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn figures_that_cannot_be_are_refused() {
    let mut volumes = volumes();
    volumes.lose(&BAD);
    let bench = bench(&volumes);
    let before = bench.names();
    for (rest, status, words) in [
        ("--mask M.npy --figure F.gif -o C.csv", 2, ["--figure F.gif", ".png or .svg"]),
        ("--mask M.npy --figure F -o C.csv", 2, ["--figure F", ".png or .svg"]),
        ("--mask M.npy --figure missing/F.png -o C.csv", 1, ["missing", "does not exist"]),
        ("--gaussian 2 --figure missing/F.png -o P.npy", 1, ["missing", "does not exist"]),
        ("--gaussian 2 --figure F.png --at 16 -o P.npy", 2, ["--at 16", "0 ..= 15"]),
        ("--gaussian 2 --figure F.png --at 3,9 -o P.npy", 2, ["--at 9", "bad sweep"]),
        ("--gaussian 2 --at 3 -o P.npy", 2, ["--at", "--figure"]),
        ("--mask M.npy --figure F.png --at 3 -o C.csv", 2, ["--at", "--gaussian"]),
        ("--gaussian 2 --figure F.png --at 3, -o P.npy", 2, ["--at", "--help"]),
        (
            "--gaussian 2 --figure F.png --at 0,1,3,4,5,6,7,8,11,12,13,14,15 -o P.npy",
            2,
            ["13", "12"],
        ),
        ("--mask M.npy --reference-frame 3 -o C.csv", 2, ["--reference-frame", "--figure"]),
    ] {
        bench.run(&format!("phase V.zarr {rest}")).refused(status, &words);
        assert_eq!(bench.names(), before, "{rest}: nothing may be left behind");
    }
    volumes.attributes["pixel_pitch_um"] = json!("small");
    let line = "phase V.zarr --gaussian 2 --figure F.png -o P.npy";
    self::bench(&volumes).run(line).refused(1, &["V.zarr", "pixel_pitch_um"]);
}

#[test]
fn help_names_the_options_of_volumes() {
    let help = Bench::new().succeed("phase --help").stdout;
    for word in ["--control", "--ensemble", "--wavelength-nm", "--figure", "--at", "sweep_ok"] {
        assert!(help.contains(word), "{word}");
    }
}

/// What is kept with a result says how it came about.
#[test]
fn the_summary_says_how() {
    let mut volumes = volumes();
    volumes.lose(&[3]);
    let bench = bench(&volumes);
    let summary =
        bench.summary("phase V.zarr --method paper --gaussian 2 --ensemble phasor -o P.zarr");
    let expected = [
        ("ensemble", json!("phasor")),
        ("layers", json!("3..4,1..1")),
        ("frames_left_out", json!([3])),
        ("wavelength_nm", json!(WAVELENGTH_NM)),
        ("method", json!("paper")),
    ];
    let kept = fs::read_to_string(bench.path("P.zarr/zarr.json")).unwrap();
    let kept: Value = serde_json::from_str(&kept).unwrap();
    for (key, value) in expected {
        assert_eq!(summary[key], value, "{key}");
        assert_eq!(kept["attributes"][key], value, "{key}");
    }
}
