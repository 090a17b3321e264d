//! Linked phases: images against the formulas written out, every lane path, what the program tells.

use num_complex::{Complex, Complex32};
use phasewalk::image::{Fit, ImageJob, Kernel, Tile, Tiles, window_kernel};
use phasewalk::io::{Series, Shape};
use phasewalk::lanes::Path;
use phasewalk::looks::SpatialCoherence;
use phasewalk::method::{Depths, Method, Plan};
use phasewalk::progress::Progress;
use phasewalk::series::{Survey, survey};
use phasewalk_tests::npy::load_f64;
use phasewalk_tests::oct::numbers;
use phasewalk_tests::oracle::gaussian_mean;
use phasewalk_tests::program::Bench;
use phasewalk_tests::recording::Recording;
use phasewalk_tests::tolerance::{CLOSURE_P, LINKED_SINGLE_RAD, SINGLE_STORED_RAD, STANDARD_SCORE};
use std::f64::consts::TAU;
use std::sync::Mutex;

const SIGMA_PX: f64 = 2.5;

/// A recording with what its linked images need.
struct Scene {
    recording: Recording,
    plan: Plan,
    survey: Survey,
    tiles: Tiles,
    looks: f64,
}

impl Scene {
    fn new(recording: Recording, depths: Depths, path: Path) -> Self {
        let series = recording.held();
        let frames = recording.shape.frames;
        let plan = Plan::new(Method::Linked, frames, None, None, depths).unwrap();
        let survey = survey(&series, &plan.depths.all()).unwrap();
        let coherence = SpatialCoherence::estimate(&series, &survey, &[0]).unwrap();
        let kernel = kernel(recording.shape);
        let looks = coherence.looks_of_kernel(&kernel);
        let fit = Fit {
            series: &series,
            survey: &survey,
            plan: &plan,
            coherence: &coherence,
            looks_of_layers: 1.0,
            looks_of_recordings: 1.0,
            looks,
            window_looks: coherence.looks_of_kernel(&window_kernel(&kernel, false).unwrap()),
            closure: true,
            path,
        };
        let tiles = fit.tiles(&Progress::hidden()).unwrap();
        Self { recording, plan, survey, tiles, looks }
    }

    /// Phases and standard deviations, (time, y, x), and p of the closure, (y, x).
    fn images(&self, path: Path, double: bool, threads: usize) -> [Vec<f32>; 3] {
        let series = self.recording.held();
        let Shape { frames, height, width, .. } = series.shape();
        let job = ImageJob {
            tiles: Some(&self.tiles),
            series: &series,
            survey: &self.survey,
            plan: &self.plan,
            sigma_px: SIGMA_PX,
            looks: self.looks,
            effective_looks: self.looks,
            sigma: true,
            double,
            path,
            threads,
            memory: 1 << 30,
        };
        let images = Mutex::new([frames, frames, 1].map(|n| vec![0.0; n * height * width]));
        job.run(&Progress::hidden(), &|strip| {
            let mut images = images.lock().unwrap();
            let results = [strip.phases, strip.sigmas.unwrap(), strip.closure.unwrap()];
            for (image, part) in images.iter_mut().zip(results) {
                for (frame, rows) in part.chunks_exact(strip.valid.len()).enumerate() {
                    let start = (frame * height + strip.first_row) * width;
                    image[start..start + rows.len()].copy_from_slice(rows);
                }
            }
            Ok(())
        })
        .unwrap();
        images.into_inner().unwrap()
    }
}

fn kernel(shape: Shape) -> Kernel {
    Kernel::new(SIGMA_PX, shape.height, shape.width, true).unwrap()
}

/// Odd sizes, a phase that grows to several turns on the right.
fn moving(seed: u64) -> Recording {
    let shape = Shape { frames: 14, depth: 1, height: 37, width: 53 };
    Recording::moving(shape, 0.93, seed)
}

fn wrapped(phase: f64) -> f64 {
    phase - TAU * (phase / TAU).round()
}

/// The largest difference of two images, up to whole turns, in radians.
fn largest_difference(a: &[f32], b: &[f32]) -> f64 {
    let pairs = a.iter().zip(b);
    pairs.map(|(&a, &b)| wrapped(f64::from(a) - f64::from(b)).abs()).fold(0.0, f64::max)
}

