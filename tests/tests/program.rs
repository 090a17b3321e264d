//! The program as a user drives it: what it writes, what it says, and how it refuses.

use num_complex::Complex32;
use phasewalk::io::Shape;
use phasewalk_tests::npy;
use phasewalk_tests::program::{Bench, Ran, phasewalk};
use phasewalk_tests::recording::Recording;
use serde_json::Value;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const FRAMES: usize = 12;
const HEIGHT: usize = 14;
const WIDTH: usize = 18;

fn recording() -> Recording {
    let shape = Shape { frames: FRAMES, depth: 1, height: HEIGHT, width: WIDTH };
    Recording::moving(shape, 0.95, 1)
}

/// A folder with a good series `F.npy`, a good mask `M.npy` and a volume `V.npy` of four depths.
fn bench() -> Bench {
    let bench = Bench::new();
    recording().save(&bench.path("F.npy"));
    npy::save_mask(&bench.path("M.npy"), &[HEIGHT, WIDTH], &[true; HEIGHT * WIDTH]);
    let shape = Shape { frames: FRAMES, depth: 4, height: HEIGHT, width: WIDTH };
    Recording::moving(shape, 0.95, 2).save(&bench.path("V.npy"));
    bench
}

/// Run, see it refused, and see that the folder is as it was.
fn refuse(bench: &Bench, line: &str, status: i32, words: &[&str]) {
    let before = bench.names();
    bench.run(line).refused(status, words);
    assert_eq!(bench.names(), before, "{line}: nothing may be left behind");
}

// ---- what it writes ------------------------------------------------------------------------

#[test]
fn from_scene_to_curve_and_images() {
    let bench = Bench::new();
    let scene = "simulate speckle --width 40 --height 24 --frames 12 --scatterers 10 -o F.npy";
    let _ = bench.succeed(scene);
    assert_eq!(bench.names(), ["F.mask.npy", "F.npy", "F.phase.npy"]);
    let (shape, _) = npy::load_complex(&bench.path("F.npy"));
    assert_eq!(shape, [12, 24, 40]);
    let (shape, truth) = npy::load_f64(&bench.path("F.phase.npy"));
    assert_eq!((shape, truth[4]), (vec![12], 0.0));

    let _ = bench.succeed("phase F.npy --mask F.mask.npy -o C.csv");
    let table = fs::read_to_string(bench.path("C.csv")).unwrap();
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("frame,time_s,phase_rad,sigma_rad,quality"));
    for (t, line) in lines.clone().enumerate() {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(&fields[..2], [t.to_string(), format!("{t}.0")]);
        assert!(fields[2..].iter().all(|text| text.parse::<f64>().unwrap().is_finite()), "{line}");
        assert_eq!(fields.len(), 5);
    }
    assert_eq!(lines.count(), 12);

    let _ = bench.succeed("phase F.npy --gaussian 2 --sigma -o P.npy");
    for name in ["P.npy", "P.sigma.npy"] {
        let (shape, values) = npy::load_f32(&bench.path(name));
        assert_eq!(shape, [12, 24, 40]);
        assert!(values.iter().all(|value| value.is_finite()), "{name}");
    }
    let _ = bench.succeed("phase F.npy --gaussian 2 -o P.zarr");
    let _ = bench.succeed("phase F.npy --mask F.mask.npy -o C.zarr");
    let _ = bench.succeed("phase F.npy --mask F.mask.npy -o C.npy");
    let expected = [
        "C.csv",
        "C.npy",
        "C.quality.npy",
        "C.sigma.npy",
        "C.zarr",
        "F.mask.npy",
        "F.npy",
        "F.phase.npy",
        "P.npy",
        "P.sigma.npy",
        "P.zarr",
    ];
    assert_eq!(bench.names(), expected);
}

