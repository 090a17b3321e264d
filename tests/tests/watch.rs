//! `phasewalk watch` as a user drives it: frames through a pipe and from files that grow, what it writes while they
//! come, and how it ends.

use num_complex::Complex32;
use phasewalk::io::Shape;
use phasewalk_tests::npy;
use phasewalk_tests::program::{Bench, Ran};
use phasewalk_tests::recording::Recording;
use phasewalk_tests::tolerance::{EXACT_TIE_RAD, SINGLE_STORED_RAD};
use serde_json::{Value, json};
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use zarrs::array::{Array, ArrayBuilder, FillValue, data_type};
use zarrs::filesystem::FilesystemStore;
use zarrs::group::GroupBuilder;

const FRAMES: usize = 24;
const HEIGHT: usize = 14;
const WIDTH: usize = 18;
const PIXELS: usize = HEIGHT * WIDTH;

fn recording() -> Recording {
    let shape = Shape { frames: FRAMES, depth: 1, height: HEIGHT, width: WIDTH };
    Recording::moving(shape, 0.95, 1)
}

/// A folder with a series `F.npy`, a mask `M.npy`, and the same frames for a pipe in `F.raw`.
fn bench_of(recording: &Recording) -> Bench {
    let bench = Bench::new();
    recording.save(&bench.path("F.npy"));
    npy::save_mask(&bench.path("M.npy"), &[HEIGHT, WIDTH], &[true; PIXELS]);
    let mut raw = header().into_bytes();
    raw.extend(bytes(&recording.field));
    fs::write(bench.path("F.raw"), raw).unwrap();
    bench
}

fn bench() -> Bench {
    bench_of(&recording())
}

fn header() -> String {
    let line = json!({
        "format": "phasewalk-frames/1", "height": HEIGHT, "width": WIDTH, "dtype": "complex64",
    });
    format!("{line}\n")
}

fn bytes(field: &[Complex32]) -> Vec<u8> {
    field.iter().flat_map(|u| [u.re.to_le_bytes(), u.im.to_le_bytes()]).flatten().collect()
}

/// Run with the file on standard input.
fn piped(bench: &Bench, line: &str, input: &str) -> Ran {
    let input = File::open(bench.path(input)).unwrap();
    Ran::of(line, &bench.command(line).stdin(input).output().unwrap())
}

