//! The program against the board's own program behind a pseudo-terminal: runs, their logs, and
//! everything that can go wrong on the line between them.

use phasewalk::io::Shape;
use phasewalk::trigger::log::{Ending, RunLog};
use phasewalk_firmware::channel::Edge;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::message::{Answer, Event, Reply, State};
use phasewalk_tests::npy;
use phasewalk_tests::program::{Bench, Ran};
use phasewalk_tests::recording::Recording;
use phasewalk_tests::rehearsed_board::{RehearsedBoard, Setup};
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The paper's plan, short: 8 volumes every 25 ms, the stimulus from the third on.
const SHORT: &str = "paper --set volumes=8 --set interval=25ms --set stimulus.volume=2";

/// Long enough to be interrupted: 40 s.
const LONG: &str = "paper --set volumes=40 --set interval=1s";

/// 4 edges per volume and 2 of the stimulus.
const SHORT_EDGES: usize = 8 * 4 + 2;

fn run_line(board: &RehearsedBoard, plan: &str) -> String {
    format!("trigger run {plan} --port {} --log R.ndjson --yes", board.port)
}

fn log(bench: &Bench) -> RunLog {
    RunLog::read(&bench.path("R.ndjson")).expect("the log can be read")
}

fn ending(bench: &Bench) -> Ending {
    log(bench).summary.expect("the log has an end").ending
}

/// Start the program in the background.
fn spawn(bench: &Bench, line: &str) -> Child {
    let mut command = bench.command(line);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("the program starts")
}

fn wait(child: Child, line: &str) -> Ran {
    Ran::of(line, &child.wait_with_output().expect("it ends"))
}

fn interrupt(child: &Child) {
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill can be run").success());
}

// ---- a board that works ---------------------------------------------------------------------

#[test]
fn the_board_says_who_and_how_it_is() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = format!("trigger info --port {}", board.port);
    let words = bench.succeed(&line).stdout;
    for word in ["16000000 ticks/s", "idle", "power on", "50 us", "closed"] {
        assert!(words.contains(word), "'{word}' is missing: {words}");
    }
    let facts = bench.summary(&line);
    assert_eq!(facts["board"]["limits"]["ticks_per_second"], 16_000_000);
    assert_eq!(facts["status"]["state"], "Idle");
}

#[test]
fn a_run_logs_every_edge_that_the_board_made() {
    let setup = Setup { exposure_delay: Some(77), ..Setup::default() };
    let (bench, board) = (Bench::new(), RehearsedBoard::start(setup));
    let ran = bench.succeed(&run_line(&board, SHORT));
    assert!(ran.stdout.contains("34 edges, all on plan"), "{ran:?}");
    let (log, made) = (log(&bench), board.edges());
    assert_eq!((log.edges.len(), made.len()), (SHORT_EDGES, SHORT_EDGES));
    let sorted = |edges: &[Edge]| {
        let mut edges: Vec<(usize, u64, bool)> =
            edges.iter().map(|edge| (edge.channel.index(), edge.tick, edge.high)).collect();
        edges.sort_unstable();
        edges
    };
    assert_eq!(sorted(&log.edges), sorted(&made));
    let summary = log.summary.as_ref().unwrap();
    assert_eq!((summary.ending, summary.safe, summary.events_lost), (Ending::Finished, true, 0));
    assert_eq!(board.state(), State::Finished);
    // Volume k is exposed 77 ticks after its trigger.
    let times = log.times().unwrap().nominal_s;
    let expected = |volume: usize| (volume as f64 * 400_000.0 + 77.0) / 16e6;
    assert_eq!(times, (0..8).map(expected).collect::<Vec<_>>());
}