/// Start, score and one step of one pixel, and p of its closure, from sums written out in `f64`.
fn by_hand(gamma: impl Fn(usize, usize) -> Complex<f64>, tile: &Tile) -> (Vec<f64>, f64) {
    let (q, inverse) = (&tile.precision, &tile.inverse);
    let n = q.len().isqrt();
    let mut z = vec![Complex::new(1.0, 0.0)];
    for i in 1..n {
        let weight = |j: usize| f64::from(-q[i * n + j]).max(0.0);
        let sum: Complex<f64> =
            (i.saturating_sub(16)..i).map(|j| gamma(i, j) * z[j] * weight(j)).sum();
        z.push(sum / sum.norm());
    }
    let residual = |i: usize, j: usize| (z[i].conj() * gamma(i, j) * z[j]).im;
    let score = |i: usize| -> f64 {
        -(0..n).filter(|&j| j != i).map(|j| f64::from(q[i * n + j]) * residual(i, j)).sum::<f64>()
    };
    let g: Vec<f64> = (0..n).map(score).collect();
    let step = |i: usize| (0..n).map(|j| f64::from(inverse[i * n + j]) * g[j]).sum::<f64>();
    let phases: Vec<f64> = (0..n).map(|i| z[i].arg() + step(i)).collect();
    let mean = phases[0] + (1..5).map(|i| wrapped(phases[i] - phases[0])).sum::<f64>() / 5.0;
    let contrast = |k: usize| -> f64 {
        let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
        pairs.map(|(i, j)| f64::from(tile.contrasts[i * n + j][k]) * residual(i, j)).sum()
    };
    let q: f64 = (0..2).map(|k| contrast(k).powi(2)).sum();
    // The tail of chi^2 with two degrees of freedom.
    (phases.iter().map(|phase| phase - mean).collect(), (-q / 2.0).exp())
}

#[test]
fn images_are_the_formulas_written_out() {
    let scene = Scene::new(moving(1), Depths::single(), Path::Portable);
    let [phases, _, closure] = scene.images(Path::Portable, true, 1);
    let pixels = scene.recording.pixels();
    let means = gaussian_mean(&scene.recording.layer(0), SIGMA_PX);
    let width = scene.recording.shape.width;
    for pixel in (0..pixels).step_by(7) {
        let pairs = &means[pixel];
        let cross = |t: usize, s: usize| pairs.mean[pairs.index(t, s - t).unwrap()];
        let gamma = |i: usize, j: usize| {
            let c = if i < j { cross(i, j) } else { cross(j, i).conj() };
            c / (pairs.power[i] * pairs.power[j]).sqrt()
        };
        let tile = scene.tiles.at(pixel / width, pixel % width);
        assert_eq!(tile.modes, 2);
        let (expected, p) = by_hand(gamma, tile);
        let error = (f64::from(closure[pixel]) - p).abs();
        assert!(error < CLOSURE_P, "pixel {pixel}: {} for {p}", closure[pixel]);
        for (frame, expected) in expected.iter().enumerate() {
            let got = f64::from(phases[frame * pixels + pixel]);
            let error = wrapped(got - expected).abs();
            assert!(
                error < SINGLE_STORED_RAD,
                "pixel {pixel}, frame {frame}: {got} for {expected}"
            );
        }
    }
}

#[test]
fn paths_and_threads_agree() {
    for (seed, depths) in [(2, "0..0"), (3, "0..1,2..3")] {
        let shape = Shape { frames: 14, depth: 4, height: 37, width: 53 };
        let recording = Recording::moving(shape, 0.93, seed);
        let depths: Depths = depths.parse().unwrap();
        let scene = Scene::new(recording, depths, Path::Portable);
        let [exact, sigmas, closure] = scene.images(Path::Portable, true, 1);
        assert!(sigmas.iter().all(|&sigma| sigma > 0.0 && sigma < 1.0));
        for path in Path::available() {
            let [single, same, p] = scene.images(path, false, 1);
            assert_eq!(same, sigmas, "{path:?}");
            let error = largest_difference(&single, &exact);
            assert!(error < LINKED_SINGLE_RAD, "{path:?}: {error:e}");
            let error = p.iter().zip(&closure).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(f64::from(error) < CLOSURE_P, "{path:?}: p differs by {error:e}");
            assert_eq!(scene.images(path, false, 3), [single, same, p], "{path:?}, three threads");
        }
    }
}

