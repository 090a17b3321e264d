//! Errors of phase images of the paper's scene at full size, by the paper's and by the linked method:
//! `cargo run --release -p phasewalk-tests --example image_errors`. Inside the x, five pixels off its edge: rms error at
//! some frames, for linked phases the mean standard deviation and that of error / sigma; then the scatterers'
//! motion from the decorrelation map; then the same in a scene whose halves move differently.

use num_complex::Complex32;
use phasewalk_tests::npy;
use phasewalk_tests::program::Bench;

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
    let bench = Bench::new();
    for (name, sigma) in [("slow", "1/32"), ("fast", "1/16")] {
        let _ = bench.succeed(&format!("simulate speckle --sigma {sigma} -o {name}.npy"));
        let x = npy::load_mask(&bench.path(&format!("{name}.mask.npy"))).1;
        let inside = |place: usize| around(place, |place| x[place]);
        println!("sigma = lambda * {sigma}, inside the x");
        for method in ["paper", "linked"] {
            evaluate(&bench, name, method, inside);
        }
    }
    println!("left half lambda/32, right half lambda/16, outside of the x");
    mix(&bench);
    let x = npy::load_mask(&bench.path("slow.mask.npy")).1;
    let outside = |place: usize| around(place, |place| !x[place]);
    let middle = WIDTH / 2;
    evaluate(&bench, "mixed", "linked", |place| place % WIDTH < middle - 20 && outside(place));
    evaluate(&bench, "mixed", "linked", |place| place % WIDTH > middle + 20 && outside(place));
}

/// Does it hold for all pixels within RIM?
fn around(place: usize, holds: impl Fn(usize) -> bool) -> bool {
    let (y, x) = (place / WIDTH, place % WIDTH);
    let rows = y.saturating_sub(RIM)..=(y + RIM).min(HEIGHT - 1);
    let columns = x.saturating_sub(RIM)..=(x + RIM).min(WIDTH - 1);
    rows.into_iter().all(|y| columns.clone().all(|x| holds(y * WIDTH + x)))
}

fn evaluate(bench: &Bench, name: &str, method: &str, chosen: impl Fn(usize) -> bool) {
    let line =
        format!("phase {name}.npy --gaussian 3 --method {method} --wavelength-nm 841 -o P.npy");
    let summary = bench.summary(&line);
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
    println!(
        "   {:.1} s, {} pixels",
        summary["seconds"].as_f64().unwrap_or(f64::NAN),
        places.len()
    );
    if let Some(walk) = summary["decorrelation"]["walk_nm"].as_f64() {
        println!("         scatterers walk by {walk:.1} nm a root frame in the median tile");
    }
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