#[test]
fn what_the_log_says_can_be_read_in_words_json_and_csv() {
    let setup = Setup { exposure_delay: Some(77), ..Setup::default() };
    let (bench, board) = (Bench::new(), RehearsedBoard::start(setup));
    let _ = bench.succeed(&run_line(&board, SHORT));
    let words = bench.succeed("trigger log R.ndjson --csv E.csv").stdout;
    for word in ["34 edges, all on plan", "7 times, mean 25 ms", "peak to peak 0 ticks", "EXPOSE"] {
        assert!(words.contains(word), "'{word}' is missing: {words}");
    }
    let table = fs::read_to_string(bench.path("E.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + SHORT_EDGES + 8);
    assert_eq!(table.lines().next(), Some("channel,level,volume,tick,time_s,fitted_s"));
    assert!(table.contains("exposed,1,7,"), "{table}");
    let facts = bench.summary("trigger log R.ndjson");
    assert_eq!(facts["defect"], Value::Null);
    assert_eq!(facts["statistics"]["exposure_delay"]["min"], 77);
    assert_eq!(facts["statistics"]["camera_minus_laser"]["max"], 0);
    assert_eq!(facts["statistics"]["intervals"][0]["made"]["mean"], 400_000.0);
}

/// Pairs 12 ms apart every 100 ms, exposed 77 ticks after the trigger: the times of the frames, in seconds.
#[test]
fn a_log_gives_a_series_its_times() {
    let setup = Setup { exposure_delay: Some(77), ..Setup::default() };
    let (bench, board) = (Bench::new(), RehearsedBoard::start(setup));
    let plan = "pairs --set volumes=8 --set interval=100ms --set stimulus.volume=2";
    let _ = bench.succeed(&run_line(&board, plan));
    let shape = |frames| Shape { frames, depth: 1, height: 20, width: 20 };
    let save = |name: &str, frames| {
        Recording::decorrelating(shape(frames), 0.95, 3, |_, _| 0.0).save(&bench.path(name));
    };
    save("F.npy", 8);
    save("G.npy", 9);
    npy::save_mask(&bench.path("M.npy"), &[20, 20], &[true; 400]);
    let _ = bench.succeed("phase F.npy --mask M.npy --times R.ndjson -o C.csv");
    let times: Vec<f64> = bench.table("C.csv").1.iter().map(|row| row[1]).collect();
    let tick = |volume: usize| (volume / 2 * 1_600_000 + volume % 2 * 192_000 + 77) as f64;
    assert_eq!(times, (0..8).map(|volume| tick(volume) / 16e6).collect::<Vec<_>>());
    let line = "phase G.npy --mask M.npy --times R.ndjson -o D.csv";
    bench.run(line).refused(1, &["R.ndjson", "8 times", "9 frames"]);
    let log = fs::read_to_string(bench.path("R.ndjson")).unwrap();
    fs::write(bench.path("R.ndjson"), log.replacen("\"version\":1", "\"version\":7", 1)).unwrap();
    let line = "phase F.npy --mask M.npy --times R.ndjson -o D.csv";
    bench.run(line).refused(1, &["R.ndjson", "version 7"]);
    assert!(!bench.path("D.csv").exists());
}

#[test]
fn a_resonator_that_is_slow_is_measured() {
    let setup = Setup { ppm: -2021.0, ..Setup::default() };
    let (bench, board) = (Bench::new(), RehearsedBoard::start(setup));
    let _ = bench.succeed(&run_line(&board, "paper --set volumes=16 --set interval=500ms"));
    let log = log(&bench);
    let fit = log.fit().unwrap();
    assert!((fit.ppm + 2021.0).abs() < 5.0 * fit.ppm_sigma + 5.0, "{fit:?}");
    assert!(fit.is_useful(), "{fit:?}");
    let times = log.times().unwrap();
    let (nominal, fitted) = (times.nominal_s[15], times.fitted_s.unwrap()[15]);
    assert!((fitted / nominal - 1.002_025).abs() < 1e-4, "{nominal} {fitted}");
}

#[test]
fn a_second_run_follows_a_first_and_its_log_is_not_overwritten() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = run_line(&board, SHORT);
    let _ = bench.succeed(&line);
    let first = fs::read(bench.path("R.ndjson")).unwrap();
    bench.run(&line).refused(2, &["R.ndjson", "exists", "--overwrite"]);
    assert_eq!(fs::read(bench.path("R.ndjson")).unwrap(), first);
    let _ = bench.succeed(&format!("{line} --overwrite"));
    assert_ne!(fs::read(bench.path("R.ndjson")).unwrap(), first);
}

#[test]
fn an_external_edge_starts_the_run() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = format!("{} --set inputs.start=external", run_line(&board, SHORT));
    let child = spawn(&bench, &line);
    board.wait_until(|state| state == State::Armed);
    board.with(|world| {
        let rehearsal = &mut world.device.board().rehearsal;
        rehearsal.start_edge = Some(rehearsal.now);
    });
    let ran = wait(child, &line);
    assert_eq!(ran.status, Some(0), "{ran:?}");
    assert!(ran.stderr.contains("waiting for a rising edge"), "{ran:?}");
    assert!(ran.stdout.contains("34 edges, all on plan"), "{ran:?}");
}

