//! The errors of the OCT reconstruction on simulated recordings, several seeds each:
//! `cargo run --release -p phasewalk-tests --example oct_table -- [SEEDS] [PRESET ...]`, where a preset
//! may have options of `simulate oct` behind it in the same argument.

use phasewalk_tests::oct::{Scores, score};
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
        "| preset | seed | a2 / a3, rad | dz dy dx, px | rotation, mrad | IS/OS / tips, px | curve, linked | \
         curve, paper | curve, phasor | curve, direct | bad missed | good lost | dead missed / false |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for preset in &presets {
        let scores: Vec<Scores> = (1..=seeds).map(|seed| row(preset, seed)).collect();
        let mean = |of: fn(&Scores) -> f64| {
            (scores.iter().map(|s| of(s).powi(2)).sum::<f64>() / scores.len() as f64).sqrt()
        };
        println!(
            "| {preset} | rms | | | | | {:.3} | {:.3} | {:.3} | {:.3} | | | |",
            mean(|s| s.linked),
            mean(|s| s.paper),
            mean(|s| s.phasor),
            mean(|s| s.direct)
        );
    }
}

fn row(preset: &str, seed: u64) -> Scores {
    let bench = Bench::new();
    let sweep = if preset == "faulty" { "--sweep down" } else { "" };
    let scene = format!("--preset {preset} --seed {seed}");
    let s = score(&bench, &scene, &format!("--images 256 {sweep}"));
    let [a2, a3] = s.dispersion;
    let [dz, dy, dx] = s.shift;
    let [isos, tips] = s.surfaces;
    let [missed, false_ones] = s.dead_pixels;
    println!(
        "| {preset} | {seed} | {a2:.2} / {a3:.2} | {dz:.3} {dy:.3} {dx:.3} | {:.2} | {isos:.3} / {tips:.3} | \
         {:.3} | {:.3} | {:.3} | {:.3} | {:?} | {:?} | {missed} / {false_ones} |",
        s.rotation * 1e3,
        s.linked,
        s.paper,
        s.phasor,
        s.direct,
        s.bad_missed,
        s.good_lost
    );
    s
}
