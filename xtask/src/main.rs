//! Developer commands: `cargo xtask test` runs everything there is to check, `cargo xtask firmware`
//! builds the boards' images, `cargo xtask instructions` counts what the program executes, `cargo xtask compare`
//! runs the program beside NumPy and dolphin.
//!
//! No dependencies: this is compiled before anything can be tested.
//!
//! ```text
//! main.rs      parse, run, one way out for errors
//! folders.rs   where things are
//! command.rs   run a program, announce and time it
//! steps.rs     `test`: what is run, in which order
//! firmware.rs  `firmware`: the images, and the emulated board
//! instructions.rs  `instructions`: what the program executes, against recorded numbers
//! interop.rs   what NumPy and zarr-python say about our files and images
//! compare.rs   `compare`: the program beside its peers, at full size
//! python.rs    the virtual environment of the scripts in tests/peers
//! packages.rs  system packages
//! ```

mod command;
mod compare;
mod firmware;
mod folders;
mod instructions;
mod interop;
mod packages;
mod python;
mod steps;

use std::process::ExitCode;

/// Errors are one sentence for a person: what failed and what to do.
type Result<T = ()> = std::result::Result<T, String>;

const HELP: &str = "\
Developer commands of Phasewalk.

Usage: cargo xtask test
       cargo xtask firmware
       cargo xtask instructions [--record]
       cargo xtask compare [--width PX] [--height PX] [--frames N] [--crop PX]
       cargo xtask help

test    Everything a change must pass: formatting, lints, the images of the boards, tests on
        emulated boards among them, documentation, the demo, instructions, and Python reading our
        files and agreeing with our images. The first failure ends it.
        As root on Debian it installs the packages it lacks; elsewhere it prints the line that
        does. Needs the network for the first run (crates, Python and Node packages).
firmware
        Builds the trigger boards' images (target/firmware/uno.elf, .hex, f405.elf, .bin), those
        that only tests measure, and the emulated Uno (target/firmware/emulated-board, what
        `phasewalk trigger ... --port sim:` starts). Prints flash and memory, holds them below
        their ceilings, and sees that an image which can panic does not link.
instructions
        Counts the instructions of the release program, one thread under Valgrind's callgrind, in
        images, curves and what is watched, and fails where a count differs by more than 5 % from
        tests/instructions.toml. On x86-64 with AVX2; elsewhere nothing is counted.
          --record      write the counts there instead: where a change is worth its price, where
                        it saves more than 5 %, or for a new compiler
compare Runs `phasewalk phase` (paper and linked), the paper's method in NumPy + SciPy, and the EVD
        and EMI of dolphin, a package of satellite interferometry, on the paper's scene, one after
        the other. Prints time, memory and errors as a Markdown table, and fails where the images
        of phasewalk and of NumPy differ. Needs the network for the first run. Full size takes
        minutes and 6 GB of memory.
          --width PX    columns [default: 640]
          --height PX   rows [default: 368]
          --frames N    frames [default: 70]
          --crop PX     side of the square in the middle that dolphin computes [default: 128]

Exit status: 0 done, 1 failed, 2 wrong usage.
";

/// What was asked for.
#[derive(Debug, PartialEq, Eq)]
enum Task {
    Test,
    Firmware,
    Instructions,
    RecordInstructions,
    Compare(compare::Size),
    Help,
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let task = match parse(&arguments) {
        Ok(task) => task,
        Err(error) => {
            eprintln!("xtask: {error}\n\n{HELP}");
            return ExitCode::from(2);
        }
    };
    let outcome = match task {
        Task::Test => steps::test(),
        Task::Firmware => firmware::build(),
        Task::Instructions => instructions::check(),
        Task::RecordInstructions => instructions::record(),
        Task::Compare(size) => compare::compare(size),
        Task::Help => {
            print!("{HELP}");
            Ok(())
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error}");
            ExitCode::FAILURE
        }
    }
}

fn parse(arguments: &[String]) -> Result<Task> {
    if arguments.iter().any(|argument| argument == "--help" || argument == "-h") {
        return Ok(Task::Help);
    }
    let (command, options) = arguments.split_first().ok_or("a command is missing")?;
    match (command.as_str(), options) {
        ("test", []) => Ok(Task::Test),
        ("firmware", []) => Ok(Task::Firmware),
        ("instructions", []) => Ok(Task::Instructions),
        ("instructions", [option]) if option == "--record" => Ok(Task::RecordInstructions),
        ("help", []) => Ok(Task::Help),
        ("compare", options) => compare::Size::parse(options).map(Task::Compare),
        ("test" | "firmware" | "instructions" | "help", [.., surplus]) => {
            Err(format!("'{surplus}' is not understood"))
        }
        (unknown, _) => Err(format!("'{unknown}' is not a command")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(line: &str) -> Result<Task> {
        parse(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn commands_are_understood() {
        assert_eq!(parsed("test"), Ok(Task::Test));
        assert_eq!(parsed("firmware"), Ok(Task::Firmware));
        assert_eq!(parsed("instructions"), Ok(Task::Instructions));
        assert_eq!(parsed("instructions --record"), Ok(Task::RecordInstructions));
        assert_eq!(parsed("help"), Ok(Task::Help));
        assert_eq!(parsed("test --help"), Ok(Task::Help));
        assert_eq!(parsed("compare"), Ok(Task::Compare(compare::Size::FULL)));
        let size = compare::Size { width: 64, height: 368, frames: 12, crop: 32 };
        assert_eq!(parsed("compare --width 64 --crop 32 --frames 12"), Ok(Task::Compare(size)));
    }

    #[test]
    fn what_is_not_understood_is_named() {
        let cases = [
            ("", "missing"),
            ("tset", "'tset'"),
            ("test now", "'now'"),
            ("instructions --recrod", "'--recrod'"),
            ("compare --widht 3", "'--widht'"),
        ];
        let numbers = [
            ("compare --width", "--width"),
            ("compare --width 0", "'0'"),
            ("compare --frames x", "'x'"),
        ];
        for (line, named) in cases.into_iter().chain(numbers) {
            let error = parsed(line).unwrap_err();
            assert!(error.contains(named), "{line}: {error}");
        }
    }
}