#[test]
fn the_dose_is_entered_once() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = format!("{} --ledger D.ndjson --subject A", run_line(&board, SHORT));
    let _ = bench.succeed(&line);
    let ledger = fs::read_to_string(bench.path("D.ndjson")).unwrap();
    assert_eq!(ledger.lines().count(), 1, "{ledger}");
    assert!(ledger.contains("\"subject\":\"A\""), "{ledger}");
    // Not armed: nothing is entered.
    board.with(|world| world.device.board().rehearsal.interlock_closed = false);
    let ran = bench.run(&format!("{line} --overwrite"));
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert_eq!(fs::read_to_string(bench.path("D.ndjson")).unwrap(), ledger);
}

#[test]
fn a_board_that_boots_is_greeted_again_and_again() {
    let setup = Setup { boot: Duration::from_millis(1500), ..Setup::default() };
    let (bench, board) = (Bench::new(), RehearsedBoard::start(setup));
    let begin = Instant::now();
    let _ = bench.succeed(&format!("trigger info --port {}", board.port));
    assert!(begin.elapsed() > Duration::from_millis(1400));
}

#[test]
fn the_selftest_measures_the_jumper() {
    let setup = Setup { exposure_delay: Some(1603), ..Setup::default() };
    let (bench, board) = (Bench::new(), RehearsedBoard::start(setup));
    let line = format!("trigger selftest --sweeps 50 --yes --port {}", board.port);
    // The laser rises 1600 ticks after the camera; D8 is seen 3 ticks later.
    let words = bench.succeed(&line).stdout;
    assert!(words.contains("3 ticks after: 50 times") && words.contains("good"), "{words}");
    let facts = bench.summary(&line);
    assert_eq!((&facts["captured"], &facts["peak_to_peak"]), (&50.into(), &0.into()));
    board.with(|world| world.device.board().exposure_delay = None);
    let ran = bench.run(&line);
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("jumper"), "{ran:?}");
}

// ---- ends before the end --------------------------------------------------------------------

#[test]
fn ctrl_c_brings_the_board_to_rest() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = run_line(&board, LONG);
    let child = spawn(&bench, &line);
    board.wait_until(|state| state == State::Running);
    std::thread::sleep(Duration::from_millis(1200));
    interrupt(&child);
    let ran = wait(child, &line);
    assert_eq!(ran.status, Some(130), "{ran:?}");
    assert_eq!(board.state(), State::Faulted(Fault::Abort));
    let log = log(&bench);
    let summary = log.summary.as_ref().unwrap();
    assert_eq!((summary.ending, summary.safe), (Ending::Aborted, true));
    assert_eq!(log.edges.len(), board.edges().len());
    assert_eq!((log.fault.unwrap().0, &summary.edges.deviation), (Fault::Abort, &None));
    assert!(log.edges.len() >= 4, "{log:?}");
}

#[test]
fn a_fault_is_said_in_words_and_can_be_followed_by_a_run() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = run_line(&board, LONG);
    let child = spawn(&bench, &line);
    board.wait_until(|state| state == State::Running);
    board.with(|world| world.device.board().rehearsal.interlock_closed = false);
    let ran = wait(child, &line);
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("the interlock is open"), "{ran:?}");
    let log = log(&bench);
    assert_eq!(log.fault.unwrap().0, Fault::Interlock);
    assert_eq!(log.summary.unwrap().ending, Ending::Fault);

    // Still open: refused, with what to do. Closed: the fault is forgotten.
    let again = format!("{} --overwrite", run_line(&board, SHORT));
    let ran = bench.run(&again);
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("close the safety loop"), "{ran:?}");
    assert_eq!(ending(&bench), Ending::Refused);
    board.with(|world| world.device.board().rehearsal.interlock_closed = true);
    let _ = bench.succeed(&again);
}