/// Left half coherence 0.93 from frame to frame, right half 0.75: each tile finds its own, on every path.
#[test]
fn each_tile_has_its_own_coherence() {
    let shape = Shape { frames: 20, depth: 1, height: 64, width: 128 };
    let still = |_: usize, _: [usize; 3]| 0.0;
    let slow = Recording::decorrelating(shape, 0.93, 5, still);
    let fast = Recording::decorrelating(shape, 0.75, 6, still);
    let right = |i: usize| i % shape.width >= shape.width / 2;
    let mixed = slow.field.iter().zip(&fast.field).enumerate();
    let field = mixed.map(|(i, (&s, &f))| if right(i) { f } else { s }).collect();
    let recording = Recording { shape, field };
    for path in Path::available() {
        let scene = Scene::new(recording.clone(), Depths::single(), path);
        for (x, rho) in [(8, 0.93), (32, 0.93), (96, 0.75), (120, 0.75)] {
            let mixture = &scene.tiles.at(30, x).mixture;
            for lag in [1.0, 2.0, 5.0] {
                let (got, expected) = (mixture.at(lag), f64::powf(rho, lag));
                assert!((got - expected).abs() < 0.05, "{path:?} x {x} lag {lag}: {got}");
            }
        }
    }
}

/// Speckle of one motion, and on the right a static reflection of the same brightness under it.
fn half_reflecting(seed: u64) -> Recording {
    let shape = Shape { frames: 40, depth: 1, height: 96, width: 192 };
    let mut recording = Recording::decorrelating(shape, 0.93, seed, |t, _| 0.1 * t as f64);
    let still = Recording::decorrelating(shape, 1.0, seed + 1, |_, _| 0.0);
    for (i, (u, v)) in recording.field.iter_mut().zip(&still.field).enumerate() {
        if i % shape.width >= shape.width / 2 {
            *u += v;
        }
    }
    recording
}

/// p of the pixels' closure is uniform where one motion explains the data, and small where a reflection lies under it:
/// in the array, in words, as JSON.
#[test]
fn pixels_of_two_motions_are_told() {
    let scene = Scene::new(half_reflecting(21), Depths::single(), Path::Portable);
    let [_, _, closure] = scene.images(Path::Portable, false, 2);
    let share = |left: bool, below: f32| {
        // A tile's width away from the middle, and from the periodic edge.
        let columns = if left { 24..72 } else { 120..168 };
        let pixels = closure.iter().enumerate();
        let inside = pixels.filter(|&(i, _)| columns.contains(&(i % 192)));
        let all: Vec<bool> = inside.map(|(_, &p)| p < below).collect();
        all.iter().filter(|&&below| below).count() as f64 / all.len() as f64
    };
    let chance = [share(true, 0.5), share(true, 0.1), share(true, 1e-3)];
    println!("one motion: {chance:?}, two: p < 0.001 in {}", share(false, 1e-3));
    // 4600 pixels of 78 looks hold about 60 independent averages: 0.065 and 0.04 are one standard deviation.
    assert!((chance[0] - 0.5).abs() < 0.2 && (chance[1] - 0.1).abs() < 0.1 && chance[2] < 0.02);
    assert!(share(false, 1e-3) > 0.9);
}

