//! Errors of phase images of the paper's scene at full size, by the paper's and by the linked method:
//! `cargo run --release -p phasewalk-tests --example image_errors -- [FOLDER]`. Inside the x, five pixels off its edge:
//! the Cramer-Rao bound for the looks of a pixel, rms error at some frames, for linked phases the mean standard
//! deviation and that of error / sigma, time and memory; then the scatterers' motion from the decorrelation map; then
//! the same in a scene whose halves move differently. Pictures of all are left in FOLDER, if it is given.

use num_complex::Complex32;
use phasewalk::io::without_rim;
use phasewalk_core::bound::{cramer_rao, reported_variance};
use phasewalk_core::square::Square;
use phasewalk_tests::npy;
use phasewalk_tests::program::Bench;
use serde_json::Value;
use std::f64::consts::PI;

const WIDTH: usize = 640;
const HEIGHT: usize = 368;
const PIXELS: usize = WIDTH * HEIGHT;
/// Pixels taken off the edge of the x, into which the aperture mixes light from the other side.
const RIM: usize = 5;
/// Frames that are looked at.
const FRAMES: [usize; 3] = [20, 40, 69];
/// Frames that the phase refers to.
const REFERENCE: usize = 5;

fn main() {
    let folder = std::env::args().nth(1);
    if let Some(folder) = &folder {
        std::fs::create_dir_all(folder).expect("the folder of the pictures can be made");
    }
    let bench = Bench::new();
    for (name, sigma) in [("slow", 32.0), ("fast", 16.0)] {
        let _ = bench.succeed(&format!("simulate speckle --sigma 1/{sigma} -o {name}.npy"));
        let x = npy::load_mask(&bench.path(&format!("{name}.mask.npy"))).1;
        let inner = without_rim(&x, WIDTH, RIM);
        let inside = |place: usize| inner[place];
        println!("sigma = lambda / {sigma}, inside the x");
        for method in ["paper", "linked"] {
            let summary = evaluate(&bench, name, method, inside);
            println!("         bound {}", bound(&summary, 1.0 / sigma));
        }
    }
    println!("left half lambda/32, right half lambda/16, outside of the x");
    mix(&bench);
    let x = npy::load_mask(&bench.path("slow.mask.npy")).1;
    let still: Vec<bool> = x.iter().map(|&x| !x).collect();
    let still = without_rim(&still, WIDTH, RIM);
    let middle = WIDTH / 2;
    evaluate(&bench, "mixed", "linked", |place| place % WIDTH < middle - 20 && still[place]);
    evaluate(&bench, "mixed", "linked", |place| place % WIDTH > middle + 20 && still[place]);
    if let Some(folder) = folder {
        for picture in PICTURES {
            let target = std::path::Path::new(&folder).join(picture);
            std::fs::copy(bench.path(picture), target).expect("the folder takes the picture");
        }
    }
}

/// Pictures that the runs leave.
const PICTURES: [&str; 5] =
    ["slow-paper.png", "slow-linked.png", "fast-paper.png", "fast-linked.png", "mixed-map.png"];

/// Cramer-Rao bound at the frames looked at, for scatterers that move by sigma wavelengths per frame and as many looks
/// as the program found in a pixel's average.
fn bound(summary: &Value, sigma_wavelengths: f64) -> String {
    let looks = summary["effective_looks"].as_f64().unwrap_or(f64::NAN);
    let rate = (4.0 * PI * sigma_wavelengths).powi(2) / 2.0;
    let n = FRAMES[FRAMES.len() - 1] + 1;
    let [mut gamma, mut covariance, mut scratch] = [0; 3].map(|_| vec![0.0; n * n]);
    let [mut gamma, mut covariance, mut scratch] =
        [&mut gamma, &mut covariance, &mut scratch].map(|data| Square::new(data, n));
    gamma.fill_with(|i, j| (-rate * i.abs_diff(j) as f64).exp());
    cramer_rao(&gamma, looks, &mut covariance, &mut scratch);
    let usable = vec![1.0; n];
    let at = |&frame: &usize| reported_variance(&covariance, &usable, REFERENCE, frame).sqrt();
    let numbers: Vec<String> = FRAMES.iter().map(|f| format!("{:.3}", at(f))).collect();
    format!("{} rad with {looks:.1} looks", numbers.join(", "))
}

fn evaluate(bench: &Bench, name: &str, method: &str, chosen: impl Fn(usize) -> bool) -> Value {
    let line =
        format!("phase {name}.npy --gaussian 3 --method {method} --wavelength-nm 841 -o P.npy");
    let summary = bench.summary(&line);
    let picture = match name {
        "mixed" => "--decorrelation mixed-map.png".to_owned(),
        _ => format!("--figure {name}-{method}.png --at 10,30,50,69"),
    };
    let _ = bench.succeed(&format!("{line} {picture}"));
    let places: Vec<usize> = (0..PIXELS).filter(|&place| chosen(place)).collect();
    let phases = npy::load_f32(&bench.path("P.npy")).1;
    let linked = method == "linked";
    let sigmas = linked.then(|| npy::load_f32(&bench.path("P.sigma.npy")).1);
    let truth = npy::load_f64(&bench.path("slow.phase.npy")).1;
    let reference = truth[..REFERENCE].iter().sum::<f64>() / REFERENCE as f64;
    let still = name == "mixed";
    print!("{method:8}");
    for frame in FRAMES {
        let expected = if still { 0.0 } else { truth[frame] - reference };
        let error = |place: usize| f64::from(phases[frame * PIXELS + place]) - expected;
        let mean_square = |value: &dyn Fn(usize) -> f64| {
            places.iter().map(|&place| value(place).powi(2)).sum::<f64>() / places.len() as f64
        };
        print!("   frame {frame}: rms {:.3} rad", mean_square(&error).sqrt());
        if let Some(sigmas) = &sigmas {
            let sigma = |place: usize| f64::from(sigmas[frame * PIXELS + place]);
            let mean = places.iter().map(|&place| sigma(place)).sum::<f64>() / places.len() as f64;
            let z = mean_square(&|place| error(place) / sigma(place)).sqrt();
            print!(", sigma {mean:.3}, z {z:.3}");
        }
    }
    let number = |key: &str| summary[key].as_f64().unwrap_or(f64::NAN);
    let (seconds, megabytes) = (number("seconds"), number("memory_bytes") / 1e6);
    println!("   {seconds:.1} s, {megabytes:.0} MB, {} pixels", places.len());
    if let Some(walk) = summary["decorrelation"]["walk_nm"].as_f64() {
        println!("         scatterers walk by {walk:.1} nm a root frame in the median tile");
    }
    summary
}

/// Left half of the slow scene, right half of the fast one.
fn mix(bench: &Bench) {
    let load = |name: &str| npy::load_complex(&bench.path(name));
    let ((shape, mut field), (_, fast)) = (load("slow.npy"), load("fast.npy"));
    let right = |place: usize| place % WIDTH >= WIDTH / 2;
    let all: Vec<Complex32> =
        field.drain(..).enumerate().map(|(i, u)| if right(i) { fast[i] } else { u }).collect();
    npy::save_complex(&bench.path("mixed.npy"), &shape, &all);
}
