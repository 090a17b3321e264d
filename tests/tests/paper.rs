//! `phasewalk paper` as a user drives it: what it writes, that it may be interrupted, what it refuses.

use phasewalk_tests::program::{Bench, Ran, names_in};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A scene that takes a fraction of a second.
const SMALL: &str = "--width 96 --height 64 --trials 2";

const FILES: [&str; 11] = [
    "bound.md",
    "claims.csv",
    "claims.md",
    "fig1.png",
    "fig1.svg",
    "fig2.png",
    "fig2.svg",
    "fig3.png",
    "fig3.svg",
    "index.html",
    "runs.csv",
];

/// Numbers and titles of the columns of the runs.
const COLUMNS: &str =
    "sigma_wavelengths,run,frame,direct_rad,one_step_rad,paper_rad,linked_rad,autocorrelation";

fn text(bench: &Bench, name: &str) -> String {
    fs::read_to_string(bench.path(name)).unwrap()
}

fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    names_in(folder)
        .into_iter()
        .map(|name| (name.clone(), fs::read(folder.join(name)).unwrap()))
        .collect()
}

#[test]
fn figures_tables_and_page_are_written() {
    let bench = Bench::new();
    let summary = bench.summary(&format!("paper --out P --runs 2 {SMALL}"));
    assert_eq!(names_in(&bench.path("P")), FILES);
    assert_eq!(summary["files"].as_array().unwrap().len(), FILES.len());

    let claims = summary["claims"].as_array().unwrap();
    assert!(claims.len() > 20);
    let judged = |claim: &Value| claim["value"].is_f64() && claim["holds"].is_boolean();
    assert!(claims.iter().all(judged), "{claims:?}");
    let table = text(&bench, "P/claims.md");
    let csv = text(&bench, "P/claims.csv");
    for claim in claims {
        let says = claim["text"].as_str().unwrap();
        assert!(table.contains(says) && csv.contains(says), "{says}");
    }
    assert_eq!(csv.lines().count(), claims.len() + 1);

    let bound = text(&bench, "P/bound.md");
    assert!(bound.contains("| λ/32 | 1000 | 0.0758 |") && bound.contains("linked"), "{bound}");
    let page = text(&bench, "P/index.html");
    assert_eq!(page.matches("<table>").count(), 3);
    assert_eq!(page.matches("<figure").count(), 3);

    let runs = text(&bench, "P/runs.csv");
    let mut lines = runs.lines();
    assert!(lines.next().unwrap().contains("width=96 height=64 seed=1"));
    assert_eq!(lines.next(), Some(COLUMNS));
    assert_eq!(lines.count(), 2 * 4 * 70, "2 runs of 4 sigmas of 70 frames");
}

#[test]
fn an_interrupted_call_is_taken_up() {
    let bench = Bench::new();
    let line = |out, threads| format!("paper --out {out} --runs 3 {SMALL} --threads {threads}");
    let mut command = bench.command(&line("A", 2));
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    let a_run_is_there =
        || fs::read_to_string(bench.path("A/runs.csv")).is_ok_and(|text| text.lines().count() > 72);
    while !a_run_is_there() {
        assert!(start.elapsed() < Duration::from_secs(60), "no run");
        std::thread::sleep(Duration::from_millis(2));
    }
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    Ran::of("paper", &output).refused(130, &["interrupted", "A/runs.csv", "goes on"]);
    assert_eq!(names_in(&bench.path("A")), ["runs.csv"]);
    // As if the power had failed in the middle of a run.
    let mut runs = fs::read(bench.path("A/runs.csv")).unwrap();
    runs.truncate(runs.len() - 1000);
    fs::write(bench.path("A/runs.csv"), runs).unwrap();

    let _ = bench.succeed(&line("A", 1));
    let _ = bench.succeed(&line("B", 2));
    assert!(contents(&bench.path("A")) == contents(&bench.path("B")));
}

#[test]
fn more_runs_are_added_and_other_settings_refused() {
    let bench = Bench::new();
    let _ = bench.succeed(&format!("paper --out P --runs 1 {SMALL}"));
    let one = text(&bench, "P/runs.csv");
    let ran = bench.succeed(&format!("paper --out P --runs 2 {SMALL}"));
    assert!(ran.stdout.contains("4 scenes of Figure 3 are there already"), "{ran:?}");
    assert!(text(&bench, "P/runs.csv").starts_with(&one));

    let before = contents(&bench.path("P"));
    for (changed, difference) in [
        ("--width 100 --height 64", "width=96, not width=100"),
        ("--width 96 --height 64 --seed 2", "seed=1, not seed=2"),
    ] {
        let ran = bench.run(&format!("paper --out P --runs 2 {changed}"));
        ran.refused(2, &["P/runs.csv", difference, "--out"]);
    }
    assert!(contents(&bench.path("P")) == before);
    fs::write(bench.path("P/runs.csv"), "mine").unwrap();
    bench.run(&format!("paper --out P {SMALL}")).refused(1, &["holds no runs", "--out"]);
    assert_eq!(text(&bench, "P/runs.csv"), "mine");
}

#[test]
fn wrong_usage_leaves_nothing() {
    let bench = Bench::new();
    for (option, words) in [
        ("--runs 0", ["--runs 0", "at least 1"]),
        ("--width 8", ["--width 8", "at least 32"]),
        ("--gaussian 0", ["--gaussian 0", "above 0"]),
        ("--gaussian 1e6", ["--gaussian 1e6", "as wide as the image"]),
        ("--trials 0", ["--trials 0", "at least 1"]),
    ] {
        bench.run(&format!("paper --out P {option}")).refused(2, &words);
        assert!(bench.names().is_empty(), "{option}");
    }
}