#[test]
fn the_program_tells_whether_one_motion_explains_the_data() {
    let bench = Bench::new();
    half_reflecting(21).save(&bench.path("F.npy"));
    for (name, columns) in [("L.npy", 8..80), ("R.npy", 112..184)] {
        let inside: Vec<bool> = (0..96 * 192).map(|i| columns.contains(&(i % 192))).collect();
        phasewalk_tests::npy::save_mask(&bench.path(name), &[96, 192], &inside);
    }
    let line = "phase F.npy --mask R.npy --control L.npy -o C.zarr";
    let summary = bench.summary(line);
    let number = |key: &str| summary[key].as_f64().unwrap();
    assert!(number("closure_p") < 1e-6 && number("control_closure_p") > 1e-3, "{summary}");
    // One scatters by sqrt(2 / 741) = 0.05, and the looks are estimated.
    assert!((number("control_closure_misfit") - 1.0).abs() < 0.2, "{summary}");
    let told = bench.succeed(line).stdout;
    assert!(told.contains("warning: no single motion explains the mask"), "{told}");
    assert!(
        told.contains("closure phases of the control: ") && told.contains(", p = 0."),
        "{told}"
    );
    assert!(!told.contains("explains the control"), "{told}");

    let summary = bench.summary("phase F.npy --gaussian 2.5 -o P.zarr");
    assert!((summary["closure"]["share"].as_f64().unwrap() - 0.5).abs() < 0.1, "{summary}");
    let array = |name: &str| numbers(&bench.path("P.zarr").join(name));
    let (shape, p) = array("closure_p");
    assert_eq!(shape, [96, 192]);
    assert!(p[192 * 48 + 48] > 1e-3 && p[192 * 48 + 144] < 1e-3);
    let (shape, quality) = array("quality");
    let (rows, columns) = (array("tile_y").1, array("tile_x").1);
    assert_eq!(shape, [40, rows.len() as u64, columns.len() as u64]);
    assert!(rows[0] == 0.0 && columns.len() > 1 && quality.iter().all(|&s| s > 0.7));
    let told = bench.succeed("info P.zarr").stdout;
    let tiles = format!("(time 40, tile_y {}, tile_x {})", rows.len(), columns.len());
    for text in ["closure_p: float32 (y 96, x 192)", &format!("quality: float32 {tiles}")] {
        assert!(told.contains(text), "{text}: {told}");
    }
    assert!(bench.summary("phase F.npy --gaussian 2.5 -o P.npy").get("closure").is_none());

    let shape = Shape { frames: 12, depth: 2, height: 96, width: 192 };
    Recording::moving(shape, 0.93, 22).save(&bench.path("Z.npy"));
    for (layers, told) in [("0..0", true), ("0..0,1..1", false)] {
        let curve = bench.summary(&format!("phase Z.npy --mask R.npy --layers {layers} -o Z.csv"));
        assert_eq!(curve["closure_p"].is_f64(), told, "{layers}: {curve}");
        let line = format!("phase Z.npy --gaussian 2.5 --layers {layers} -o Z.zarr");
        assert_eq!(bench.summary(&line)["closure"].is_object(), told, "{layers}");
        assert!(bench.path("Z.zarr/quality").is_dir());
        std::fs::remove_dir_all(bench.path("Z.zarr")).unwrap();
    }
}

/// A line scan, lying and standing: speckles, blocks and looks run along it. Neighbours share half of their light, which
/// leaves 2 sqrt(pi) sigma / 1.5 = 9.5 looks.
#[test]
fn a_line_scan_has_images() {
    const LENGTH: usize = 600;
    let truth = |t: usize| 0.3 * t as f64;
    let bench = Bench::new();
    for (height, width) in [(1, LENGTH), (LENGTH, 1)] {
        let shape = Shape { frames: 20, depth: 1, height, width };
        let mut line = Recording::decorrelating(shape, 0.95, 5, |t, _| truth(t));
        for frame in line.field.chunks_exact_mut(LENGTH) {
            let first = frame[0];
            for x in 0..LENGTH {
                frame[x] += frame.get(x + 1).copied().unwrap_or(first);
            }
        }
        line.save(&bench.path("F.npy"));
        let summary = bench.summary("phase F.npy --gaussian 4 -o P.npy");
        let looks = summary["effective_looks"].as_f64().unwrap();
        assert!((looks / 9.5 - 1.0).abs() < 0.1, "{height} rows: {looks}");
        let [phases, sigmas] = ["P.npy", "P.sigma.npy"]
            .map(|name| phasewalk_tests::npy::load_f32(&bench.path(name)).1);
        let scores = phases.chunks(LENGTH).zip(sigmas.chunks(LENGTH)).enumerate().skip(5);
        let squares = scores.flat_map(|(t, (phases, sigmas))| {
            let error = move |phase: f32| f64::from(phase) - (truth(t) - truth(2));
            phases.iter().zip(sigmas).map(move |(&p, &s)| (error(p) / f64::from(s)).powi(2))
        });
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, n), square| (sum + square, n + 1.0));
        let z = f64::sqrt(sum / count);
        assert!((z - 1.0).abs() < 0.25, "{height} rows: error over sigma {z}");
    }
}

/// The program's map finds the walk of the scatterers: sigma lambda/16 of 841 nm is 52.6 nm. Asked: 5 %.
#[test]
fn the_map_tells_how_the_scatterers_move() {
    let bench = Bench::new();
    let size = "--width 320 --height 184 --scatterers 10";
    let _ = bench.succeed(&format!("simulate speckle {size} --sigma 1/16 -o F.npy"));
    let line = "phase F.npy --gaussian 3 --wavelength-nm 841 --decorrelation M.svg -o P.zarr";
    let summary = bench.summary(line);
    let walk = summary["decorrelation"]["walk_nm"].as_f64().unwrap();
    assert!((walk / 52.56 - 1.0).abs() < 0.05, "{walk} nm");
    let svg = std::fs::read_to_string(bench.path("M.svg")).unwrap();
    for text in ["decay rate", "walk / (nm", "static share", "noise share"] {
        assert!(svg.contains(text), "{text}");
    }
    for array in ["decay_rate", "static_share", "noise_share", "walk_nm"] {
        assert!(bench.path("P.zarr").join(array).is_dir(), "{array}");
    }
    let line = "phase F.npy --mask F.mask.npy --decorrelation M.png -o C.csv";
    bench.run(line).refused(2, &["--decorrelation", "--gaussian"]);
}

