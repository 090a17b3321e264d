//! The errors of the OCT reconstruction on simulated recordings, several seeds each:
//! `cargo run --release -p phasewalk-tests --example oct_table -- [SEEDS] [PRESET ...]`, where a preset
//! may have options of `simulate oct` behind it in the same argument.

use phasewalk_tests::oct::{CurveError, Scores, score, without_wide_rim};
use phasewalk_tests::program::Bench;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(5);
    let mut presets: Vec<String> = arguments.collect();
    if presets.is_empty() {
        let all = ["easy", "medium", "faulty", "human", "human --sweeps 24"];
        presets = all.map(str::to_owned).to_vec();
    }
    println!(
        "| preset | seed | a2 / a3, rad | dz dy dx, px | rotation, mrad | IS/OS / tips, px | curve, linked | rim off: linked | \
         curve, paper | curve, phasor | curve, direct | wide rim off: linked, paper, phasor | bad missed | good lost | dead missed / false |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for preset in &presets {
        let scores: Vec<Row> = (1..=seeds).map(|seed| row(preset, seed)).collect();
        let curves: [fn(&Row) -> CurveError; 8] = [
            |row| row.scores.linked[0],
            |row| row.scores.linked[1],
            |row| row.scores.paper,
            |row| row.scores.phasor,
            |row| row.scores.direct,
            |row| row.inner[0],
            |row| row.inner[1],
            |row| row.inner[2],
        ];
        let summary = curves.map(|curve| over_seeds(&scores.iter().map(curve).collect::<Vec<_>>()));
        let [linked, linked_inner, paper, phasor, direct, inner @ ..] = summary;
        println!(
            "| {preset} | rms (end: mean ± deviation) | | | | | {linked} | {linked_inner} | {paper} | {phasor} | {direct} | {} | | | |",
            inner.join(", ")
        );
        let more = |other: fn(&Row) -> [CurveError; 2]| more_than(&scores, other);
        println!(
            "{preset}: mean square of linked less that of paper {}, phasor {}; rim off for linked too: paper {}, phasor \
             {}; wide rim off: paper {}, phasor {} rad^2",
            more(|row| [row.scores.linked[0], row.scores.paper]),
            more(|row| [row.scores.linked[0], row.scores.phasor]),
            more(|row| [row.scores.linked[1], row.scores.paper]),
            more(|row| [row.scores.linked[1], row.scores.phasor]),
            more(|row| [row.inner[0], row.inner[1]]),
            more(|row| [row.inner[0], row.inner[2]]),
        );
    }
}

/// Root mean square over seeds and sweeps; mean of the error at the last sweep, which a bias leaves, and its standard
/// deviation, which chance leaves.
fn over_seeds(errors: &[CurveError]) -> String {
    let mean =
        |of: &dyn Fn(&CurveError) -> f64| errors.iter().map(of).sum::<f64>() / errors.len() as f64;
    let rms = mean(&|error| error.rms.powi(2)).sqrt();
    let end = mean(&|error| error.end);
    let deviation = mean(&|error| (error.end - end).powi(2)).sqrt();
    format!("{rms:.3} ({end:.3} ± {deviation:.3})")
}

/// By how much the first mean square exceeds the second, on the same recordings: mean over the seeds ± its standard
/// error.
fn more_than(scores: &[Row], pair: fn(&Row) -> [CurveError; 2]) -> String {
    let count = scores.len() as f64;
    let excess = |row: &Row| {
        let [first, second] = pair(row);
        first.rms.powi(2) - second.rms.powi(2)
    };
    let mean = scores.iter().map(excess).sum::<f64>() / count;
    let square = scores.iter().map(|s| (excess(s) - mean).powi(2)).sum::<f64>();
    format!("{mean:+.4} ± {:.4}", (square / (count * (count - 1.0))).sqrt())
}

/// One recording.
struct Row {
    scores: Scores,
    /// Linked phases, the paper's method and phasors without a wide rim.
    inner: [CurveError; 3],
}

fn row(preset: &str, seed: u64) -> Row {
    let bench = Bench::new();
    let sweep = if preset == "faulty" { "--sweep down" } else { "" };
    let scene = format!("--preset {preset} --seed {seed}");
    let s = score(&bench, &scene, &format!("--images 256 {sweep}"));
    let inner = without_wide_rim(&bench);
    let [a2, a3] = s.dispersion;
    let [dz, dy, dx] = s.shift;
    let [isos, tips] = s.surfaces;
    let [missed, false_ones] = s.dead_pixels;
    println!(
        "| {preset} | {seed} | {a2:.2} / {a3:.2} | {dz:.3} {dy:.3} {dx:.3} | {:.2} | {isos:.3} / {tips:.3} | \
         {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {} | {:?} | {:?} | {missed} / {false_ones} |",
        s.rotation * 1e3,
        s.linked[0].rms,
        s.linked[1].rms,
        s.paper.rms,
        s.phasor.rms,
        s.direct.rms,
        inner.map(|error| format!("{:.3}", error.rms)).join(", "),
        s.bad_missed,
        s.good_lost
    );
    Row { scores: s, inner }
}
