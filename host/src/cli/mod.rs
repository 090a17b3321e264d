//! The command line: parse, validate, run. One file per sub-command, one way out for errors.

mod demo;
mod folder;
mod info;
mod paper;
mod phase;
mod reconstruct;
mod simulate;
mod trigger;
mod watch;

use crate::error::{Error, Result};
use crate::progress;
use clap::{Parser, Subcommand};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Measure nanometre changes of an optical path while the speckle pattern decorrelates.
///
/// Exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted.
#[derive(Debug, Parser)]
#[command(name = "phasewalk", version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    common: Common,
}

/// Options of every command.
#[derive(Debug, clap::Args)]
struct Common {
    /// Number of threads [default: all cores]
    #[arg(long, global = true, value_name = "N", allow_negative_numbers = true,
          value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Print the summary as one line of JSON
    #[arg(long, global = true)]
    json: bool,
}

impl Common {
    fn threads(&self) -> usize {
        let all = || std::thread::available_parallelism().map_or(1, usize::from);
        self.threads.map_or_else(all, usize::from)
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Simulate, evaluate and draw a small scene: the quickest way to see what the method does
    Demo(demo::Arguments),
    /// Make a series with known truth
    #[command(subcommand)]
    Simulate(simulate::Scenes),
    /// Camera recording of sweeps, or spectra, to complex volumes
    Reconstruct(reconstruct::Arguments),
    /// Phase of a series: a curve over a mask, or images by a Gaussian average
    Phase(phase::Arguments),
    /// Phase of frames as they come: the newest point of a curve or the newest image, in memory that does not grow
    Watch(watch::Arguments),
    /// Every figure and number of the paper that can be computed; may be interrupted and resumed
    Paper(paper::Arguments),
    /// What a file holds
    Info(info::Arguments),
    /// The trigger board: check, preview, run and record
    #[command(subcommand)]
    Trigger(trigger::Command),
}

/// Parse the command line, run it, report.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return usage(&error),
    };
    let outcome = progress::install_interrupt_handler().and_then(|()| run(&arguments));
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("phasewalk: {error}");
            ExitCode::from(error.exit_status())
        }
    }
}

/// Help and version as clap prints them; its complaints in one line, as all of ours.
fn usage(error: &clap::Error) -> ExitCode {
    use clap::error::ErrorKind;
    if !error.use_stderr() || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        // A closed pipe (`phasewalk --help | head -1`) is no failure of ours.
        let _ = error.print();
    } else {
        eprintln!("phasewalk: {}", one_line(&error.to_string()));
    }
    ExitCode::from(if error.use_stderr() { 2 } else { 0 })
}

/// The sentence of a message whose usage and hints stand in paragraphs of their own.
fn one_line(message: &str) -> String {
    let paragraph = message.split("\n\nUsage").next().unwrap_or(message);
    let paragraph = paragraph.split("\n\nFor more").next().unwrap_or(paragraph);
    let words: Vec<&str> = paragraph.split_whitespace().collect();
    format!("{} (see --help)", words.join(" ").trim_start_matches("error: "))
}

fn run(arguments: &Arguments) -> Result<()> {
    let common = &arguments.common;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(common.threads()).build();
    let pool = pool.map_err(|e| Error::failed(format!("cannot start the threads: {e}")))?;
    pool.install(|| match &arguments.command {
        Command::Demo(arguments) => demo::run(arguments, common),
        Command::Simulate(scene) => simulate::run(scene, common),
        Command::Reconstruct(arguments) => reconstruct::run(arguments, common),
        Command::Phase(arguments) => phase::run(arguments, common),
        Command::Watch(arguments) => watch::run(arguments, common),
        Command::Paper(arguments) => paper::run(arguments, common),
        Command::Info(arguments) => info::run(arguments, common),
        Command::Trigger(command) => trigger::run(command, common),
    })
}

/// Print to standard output; a reader that has gone away is no failure of ours.
fn print(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// A number, or a fraction such as `1/32`.
fn fraction(text: &str) -> std::result::Result<f64, String> {
    let number = |part: &str| part.trim().parse::<f64>().map_err(|e| format!("'{part}': {e}"));
    let value = match text.split_once('/') {
        Some((numerator, denominator)) => number(numerator)? / number(denominator)?,
        None => number(text)?,
    };
    if value.is_finite() { Ok(value) } else { Err(format!("'{text}' is not a finite number")) }
}

/// What `--keep-leakage` is refused with elsewhere.
fn leakage_is_of_linked_curves() -> Error {
    Error::usage(
        "--keep-leakage is for curves (--mask) of --method linked, which alone takes that light off: leave it out",
    )
}

/// Refuse to write over one of the inputs.
fn check_output(flag: &str, output: &Path, inputs: &[&Path]) -> Result<()> {
    let Ok(target) = output.canonicalize() else { return Ok(()) };
    for input in inputs {
        let Ok(source) = input.canonicalize() else { continue };
        if source == target || source.starts_with(&target) || target.starts_with(&source) {
            return Err(Error::usage(format!(
                "{flag} {}: is the input {}; give another name",
                output.display(),
                input.display()
            )));
        }
    }
    Ok(())
}

/// `a, b and c` for messages.
fn list(paths: &[PathBuf]) -> String {
    let names: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    match names.as_slice() {
        [] => String::new(),
        [one] => one.clone(),
        [start @ .., last] => format!("{} and {last}", start.join(", ")),
    }
}

/// Bytes in the unit people read.
fn megabytes(bytes: u64) -> String {
    format!("{} MB", bytes.div_ceil(1_000_000))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn fractions_of_a_wavelength() {
        assert_eq!(fraction("1/32"), Ok(0.03125));
        assert_eq!(fraction("0"), Ok(0.0));
        assert_eq!(fraction(" 0.5 "), Ok(0.5));
        for wrong in ["", "1/0", "a", "1/2/3", "nan", "inf"] {
            assert!(fraction(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn complaints_take_one_line() {
        let error = Arguments::try_parse_from(["phasewalk", "phase", "F.npy", "-o", "C.csv"]);
        let line = one_line(&error.unwrap_err().to_string());
        assert!(
            !line.contains('\n') && line.contains("--mask") && line.contains("--help"),
            "{line}"
        );
        assert!(!line.contains("Usage"), "{line}");
    }

    #[test]
    fn names_are_listed_as_people_do() {
        let paths: Vec<PathBuf> = ["a", "b", "c"].iter().map(PathBuf::from).collect();
        assert_eq!(list(&paths), "a, b and c");
        assert_eq!(list(&paths[..1]), "a");
    }
}
