//! How near the estimators come to the Cramér–Rao bound:
//! `cargo run --release -p phasewalk-tests --example bound_table -- [TRIALS] [LOOKS,...] [SCENARIO ...]`, a
//! scenario being any part of its name. Each entry: rms error of the end phase over the bound +- its standard
//! error, and the standard deviation of the standard scores.

use phasewalk::progress::Progress;
use phasewalk::study::{Estimator, run, scenarios};

/// The seed of the published table.
const SEED: u64 = 1;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let trials = arguments.next().map_or(400, |n| n.parse().expect("TRIALS is a number"));
    let looks = arguments.next().unwrap_or_else(|| "1000,100".to_owned());
    let looks: Vec<usize> =
        looks.split(',').map(|n| n.parse().expect("LOOKS are numbers")).collect();
    let wanted: Vec<String> = arguments.collect();
    let names = Estimator::ALL.map(|estimator| format!(" {} |", estimator.name()));
    println!("| scenario | looks | bound, rad |{}", names.concat());
    println!("|---|---|---|{}", "---|".repeat(names.len()));
    for scenario in scenarios() {
        if !wanted.is_empty() && !wanted.iter().any(|name| scenario.name.contains(name.as_str())) {
            continue;
        }
        for &looks in &looks {
            let progress = Progress::new(scenario.name, trials as u64);
            let scores = run(&scenario, looks, trials, SEED, &progress).expect("enough memory");
            drop(progress);
            let entries: String = scores.iter().map(|score| format!(" {score} |")).collect();
            let bound = scenario.bound(looks as f64);
            println!("| {} | {looks} | {bound:.4} |{entries}", scenario.name);
        }
    }
}
