//! The on-line solver, driven as a user does: the board's own program behind a pseudo-terminal with
//! the core's solver in it, volumes streamed at rest and during runs, and what the phase does to them.

use num_complex::Complex;
use phasewalk::io::Shape;
use phasewalk::trigger::log::{Ending, RunLog};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::message::{Answer, Event, Model, State};
use phasewalk_firmware::rehearsal::AsF405;
use phasewalk_tests::npy;
use phasewalk_tests::program::Bench;
use phasewalk_tests::recording::Recording;
use phasewalk_tests::rehearsed_board::{Bench as Board, RehearsedBoard};
use serde_json::Value;
use std::fs;

const VOLUMES: usize = 24;

/// The paper's plan, short: 24 volumes every 50 ms, the stimulus from the third on.
const SHORT: &str =
    "paper --set volumes=24 --set interval=50ms --set stimulus.volume=2 --set ready=off";

/// 4 edges per volume and 2 of the stimulus.
const SHORT_EDGES: u64 = 24 * 4 + 2;

/// 10 x 10 speckles whose phase grows by 0.2 rad per volume, and a mask over half of them.
fn series(bench: &Bench) {
    let shape = Shape { frames: VOLUMES, depth: 1, height: 10, width: 10 };
    let recording = Recording::decorrelating(shape, 0.99, 1, |t, _| 0.2 * t as f64);
    recording.save(&bench.path("F.npy"));
    let mask: Vec<bool> = (0..100).map(|pixel| pixel % 2 == 0).collect();
    npy::save_mask(&bench.path("M.npy"), &[10, 10], &mask);
}

fn benches() -> (Bench, RehearsedBoard<AsF405>) {
    let bench = Bench::new();
    series(&bench);
    (bench, RehearsedBoard::f405())
}

fn solve(board: &RehearsedBoard<AsF405>, more: &str) -> String {
    format!("trigger solve F.npy --port {} {more}", board.port)
}

fn run(board: &RehearsedBoard<AsF405>, more: &str) -> String {
    format!(
        "trigger run {SHORT} --port {} --log R.ndjson --yes --solve F.npy --mask M.npy {more}",
        board.port
    )
}

fn log(bench: &Bench) -> RunLog {
    RunLog::read(&bench.path("R.ndjson")).expect("the log can be read")
}

/// The solver's phase of a volume is changed on its way.
fn spoil(answer: Answer, volume: u32, phase: impl Fn(u32) -> u32) -> Answer {
    match answer {
        Answer::Event { number, event: Event::Solved(mut estimate) }
            if estimate.volume == volume =>
        {
            estimate.phase = phase(estimate.phase);
            Answer::Event { number, event: Event::Solved(estimate) }
        }
        other => other,
    }
}

// ---- at rest --------------------------------------------------------------------------------