#[test]
fn a_line_that_is_cut_leaves_a_log_and_says_what_the_board_does() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = run_line(&board, LONG);
    let child = spawn(&bench, &line);
    board.wait_until(|state| state == State::Running);
    std::thread::sleep(Duration::from_millis(300));
    board.unplug();
    let ran = wait(child, &line);
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(
        ran.stderr.contains("lost") && ran.stderr.contains("ends the run by itself 2 s"),
        "{ran:?}"
    );
    let log = log(&bench);
    let summary = log.summary.as_ref().unwrap();
    assert_eq!((summary.ending, summary.safe), (Ending::LineLost, false));
    assert!(!log.edges.is_empty());
}

#[test]
fn a_board_that_falls_silent_stops_by_itself() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = run_line(&board, LONG);
    let child = spawn(&bench, &line);
    board.wait_until(|state| state == State::Running);
    // It neither hears nor is heard.
    board.with(|world| world.deaf = true);
    board.wait_until(|state| state == State::Faulted(Fault::Heartbeat));
    let ran = wait(child, &line);
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("no answer"), "{ran:?}");
    assert_eq!(ending(&bench), Ending::LineLost);
}

#[test]
fn a_board_that_starts_anew_is_noticed() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = run_line(&board, LONG);
    let child = spawn(&bench, &line);
    board.wait_until(|state| state == State::Running);
    board.with(|world| world.reset());
    let ran = wait(child, &line);
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("started anew"), "{ran:?}");
    assert_eq!(ending(&bench), Ending::Reset);
}

#[test]
fn abort_ends_what_a_killed_program_has_left() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = run_line(&board, LONG);
    let mut child = spawn(&bench, &line);
    board.wait_until(|state| state == State::Running);
    child.kill().unwrap();
    let _ = child.wait();
    let words = bench.succeed(&format!("trigger abort --port {}", board.port)).stdout;
    assert!(words.contains("aborted by the host"), "{words}");
    assert_eq!(board.state(), State::Faulted(Fault::Abort));
    // The killed program's log has no end, and is read all the same.
    let ran = bench.succeed("trigger log R.ndjson");
    assert!(ran.stdout.contains("the log has no end"), "{ran:?}");
}

// ---- the line -------------------------------------------------------------------------------

#[test]
fn garbage_on_the_line_does_no_harm() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let line = run_line(&board, "paper --set volumes=20 --set interval=100ms");
    let child = spawn(&bench, &line);
    for _ in 0..40 {
        board.with(|world| {
            // Between two frames, in either direction.
            let _ = world.line.write_all(&[0, 3, 200, 17, 0, 1, 0, 0]);
            let inward = &mut world.device.board().rehearsal.inward;
            for byte in [0, 9, 9, 9, 0] {
                let _ = inward.push_back(byte);
            }
        });
        std::thread::sleep(Duration::from_millis(50));
    }
    let ran = wait(child, &line);
    assert_eq!(ran.status, Some(0), "{ran:?}");
    assert!(ran.stdout.contains("82 edges, all on plan"), "{ran:?}");
    assert!(ran.stdout.contains("could not be understood"), "{ran:?}");
}

#[test]
fn answers_that_get_lost_are_asked_for_again() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let mut count = 0_u32;
    board.filter(move |answer| {
        count += u32::from(matches!(answer, Answer::Reply { .. }));
        let lost = matches!(answer, Answer::Reply { .. }) && count.is_multiple_of(3);
        if lost { vec![] } else { vec![answer, answer] }.into_iter().take(once(&answer)).collect()
    });
    let ran = bench.succeed(&run_line(&board, SHORT));
    assert!(ran.stdout.contains("34 edges, all on plan"), "{ran:?}");
    assert!(ran.stdout.contains("had to be repeated"), "{ran:?}");
}

/// Replies come twice, as after a repetition; events do not.
fn once(answer: &Answer) -> usize {
    if matches!(answer, Answer::Reply { .. }) { 2 } else { 1 }
}

#[test]
fn an_event_that_gets_lost_is_said() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let mut edges = 0;
    board.filter(move |answer| {
        let edge = matches!(answer, Answer::Event { event: Event::Made(_), .. });
        edges += u32::from(edge);
        if edge && edges == 10 { vec![] } else { vec![answer] }
    });
    let ran = bench.run(&run_line(&board, SHORT));
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("events lost: 1"), "{ran:?}");
    let log = log(&bench);
    assert_eq!((log.lost, log.edges.len()), (1, SHORT_EDGES - 1));
    assert!(log.volume_times_s().unwrap_err().to_string().contains("lost"));
}

