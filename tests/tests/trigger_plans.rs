//! Plans of the trigger board as a user checks and previews them.

use phasewalk_tests::program::Bench;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::time::{Duration, Instant};

/// Run it, see it refused, and see that the folder is as it was.
fn refuse(bench: &Bench, line: &str, status: i32, words: &[&str]) {
    let before = bench.names();
    let ran = bench.run(line);
    ran.refused(status, words);
    assert_eq!(ran.stdout, "", "{line}: nothing half-done");
    assert_eq!(bench.names(), before, "{line}: nothing may be left behind");
}

/// The limits that come with the program, for a laser that is dark between its pulses.
fn gated_limits() -> String {
    let example = include_str!("../../host/src/trigger/presets/limits.toml");
    example.replace("emission = \"continuous\"", "emission = \"gated\"")
}

fn channel<'a>(summary: &'a Value, name: &str) -> &'a Value {
    let channels = summary["certificate"]["channels"].as_array().unwrap();
    channels.iter().find(|channel| channel["channel"] == name).unwrap()
}

// ---- check ---------------------------------------------------------------------------------

#[test]
fn the_papers_sequence_is_checked() {
    let bench = Bench::new();
    let text = bench.succeed("trigger check paper").stdout;
    for words in [
        "70 sweeps, one every 225 ms",
        "8.5333125 ms (136533 ticks)",
        "35840 of the 35840 images",
        "with volume 5 (counted from 0), at 1.125 s",
        "282 edges",
        "not certified",
        "All rules kept",
    ] {
        assert!(text.contains(words), "'{words}' is missing: {text}");
    }
}

#[test]
fn presets_pass_and_their_json_has_the_figures() {
    let bench = Bench::new();
    for (preset, volumes, edges) in [("paper", 70, 282), ("pairs", 70, 282), ("triples", 69, 278)] {
        let summary = bench.summary(&format!("trigger check {preset}"));
        assert_eq!(summary["volumes"], volumes);
        assert_eq!(summary["certificate"]["edges"], edges);
        let rows = summary["budget"].as_array().unwrap();
        assert!(rows.iter().all(|row| row["share"].as_f64().unwrap() <= 1.0), "{preset}");
        for name in ["laser", "camera", "stimulus"] {
            assert!(channel(&summary, name)["least_slack_ticks"].as_u64().unwrap() > 0, "{name}");
        }
    }
    let summary = bench.summary("trigger check paper");
    assert_eq!(
        (&summary["images"], &summary["camera_bytes"]),
        (&35_840.into(), &12_661_555_200_u64.into())
    );
    // 5 mW on 2.6 mm x 1.5 mm for the 15.5 s of the run.
    let dose = summary["doses_j_cm2"]["retina, laser"].as_f64().unwrap();
    assert!((dose - 5e-3 / 0.039 * (69.0 * 0.225 + 136_533.0 / 16e6)).abs() < 1e-9, "{dose}");
}

#[test]
fn settings_change_the_plan() {
    let bench = Bench::new();
    let settings = "--set volumes=10 --set interval=300ms --set interlock=off --set ready=off \
                    --set stimulus.duration=2s --set burst.sweeps=2 --set burst.spacing=12ms";
    let summary = bench.summary(&format!("trigger check paper {settings}"));
    assert_eq!((&summary["bursts"], &summary["interval_s"]), (&5.into(), &0.3.into()));
    assert_eq!(summary["plan_ticks"]["spacing"][0], 192_000);
    assert_eq!(summary["plan_ticks"]["stimulus"]["on"], 32_000_000);
    let warnings = summary["warnings"].to_string();
    assert!(warnings.contains("interlock off") && warnings.contains("ready off"), "{warnings}");
}

#[test]
fn a_file_goes_before_a_preset() {
    let bench = Bench::new();
    fs::write(bench.path("paper"), "volumes = 3\ninterval_ms = 20\n").unwrap();
    assert_eq!(bench.summary("trigger check paper")["volumes"], 3);
}

#[test]
fn files_that_are_wrong_are_refused_with_their_line() {
    let bench = Bench::new();
    for (text, words) in [
        ("volumes = 1\n\ncolour = 3\n", ["line 3", "colour", "volumes"]),
        ("volumes = 1\n[camera]\npulse = 3\n", ["line 3", "camera.pulse", "us"]),
        ("volumes = 1\n[camera]\npulse_ms = \"3\"\n", ["line 3", "camera.pulse_ms", "number"]),
        (
            "volumes = 5\ninterval_ms = 50\n[burst]\nsweeps = 2\nspacing_ms = 12\n",
            ["line 1", "multiple", "4 or 6"],
        ),
        ("volumes = = 5\n", ["P.toml", "line 1", "="]),
    ] {
        fs::write(bench.path("P.toml"), text).unwrap();
        refuse(&bench, "trigger check P.toml", 1, &words);
    }
    refuse(&bench, "trigger check papyrus", 1, &["papyrus", "paper, pairs, triples"]);
}

