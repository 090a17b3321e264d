//! Raw sweeps to the phase curve: simulated recordings against their truth, interruption, and
//! recordings that are not as they should be.

use phasewalk_tests::npy;
use phasewalk_tests::oct::{Scores, compare, numbers, score};
use phasewalk_tests::program::{Bench, Ran, names_in};
use phasewalk_tests::rehearsed_board::RehearsedBoard;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

const SOURCE: &str = "--wavelength-nm 841 --bandwidth-nm 51";

/// A recording that is quick to make: the layers as always, a small field.
const SMALL: &str = "--preset easy --sweeps 10 --height 40 --width 64 --seed 3";

fn small() -> Bench {
    let bench = Bench::new();
    let _ = bench.succeed(&format!("simulate oct {SMALL} -o R"));
    bench
}

fn reconstruct(more: &str) -> String {
    format!("reconstruct R/run.cihx --images 256 {SOURCE} {more}")
}

// ---- against the truth ----------------------------------------------------------------------

/// What is asked of every recording; the plain reference reached a third of it or less.
fn check(scores: &Scores, curve_rad: f64) {
    assert!(scores.dispersion.iter().all(|e| *e < 0.5), "{scores:?}");
    assert!(scores.shift.iter().all(|e| *e < 0.1), "{scores:?}");
    assert!(scores.surfaces.iter().all(|e| *e < 0.25), "{scores:?}");
    assert!(scores.paper.rms < curve_rad, "{scores:?}");
    assert!(scores.direct.rms > scores.paper.rms, "the walk is better: {scores:?}");
    assert_eq!((&scores.bad_missed, &scores.good_lost), (&vec![], &vec![]), "{scores:?}");
    assert_eq!(scores.dead_pixels, [0, 0], "{scores:?}");
}

/// 1.3 times the curve's error of the plain reference.
#[test]
fn an_easy_recording() {
    check(&score(&Bench::new(), "--preset easy --seed 1", "--images 256"), 0.100);
}

/// Down-sweep, saturated, missing and short sweeps, dead pixels.
#[test]
fn a_faulty_recording() {
    let scores = score(&Bench::new(), "--preset faulty --seed 1", "--images 256 --sweep down");
    check(&scores, 0.140);
}

/// Saccades, a blink, torsion, Doppler, a camera that begins late: twice what is asked of the
/// medium recording.
#[test]
fn a_living_eye() {
    let scores = score(&Bench::new(), "--preset human --seed 1", "--images 256");
    let Scores { paper, shift, surfaces, .. } = scores;
    assert!(shift.iter().chain(&surfaces).all(|e| *e < 0.1), "{scores:?}");
    assert!(paper.rms < 2.0 * 0.170 && scores.direct.rms > paper.rms, "{scores:?}");
    assert_eq!((&scores.bad_missed, &scores.good_lost), (&vec![], &vec![]), "{scores:?}");
}

/// Whole volumes hold the same layers, and the phase without further options finds them.
#[test]
fn whole_volumes_give_the_same_curve() {
    let bench = small();
    let _ = bench.succeed(&reconstruct("--no-pictures -o V.zarr"));
    let near = compare(&bench);
    let shape = numbers(&bench.path("V.zarr/surface_isos_px")).0;
    assert_eq!(shape, [40, 64]);
    fs::remove_dir_all(bench.path("V.zarr")).unwrap();
    let _ = bench.succeed(&reconstruct("--full --no-pictures -o V.zarr"));
    let whole = compare(&bench);
    let text = fs::read_to_string(bench.path("V.zarr/field/zarr.json")).unwrap();
    let metadata: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(metadata["shape"], serde_json::json!([10, 128, 40, 64]));
    // The same samples, flattened at another depth: only the window of the FFT moves.
    assert!((near.paper.rms - whole.paper.rms).abs() < 0.01, "{near:?} {whole:?}");
}

#[test]
fn pictures_and_page_of_every_step() {
    let bench = small();
    let ran = bench.succeed(&reconstruct("-o V.zarr"));
    for words in ["10 of 10 sweeps used", "memory", "Gsamples/s", "wrote V.zarr and pictures"] {
        assert!(ran.stdout.contains(words), "{words}: {}", ran.stdout);
    }
    let names = names_in(&bench.path("V.steps"));
    let steps = ["dispersion", "enface", "layers", "motion", "source", "surfaces"];
    let mut expected: Vec<String> = steps.iter().map(|step| format!("{step}.png")).collect();
    expected.insert(4, "report.html".to_owned());
    assert_eq!(names, expected);
    let facts = bench.summary(&reconstruct("--no-pictures -o W.zarr"));
    assert_eq!(facts["sweeps_used"], 10);
    assert!(facts["memory_bytes"].as_u64().unwrap() > 1_000_000);
}