#[test]
fn the_map_of_noise_or_of_two_frames_has_no_numbers() {
    let bench = Bench::new();
    let shape = |frames| Shape { frames, depth: 1, height: 40, width: 40 };
    Recording::random(shape(12), 9).save(&bench.path("R.npy"));
    Recording::decorrelating(shape(2), 0.9, 3, |_, _| 0.0).save(&bench.path("T.npy"));
    Recording::decorrelating(shape(3), 0.9, 3, |_, _| 0.0).save(&bench.path("S.npy"));
    for (name, known) in [("R", false), ("T", false), ("S", true)] {
        let line = format!("phase {name}.npy --gaussian 3 --decorrelation M.svg -o {name}.zarr");
        let summary = bench.summary(&line);
        for quantity in ["decay_rate", "static_share", "noise_share"] {
            let median = &summary["decorrelation"][quantity]["median"];
            assert_eq!(median.is_f64(), known, "{name} {quantity}: {median}");
        }
    }
    let ran = bench.succeed("phase R.npy --gaussian 3 -o Q.npy");
    assert!(ran.stdout.contains("decorrelation: nan"), "{ran:?}");
}

/// Bursts with a phase of 2 pi in the gap: the velocity within the bursts bridges it, even sampling of as many frames over the
/// same time does not see the phase at all.
#[test]
fn bursts_hold_where_even_sampling_fails() {
    let shape = |frames| Shape { frames, depth: 1, height: 40, width: 40 };
    let rate = 1.2;
    let series = |times: &[f64], seed| -> Recording {
        // Decorrelation by 0.9 per unit of time, whatever the interval.
        let mut random = phasewalk_tests::random::Random::new(seed);
        let mut speckle: Vec<_> = (0..1600).map(|_| random.speckle()).collect();
        let mut field = Vec::new();
        for (t, &time) in times.iter().enumerate() {
            if t > 0 {
                let rho = 0.97_f64.powf(time - times[t - 1]);
                for a in &mut speckle {
                    *a = *a * rho + random.speckle() * (1.0 - rho * rho).sqrt();
                }
            }
            let turn = Complex::from_polar(1.0, rate * time);
            field.extend(speckle.iter().map(|a| {
                let u = *a * turn;
                Complex32::new(u.re as f32, u.im as f32)
            }));
        }
        Recording { shape: shape(times.len()), field }
    };
    let bursts: Vec<f64> = (0..24).map(|i| f64::from(i / 3 * 12 + i % 3)).collect();
    let even: Vec<f64> = (0..24).map(|i| f64::from(i) * 86.0 / 23.0).collect();
    let bench = Bench::new();
    phasewalk_tests::npy::save_mask(&bench.path("M.npy"), &[40, 40], &[true; 1600]);
    let end = |name: &str, times: &[f64]| -> f64 {
        series(times, 11).save(&bench.path("F.npy"));
        let text: Vec<String> = times.iter().map(f64::to_string).collect();
        std::fs::write(bench.path("T.txt"), text.join("\n")).unwrap();
        let _ = bench.succeed(&format!("phase F.npy --mask M.npy --times T.txt -o {name}"));
        let table = rows(&bench, name);
        let (first, last) = (&table[0], &table[times.len() - 1]);
        (last[2] - first[2]) - rate * (times[times.len() - 1] - times[0])
    };
    assert!(end("A.csv", &bursts).abs() < 0.5, "bursts hold");
    assert!(end("B.csv", &even).abs() > 6.0, "more than pi between frames cannot be seen");
}