#[test]
fn a_last_event_that_gets_lost_is_said() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    board.filter(|answer| {
        let last = matches!(answer, Answer::Event { event: Event::Finished { .. }, .. });
        if last { vec![] } else { vec![answer] }
    });
    let ran = bench.run(&run_line(&board, SHORT));
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("events lost: 1"), "{ran:?}");
    assert_eq!((ending(&bench), log(&bench).edges.len()), (Ending::Finished, SHORT_EDGES));
}

#[test]
fn other_firmware_is_told_from_silence() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    board.filter(|_| vec![]);
    let port = board.port.clone();
    let talk = std::thread::spawn(move || {
        for _ in 0..100 {
            board.with(|world| {
                let _ = world.line.write_all(b"temperature 21\n\0");
            });
            std::thread::sleep(Duration::from_millis(50));
        }
    });
    let line = format!("trigger info --port {port}");
    bench.run(&line).refused(1, &["cannot be understood", "--baud", "trigger flash"]);
    talk.join().unwrap();
}

#[test]
fn another_hash_is_refused() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    board.filter(|answer| {
        vec![match answer {
            Answer::Reply { number, reply: Reply::Hash(hash) } => {
                Answer::Reply { number, reply: Reply::Hash(hash ^ 1) }
            }
            other => other,
        }]
    });
    let ran = bench.run(&run_line(&board, SHORT));
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("another one"), "{ran:?}");
    assert_eq!((ending(&bench), board.edges().len()), (Ending::Refused, 0));
}

#[test]
fn another_protocol_is_refused_with_both_versions() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    board.filter(|answer| {
        vec![match answer {
            Answer::Reply { number, reply: Reply::Hello(mut hello) } => {
                hello.protocol = 0x1234_5678;
                Answer::Reply { number, reply: Reply::Hello(hello) }
            }
            other => other,
        }]
    });
    let line = format!("trigger info --port {}", board.port);
    bench.run(&line).refused(1, &["12345678", "0.1.0", "trigger flash"]);
}

#[test]
fn a_board_that_says_nothing_is_explained() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    board.with(|world| world.deaf = true);
    let line = format!("trigger info --port {}", board.port);
    bench.run(&line).refused(1, &["no answer", &board.port, "trigger flash", "trigger ports"]);
}

#[test]
fn a_port_that_is_none_is_explained() {
    let bench = Bench::new();
    bench.run("trigger info --port /dev/nothing").refused(1, &["/dev/nothing", "trigger ports"]);
    bench.run("trigger info --port /dev/null").refused(1, &["/dev/null", "serial port"]);
    fs::write(bench.path("i.elf"), "no image").unwrap();
    let mut command = bench.command("trigger info --port sim:i.elf");
    command.env("PHASEWALK_EMULATED_BOARD", "/bin/nothing");
    let ran = Ran::of("sim:", &command.output().unwrap());
    ran.refused(1, &["/bin/nothing", "cannot be started"]);
}

#[test]
fn nobody_to_ask_needs_yes() {
    let bench = Bench::new();
    let mut command = bench.command("trigger run paper --port /dev/nothing --log R.ndjson");
    command.stdin(Stdio::null());
    Ran::of("run", &command.output().unwrap()).refused(2, &["--yes"]);
}

#[test]
fn an_emulated_board_is_started_and_ended() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    // Stands for the emulator: says the port of our board, ends with its standard input.
    let script = format!("#!/bin/sh\necho {}\ncat > /dev/null\necho ended > ended\n", board.port);
    fs::write(bench.path("emulator"), script).unwrap();
    fs::set_permissions(bench.path("emulator"), fs::Permissions::from_mode(0o755)).unwrap();
    fs::write(bench.path("i.elf"), "").unwrap();
    let mut command = bench.command("trigger info --port sim:i.elf");
    command.env("PHASEWALK_EMULATED_BOARD", bench.path("emulator"));
    let ran = Ran::of("sim:", &command.output().unwrap()).succeeded();
    assert!(ran.stdout.contains("at sim:i.elf"), "{ran:?}");
    assert!(bench.path("ended").exists());
}

// ---- flashing -------------------------------------------------------------------------------

const IMAGE: &str = ":0400000001020304F2\n:00000001FF\n";