// ---- the same result ------------------------------------------------------------------------

/// All files below a folder with their bytes.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for name in names_in(&next) {
            let path = next.join(name);
            if path.is_dir() {
                folders.push(path);
            } else {
                let below = path.strip_prefix(folder).unwrap().to_owned();
                files.push((below, fs::read(&path).unwrap()));
            }
        }
    }
    files.sort();
    files
}

fn same(a: &Path, b: &Path) {
    let (a, b) = (contents(a), contents(b));
    let names = |files: &[(PathBuf, Vec<u8>)]| -> Vec<PathBuf> {
        files.iter().map(|(name, _)| name.clone()).collect()
    };
    assert_eq!(names(&a), names(&b));
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{} differs", name.display());
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let bench = small();
    let _ = bench.succeed(&reconstruct("--no-pictures --threads 1 -o A.zarr"));
    let _ = bench.succeed(&reconstruct("--no-pictures --threads 3 -o B.zarr"));
    same(&bench.path("A.zarr"), &bench.path("B.zarr"));
}

/// Run it, and send SIGINT after some time.
fn run_for(bench: &Bench, line: &str, time: Duration) -> Ran {
    let mut command = bench.command(line);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = command.spawn().expect("the program starts");
    std::thread::sleep(time);
    // It may have ended already.
    let _ = Command::new("kill").args(["-INT", &child.id().to_string()]).output();
    Ran::of(line, &child.wait_with_output().expect("it ends"))
}

/// Interrupted again and again, in both passes, it goes on where it was.
#[test]
fn interrupted_and_resumed_is_the_same() {
    let bench = Bench::new();
    let scene = "--preset medium --sweeps 12 --height 64 --width 96 --seed 5";
    let _ = bench.succeed(&format!("simulate oct {scene} -o R"));
    let _ = bench.succeed(&reconstruct("--no-pictures -o A.zarr"));
    let line = reconstruct("--no-pictures --resume -o B.zarr");
    let (mut interrupted, mut milliseconds) = (0, 150);
    while !bench.path("B.zarr").exists() {
        assert!(milliseconds < 60_000, "it never ends");
        let ran = run_for(&bench, &line, Duration::from_millis(milliseconds));
        if ran.status == Some(0) {
            break;
        }
        ran.refused(130, &["interrupted"]);
        interrupted += u32::from(ran.stderr.contains("--resume"));
        milliseconds += 130;
    }
    assert!(interrupted > 1, "it was quicker than {milliseconds} ms");
    same(&bench.path("A.zarr"), &bench.path("B.zarr"));
    assert_eq!(bench.names(), ["A.zarr", "B.zarr", "R"], "no debris");
}

#[test]
fn another_recording_is_not_resumed() {
    let bench = small();
    let line = reconstruct("--no-pictures -o V.zarr");
    let mut milliseconds = 100;
    while !run_for(&bench, &line, Duration::from_millis(milliseconds)).stderr.contains("--resume") {
        assert!(!bench.path("V.zarr").exists(), "it was quicker than {milliseconds} ms");
        assert!(milliseconds < 30_000, "nothing was kept");
        milliseconds += 50;
    }
    let other = line.replace("--images 256", "--images 256 --dispersion 1,2");
    bench.run(&format!("{other} --resume")).refused(2, &["--resume", "other settings"]);
    let _ = bench.succeed(&format!("{line} --resume"));
    assert_eq!(bench.names(), ["R", "V.zarr"]);
}

/// What an earlier run left is checked before it is gone on with.
#[test]
fn damaged_or_foreign_state_is_not_gone_on_with() {
    let bench = small();
    let line = reconstruct("--no-pictures -o V.zarr");
    let mut milliseconds = 100;
    while !bench.path(".V.zarr.unfinished/first-pass").exists() {
        assert!(milliseconds < 30_000, "nothing was kept");
        let _ = fs::remove_dir_all(bench.path("V.zarr"));
        let _ = run_for(&bench, &line, Duration::from_millis(milliseconds));
        milliseconds += 50;
    }
    let state = bench.path(".V.zarr.unfinished/first-pass");
    let kept = fs::read(&state).unwrap();
    let mut damaged = kept.clone();
    damaged[kept.len() / 2] ^= 1;
    fs::write(&state, damaged).unwrap();
    let resume = format!("{line} --resume");
    bench.run(&resume).refused(1, &[".V.zarr.unfinished", "damaged", "--resume"]);
    fs::write(&state, kept).unwrap();
    let header = fs::read(bench.path("R/run.cihx")).unwrap();
    fs::write(bench.path("R/run.cihx"), header).unwrap();
    bench.run(&resume).refused(2, &["--resume", "another recording"]);
    let _ = bench.succeed(&line);
    bench.run(&resume).refused(2, &["--resume", "V.zarr is finished"]);
    assert_eq!(bench.names(), ["R", "V.zarr"]);
}

