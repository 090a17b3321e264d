//! How near the estimators come to the Cramér–Rao bound:
//! `cargo run --release -p phasewalk-tests --example bound_table -- [TRIALS] [LOOKS,...] [SCENARIO ...]`, a
//! scenario being any part of its name. Each entry: rms error of the end phase over the bound +- its standard
//! error, and the standard deviation of the standard scores.

use phasewalk::progress::Progress;
use phasewalk::study::{ESTIMATORS, run, scenarios};

/// The seed of the published table.
const SEED: u64 = 1;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let trials = arguments.next().map_or(400, |n| n.parse().expect("TRIALS is a number"));
    let looks = arguments.next().unwrap_or_else(|| "1000,100".to_owned());
    let looks: Vec<usize> =
        looks.split(',').map(|n| n.parse().expect("LOOKS are numbers")).collect();
    let wanted: Vec<String> = arguments.collect();
    print!("| scenario | looks | bound, rad |");
    println!("{}", ESTIMATORS.map(|(name, _)| format!(" {name} |")).concat());
    println!("|---|---|---|{}", "---|".repeat(ESTIMATORS.len()));
    for scenario in scenarios() {
        if !wanted.is_empty() && !wanted.iter().any(|name| scenario.name.contains(name.as_str())) {
            continue;
        }
        for &looks in &looks {
            let progress = Progress::new(scenario.name, trials as u64);
            let scores = run(&scenario, looks, trials, SEED, &progress).expect("enough memory");
            drop(progress);
            print!("| {} | {looks} | {:.4} |", scenario.name, scenario.bound(looks as f64));
            for score in scores {
                let lost =
                    if score.lost > 0 { format!(", {} lost", score.lost) } else { String::new() };
                let (over, error) = (score.over_bound, score.standard_error);
                print!(" {over:.3} ± {error:.3}, z {:.2}{lost} |", score.z);
            }
            println!();
        }
    }
}