#[test]
fn board_and_host_have_the_same_bits() {
    let (bench, board) = benches();
    let words = bench.succeed(&solve(&board, "--mask M.npy -o C.csv --plot C.png")).stdout;
    for word in ["same bits: 24 of 24", "50 speckles", "1 ms per volume", "C.csv and C.png"] {
        assert!(words.contains(word), "'{word}' is missing: {words}");
    }
    let table = fs::read_to_string(bench.path("C.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    let head = "volume,phase_rad,sigma_rad,host_phase_rad,difference_rad,took_us";
    assert_eq!((lines.len(), lines[0]), (1 + VOLUMES, head));
    let phase: f64 = lines[VOLUMES].split(',').nth(1).unwrap().parse().unwrap();
    // 23 steps of 0.2 rad, less the mean of the first five.
    assert!((phase - (4.6 - 0.4)).abs() < 0.3, "{phase}");
    assert!(fs::read(bench.path("C.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn the_summary_is_json() {
    let (bench, board) = benches();
    let facts = bench.summary(&solve(&board, "--pick 64 --volumes 7"));
    assert_eq!((&facts["volumes"], &facts["same_bits"]), (&7.into(), &7.into()));
    assert_eq!((&facts["speckles"], &facts["looks"]), (&64.into(), &64.0.into()));
    assert_eq!(facts["first_other_volume"], Value::Null);
    assert!(facts["largest_difference_rad"].as_f64().unwrap() < 1e-4, "{facts}");
    // A second series begins anew.
    let facts = bench.summary(&solve(&board, "--mask M.npy --looks effective"));
    assert_eq!(facts["same_bits"], VOLUMES);
    assert!(facts["looks"].as_f64().unwrap() <= 50.0, "{facts}");
}

#[test]
fn a_bit_that_differs_is_named() {
    let (bench, board) = benches();
    board.filter(|answer| vec![spoil(answer, 5, |bits| bits ^ 1)]);
    let ran = bench.run(&solve(&board, "--mask M.npy"));
    ran.refused(1, &["volume 5", "bit for bit"]);
    assert!(ran.stdout.contains("same bits: 23 of 24"), "{ran:?}");
}

#[test]
fn a_phase_that_is_lost_is_named() {
    let (bench, board) = benches();
    board.filter(|answer| match answer {
        Answer::Event { event: Event::Solved(estimate), .. } if estimate.volume == 3 => {
            // It is lost, and something else happens after it.
            match answer {
                Answer::Event { number, .. } => vec![Answer::Event {
                    number: number.wrapping_add(1),
                    event: Event::Exposed { tick: 0 },
                }],
                other => vec![other],
            }
        }
        other => vec![other],
    });
    bench.run(&solve(&board, "--mask M.npy")).refused(1, &["volume 3", "lost"]);
}

#[test]
fn requests_whose_answer_is_lost_are_done_once() {
    let (bench, board) = benches();
    let mut replies = 0_u32;
    board.filter(move |answer| {
        replies += u32::from(matches!(answer, Answer::Reply { .. }));
        let lost = matches!(answer, Answer::Reply { .. }) && replies.is_multiple_of(5);
        if lost { vec![] } else { vec![answer] }
    });
    let words = bench.succeed(&solve(&board, "--mask M.npy --volumes 8")).stdout;
    assert!(words.contains("same bits: 8 of 8"), "{words}");
}

#[test]
fn what_cannot_be_solved_is_refused() {
    let (bench, board) = benches();
    for (more, status, words) in [
        ("", 1, &["100 speckles", "64", "--pick"][..]),
        ("--mask M.npy --pick 51", 1, &["51", "50 usable"]),
        ("--mask M.npy --pick 8", 2, &["looks = 8", "9"]),
        ("--mask M.npy --looks 51", 2, &["looks = 51", "speckles"]),
        ("--mask M.npy -o C.npy", 2, &["C.npy", ".csv"]),
        ("--mask M.npy --depth 1", 2, &["--depth 1", "0 to 0"]),
        ("--mask M.npy --plot F.npy", 2, &["F.npy", ".png"]),
    ] {
        bench.run(&solve(&board, more)).refused(status, words);
    }
    let uno = RehearsedBoard::default();
    let line = format!("trigger solve F.npy --mask M.npy --port {}", uno.port);
    bench.run(&line).refused(2, &["no on-line solver"]);
}

#[test]
fn the_board_says_what_it_can() {
    let (bench, board) = benches();
    let line = format!("trigger info --port {}", board.port);
    let words = bench.succeed(&line).stdout;
    for word in ["64 speckles x 16 lags", "10 us to 780.2 us", "runs without outputs", "84000000"] {
        assert!(words.contains(word), "'{word}' is missing: {words}");
    }
    let uno = RehearsedBoard::default();
    let words = bench.succeed(&format!("trigger info --port {}", uno.port)).stdout;
    assert!(words.contains("solver      none"), "{words}");
}

// ---- during a run ---------------------------------------------------------------------------

#[test]
fn every_volume_of_a_run_is_solved() {
    let (bench, board) = benches();
    let words = bench.succeed(&run(&board, "")).stdout;
    assert!(words.contains(&format!("{SHORT_EDGES} edges, all on plan")), "{words}");
    let log = log(&bench);
    let volumes: Vec<u32> = log.phases.iter().map(|phase| phase.volume).collect();
    assert_eq!(volumes, (0..VOLUMES as u32).collect::<Vec<_>>());
    // As the same series at rest.
    let _ = bench.succeed(&solve(&board, "--mask M.npy -o C.csv"));
    let table = fs::read_to_string(bench.path("C.csv")).unwrap();
    for (line, phase) in table.lines().skip(1).zip(&log.phases) {
        let at_rest: f32 = line.split(',').nth(1).unwrap().parse().unwrap();
        assert_eq!(at_rest.to_bits(), phase.phase_rad.to_bits());
    }
    let words = bench.succeed("trigger log R.ndjson").stdout;
    assert!(words.contains("on-line phase: 24 volumes, last 4."), "{words}");
    assert!(words.contains("50 speckles"), "{words}");
    let facts = bench.summary("trigger log R.ndjson");
    assert_eq!((&facts["phases"][0]["sigma_rad"], &facts["crossed"]), (&0.0.into(), &Value::Null));
}

#[test]
fn a_volume_is_solved_soon_after_its_sweep() {
    let (bench, board) = benches();
    let _ =
        bench.succeed(&run(&board, "--set interval=200ms --set volumes=12 --set heartbeat=500ms"));
    let log = log(&bench);
    let fit = log.fit().expect("the clock is known");
    let first = log.clock.first().expect("it was compared");
    for phase in log.phases.iter().take(11) {
        // The tick when the phase was read, against the camera's trigger of its volume.
        let tick = first.tick as f64 + (phase.host_s - first.host_s) * fit.ticks_per_second;
        let camera = log.ticks(Channel::Camera, true)[phase.volume as usize];
        let later = (tick - camera as f64) / 84e6;
        assert!((0.0..0.19).contains(&later), "volume {}: {later} s", phase.volume);
    }
}

#[test]
fn a_phase_beyond_its_limit_ends_the_light_and_the_run_goes_on() {
    let (bench, board) = benches();
    let limit = "--set phase_limit.radians=1.5 --set phase_limit.action=stimulus";
    let words = bench.succeed(&run(&board, limit)).stdout;
    for word in [
        "the phase left ±1.5 rad",
        "the stimulus is off",
        "on plan but for the end of the stimulus",
    ] {
        assert!(words.contains(word), "'{word}' is missing: {words}");
    }
    let log = log(&bench);
    let crossed = log.crossed.expect("it is told");
    assert_eq!(log.phases.len(), VOLUMES);
    assert_eq!(log.ticks(Channel::Stimulus, false), [crossed]);
    assert_eq!(log.comparison().deviation, None);
    assert_eq!(board.state(), State::Finished);
    assert!(board.with(|world| world.device.board().rehearsal.phase_line));
    let first = log.phases.iter().find(|phase| phase.phase_rad.abs() > 1.5).unwrap();
    let camera = log.ticks(Channel::Camera, false);
    assert!(crossed > camera[first.volume as usize], "not before its volume");
    let words = bench.succeed("trigger log R.ndjson").stdout;
    assert!(words.contains("the stimulus is off"), "{words}");
}

#[test]
fn a_phase_beyond_its_limit_ends_the_run() {
    let (bench, board) = benches();
    let limit = "--set phase_limit.radians=1.5 --set phase_limit.action=stop";
    let ran = bench.run(&run(&board, limit));
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("the phase has left the bounds"), "{ran:?}");
    let log = log(&bench);
    let summary = log.summary.as_ref().unwrap();
    assert_eq!((summary.ending, summary.safe), (Ending::Fault, true));
    assert_eq!(log.fault.unwrap().0, Fault::Phase);
    assert!(log.phases.last().unwrap().phase_rad > 1.5);
}

#[test]
fn a_line_only_says_so() {
    let (bench, board) = benches();
    let limit = "--set phase_limit.radians=1.5 --set phase_limit.action=line";
    let words = bench.succeed(&run(&board, limit)).stdout;
    for word in ["98 edges, all on plan", "phase line went high"] {
        assert!(words.contains(word), "'{word}' is missing: {words}");
    }
    assert!(!words.contains("stimulus is off"), "{words}");
}

#[test]
fn without_volumes_a_limit_warns_and_silence_ends_the_run() {
    let (bench, board) = benches();
    let limit = "--set phase_limit.radians=2 --set phase_limit.action=line";
    let line = format!("trigger run {SHORT} {limit} --port {} --log R.ndjson --yes", board.port);
    let words = bench.succeed(&line).stdout;
    assert!(words.contains("--solve"), "{words}");
    let ran = bench.run(&format!("{line} --overwrite --set phase_limit.silence=300ms"));
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("no volume was solved"), "{ran:?}");
    assert_eq!(log(&bench).fault.unwrap().0, Fault::NoPhase);
    // With them the same plan goes to its end.
    let _ = bench
        .succeed(&run(&board, &format!("{limit} --overwrite --set phase_limit.silence=300ms")));
}

#[test]
fn runs_that_cannot_be_solved_are_refused_before_they_begin() {
    let (bench, board) = benches();
    bench
        .run(&run(&board, "--set volumes=30 --set camera.memory_images=99999"))
        .refused(1, &["F.npy", "24 volumes", "30 sweeps"]);
    let line = format!("trigger run {SHORT} --port {} --log R.ndjson --yes", board.port);
    bench.run(&format!("{line} --mask M.npy")).refused(2, &["--mask", "--solve"]);
    let uno = RehearsedBoard::default();
    let line = format!("trigger run {SHORT} --port {} --log R.ndjson --yes", uno.port);
    bench.run(&format!("{line} --solve F.npy --mask M.npy")).refused(2, &["no on-line solver"]);
    let limit = "--set phase_limit.radians=2 --set phase_limit.action=line";
    bench.run(&format!("{line} {limit}")).refused(1, &["[phase_limit]", "no on-line solver"]);
    assert!(!bench.path("R.ndjson").exists());
}

#[test]
fn the_frame_clock_runs_during_the_run() {
    let (bench, board) = benches();
    let line = format!("trigger run {SHORT} --port {} --log R.ndjson --yes", board.port);
    let line = format!("{line} --set camera.frame_clock=board");
    let words = bench.succeed(&line).stdout;
    assert!(words.contains("1400 ticks, 60000 Hz") && words.contains("all on plan"), "{words}");
    let plan = log(&bench).header.plan;
    assert_eq!((plan.frame, plan.camera.width), (1400, 512 * 1400));
}

#[test]
fn the_boards_solver_is_the_cores() {
    // The stand-in must not be easier than the board: it takes no speckles out of turn.
    use phasewalk_firmware::board::Solve;
    let mut board = Board::<AsF405>::default();
    assert!(!board.samples(0, &[0; 8]), "no series");
    assert!(!board.begin_series(8, 8.0_f32.to_bits()), "too few");
    assert!(board.begin_series(9, 9.0_f32.to_bits()));
    let speckle = Complex::new(1.0_f32, 0.0);
    let bytes: Vec<u8> = [speckle.re, speckle.im].map(f32::to_le_bytes).concat();
    assert!(!board.samples(1, &bytes) && board.samples(0, &bytes) && !board.samples(0, &bytes));
    assert_eq!(board.solved(), None);
    assert!(board.samples(1, &bytes.repeat(8)));
    assert!(board.solved().is_some_and(|estimate| estimate.volume == 0));
}

// ---- not with a subject -----------------------------------------------------------------------

#[test]
fn a_board_whose_timing_was_never_measured_is_not_for_subjects() {
    let (bench, board) = benches();
    board.with(|world| world.device.board().identity.model = Model::F405);
    let info = bench.succeed(&format!("trigger info --port {}", board.port)).stdout;
    assert!(info.contains("not with a subject"), "{info}");
    let with_subject = run(&board, "--ledger D.ndjson --subject A");
    bench.run(&with_subject).refused(1, &["not with a subject", "Arduino Uno"]);
    assert_eq!(bench.names(), ["F.npy", "M.npy"], "nothing was written");
    let _ = bench.succeed(&run(&board, ""));
    let warnings = log(&bench).header.warnings;
    assert!(warnings.iter().any(|warning| warning.contains("not with a subject")), "{warnings:?}");
}