/// A turn is wrong where the velocity around a gap, times the gap, is by more than half a turn: the program says how well it
/// is known, and warns where that is not enough, of curves and of images.
#[test]
fn turns_across_long_gaps_are_said_to_be_unsure() {
    let bench = Bench::new();
    for (burst, sure) in [("--burst 2,3", true), ("--burst 2,1000", false), ("", true)] {
        let scene = "simulate speckle --width 48 --height 48 --frames 12 --sigma 1/64";
        let _ = bench.succeed(&format!("{scene} {burst} -o F.npy"));
        let line = "phase F.npy --mask F.mask.npy -o C.csv";
        let told = bench.succeed(line).stdout.contains("off by whole turns");
        assert_eq!(told, !sure, "{burst}");
        let error = bench.summary(line)["gap_error_rad"].as_f64();
        assert_eq!(error.is_some(), !burst.is_empty(), "{burst}: {error:?}");
        assert!(
            error.is_none_or(|error| (3.0 * error < std::f64::consts::PI) == sure),
            "{error:?}"
        );
        // So do images, of their pixels.
        let images = "phase F.npy --gaussian 3 -o P.npy";
        let told = bench.succeed(images).stdout.contains("tell the whole turns");
        let share = bench.summary(images)["share_unsure_over_gaps"].as_f64();
        assert_eq!(share, (!burst.is_empty()).then_some(if sure { 0.0 } else { 1.0 }), "{burst}");
        assert_eq!(told, !sure, "{burst}");
        let _ = std::fs::remove_file(bench.path("F.times.npy"));
    }
}

/// One pixel has no coherence but 1, whatever number of looks is claimed for it.
#[test]
fn one_pixel_is_refused_with_any_number_of_looks() {
    let bench = Bench::new();
    let _ = bench.succeed("simulate speckle --width 24 --height 24 --frames 8 -o F.npy");
    let one: Vec<bool> = (0..24 * 24).map(|i| i == 200).collect();
    phasewalk_tests::npy::save_mask(&bench.path("M.npy"), &[24, 24], &one);
    for looks in ["", "--looks 3", "--looks 50"] {
        for method in ["linked", "paper"] {
            let line = format!("phase F.npy --mask M.npy --method {method} {looks} -o C.csv");
            bench.run(&line).refused(2, &["--mask", "1.0 looks", "more pixels"]);
        }
    }
    let _ = bench.succeed("phase F.npy --mask M.npy --method one-step -o C.csv");
}

#[test]
fn times_that_cannot_be_are_refused() {
    let bench = Bench::new();
    let _ =
        bench.succeed("simulate speckle --width 24 --height 24 --frames 6 --burst 2,10 -o F.npy");
    let times = phasewalk_tests::npy::load_f64(&bench.path("F.times.npy")).1;
    assert_eq!(times, [0.0, 1.0, 11.0, 12.0, 22.0, 23.0]);
    let _ = bench.succeed("phase F.npy --mask F.mask.npy --times F.times.npy -o C.csv");
    assert_eq!(rows(&bench, "C.csv")[4][1], 22.0);
    let _ = bench.succeed("phase F.npy --mask F.mask.npy --acceleration 0.01 -o C.csv");
    for (text, words) in
        [("0\n1\n", ["2 times", "6 frames"]), ("0\n1\n1\n2\n3\n4\n", ["frame 2", "ascending"])]
    {
        std::fs::write(bench.path("T.txt"), text).unwrap();
        let line = "phase F.npy --mask F.mask.npy --times T.txt -o D.csv";
        bench.run(line).refused(1, &[words[0], words[1], "T.txt"]);
    }
    for (option, word) in
        [("--times none.txt", "none.txt"), ("--acceleration 0", "--acceleration 0")]
    {
        let line = format!("phase F.npy --mask F.mask.npy {option} -o D.csv");
        let ran = bench.run(&line);
        assert!(ran.status != Some(0) && ran.stderr.contains(word), "{ran:?}");
    }
    for option in ["--burst 0,10", "--burst 2,0", "--burst 2", "--times T.txt"] {
        let line = format!("simulate speckle --width 24 --height 24 --frames 9 {option} -o G.npy");
        let ran = bench.run(&line);
        assert!(matches!(ran.status, Some(1 | 2)), "{option}: {ran:?}");
    }
    assert!(!bench.path("D.csv").exists() && !bench.path("G.npy").exists());
}