/// A Zarr series and mask go in as .npy ones do, and what comes out is the same.
#[test]
fn zarr_in_is_npy_in() {
    let bench = Bench::new();
    for name in ["F.npy", "F.zarr"] {
        let size = "--width 40 --height 24 --frames 12 --scatterers 10";
        let _ = bench.succeed(&format!("simulate speckle {size} -o {name}"));
    }
    let _ = bench.succeed("phase F.npy --mask F.mask.npy -o A.csv");
    let _ = bench.succeed("phase F.zarr --mask F.zarr -o B.csv");
    let table = |name: &str| fs::read_to_string(bench.path(name)).unwrap();
    let without_times = |text: String| -> Vec<String> {
        let keep = |line: &str| {
            line.split(',')
                .enumerate()
                .filter(|(i, _)| *i != 1)
                .map(|f| f.1.to_owned())
                .collect::<Vec<_>>()
                .join(",")
        };
        text.lines().map(keep).collect()
    };
    assert_eq!(without_times(table("A.csv")), without_times(table("B.csv")));
    let _ = bench.succeed("phase F.npy --gaussian 2 -o A.npy");
    let _ = bench.succeed("phase F.zarr --gaussian 2 -o B.npy");
    assert!(fs::read(bench.path("A.npy")).unwrap() == fs::read(bench.path("B.npy")).unwrap());
}

#[test]
fn the_summary_is_one_line_of_json() {
    let bench = bench();
    let summary = bench.summary("phase F.npy --method paper --mask M.npy -o C.csv");
    assert_eq!(summary["files"], Value::from(vec!["C.csv"]));
    assert_eq!((&summary["method"], &summary["max_lag"]), (&"paper".into(), &11.into()));
    assert_eq!(summary["pixels"], HEIGHT * WIDTH);
    let summary = bench.summary("phase F.npy --gaussian 2 -o P.npy");
    assert_eq!(summary["gaussian_px"], 2.0);
    let summary = bench.summary("simulate speckle --width 8 --height 8 --frames 2 -o S.npy");
    assert_eq!(summary["files"], Value::from(vec!["S.npy", "S.mask.npy", "S.phase.npy"]));
}

#[test]
fn info_says_what_a_file_holds() {
    let bench = bench();
    let text = bench.succeed("info F.npy").stdout;
    assert!(text.contains("complex64 (time 12, y 14, x 18)"), "{text}");
    let text = bench.succeed("info V.npy").stdout;
    assert!(text.contains("complex64 (time 12, z 4, y 14, x 18)"), "{text}");
    let summary = bench.summary("info M.npy");
    assert_eq!(summary["arrays"][0]["data_type"], "bool");
    refuse(&bench, "info nothing.npy", 1, &["nothing.npy", "no such file"]);
}

#[test]
fn help_names_commands_and_options() {
    let bench = Bench::new();
    for (line, words) in [
        ("--help", ["simulate", "phase", "info", "demo"]),
        ("phase --help", ["--mask", "--gaussian", "--max-lag", "--layers"]),
        ("simulate speckle --help", ["--width", "--sigma", "--seed", "--output"]),
        ("--version", ["phasewalk", "0", ".", "1"]),
    ] {
        let ran = bench.succeed(line);
        for word in words {
            assert!(ran.stdout.contains(word), "{line}: {word}");
        }
    }
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let bench = bench();
    for (threads, name) in [(1, "A"), (2, "B")] {
        let common = format!("--threads {threads} -o {name}");
        let _ = bench.succeed(&format!("phase F.npy --mask M.npy {common}.csv"));
        let _ = bench.succeed(&format!("phase F.npy --gaussian 2 --sigma {common}.npy"));
        let _ =
            bench.succeed(&format!("phase V.npy --layers 0..1,3..3 --gaussian 2 {common}V.npy"));
    }
    for suffix in [".csv", ".npy", ".sigma.npy", "V.npy"] {
        let bytes = |name: &str| fs::read(bench.path(&format!("{name}{suffix}"))).unwrap();
        assert!(bytes("A") == bytes("B"), "{suffix}");
    }
}

#[test]
fn pixels_that_cannot_be_used_do_not_end_the_run() {
    let bench = Bench::new();
    let mut recording = recording();
    recording.fill_pixel(3, Complex32::new(f32::NAN, 0.0));
    recording.fill_pixel(50, Complex32::new(0.0, f32::INFINITY));
    recording.fill_pixel(99, Complex32::default());
    recording.save(&bench.path("F.npy"));
    npy::save_mask(&bench.path("M.npy"), &[HEIGHT, WIDTH], &[true; HEIGHT * WIDTH]);
    let ran = bench.succeed("phase F.npy --gaussian 2 -o P.npy");
    assert!(ran.stdout.contains("2 not finite and 1 always zero"), "{ran:?}");
    let (_, phases) = npy::load_f32(&bench.path("P.npy"));
    assert_eq!(phases.iter().filter(|phase| phase.is_nan()).count(), 3 * FRAMES);
    let ran = bench.succeed("phase F.npy --mask M.npy -o C.csv");
    assert!(ran.stdout.contains("3 of the mask left out"), "{ran:?}");
    let table = fs::read_to_string(bench.path("C.csv")).unwrap();
    assert!(!table.to_lowercase().contains("nan"), "{table}");
}

