//! How near linked phases of two layers come to the Cramér–Rao bound of the difference:
//! `cargo run --release -p phasewalk-tests --example layer_table -- [TRIALS]`. Each entry: rms error of the end phase
//! over the bound +- its standard error, and the standard deviation of the standard scores.

use phasewalk::progress::Progress;
use phasewalk::study::{Tilt, run_layers, scenarios};

/// The seed of the published table.
const SEED: u64 = 1;
/// Sides of the squares of speckles: 1024 and 100 looks.
const SIDES: [usize; 2] = [32, 10];
/// Phase from edge to edge, rad.
const TILTS: [f64; 2] = [0.0, 3.0];

fn main() {
    let trials = std::env::args().nth(1).map_or(400, |n| n.parse().expect("TRIALS is a number"));
    println!("| scenario | looks | tilt, rad | linked |");
    println!("|---|---|---|---|");
    for scenario in scenarios().iter().take(4) {
        for side in SIDES {
            for across_rad in TILTS {
                let progress = Progress::new(scenario.name, trials as u64);
                let tilt = Tilt { across_rad };
                let score = run_layers(scenario, side, tilt, trials, SEED, &progress);
                let score = score.expect("enough memory");
                println!("| {} | {} | {across_rad} | {score} |", scenario.name, side * side);
            }
        }
    }
}