/// F.times.npy beside F.npy counts as its own times, unless others are given; a curve is a table of times, too.
#[test]
fn times_beside_a_series_are_its_own() {
    let bench = Bench::new();
    let _ =
        bench.succeed("simulate speckle --width 24 --height 24 --frames 6 --burst 2,10 -o F.npy");
    let line = "phase F.npy --mask F.mask.npy";
    let times = |name: &str| rows(&bench, name).iter().map(|row| row[1]).collect::<Vec<_>>();
    let own = [0.0, 1.0, 11.0, 12.0, 22.0, 23.0];
    let ran = bench.succeed(&format!("{line} -o C.csv"));
    assert!(ran.stdout.contains("times in seconds from F.times.npy"), "{ran:?}");
    assert_eq!(times("C.csv"), own);
    let summary = bench.summary(&format!("{line} --times C.csv --acceleration 0.5 -o D.csv"));
    assert_eq!(times("D.csv"), own, "the column time_s, not the first");
    assert_eq!((&summary["times_from"], &summary["time_unit"]), (&"C.csv".into(), &"s".into()));
    assert_eq!((&summary["mask"], &summary["acceleration"]), (&"F.mask.npy".into(), &0.5.into()));
    assert_eq!(summary["reference_frames"], serde_json::json!([0, 1, 2, 3, 4]));
    std::fs::write(bench.path("T.txt"), "0,5\n1,5\n2,5\n3,5\n4,5\n5,5\n").unwrap();
    let given = format!("{line} --times T.txt -o D.csv");
    bench.run(&given).refused(1, &["T.txt: line 1: '0,5'", "time_s", "point"]);
    bench.run(&format!("{line} -o F.times.npy")).refused(2, &["-o F.times.npy", "input"]);
    std::fs::write(bench.path("F.times.npy"), "no times").unwrap();
    bench.run(&format!("{line} -o D.csv")).refused(1, &["F.times.npy"]);
    std::fs::write(bench.path("T.txt"), "0\n1\n2\n3\n4\n7\n").unwrap();
    let ran = bench.succeed(&given);
    assert!(ran.stdout.contains("from T.txt") && times("D.csv")[5] == 7.0, "{ran:?}");
    std::fs::remove_file(bench.path("F.times.npy")).unwrap();
    let ran = bench.succeed(&format!("{line} -o D.csv"));
    assert!(ran.stdout.contains("no times are known") && times("D.csv")[5] == 5.0, "{ran:?}");
}

/// The file `name` of the table's columns: frame, time, phase, sigma, quality.
fn rows(bench: &Bench, name: &str) -> Vec<Vec<f64>> {
    let (head, rows) = bench.table(name);
    assert_eq!(head, "frame,time_s,phase_rad,sigma_rad,quality");
    rows
}

#[test]
fn a_curve_tells_bad_frames_and_its_error() {
    const BAD: usize = 9;
    let bench = Bench::new();
    let shape = Shape { frames: 24, depth: 1, height: 40, width: 40 };
    let truth = |t: usize| 0.4 * t as f64;
    let mut recording = Recording::decorrelating(shape, 0.9, 7, |t, _| truth(t));
    let other = Recording::random(shape, 8);
    let bad = other.field[BAD * 1600..(BAD + 1) * 1600].to_vec();
    recording.image_mut(BAD, 0).copy_from_slice(&bad);
    recording.save(&bench.path("F.npy"));
    phasewalk_tests::npy::save_mask(&bench.path("M.npy"), &[40, 40], &[true; 1600]);
    let summary = bench.summary("phase F.npy --mask M.npy -o C.csv");
    assert_eq!(summary["method"], "linked");
    let model = &summary["coherence_model"];
    assert!(model["noise"].as_f64().unwrap() < 0.05, "{model}");
    assert_eq!(model["periodic"], false);
    for row in rows(&bench, "C.csv") {
        let [frame, _, phase, sigma, quality] = row[..] else { panic!("five columns") };
        let frame = frame as usize;
        if frame == BAD {
            assert!(phase.is_nan() && sigma == f64::INFINITY && quality < 0.3, "{row:?}");
            continue;
        }
        let error = phase - (truth(frame) - truth(2));
        assert!(quality > 0.9 && error.abs() < STANDARD_SCORE * sigma, "{row:?}: {error}");
        assert!(sigma < 0.1, "{row:?}");
    }
    let _ = bench.succeed("phase F.npy --mask M.npy -o C.zarr");
    assert!(bench.path("C.zarr/quality").is_dir() && bench.path("C.zarr/coherence").is_dir());
    let _ = bench.succeed("phase F.npy --mask M.npy -o C.npy");
    assert!(bench.path("C.quality.npy").is_file());
    let _ = bench.succeed("phase F.npy --gaussian 3 -o P.zarr");
    let (shape, quality) = numbers(&bench.path("P.zarr/quality"));
    let tiles = quality.len() / 24;
    assert_eq!(shape[0], 24);
    for (frame, tiles) in quality.chunks_exact(tiles).enumerate() {
        assert!(tiles.iter().all(|&s| if frame == BAD { s < 0.3 } else { s > 0.7 }), "{frame}");
    }
    let _ = bench.succeed("phase F.npy --gaussian 3 -o P.npy");
    let (shape, sigmas) = phasewalk_tests::npy::load_f32(&bench.path("P.sigma.npy"));
    assert_eq!(shape, [24, 40, 40]);
    assert!(sigmas[BAD * 1600..(BAD + 1) * 1600].iter().all(|&sigma| sigma == f32::INFINITY));
}