/// A link as output stays a link, and an earlier result stays until the new one is whole.
#[test]
fn an_earlier_result_survives_a_failed_run() {
    let bench = bench();
    fs::write(bench.path("C.csv"), "earlier").unwrap();
    bench
        .run("phase F.npy --method paper --mask M.npy --max-lag 99 -o C.csv")
        .refused(2, &["--max-lag"]);
    assert_eq!(fs::read_to_string(bench.path("C.csv")).unwrap(), "earlier");
}

// ---- series that cannot be used ------------------------------------------------------------

#[test]
fn series_that_are_none_are_refused() {
    let bench = bench();
    let whole = fs::read(bench.path("F.npy")).unwrap();
    fs::write(bench.path("cut.npy"), &whole[..whole.len() - 7]).unwrap();
    fs::write(bench.path("head.npy"), &whole[..40]).unwrap();
    fs::write(bench.path("empty.npy"), "").unwrap();
    fs::write(bench.path("text.npy"), "frame,time_s\n0,1\n").unwrap();
    fs::write(bench.path("F.tif"), "II*").unwrap();
    npy::save_bytes(&bench.path("real.npy"), "<f4", &[2, 2, 2], &[0; 32]);
    npy::save_complex(&bench.path("flat.npy"), &[4, 4], &[Complex32::ONE; 16]);
    npy::save_complex(&bench.path("five.npy"), &[1, 2, 1, 2, 2], &[Complex32::ONE; 8]);
    npy::save_complex(&bench.path("none.npy"), &[0, 4, 4], &[]);
    npy::save_complex(&bench.path("one.npy"), &[1, 4, 4], &[Complex32::ONE; 16]);
    npy::save_complex(&bench.path("dark.npy"), &[2, 4, 4], &[Complex32::ZERO; 32]);
    npy::save_complex(&bench.path("nan.npy"), &[2, 4, 4], &[Complex32::new(f32::NAN, 0.0); 32]);
    for (name, word) in [
        ("missing.npy", "no such file"),
        ("missing.zarr", "no such file"),
        (".", "Zarr"),
        ("F.tif", "unknown kind"),
        ("cut.npy", "cut short"),
        ("head.npy", "damaged"),
        ("empty.npy", "empty"),
        ("text.npy", "not an .npy file"),
        ("real.npy", "float32"),
        ("flat.npy", "[4, 4]"),
        ("five.npy", "[1, 2, 1, 2, 2]"),
        ("none.npy", "empty"),
        ("one.npy", "at least 2"),
        ("dark.npy", "zero in all frames"),
        ("nan.npy", "not finite"),
    ] {
        refuse(&bench, &format!("phase {name} --gaussian 1 -o P.npy"), 1, &[word]);
        refuse(&bench, &format!("phase {name} --mask M.npy -o C.csv"), 1, &[]);
    }
}

/// What, where, what to do: every refusal of a file names the file.
#[test]
fn refusals_of_a_series_name_the_file() {
    let bench = bench();
    npy::save_complex(&bench.path("one.npy"), &[1, 14, 18], &[Complex32::ONE; 252]);
    npy::save_complex(&bench.path("dark.npy"), &[2, 14, 18], &[Complex32::ZERO; 504]);
    for name in ["one.npy", "dark.npy"] {
        refuse(&bench, &format!("phase {name} --gaussian 1 -o P.npy"), 1, &[name]);
        refuse(&bench, &format!("phase {name} --mask M.npy -o C.csv"), 1, &[name]);
    }
}