#[test]
fn settings_that_are_wrong_are_refused() {
    let bench = Bench::new();
    for (setting, words) in [
        ("interval=225", ["--set interval=225", "unit"]),
        ("interval=225kHz", ["kHz", "ms"]),
        ("intervall=225ms", ["intervall", "interval_"]),
        ("volumes=many", ["volumes=many", "whole number"]),
        ("interlock=perhaps", ["perhaps", "pulsed"]),
    ] {
        refuse(&bench, &format!("trigger check paper --set {setting}"), 2, &words);
    }
}

#[test]
fn rules_are_kept_with_their_figures() {
    let bench = Bench::new();
    for (settings, words) in [
        ("--set volumes=71", ["36352", "35840", "camera"]),
        ("--set camera.pulse=10us", ["0.01 ms", "0.05 ms", "800 ticks"]),
        ("--set interval=8.55ms", ["interval", "8.55 ms", "8.5833125 ms"]),
        ("--set laser.pulse=21ms", ["laser", "21 ms", "20 ms"]),
    ] {
        refuse(&bench, &format!("trigger check paper {settings}"), 1, &words);
    }
}

#[test]
fn exposures_above_the_limit_are_refused() {
    let bench = Bench::new();
    let limits = gated_limits();
    fs::write(bench.path("dim.toml"), &limits).unwrap();
    let _ = bench.succeed("trigger check paper --limits dim.toml");
    fs::write(bench.path("strong.toml"), limits.replace("power_mw = 5.0", "power_mw = 25.0"))
        .unwrap();
    let words = ["retina, laser: irradiance", "0.641", "0.5 W/cm2", "strong.toml"];
    refuse(&bench, "trigger check paper --limits strong.toml", 1, &words);
    refuse(&bench, "trigger preview paper --limits strong.toml -o P.svg", 1, &words);
    fs::write(bench.path("odd.toml"), limits.replace("duty = 0.2", "dutty = 0.2")).unwrap();
    refuse(&bench, "trigger check paper --limits odd.toml", 1, &["odd.toml", "line 15", "dutty"]);
}

/// A source that may emit with its trigger low counts for the whole run.
#[test]
fn long_plans_are_checked_quickly() {
    let bench = Bench::new();
    fs::write(bench.path("dark.toml"), gated_limits()).unwrap();
    let line = "trigger check paper --set interval=300s --set stimulus.duration=2s";
    let start = Instant::now();
    let summary = bench.summary(&format!("{line} --limits dark.toml"));
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
    assert_eq!(summary["certificate"]["edges"], 282);
    refuse(&bench, line, 1, &["retina, laser", "J/cm2", "continuous"]);
}

#[test]
fn doses_add_up_over_runs() {
    let bench = Bench::new();
    let line = "trigger check paper --ledger L.ndjson --subject S07";
    assert_eq!(bench.summary(line)["volumes"], 70);
    assert_eq!(bench.names(), [""; 0], "check does not write the ledger");
    let entry = |dose: f64| {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap();
        let date = rfc3339(now.as_secs() - 3600);
        format!(
            "{{\"date\":\"{date}\",\"subject\":\"S07\",\"plan\":\"paper\",\"plan_hash\":\"00000000\",\
             \"doses_j_cm2\":{{\"retina, laser\":{dose}}}}}\n"
        )
    };
    fs::write(bench.path("L.ndjson"), entry(24.0)).unwrap();
    let _ = bench.succeed(line);
    fs::write(bench.path("L.ndjson"), entry(24.0) + &entry(24.5)).unwrap();
    refuse(&bench, line, 1, &["retina, laser: 24 h", "50.49", "50 J/cm2"]);
    let _ = bench.succeed("trigger check paper --ledger L.ndjson --subject S08");
    fs::write(bench.path("L.ndjson"), entry(24.0) + "{\"date\":").unwrap();
    refuse(&bench, line, 1, &["L.ndjson", "line 2"]);
    refuse(&bench, "trigger check paper --ledger L.ndjson", 2, &["--subject"]);
}