#[test]
fn what_cannot_be_linked_is_refused_or_has_no_number() {
    let bench = Bench::new();
    let shape = Shape { frames: 12, depth: 1, height: 24, width: 24 };
    let mask = |pixels: usize| -> Vec<bool> { (0..576).map(|i| i < pixels).collect() };
    for (name, pixels) in [("one.npy", 1), ("all.npy", 576)] {
        phasewalk_tests::npy::save_mask(&bench.path(name), &[24, 24], &mask(pixels));
    }
    Recording::random(shape, 9).save(&bench.path("R.npy"));
    bench.run("phase R.npy --mask one.npy -o C.csv").refused(2, &["looks", "more pixels"]);
    let _ = bench.succeed("phase R.npy --mask all.npy -o C.csv");
    for row in rows(&bench, "C.csv") {
        assert!(row[2].is_nan() && row[3] == f64::INFINITY, "{row:?}");
    }
    bench.run("phase R.npy --gaussian 0.3 -o P.npy").refused(2, &["looks", "--gaussian"]);
    for option in ["--max-lag 3", "--weights fisher"] {
        let line = format!("phase R.npy --mask all.npy {option} -o C.csv");
        bench.run(&line).refused(2, &["--method paper"]);
    }
    let line = "phase R.npy --mask all.npy --ensemble phasor -o C.csv";
    bench.run(line).refused(2, &["--ensemble", "--method paper"]);
    // Two frames are the fewest: one difference.
    let two = Shape { frames: 2, ..shape };
    let pair = Recording::decorrelating(two, 0.9, 3, |t, _| 0.7 * t as f64);
    pair.save(&bench.path("T.npy"));
    let _ = bench.succeed("phase T.npy --mask all.npy -o C.csv");
    let table = rows(&bench, "C.csv");
    assert!((table[1][2] - table[0][2] - 0.7).abs() < 0.2, "{table:?}");
    let dark = Recording { shape, field: vec![Complex32::new(0.0, 0.0); 12 * 576] };
    dark.save(&bench.path("D.npy"));
    bench.run("phase D.npy --mask all.npy -o C.csv").refused(1, &["zero"]);
}

/// Around the x light rests, and the aperture mixes it in. Nothing decorrelates, so it is all that is wrong.
#[test]
fn light_from_outside_of_the_mask_is_taken_off() {
    const SEEDS: u64 = 4;
    let bench = Bench::new();
    let (mut kept, mut taken_off) = (0.0, 0.0);
    for seed in 1..=SEEDS {
        let scene = "--width 160 --height 92 --frames 12 --scatterers 20 --sigma 0";
        let _ = bench.succeed(&format!("simulate speckle {scene} --seed {seed} -o F.npy"));
        let truth = load_f64(&bench.path("F.phase.npy")).1;
        let reference = truth[..5].iter().sum::<f64>() / 5.0;
        let phase = |option: &str| {
            let summary =
                bench.summary(&format!("phase F.npy --mask F.mask.npy {option} -o C.csv"));
            let share = &summary["light_from_outside"];
            let end = rows(&bench, "C.csv")[11][2];
            (share.as_f64(), end / (truth[11] - reference) - 1.0)
        };
        let (share, error) = phase("");
        assert!(share.is_some_and(|share| (0.05..0.12).contains(&share)), "{share:?}");
        taken_off += error / SEEDS as f64;
        let (share, error) = phase("--keep-leakage");
        assert_eq!(share, None);
        kept += error / SEEDS as f64;
    }
    assert!(kept < -0.03 && taken_off.abs() < 0.3 * kept.abs(), "{kept} {taken_off}");

    let refused = |line: &str| bench.run(line).refused(2, &["--keep-leakage", "--mask", "linked"]);
    refused("phase F.npy --gaussian 3 --keep-leakage -o P.npy");
    refused("phase F.npy --mask F.mask.npy --method paper --keep-leakage -o P.csv");
}