#[test]
fn masks_that_do_not_fit_are_refused() {
    let bench = bench();
    npy::save_mask(&bench.path("small.npy"), &[4, 4], &[true; 16]);
    npy::save_mask(&bench.path("turned.npy"), &[WIDTH, HEIGHT], &[true; HEIGHT * WIDTH]);
    npy::save_mask(&bench.path("nothing.npy"), &[HEIGHT, WIDTH], &[false; HEIGHT * WIDTH]);
    npy::save_bytes(&bench.path("real.npy"), "<f4", &[HEIGHT, WIDTH], &[1; 4 * HEIGHT * WIDTH]);
    for (name, word) in [
        ("missing.npy", "no such file"),
        ("small.npy", "[14, 18]"),
        ("turned.npy", "[14, 18]"),
        ("nothing.npy", "no pixel"),
        ("real.npy", "float32"),
        ("F.npy", "complex64"),
    ] {
        refuse(&bench, &format!("phase F.npy --mask {name} -o C.csv"), 1, &[name, word]);
    }
}

#[test]
fn a_mask_of_unusable_pixels_is_refused() {
    let bench = Bench::new();
    let mut recording = recording();
    recording.fill_pixel(3, Complex32::new(f32::NAN, 0.0));
    recording.save(&bench.path("F.npy"));
    let mask: Vec<bool> = (0..HEIGHT * WIDTH).map(|pixel| pixel == 3).collect();
    npy::save_mask(&bench.path("M.npy"), &[HEIGHT, WIDTH], &mask);
    refuse(&bench, "phase F.npy --mask M.npy -o C.csv", 1, &["1 pixel", "usable"]);
}

// ---- parameters out of range ---------------------------------------------------------------

#[test]
fn parameters_out_of_range_are_refused() {
    let bench = bench();
    for (line, word) in [
        ("F.npy --gaussian 0 -o P.npy", "--gaussian 0"),
        ("F.npy --gaussian -2 -o P.npy", "--gaussian -2"),
        ("F.npy --gaussian nan -o P.npy", "--gaussian"),
        ("F.npy --gaussian inf -o P.npy", "--gaussian"),
        ("F.npy --gaussian 18 -o P.npy", "as wide as the image"),
        ("F.npy --gaussian 1e300 -o P.npy", "as wide as the image"),
        ("F.npy --method paper --mask M.npy --max-lag 0 -o C.csv", "--max-lag 0"),
        ("F.npy --method paper --mask M.npy --max-lag 12 -o C.csv", "--max-lag 12"),
        ("F.npy --method paper --gaussian 1 --max-lag 12 -o P.npy", "--max-lag 12"),
        (
            "F.npy --mask M.npy --method direct --reference-frame 12 -o C.csv",
            "--reference-frame 12",
        ),
        ("F.npy --mask M.npy --method direct --max-lag 3 -o C.csv", "--max-lag"),
        ("F.npy --gaussian 1 --memory 0 -o P.npy", "--memory"),
        ("F.npy --mask M.npy --layers 0..1 -o C.csv", "--layers"),
        ("V.npy --mask M.npy -o C.csv", "--layers"),
        ("V.npy --mask M.npy --layers 0..4 -o C.csv", "--layers 0..4"),
        ("V.npy --mask M.npy --layers 2..1 -o C.csv", "--layers 2..1"),
        ("V.npy --gaussian 1 --layers 0..1,9..9 -o P.npy", "--layers 9..9"),
        ("F.npy --gaussian 1 -o P.csv", "P.csv"),
        ("F.npy --gaussian 1 -o P.tif", "P.tif"),
        ("F.npy --gaussian 1 -o P", "extension"),
        ("F.npy --gaussian 1 -o F.npy", "is the input"),
        ("F.npy --mask M.npy -o M.npy", "is the input"),
    ] {
        refuse(&bench, &format!("phase {line}"), 2, &[word]);
    }
    for (line, word) in [
        ("--width 0 -o S.npy", "--width 0"),
        ("--frames 1 -o S.npy", "--frames 1"),
        ("--sigma -1 -o S.npy", "--sigma -1"),
        ("--na 0 -o S.npy", "--na 0"),
        ("--width 65536 --height 65536 -o S.npy", "smaller"),
        ("-o S.csv", "S.csv"),
    ] {
        refuse(&bench, &format!("simulate speckle {line}"), 2, &[word]);
    }
}

#[test]
fn one_layer_of_a_flat_series_is_the_series() {
    let bench = bench();
    let _ = bench.succeed("phase F.npy --mask M.npy -o A.csv");
    let _ = bench.succeed("phase F.npy --mask M.npy --layers 0..0 -o B.csv");
    assert_eq!(fs::read(bench.path("A.csv")).unwrap(), fs::read(bench.path("B.csv")).unwrap());
}

