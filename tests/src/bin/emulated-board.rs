//! An emulated Arduino Uno behind a serial port, in real time.

use clap::Parser;
use phasewalk_tests::board::{CLOCK, Pin, Port, Reset, State, Uno, console, write_csv, write_vcd};
use std::error::Error;
use std::fs::File;
use std::io::{BufRead, Write, stdin, stdout};
use std::os::fd::AsFd;
use std::os::unix::fs::FileTypeExt;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// How often bytes are passed on and commands are read.
const TICK: Duration = Duration::from_millis(1);
/// What is emulated between two looks at the port while the board is behind the wall clock.
const CATCH_UP: u64 = CLOCK / 100;

/// Run a firmware image on an emulated Arduino Uno, in real time.
///
/// The first line of standard output is the path of a serial port (a pseudo-terminal); any baud
/// rate can be set on it, the bytes are paced as the firmware sets its own. It ends at SIGINT,
/// SIGTERM, `quit`, or the end of standard input if that is a pipe, and then writes the files of
/// edges.
#[derive(Parser)]
#[command(after_help = console::HELP, after_long_help = console::HELP)]
struct Options {
    /// Firmware image: ELF or Intel HEX
    image: PathBuf,
    /// Write all edges as a value change dump, for a wave viewer
    #[arg(long, value_name = "FILE")]
    vcd: Option<PathBuf>,
    /// Write all edges as a table: cycle, pin, level
    #[arg(long, value_name = "FILE")]
    edges: Option<PathBuf>,
    /// Interlock loop closed: D2 held low (default)
    #[arg(long, overrides_with = "open")]
    closed: bool,
    /// Interlock loop open: D2 not driven
    #[arg(long)]
    open: bool,
    /// Camera ready: D4 held high (default)
    #[arg(long, overrides_with = "not_ready")]
    ready: bool,
    /// Camera not ready: D4 held low
    #[arg(long)]
    not_ready: bool,
    /// Connect an output to an input, as D9-D8; can be repeated
    #[arg(long, value_name = "FROM-TO", value_parser = jumper)]
    jumper: Vec<(Pin, Pin)>,
    /// Reset the board when the port is opened, as an Uno does; one who closes and opens the port
    /// within a millisecond is not noticed (see the command `reset`)
    #[arg(long)]
    reset_on_open: bool,
}

fn jumper(text: &str) -> Result<(Pin, Pin), String> {
    let (from, to) = text.split_once('-').ok_or("two pins, as D9-D8")?;
    Ok((from.parse()?, to.parse()?))
}

/// How the board is wired before the power comes on.
fn wire(uno: &mut Uno, options: &Options) {
    if !options.open {
        uno.drive(Pin::D2, false);
    }
    uno.drive(Pin::D4, !options.not_ready);
    for &(from, to) in &options.jumper {
        uno.connect(from, to);
    }
}

/// What standard input brings.
enum Input {
    Line(String),
    End,
}

/// Lines of standard input. Its end counts if it is a pipe: a terminal or no input is no caller
/// that has gone.
fn listen(to: &Sender<Input>) {
    for line in stdin().lock().lines().map_while(Result::ok) {
        if to.send(Input::Line(line)).is_err() {
            return;
        }
    }
    let file = stdin().as_fd().try_clone_to_owned().map(File::from);
    let kind = file.and_then(|file| file.metadata()).map(|data| data.file_type());
    if kind.is_ok_and(|kind| kind.is_fifo() || kind.is_socket()) {
        let _ = to.send(Input::End);
    }
}

fn inputs() -> Receiver<Input> {
    let (to, inputs) = channel();
    let _ = thread::spawn(move || listen(&to));
    inputs
}

/// A board that keeps up with the wall clock.
struct Bench {
    uno: Uno,
    port: Port,
    start: Instant,
    reset_on_open: bool,
    keep_edges: bool,
}

impl Bench {
    /// Cycles that should have passed.
    fn due(&self) -> u64 {
        let nanoseconds = self.start.elapsed().as_nanos() * u128::from(CLOCK);
        u64::try_from(nanoseconds / 1_000_000_000).unwrap_or(u64::MAX)
    }

    /// Pass bytes in, run, pass bytes out; whether the board has caught up.
    fn tick(&mut self) -> Result<bool, Box<dyn Error>> {
        if self.port.newly_opened()? && self.reset_on_open {
            self.uno.reset(Reset::External);
        }
        let bytes = self.port.read()?;
        self.uno.send(&bytes);
        let due = self.due();
        if let State::Crashed(reason) = self.uno.run_until(due.min(self.uno.cycle() + CATCH_UP)) {
            return Err(format!("the board has crashed: {reason}").into());
        }
        let bytes = self.uno.received();
        self.port.write(&bytes)?;
        if !self.keep_edges {
            self.uno.forget_edges();
        }
        Ok(self.uno.cycle() >= due)
    }

    /// Carry commands out; whether to go on.
    fn obey(&mut self, inputs: &Receiver<Input>) -> bool {
        while let Ok(input) = inputs.try_recv() {
            let Input::Line(line) = input else { return false };
            if line.trim().is_empty() {
                continue;
            }
            if line.trim() == "quit" {
                let _ = say("ok");
                return false;
            }
            let answer = console::command(&mut self.uno, &line);
            if !say(&answer.unwrap_or_else(|error| format!("error: {error}"))) {
                return false;
            }
        }
        true
    }
}

/// One line to standard output; whether somebody still takes it.
fn say(line: &str) -> bool {
    let mut out = stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).is_ok()
}

fn run(bench: &mut Bench, end: &AtomicBool) -> Result<(), Box<dyn Error>> {
    let inputs = inputs();
    while !end.load(Ordering::Relaxed) && bench.obey(&inputs) {
        if bench.tick()? {
            thread::sleep(TICK);
        }
    }
    Ok(())
}

fn save(bench: &Bench, options: &Options) -> Result<(), Box<dyn Error>> {
    if let Some(path) = &options.vcd {
        write_vcd(path, bench.uno.edges())
            .map_err(|error| format!("{}: {error}", path.display()))?;
    }
    if let Some(path) = &options.edges {
        write_csv(path, bench.uno.edges())
            .map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(())
}

fn emulate(options: &Options) -> Result<(), Box<dyn Error>> {
    let end = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&end);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))?;
    let mut uno = Uno::load(&options.image)?;
    wire(&mut uno, options);
    let port = Port::new()?;
    let keep_edges = options.vcd.is_some() || options.edges.is_some();
    let _ = say(&port.path().display().to_string());
    let start = Instant::now();
    let mut bench = Bench { uno, port, start, reset_on_open: options.reset_on_open, keep_edges };
    let ran = run(&mut bench, &end);
    save(&bench, options)?;
    ran
}

fn main() -> ExitCode {
    match emulate(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("emulated-board: {error}");
            ExitCode::FAILURE
        }
    }
}