fn start(bench: &Bench, line: &str) -> Child {
    let mut command = bench.command(line);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// Wait until it is so.
fn wait(what: &str, mut is_so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < Duration::from_secs(60), "in vain: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn lines(path: &Path) -> usize {
    fs::read_to_string(path).map_or(0, |text| text.lines().count())
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance || a == b || (a.is_nan() && b.is_nan())
}

/// Both tables have the same frames and phases.
fn same_phases(bench: &Bench, [one, other]: [&str; 2], tolerance: f64) {
    let ([a, b], phase) = ([one, other].map(|name| bench.table(name).1), 2);
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(&b) {
        assert_eq!(a[0], b[0], "{one}, {other}");
        assert!(close(a[phase], b[phase], tolerance), "{one}: {a:?}, {other}: {b:?}");
    }
}

// ---- curves --------------------------------------------------------------------------------

#[test]
fn a_curve_through_a_pipe() {
    let bench = bench();
    let ran = piped(&bench, "watch - --mask M.npy --follow -o C.csv", "F.raw").succeeded();
    let (header, rows) = bench.table("C.csv");
    assert_eq!((header.as_str(), rows.len()), ("frame,time_s,phase_rad,sigma_rad,quality", FRAMES));
    let followed: Vec<&str> = ran.stdout.lines().collect();
    assert!(followed[0].contains("MB of memory, whatever the number of frames"), "{ran:?}");
    assert!(followed[2 + FRAMES].starts_with("24 frames, 252 pixels; "), "{ran:?}");
    for (line, row) in followed[2..].iter().zip(&rows) {
        let numbers: Vec<f64> = line.split_whitespace().map(|n| n.parse().unwrap()).collect();
        assert!(close(numbers[2], row[2], 6e-5) && numbers[0] == row[0], "{line} {row:?}");
    }
    // What the phase does on the way is what the batch finds afterwards, within a few of its standard deviations.
    let _ = bench.succeed("phase F.npy --mask M.npy -o B.csv");
    for (newest, batch) in rows.iter().zip(bench.table("B.csv").1).skip(5) {
        assert!((newest[2] - batch[2]).abs() < 4.0 * newest[3], "{newest:?} {batch:?}");
    }
}

#[test]
fn lines_of_json() {
    let bench = bench();
    let line =
        "watch - --mask M.npy --wavelength-nm 841 --interval 0.5 --follow --json -o C.ndjson";
    let ran = piped(&bench, line, "F.raw").succeeded();
    let file = fs::read_to_string(bench.path("C.ndjson")).unwrap();
    let (rows, summary) = ran.stdout.split_at(file.len());
    assert_eq!(rows, file);
    let summary: Value = serde_json::from_str(summary).unwrap();
    assert_eq!((&summary["frames"], &summary["ended"]), (&json!(FRAMES), &json!("end")));
    assert!(summary["frames_per_second"].as_f64().unwrap() > 0.0, "{summary}");
    let row: Value = serde_json::from_str(file.lines().nth(7).unwrap()).unwrap();
    assert_eq!((&row["frame"], &row["time_s"]), (&json!(7), &json!(3.5)));
    let [phase, path] = ["phase_rad", "opl_nm"].map(|key| row[key].as_f64().unwrap());
    assert!((path / phase - 841.0 / (4.0 * std::f64::consts::PI)).abs() < 1e-9, "{row}");
}

/// The smoothed curve of a history is that of the series as a whole.
#[test]
fn a_history_is_the_batch() {
    let bench = bench();
    for lag in [1, 4, 16, 23] {
        let watch =
            format!("watch - --mask M.npy --method paper --max-lag {lag} --history -o C.csv");
        let ran = piped(&bench, &watch, "F.raw").succeeded();
        assert!(ran.stdout.contains("bytes for every frame"), "{ran:?}");
        let _ = bench
            .succeed(&format!("phase F.npy --mask M.npy --method paper --max-lag {lag} -o B.csv"));
        same_phases(&bench, ["C.smoothed.csv", "B.csv"], EXACT_TIE_RAD);
        // The newest frame has none after it: smoothed or not is the same.
        let [newest, batch] = ["C.csv", "B.csv"].map(|name| bench.table(name).1[FRAMES - 1][2]);
        assert!((newest - batch).abs() < 1e-7, "lag {lag}: {newest} {batch}");
    }
}

/// On the way every point is the last one of a batch that ends there.
#[test]
fn the_newest_point_is_the_last_of_a_batch() {
    let bench = bench();
    let _ = piped(&bench, "watch - --mask M.npy --method paper --max-lag 4 -o C.csv", "F.raw");
    let (rows, field) = (bench.table("C.csv").1, recording().field);
    for frames in [6, 11, 19] {
        let shape = [frames, HEIGHT, WIDTH];
        npy::save_complex(&bench.path("P.npy"), &shape, &field[..frames * PIXELS]);
        let _ = bench.succeed("phase P.npy --mask M.npy --method paper --max-lag 4 -o P.csv");
        let last = &bench.table("P.csv").1[frames - 1];
        assert!((rows[frames - 1][2] - last[2]).abs() < 1e-7, "{frames}: {last:?}");
    }
}

#[test]
fn linked_frames_are_smoothed_when_they_leave_the_window() {
    let bench = bench();
    let _ = piped(&bench, "watch - --mask M.npy --history -o C.csv", "F.raw").succeeded();
    let (newest, smoothed) = (bench.table("C.csv").1, bench.table("C.smoothed.csv").1);
    assert_eq!(smoothed.len(), FRAMES);
    let _ = bench.succeed("phase F.npy --mask M.npy -o B.csv");
    let batch = bench.table("B.csv").1;
    let off = |rows: &[Vec<f64>]| -> f64 {
        rows.iter().zip(&batch).map(|(a, b)| (a[2] - b[2]).powi(2)).sum::<f64>()
    };
    assert!(off(&smoothed) < off(&newest), "{} {}", off(&smoothed), off(&newest));
}

#[test]
fn frames_without_numbers_are_left_out_and_told() {
    let mut recording = recording();
    recording.image_mut(0, 0).fill(Complex32::default());
    recording.image_mut(9, 0).fill(Complex32::new(f32::NAN, 0.0));
    let bench = bench_of(&recording);
    for method in ["linked", "paper"] {
        let line = format!("watch - --mask M.npy --method {method} -o C.csv");
        let ran = piped(&bench, &line, "F.raw").succeeded();
        assert!(ran.stdout.contains("2 of 24 frames left out"), "{ran:?}");
        assert!(ran.stdout.contains(": 0, 9\n"), "{ran:?}");
        for row in bench.table("C.csv").1 {
            assert_eq!(row[2].is_nan(), [0.0, 9.0].contains(&row[0]), "{method}: {row:?}");
        }
    }
    let _ = piped(&bench, "watch - --gaussian 2 -o P.zarr", "F.raw").succeeded();
    let (shape, images) = zarr_images(&bench.path("P.zarr"));
    assert_eq!(shape, [FRAMES as u64, HEIGHT as u64, WIDTH as u64]);
    for (frame, image) in images.chunks_exact(PIXELS).enumerate() {
        assert!(image.iter().all(|phase| phase.is_nan() == [0, 9].contains(&frame)), "{frame}");
    }
}

// ---- images --------------------------------------------------------------------------------

fn zarr_images(path: &Path) -> (Vec<u64>, Vec<f32>) {
    let store = Arc::new(FilesystemStore::new(path).unwrap());
    let array = Array::open(store, "/phase_rad").unwrap();
    let all = array.retrieve_array_subset::<Vec<f32>>(&array.subset_all()).unwrap();
    (array.shape().to_vec(), all)
}

/// The newest image holds earlier phases where they were, but the walk is the same: a batch that ends at the frame has
/// about the same phases.
#[test]
fn the_newest_image_is_near_the_last_of_a_batch() {
    let bench = bench();
    let ran = piped(&bench, "watch - --gaussian 3 --max-lag 8 --follow -o P.npy", "F.raw");
    assert!(ran.succeeded().stdout.contains("measured_%"));
    let _ = piped(&bench, "watch - --gaussian 3 --max-lag 8 -o P.zarr", "F.raw").succeeded();
    let (shape, newest) = npy::load_f32(&bench.path("P.npy"));
    assert_eq!(shape, [HEIGHT, WIDTH]);
    let (_, all) = zarr_images(&bench.path("P.zarr"));
    assert_eq!(all[(FRAMES - 1) * PIXELS..], newest);
    let _ = bench.succeed("phase F.npy --gaussian 3 --method paper --max-lag 8 -o B.npy");
    let (_, batch) = npy::load_f32(&bench.path("B.npy"));
    let off = |a: &[f32], b: &[f32]| -> f32 {
        let squares: f32 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
        (squares / PIXELS as f32).sqrt()
    };
    let last = &batch[(FRAMES - 1) * PIXELS..];
    let (difference, moved) = (off(&newest, last), off(last, &batch[4 * PIXELS..5 * PIXELS]));
    assert!(difference < 0.1 * moved, "{difference} of {moved}");
}

#[test]
fn threads_do_not_change_the_images() {
    let bench = bench();
    let image = |threads: usize| {
        let line = format!("watch - --gaussian 2 --threads {threads} -o P.npy");
        let _ = piped(&bench, &line, "F.raw").succeeded();
        npy::load_f32(&bench.path("P.npy")).1
    };
    let one = image(1);
    for threads in [2, 3, 14, 30] {
        let other = image(threads);
        let most = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(f64::from(most) < SINGLE_STORED_RAD, "{threads}: {most}");
    }
}

/// Ten times as many frames take no more memory.
#[test]
fn memory_does_not_grow() {
    let bench = bench();
    let shape = Shape { frames: 30, depth: 1, height: 64, width: 96 };
    let frames = bytes(&Recording::moving(shape, 0.95, 3).field);
    let header = header().replace("14", "64").replace("18", "96");
    let peak = |line: &str, times: usize| {
        let mut child = start(&bench, line);
        let mut input = child.stdin.take().unwrap();
        input.write_all(header.as_bytes()).unwrap();
        (0..times).for_each(|_| input.write_all(&frames).unwrap());
        drop(input);
        let ran = Ran::of(line, &child.wait_with_output().unwrap()).succeeded();
        let summary: Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!(summary["frames"], json!(30 * times));
        summary["peak_resident_bytes"].as_f64().unwrap()
    };
    npy::save_mask(&bench.path("W.npy"), &[64, 96], &[true; 64 * 96]);
    for line in [
        "--gaussian 2 --max-lag 4 -o P.npy",
        "--mask W.npy -o C.csv",
        "--mask W.npy --method paper -o C.csv",
    ] {
        let line = format!("watch - {line} --json");
        let [few, many] = [1, 10].map(|times| peak(&line, times));
        assert!(many < few + 3e6, "{line}: {few} {many}");
    }
}

// ---- files that grow -----------------------------------------------------------------------

/// The header names all frames, and another program appends half a frame at a time.
#[test]
fn a_growing_npy() {
    let bench = bench();
    let _ = piped(&bench, "watch - --mask M.npy -o P.csv", "F.raw").succeeded();
    let whole = fs::read(bench.path("F.npy")).unwrap();
    let begin = whole.len() - FRAMES * PIXELS * 8;
    fs::write(bench.path("G.npy"), &whole[..begin]).unwrap();
    let child = start(&bench, "watch G.npy --mask M.npy --idle 2 -o C.csv");
    let mut file = File::options().append(true).open(bench.path("G.npy")).unwrap();
    let path = bench.path("C.csv");
    for (n, half) in whole[begin..].chunks(PIXELS * 4).enumerate() {
        file.write_all(half).unwrap();
        if n == 9 {
            wait("lines of five frames", || lines(&path) == 6);
        }
        std::thread::sleep(Duration::from_millis(3));
    }
    let ran = Ran::of("watch G.npy", &child.wait_with_output().unwrap()).succeeded();
    assert!(ran.stdout.contains("24 frames"), "{ran:?}");
    same_phases(&bench, ["C.csv", "P.csv"], 0.0);
}

/// The header is rewritten for every frame.
#[test]
fn an_npy_whose_header_grows() {
    let bench = bench();
    let field = recording().field;
    let save = |frames: usize| {
        npy::save_complex(
            &bench.path("H.npy"),
            &[frames, HEIGHT, WIDTH],
            &field[..frames * PIXELS],
        );
        fs::rename(bench.path("H.npy"), bench.path("G.npy")).unwrap();
    };
    save(1);
    let child = start(&bench, "watch G.npy --mask M.npy --method paper --idle 2 -o C.csv");
    for frames in 2..=FRAMES {
        save(frames);
        std::thread::sleep(Duration::from_millis(3));
    }
    let _ = Ran::of("watch G.npy", &child.wait_with_output().unwrap()).succeeded();
    let _ = piped(&bench, "watch - --mask M.npy --method paper -o P.csv", "F.raw").succeeded();
    same_phases(&bench, ["C.csv", "P.csv"], 0.0);
}

/// A program enlarges the array and writes the frame, or the other way round; chunks of one frame and of three.
#[test]
fn a_growing_zarr() {
    let bench = bench();
    let _ = piped(&bench, "watch - --mask M.npy -o P.csv", "F.raw").succeeded();
    for frames_of_chunk in [1, 3] {
        let name = format!("G{frames_of_chunk}.zarr");
        let store = Arc::new(FilesystemStore::new(bench.path(&name)).unwrap());
        GroupBuilder::new().build(Arc::clone(&store), "/").unwrap().store_metadata().unwrap();
        let (shape, chunk) = (vec![0, HEIGHT as u64, WIDTH as u64], vec![frames_of_chunk, 8, 18]);
        let zero = FillValue::from(Complex32::default());
        let mut array = ArrayBuilder::new(shape, chunk, data_type::complex64(), zero)
            .build(store, "/field")
            .unwrap();
        array.store_metadata().unwrap();
        let child = start(&bench, &format!("watch {name} --mask M.npy --idle 2 -o C.csv"));
        for (n, frame) in (0_u64..).zip(recording().field.chunks_exact(PIXELS)) {
            array.set_shape(vec![n + 1, HEIGHT as u64, WIDTH as u64]).unwrap();
            if frames_of_chunk == 1 {
                array.store_metadata().unwrap();
            }
            let place = [n..n + 1, 0..HEIGHT as u64, 0..WIDTH as u64];
            array.store_array_subset(&place, frame).unwrap();
            array.store_metadata().unwrap();
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = Ran::of(&name, &child.wait_with_output().unwrap()).succeeded();
        same_phases(&bench, ["C.csv", "P.csv"], 0.0);
    }
}

// ---- how it ends ---------------------------------------------------------------------------

#[test]
fn a_frame_that_is_cut_short() {
    let bench = bench();
    let whole = fs::read(bench.path("F.raw")).unwrap();
    fs::write(bench.path("cut.raw"), &whole[..header().len() + 7 * PIXELS * 8 + 100]).unwrap();
    let line = "watch - --mask M.npy --method paper --history -o C.csv";
    let ran = piped(&bench, line, "cut.raw");
    ran.refused(1, &["standard input", "frame 7 is cut short: 100 of its 2016 bytes"]);
    assert_eq!(bench.table("C.csv").1.len(), 7, "what came is kept");
    assert_eq!(bench.table("C.smoothed.csv").1.len(), 7);

    let npy = fs::read(bench.path("F.npy")).unwrap();
    fs::write(bench.path("G.npy"), &npy[..npy.len() - 16]).unwrap();
    let ran = bench.run("watch G.npy --mask M.npy --idle 0.1 -o C.csv");
    ran.refused(1, &["G.npy", "frame 23 is cut short: 2000 of its 2016 bytes"]);
    assert_eq!(bench.table("C.csv").1.len(), 23);
}

#[test]
fn interrupted_it_ends_cleanly() {
    for (line, signal) in [
        ("watch F.npy --mask M.npy -o C.csv", "-INT"),
        ("watch F.npy --mask M.npy --method paper --history -o C.csv", "-TERM"),
        ("watch - --mask M.npy -o C.csv", "-INT"),
    ] {
        let bench = bench();
        let mut child = start(&bench, line);
        let raw = fs::read(bench.path("F.raw")).unwrap();
        let mut input = child.stdin.take().unwrap();
        // Files do not read it.
        let _ = input.write_all(&raw[..raw.len() - 3]);
        let frames = if line.contains("watch -") { FRAMES - 1 } else { FRAMES };
        let path = bench.path("C.csv");
        wait("all frames", || lines(&path) == 1 + frames);
        let id = child.id().to_string();
        assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
        let ran = Ran::of(line, &child.wait_with_output().unwrap());
        ran.refused(130, &["interrupted", &format!("{frames} frames")]);
        assert!(ran.stdout.contains("wrote C.csv"), "{ran:?}");
        assert!(fs::read_to_string(&path).unwrap().ends_with('\n'));
        let smoothed = bench.path("C.smoothed.csv").exists();
        assert_eq!(smoothed, line.contains("--history"), "{line}");
        let partial = bench.names().into_iter().find(|name| name.contains("partial"));
        assert_eq!(partial, None, "{line}");
    }
}

#[test]
fn what_is_wrong_is_told() {
    let bench = bench();
    let refuse = |line: &str, status: i32, words: &[&str]| {
        let before = bench.names();
        piped(&bench, line, "F.raw").refused(status, words);
        assert_eq!(bench.names(), before, "{line}");
    };
    npy::save_mask(&bench.path("S.npy"), &[3, 5], &[true; 15]);
    let shape = Shape { frames: 3, depth: 2, height: HEIGHT, width: WIDTH };
    Recording::moving(shape, 0.9, 4).save(&bench.path("V.npy"));
    fs::write(bench.path("run.cihx"), "").unwrap();
    for (line, status, words) in [
        ("watch - -o C.csv", 2, &["--mask"][..]),
        ("watch - --mask M.npy", 2, &["--output"]),
        ("watch - --mask M.npy -o C.npy", 2, &["C.npy", ".csv or .ndjson"]),
        ("watch - --gaussian 2 -o P.csv", 2, &["images go to .npy or .zarr"]),
        ("watch - --gaussian 2 --method linked -o P.npy", 2, &["--method linked is for curves"]),
        ("watch - --gaussian 2 --history -o P.npy", 2, &["--history is for curves"]),
        ("watch - --gaussian 0 -o P.npy", 2, &["--gaussian 0"]),
        ("watch - --gaussian 2 --max-lag 65 -o P.npy", 2, &["--max-lag 65", "64"]),
        ("watch - --mask M.npy --max-lag 3 -o C.csv", 2, &["--max-lag belongs to --method paper"]),
        ("watch - --mask M.npy --idle -1 -o C.csv", 2, &["--idle -1"]),
        ("watch - --mask M.npy --history --follow", 2, &["--history needs -o"]),
        ("watch - --mask S.npy -o C.csv", 1, &["S.npy", "[3, 5]", "[14, 18]"]),
        ("watch V.npy --mask M.npy -o C.csv", 1, &["V.npy", "axes (time, y, x)"]),
        ("watch M.npy --mask M.npy -o C.csv", 1, &["M.npy", "bool"]),
        ("watch run.cihx --mask M.npy -o C.csv", 1, &["run.cihx", "reconstruct"]),
        ("watch no.npy --mask M.npy -o C.csv", 1, &["no.npy", "no such file"]),
        ("watch F.npy --gaussian 2 -o F.npy", 2, &["F.npy", "is the input"]),
    ] {
        refuse(line, status, words);
    }
    piped(&bench, "watch - --mask M.npy --follow", "M.npy")
        .refused(1, &["standard input", "must begin with a line"]);
    fs::write(bench.path("none.raw"), header()).unwrap();
    piped(&bench, "watch - --mask M.npy --follow", "none.raw").refused(1, &["no usable frame"]);
}