// ---- bad recordings -------------------------------------------------------------------------

/// A camera's recording is not simulated over.
#[test]
fn a_camera_recording_is_not_replaced() {
    let bench = small();
    fs::remove_dir_all(bench.path("R/truth.zarr")).unwrap();
    let before = fs::read(bench.path("R/run.cihx")).unwrap();
    refuse(&bench, "simulate oct --sweeps 6 -o R", 1, &["R", "truth.zarr", "another name"]);
    assert_eq!(fs::read(bench.path("R/run.cihx")).unwrap(), before);
}

/// Refused with one line, and nothing left behind.
fn refuse(bench: &Bench, line: &str, status: i32, words: &[&str]) {
    let before = bench.names();
    bench.run(line).refused(status, words);
    assert_eq!(bench.names(), before, "{line}");
}

#[test]
fn what_is_missing_is_named() {
    let bench = small();
    let out = "-o V.zarr";
    refuse(&bench, &format!("reconstruct R/run.cihx {SOURCE} {out}"), 2, &["--images"]);
    refuse(&bench, &format!("reconstruct R/run.cihx --images 256 {out}"), 2, &["--wavelength-nm"]);
    refuse(&bench, &reconstruct("-o V.npy"), 2, &["-o", ".zarr"]);
    refuse(&bench, &reconstruct("-o R"), 2, &["R"]);
    let absurd = reconstruct(out).replace("--bandwidth-nm 51", "--bandwidth-nm 900");
    refuse(&bench, &absurd, 2, &["--bandwidth-nm"]);
    let beyond = reconstruct("--stimulus-sweep 10 -o V.zarr");
    refuse(&bench, &beyond, 2, &["--stimulus-sweep 10", "0..9"]);
    refuse(&bench, &reconstruct("--mirror R/mask.npy -o V.zarr"), 2, &["--mirror", "spectra"]);
    let images = "reconstruct R/mask.npy --images 256 -o V.zarr";
    refuse(&bench, images, 2, &["--images", "camera recordings"]);
    fs::write(bench.path("V.steps"), "").unwrap();
    refuse(&bench, &reconstruct(out), 1, &["V.steps", "is a file"]);
    fs::remove_file(bench.path("V.steps")).unwrap();
    let nothing = reconstruct(out).replace("R/run.cihx", "R/no.cihx");
    refuse(&bench, &nothing, 1, &["no.cihx", "no such file"]);
    refuse(&bench, &format!("reconstruct R/mask.npy {out}"), 1, &["mask.npy"]);
}

#[test]
fn a_wrong_number_of_images_is_told() {
    let bench = small();
    for wrong in ["128", "255", "300"] {
        let line = reconstruct("-o V.zarr").replace("--images 256", &format!("--images {wrong}"));
        refuse(&bench, &line, 1, &["run.cihx", "--images"]);
    }
}

#[test]
fn files_that_are_cut_or_do_not_fit_are_refused() {
    let bench = small();
    let counts = fs::read(bench.path("R/run.mraw")).unwrap();
    fs::write(bench.path("R/run.mraw"), &counts[..counts.len() / 2 + 100]).unwrap();
    refuse(&bench, &reconstruct("-o V.zarr"), 1, &["run.mraw", "1280"]);
    fs::write(bench.path("R/run.mraw"), []).unwrap();
    refuse(&bench, &reconstruct("-o V.zarr"), 1, &["run.mraw"]);
    fs::remove_file(bench.path("R/run.mraw")).unwrap();
    refuse(&bench, &reconstruct("-o V.zarr"), 1, &["run.mraw"]);
}

/// Nothing to see: each is refused with its reason.
#[test]
fn dark_saturated_and_empty_recordings_are_refused() {
    let bench = small();
    let length = fs::metadata(bench.path("R/run.mraw")).unwrap().len() as usize;
    fs::write(bench.path("R/run.mraw"), vec![0; length]).unwrap();
    refuse(&bench, &reconstruct("-o V.zarr"), 1, &["run.cihx", "no light"]);
    fs::write(bench.path("R/run.mraw"), vec![255; length]).unwrap();
    refuse(&bench, &reconstruct("-o V.zarr"), 1, &["run.cihx", "saturated"]);
}