/// What the parser of the command line refuses: it, too, in one line.
#[test]
fn words_that_cannot_be_understood_are_refused_in_one_line() {
    let bench = bench();
    for (line, word) in [
        ("phase F.npy -o C.csv", "--gaussian"),
        ("phase F.npy --mask M.npy --gaussian 2 -o P.npy", "--gaussian"),
        ("phase F.npy --mask M.npy", "--output"),
        ("phase --mask M.npy -o C.csv", "SERIES"),
        ("phase V.npy --mask M.npy --layers upper -o C.csv", "upper"),
        ("phase F.npy --method paper --mask M.npy --max-lag -1 -o C.csv", "-1"),
        ("phase F.npy --method paper --mask M.npy --max-lag many -o C.csv", "many"),
        ("phase F.npy --gaussian wide -o P.npy", "wide"),
        ("phase F.npy --mask M.npy --method best -o C.csv", "best"),
        ("phase F.npy --mask M.npy --looks 0 -o C.csv", "looks"),
        ("phase F.npy --mask M.npy --colour -o C.csv", "--colour"),
        ("phase F.npy --mask M.npy --threads 0 -o C.csv", "--threads"),
        ("simulate speckle --sigma 1/0 -o S.npy", "1/0"),
        ("dance", "dance"),
    ] {
        refuse(&bench, line, 2, &[word]);
    }
}

#[test]
fn unknown_vector_instructions_are_refused() {
    let bench = bench();
    let before = bench.names();
    let mut command = bench.command("phase F.npy --gaussian 1 -o P.npy");
    let output = command.env("PHASEWALK_SIMD", "sse9").output().unwrap();
    Ran::of("PHASEWALK_SIMD=sse9", &output).refused(2, &["PHASEWALK_SIMD=sse9", "portable"]);
    assert_eq!(bench.names(), before);
}

// ---- outputs that cannot be written --------------------------------------------------------

/// One run of each kind of output.
const RUNS: [&str; 6] = [
    "phase F.npy --mask M.npy -o OUT.csv",
    "phase F.npy --mask M.npy -o OUT.npy",
    "phase F.npy --mask M.npy -o OUT.zarr",
    "phase F.npy --gaussian 1 --sigma -o OUT.npy",
    "phase F.npy --gaussian 1 --sigma -o OUT.zarr",
    "simulate speckle --width 40 --height 40 --frames 9 --scatterers 2 -o OUT.npy",
];

#[test]
fn folders_that_are_none_are_refused() {
    let bench = bench();
    for run in RUNS {
        refuse(&bench, &run.replace("OUT", "missing/OUT"), 1, &["missing", "does not exist"]);
        refuse(&bench, &run.replace("OUT", "M.npy/OUT"), 1, &["M.npy", "not a folder"]);
    }
    fs::create_dir(bench.path("folder.npy")).unwrap();
    fs::create_dir(bench.path("folder.zarr")).unwrap();
    let line = "phase F.npy --gaussian 1 -o folder.npy";
    refuse(&bench, line, 1, &["folder.npy", "not an ordinary file"]);
    let line = "phase F.npy --gaussian 1 -o folder.zarr";
    refuse(&bench, line, 1, &["folder.zarr", "not a Zarr group"]);
}

/// Permissions do not bind root, who finds the file system read-only instead: both ways are one to
/// the program.
#[test]
fn folders_without_permission_are_refused() {
    let bench = bench();
    fs::create_dir(bench.path("locked")).unwrap();
    fs::set_permissions(bench.path("locked"), fs::Permissions::from_mode(0o555)).unwrap();
    let is_root = fs::write(bench.path("locked/probe"), "").is_ok();
    let target = if is_root { "/proc" } else { "locked" };
    for run in RUNS {
        let words: &[&str] = if is_root { &["/proc"] } else { &["locked", "no permission"] };
        refuse(&bench, &run.replace("OUT", &format!("{target}/OUT")), 1, words);
    }
}