/// Seconds since 1970 as a date (Howard Hinnant's algorithm for days from 1970 on).
fn rfc3339(seconds: u64) -> String {
    let (days, rest) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let (month, carry) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    let year = era * 400 + year + carry;
    let (hour, minute, second) = (rest / 3600, rest / 60 % 60, rest % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

// ---- preview -------------------------------------------------------------------------------

/// Edges of a VCD file in ticks of 16 MHz: time, name, level.
fn vcd_edges(text: &str) -> Vec<(u64, String, bool)> {
    let mut names = BTreeMap::new();
    let (mut edges, mut time, mut started) = (Vec::new(), 0, false);
    assert!(text.contains("$timescale 100 ps $end"));
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if let ["$var", "wire", "1", id, name, "$end"] = words.as_slice() {
            let _ = names.insert((*id).to_owned(), (*name).to_owned());
        } else if let Some(steps) = line.strip_prefix('#') {
            let steps: u64 = steps.parse().unwrap();
            assert_eq!(steps % 625, 0, "a whole number of ticks");
            assert!(!started || steps / 625 > time, "time goes on");
            (time, started) = (steps / 625, true);
        } else if started {
            let (level, id) = line.split_at(1);
            edges.push((time, names[id].clone(), level == "1"));
        }
    }
    edges
}

#[test]
fn the_vcd_file_holds_the_schedule() {
    let bench = Bench::new();
    let _ = bench.succeed("trigger preview paper -o P.vcd");
    let text = fs::read_to_string(bench.path("P.vcd")).unwrap();
    let hash = bench.summary("trigger check paper")["compiled"]["hash"].clone();
    assert!(text.starts_with("$comment plan paper") && text.contains(hash.as_str().unwrap()));
    let mut expected = Vec::new();
    for volume in 0..70 {
        let start = volume * 3_600_000;
        for (name, width) in [("laser", 136_533), ("camera", 1600)] {
            expected.push((start, name.to_owned(), true));
            expected.push((start + width, name.to_owned(), false));
        }
    }
    expected.push((5 * 3_600_000, "stimulus".to_owned(), true));
    expected.push((69 * 3_600_000 + 136_533, "stimulus".to_owned(), false));
    expected.sort();
    let mut edges = vcd_edges(&text);
    edges.sort();
    assert_eq!(edges, expected);
}

#[test]
fn the_picture_shows_run_and_details() {
    let bench = Bench::new();
    for preset in ["paper", "pairs", "triples"] {
        let ran = bench.succeed(&format!("trigger preview {preset} -o P.svg"));
        assert!(ran.stdout.contains("P.svg"), "{ran:?}");
        let svg = fs::read_to_string(bench.path("P.svg")).unwrap();
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n") && !svg.contains("<script"));
        for words in [preset, "whole run", "laser 8.5333125 ms", "stimulus", "camera", "interval"] {
            assert!(svg.contains(words), "{preset}: '{words}' is missing");
        }
    }
    assert_eq!(bench.names(), ["P.svg"]);
}

#[test]
fn wavedrom_is_json_with_lanes_of_one_length() {
    let bench = Bench::new();
    let _ = bench.succeed("trigger preview pairs -o P.json");
    let text = fs::read_to_string(bench.path("P.json")).unwrap();
    let picture: Value = serde_json::from_str(&text).unwrap();
    let lanes = picture["signal"].as_array().unwrap();
    let waves: Vec<&str> = lanes.iter().map(|lane| lane["wave"].as_str().unwrap()).collect();
    assert_eq!(lanes.len(), 4);
    assert!(waves.iter().all(|wave| wave.len() == waves[0].len()), "{waves:?}");
    assert!(waves[0].starts_with("01.01.0|"), "{waves:?}");
    let boxes = waves[3].matches('=').count();
    assert_eq!(lanes[3]["data"].as_array().unwrap().len(), boxes);
    assert!(picture["foot"]["text"].as_str().unwrap().contains("Not to scale"));
}

#[test]
fn without_a_file_it_is_drawn_on_the_terminal() {
    let bench = Bench::new();
    let text = bench.succeed("trigger preview paper").stdout;
    assert!(text.contains("stimulus ____|####") && text.contains("15.53 s"), "{text}");
    assert!(bench.names().is_empty());
}

#[test]
fn previews_that_cannot_be_written_are_refused() {
    let bench = Bench::new();
    refuse(&bench, "trigger preview paper -o P.png", 2, &["P.png", ".svg", ".vcd", ".json"]);
    refuse(&bench, "trigger preview paper -o missing/P.svg", 1, &["missing", "does not exist"]);
}
