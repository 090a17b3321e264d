//! How near the estimators come to the Cramér–Rao bound:
//! `cargo run --release -p phasewalk-tests --example bound_table -- [TRIALS] [LOOKS,...] [SCENARIO ...]`, a
//! scenario being any part of its name. Each entry: rms error of the end phase over the bound +- its standard
//! error, and the standard deviation of the standard scores. Phase linking, as a series and tracked, is tried on all
//! TRIALS, the other estimators on the first fifth of them.

use phasewalk::method::Method;
use phasewalk::progress::Progress;
use phasewalk::study::{Estimator, Scenario, Score, run, scenarios};

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
            let entries: String = scores(&scenario, looks, trials)
                .iter()
                .map(|score| format!(" {score} |"))
                .collect();
            let bound = scenario.bound(looks as f64);
            println!("| {} | {looks} | {bound:.4} |{entries}", scenario.name);
        }
    }
}

/// Scores of [`Estimator::ALL`].
fn scores(scenario: &Scenario, looks: usize, trials: usize) -> Vec<Score> {
    let few = (trials / 5).max(1);
    let ours = [Estimator::Own(Method::Linked), Estimator::Tracker];
    let others: Vec<_> = Estimator::ALL.into_iter().filter(|one| !ours.contains(one)).collect();
    let progress = Progress::new(scenario.name, (trials + few) as u64);
    let run = |estimators: &[Estimator], trials| {
        run(scenario, estimators, looks, trials, SEED, &progress).expect("enough memory")
    };
    let (exact, coarse) = (run(&ours, trials), run(&others, few));
    let found = |one: Estimator| {
        let place = |all: &[Estimator]| all.iter().position(|&other| other == one);
        place(&ours).map_or_else(|| coarse[place(&others).expect("one of them")], |i| exact[i])
    };
    Estimator::ALL.into_iter().map(found).collect()
}