/// A limit on the size of files, which binds root and users alike, stops the writing midway.
#[test]
fn writing_that_fails_midway_leaves_nothing() {
    let bench = bench();
    for run in RUNS.into_iter().filter(|run| !run.contains(".csv")) {
        // `ulimit -f 0` in blocks: not one byte fits; the signal is ignored, the write fails.
        let before = bench.names();
        let script = format!("trap '' XFSZ; ulimit -f 0; exec '{}' {run}", phasewalk().display());
        let output = shell(&bench, &script);
        Ran::of(run, &output).refused(1, &["OUT"]);
        assert_eq!(bench.names(), before, "{run}");
    }
}

/// A disk of 16 KiB, mounted in a name space of its own, which root and most users may make. Where the
/// machine forbids that (some containers), a limit on the size of files stands in for the disk.
#[test]
fn a_full_disk_is_named_and_leaves_nothing() {
    let bench = bench();
    fs::create_dir(bench.path("disk")).unwrap();
    let mount = "mount -t tmpfs -o size=16k tmpfs disk";
    let can_mount = in_name_space(&bench, mount).status.success();
    for run in [
        "phase F.npy --gaussian 1 --sigma --precision f64 -o disk/OUT.npy",
        "simulate speckle --width 64 --height 64 --frames 9 --scatterers 2 -o disk/OUT.npy",
        "simulate speckle --width 64 --height 64 --frames 9 --scatterers 2 -o disk/OUT.zarr",
    ] {
        let run_and_list = format!("'{}' {run}; s=$?; ls -A disk; exit $s", phasewalk().display());
        let (output, words) = if can_mount {
            let script = format!("{mount} && {run_and_list}");
            (in_name_space(&bench, &script), ["OUT", "the disk is full"])
        } else {
            let script = format!("trap '' XFSZ; ulimit -f 4; {run_and_list}");
            (shell(&bench, &script), ["OUT", "cannot be written"])
        };
        let ran = Ran::of(run, &output);
        ran.refused(1, &words);
        let left = ran.stdout.lines().filter(|line| line.contains("OUT")).count();
        assert_eq!(left, 0, "nothing may be left on the disk: {ran:?}");
    }
}

/// Run a script as the root of a new user and mount name space.
fn in_name_space(bench: &Bench, script: &str) -> std::process::Output {
    let mut command = Command::new("unshare");
    command.args(["--map-root-user", "--mount", "sh", "-c", script]);
    command.current_dir(bench.path("")).output().unwrap()
}

fn shell(bench: &Bench, script: &str) -> std::process::Output {
    let mut command = Command::new("sh");
    command.args(["-c", script]).current_dir(bench.path("")).output().unwrap()
}

// ---- interruption --------------------------------------------------------------------------

/// Start a long run, wait until its temporary file is there, and send it the signal.
fn interrupt(bench: &Bench, line: &str, signal: &str) {
    let before = bench.names();
    let mut command = bench.command(line);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for_partial(bench, &child, before.len());
    let id = child.id().to_string();
    assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    Ran::of(line, &output).refused(130, &["interrupted"]);
    assert_eq!(bench.names(), before, "{line}");
}

fn wait_for_partial(bench: &Bench, child: &Child, before: usize) {
    let start = Instant::now();
    while bench.names().len() == before {
        assert!(start.elapsed() < Duration::from_secs(60), "no file from {}", child.id());
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn interrupted_runs_leave_nothing() {
    let bench = Bench::new();
    let shape = Shape { frames: 40, depth: 1, height: 200, width: 300 };
    Recording::moving(shape, 0.95, 1).save(&bench.path("F.npy"));
    let simulate = "simulate speckle --width 640 --height 368 --frames 70";
    for line in [
        format!("{simulate} -o S.npy"),
        format!("{simulate} -o S.zarr"),
        "phase F.npy --gaussian 6 --sigma --precision f64 --threads 1 -o P.npy".to_owned(),
        "phase F.npy --gaussian 6 --sigma --precision f64 --threads 1 -o P.zarr".to_owned(),
    ] {
        interrupt(&bench, &line, "-INT");
        interrupt(&bench, &line, "-TERM");
    }
}

/// Standard output that has gone away is no failure.
#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let bench = bench();
    let script = format!("'{}' phase F.npy --mask M.npy -o C.csv | true", phasewalk().display());
    let output = shell(&bench, &script);
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    wait_until_there(&bench.path("C.csv"));
}

fn wait_until_there(path: &Path) {
    let start = Instant::now();
    while !path.exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "{}", path.display());
        std::thread::sleep(Duration::from_millis(5));
    }
}