/// A folder with an image and a tool that notes how it was called.
fn flash_bench(tool: &str) -> Bench {
    let bench = Bench::new();
    fs::write(bench.path("a.hex"), IMAGE).unwrap();
    fs::write(bench.path("avrdude"), format!("#!/bin/sh\necho \"$@\" > called\n{tool}\n")).unwrap();
    fs::set_permissions(bench.path("avrdude"), fs::Permissions::from_mode(0o755)).unwrap();
    bench
}

fn flash(bench: &Bench, board: &RehearsedBoard) -> Ran {
    let line = format!("trigger flash --image a.hex --port {}", board.port);
    let mut command = bench.command(&line);
    let path = std::env::var("PATH").unwrap_or_default();
    command.env("PATH", format!("{}:{path}", bench.path(".").display()));
    Ran::of(&line, &command.output().unwrap())
}

#[test]
fn the_image_is_written_and_verified_by_the_board() {
    let (bench, board) = (flash_bench("exit 0"), RehearsedBoard::default());
    board.with(|world| {
        let identity = &mut world.device.board().identity;
        (identity.image, identity.image_bytes) = (0xB63C_FBCD, 4);
    });
    let ran = flash(&bench, &board).succeeded();
    assert!(ran.stdout.contains("4 bytes, hash b63cfbcd"), "{ran:?}");
    assert!(ran.stdout.contains("verified"), "{ran:?}");
    let called = fs::read_to_string(bench.path("called")).unwrap();
    let expected = format!("-p m328p -c arduino -P {} -b 115200 -D -U flash:w:a.hex:i", board.port);
    assert_eq!(called.trim(), expected);

    board.with(|world| world.device.board().identity.image ^= 1);
    let ran = flash(&bench, &board);
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("write it again"), "{ran:?}");
}

#[test]
fn a_tool_that_fails_or_is_missing_is_named() {
    let (bench, board) = (flash_bench("exit 3"), RehearsedBoard::default());
    let ran = flash(&bench, &board);
    assert_eq!(ran.status, Some(1), "{ran:?}");
    assert!(ran.stderr.contains("avrdude failed"), "{ran:?}");
    let line = format!("trigger flash --image a.hex --port {}", board.port);
    let mut command = bench.command(&line);
    command.env("PATH", "/nothing");
    let ran = Ran::of(&line, &command.output().unwrap());
    assert!(ran.stderr.contains("apt install avrdude"), "{ran:?}");
    let ran = bench.succeed(&format!("{line} --dry-run"));
    assert!(ran.stdout.contains("avrdude -p m328p"), "{ran:?}");
}

// ---- broken logs ----------------------------------------------------------------------------

#[test]
fn broken_logs_are_refused_with_their_line() {
    let (bench, board) = (Bench::new(), RehearsedBoard::default());
    let _ = bench.succeed(&run_line(&board, SHORT));
    let text = fs::read_to_string(bench.path("R.ndjson")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let edge = lines.iter().position(|line| line.contains("\"edge\"")).unwrap();
    let with = |at: usize, line: &str| {
        let mut lines = lines.clone();
        lines[at] = line;
        lines.join("\n") + "\n"
    };
    let number = format!("line {}", edge + 1);
    for (text, words) in [
        (String::new(), "empty"),
        ("hello\n".to_owned(), "line 1: no JSON"),
        ("{\"a\":1}\n".to_owned(), "not a run log"),
        (text.replacen("\"version\":1", "\"version\":9", 1), "version 9"),
        (text.replacen("\"bursts\":8", "\"bursts\":9", 1), "do not agree"),
        (with(edge, "{\"record\":\"edge\"}"), number.as_str()),
        (with(edge, "{\"record\":\"what\"}"), number.as_str()),
        (with(edge, lines[0]), "a second header"),
        (format!("{text}{}\n", lines[edge]), "after the summary"),
    ] {
        fs::write(bench.path("B.ndjson"), text).unwrap();
        bench.run("trigger log B.ndjson").refused(1, &["B.ndjson", words]);
    }
    // Cut within its last line: the rest is read, and that is said.
    fs::write(bench.path("B.ndjson"), &text[..text.len() - 40]).unwrap();
    let ran = bench.succeed("trigger log B.ndjson");
    assert!(ran.stdout.contains("cut off") && ran.stdout.contains("no end"), "{ran:?}");
    bench.run("trigger log N.ndjson").refused(1, &["N.ndjson", "no such file"]);
}