/// Light without a sample: no layers, no dispersion.
#[test]
fn a_recording_without_a_retina_is_refused() {
    let bench = Bench::new();
    let scene = format!("{SMALL} --set isos_fringe_dn=0 --set fixed_fringe_brightness=0");
    let _ = bench.succeed(&format!("simulate oct {scene} -o R"));
    let ran = bench.run(&reconstruct("--no-pictures -o V.zarr"));
    ran.refused(1, &["run.cihx"]);
    assert_eq!(bench.names(), ["R"], "{ran:?}");
}

/// A sweep that was lost at the end, as when the camera's memory was full.
#[test]
fn a_recording_that_ends_early_keeps_its_sweeps() {
    let bench = Bench::new();
    let scene = format!("{SMALL} --set short_sweeps=1");
    let _ = bench.succeed(&format!("simulate oct {scene} -o R"));
    let facts = bench.summary(&reconstruct("--no-pictures -o V.zarr"));
    let verdicts: Vec<String> = serde_json::from_value(facts["verdicts"].clone()).unwrap();
    assert_eq!(verdicts.iter().filter(|v| v.starts_with("short: 37 of 256")).count(), 1);
    assert_eq!((verdicts.len(), facts["sweeps_used"].as_u64()), (10, Some(9)));
    let curve = "phase V.zarr --mask R/mask.npy -o C.csv";
    let _ = bench.succeed(curve);
    let table = fs::read_to_string(bench.path("C.csv")).unwrap();
    assert_eq!(table.lines().filter(|line| line.contains("nan")).count(), 1, "{table}");
    assert!(table.starts_with("frame,time_s,phase_rad,sigma_rad,opl_nm,sigma_nm"), "{table}");
}

// ---- run log --------------------------------------------------------------------------------

/// The times of a run go with the volumes; a run of another length is refused.
#[test]
fn a_run_log_gives_the_times() {
    let (bench, board) = (small(), RehearsedBoard::default());
    let plan = |volumes: usize| {
        format!("paper --set volumes={volumes} --set interval=25ms --set stimulus.volume=2")
    };
    let run = |volumes: usize, log: &str| {
        let line = format!("trigger run {} --port {} --log {log} --yes", plan(volumes), board.port);
        let ran = bench.run(&line);
        assert_eq!(ran.status, Some(0), "{ran:?}");
    };
    run(10, "ten.ndjson");
    run(8, "eight.ndjson");
    refuse(
        &bench,
        &reconstruct("--run-log eight.ndjson -o V.zarr"),
        1,
        &["run log", "8 sweeps", "10"],
    );
    let noted = "--run-log ten.ndjson --pixel-pitch-um 4.06 --no-pictures -o V.zarr";
    let _ = bench.succeed(&reconstruct(noted));
    let (shape, times) = numbers(&bench.path("V.zarr/time_s"));
    assert_eq!(shape, [10]);
    assert!(times.windows(2).all(|pair| (pair[1] - pair[0] - 0.025).abs() < 1e-4), "{times:?}");
    let group = fs::read_to_string(bench.path("V.zarr/zarr.json")).unwrap();
    let group: Value = serde_json::from_str(&group).unwrap();
    assert_eq!(group["attributes"]["pixel_pitch_um"], 4.06);
    let began = group["attributes"]["stimulus_s"].as_f64().unwrap();
    assert!((times[2] - 0.005..times[3]).contains(&began), "{began} s of {times:?}");
    let _ = bench.succeed("phase V.zarr --mask R/mask.npy -o C.csv");
    let (_, truth) = npy::load_f64(&bench.path("R/phase.npy"));
    assert_eq!(fs::read_to_string(bench.path("C.csv")).unwrap().lines().count(), truth.len() + 1);
}

/// A camera that begins late and a fringe that repeats every 8 images: neither 8 nor another number
/// passes for a sweep.
#[test]
fn fringes_within_a_sweep_are_no_period() {
    let bench = Bench::new();
    let scene =
        "--preset human --sweeps 16 --height 40 --width 64 --seed 2 --set start_jitter_images=1";
    let _ = bench.succeed(&format!("simulate oct {scene} -o R"));
    for wrong in ["128", "512"] {
        let line = reconstruct("-o V.zarr").replace("--images 256", &format!("--images {wrong}"));
        refuse(&bench, &line, 1, &["every 256", &format!("not every {wrong}")]);
    }
    let facts = bench.summary(&reconstruct("--no-pictures -o V.zarr"));
    assert_eq!(facts["sweeps"], 16);
}
