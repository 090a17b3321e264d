//! The program and the very image that is flashed, over a serial port: start to run log, in real
//! time.

use phasewalk::trigger::log::RunLog;
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::fault::Fault;
use phasewalk_tests::program::Bench;
use phasewalk_tests::session::{image, pin_of};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};

/// The emulated board as a program with a port.
struct Emulated {
    child: Child,
    input: Option<ChildStdin>,
    port: String,
}

impl Emulated {
    fn start(options: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_emulated-board"));
        command.arg(image()).args(options).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("the emulated board starts");
        let input = child.stdin.take();
        let mut output = BufReader::new(child.stdout.take().expect("a pipe"));
        let mut port = String::new();
        output.read_line(&mut port).expect("it says its port");
        // What it answers later must be read, or it would wait.
        std::thread::spawn(move || output.read_to_end(&mut Vec::new()));
        Self { child, input, port: port.trim_end().to_owned() }
    }

    fn order(&mut self, line: &str) {
        let input = self.input.as_mut().expect("it listens");
        writeln!(input, "{line}").expect("it listens");
        input.flush().expect("it listens");
    }

    /// Switch it off; it writes its files.
    fn end(mut self) {
        drop(self.input.take());
        assert!(self.child.wait().expect("it ends").success());
    }
}

/// Edges of laser, camera and stimulus in a file of `emulated-board --edges`: channel, level and
/// cycles since the first of them.
fn edges_in(file: &Path) -> Vec<(Channel, bool, u64)> {
    let text = std::fs::read_to_string(file).expect("the board has written its edges");
    let mut edges: Vec<(Channel, bool, u64)> = text
        .lines()
        .skip(1)
        .filter_map(|line| {
            let mut fields = line.split(',');
            let cycle: u64 = fields.next()?.parse().ok()?;
            let (pin, level) = (fields.next()?, fields.next()?);
            let of_pin = |channel: &&Channel| pin_of(**channel).to_string() == pin;
            let channel = Channel::ALL.iter().find(of_pin)?;
            Some((*channel, level == "1", cycle))
        })
        .collect();
    let first = edges.iter().map(|edge| edge.2).min().unwrap_or(0);
    edges.iter_mut().for_each(|edge| edge.2 -= first);
    edges.sort_unstable();
    edges
}

fn edges_of(log: &RunLog) -> Vec<(Channel, bool, u64)> {
    let first = log.edges.iter().map(|edge| edge.tick).min().unwrap_or(0);
    let edges = log.edges.iter();
    let mut edges: Vec<_> =
        edges.map(|edge| (edge.channel, edge.high, edge.tick - first)).collect();
    edges.sort_unstable();
    edges
}

#[test]
fn the_papers_run_and_its_log_and_the_boards_pins_agree() {
    let bench = Bench::new();
    let file = bench.path("pins.csv");
    let board = Emulated::start(&["--edges", &file.display().to_string()]);
    let line = format!("trigger run paper --port {} --log R.ndjson --yes", board.port);
    let ran = bench.succeed(&line);
    assert!(ran.stdout.contains("282 edges, all on plan"), "{ran:?}");
    board.end();

    let log = RunLog::read(&bench.path("R.ndjson")).expect("the log can be read");
    let (pins, told) = (edges_in(&file), edges_of(&log));
    assert_eq!(pins.len(), 282);
    assert_eq!(pins, told, "the log's edges are the pins'");
    assert_eq!(log.volume_times_s().expect("all volumes were timed").len(), 70);
}

#[test]
fn a_fault_of_the_board_ends_the_run_and_is_in_the_log() {
    let bench = Bench::new();
    let mut board = Emulated::start(&[]);
    let line = format!("trigger run paper --port {} --log R.ndjson --yes", board.port);
    let mut command = bench.command(&line);
    let run = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let run = run.expect("the program starts");
    while !std::fs::read_to_string(bench.path("R.ndjson"))
        .is_ok_and(|log| log.matches("\"edge\"").count() > 20)
    {
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    board.order("drive D2 1");
    let output = run.wait_with_output().expect("it ends");
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains("interlock"), "{error}");
    board.end();
    let log = std::fs::read_to_string(bench.path("R.ndjson")).expect("the log was kept");
    assert!(log.contains(&format!("\"{:?}\"", Fault::Interlock)), "{log}");
}

#[test]
fn the_board_measures_its_own_edges_over_a_jumper() {
    let bench = Bench::new();
    let board = Emulated::start(&["--jumper", "D9-D8"]);
    let line = format!("trigger selftest --port {} --sweeps 50 --yes", board.port);
    let facts = bench.summary(&line);
    println!("{facts}");
    board.end();
}
