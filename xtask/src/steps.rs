//! `cargo xtask test`: everything, in the order in which failures are cheapest to learn about.

use crate::command::{cargo, command, run, succeeds};
use crate::packages::{
    self, ARDUINO, ARM_TOOLS, AVR_TOOLS, NODE, QEMU, RUST_SOURCES, SIMAVR, VALGRIND,
};
use crate::{Result, firmware, folders, instructions, interop, python};
use std::path::Path;
use std::time::Instant;

/// The demo's promise to someone who tries the program out, on two cores.
const DEMO_SECONDS: f64 = 60.0;

/// The emulated boards; they need libsimavr.
const BOARDS: &str = "--features phasewalk-tests/emulated-boards";

type Step = (&'static str, fn() -> Result);

// Tests run in their own profile, not in release: `panic = "abort"` there means that cargo cannot
// share one artefact between release tests and the release program, and the test profile adds
// overflow checks and debug assertions and shares its dependencies' build scripts with clippy.
const STEPS: &[Step] = &[
    ("tools", tools),
    ("formatting", || run(&mut cargo("fmt --all --check"))),
    ("lints", || {
        run(&mut cargo(&format!("clippy --workspace --all-targets {BOARDS} -- -D warnings")))
    }),
    ("firmware", firmware::build),
    ("tests", || run(&mut cargo(&format!("test --workspace {BOARDS}")))),
    ("tests with micromath", || run(&mut cargo("test -p phasewalk-core --features micromath"))),
    ("documentation", documentation),
    ("release build", || run(&mut cargo("build --release"))),
    ("demo", demo),
    ("instructions", instructions::check),
    ("Python", || interop::check(&python::environment()?)),
];

/// Run all steps; the first failure ends it.
pub(crate) fn test() -> Result {
    let start = Instant::now();
    let mut times = Vec::new();
    for (number, (name, step)) in STEPS.iter().enumerate() {
        println!("== {}/{} {name}", number + 1, STEPS.len());
        let began = Instant::now();
        step().map_err(|error| format!("step '{name}': {error}"))?;
        let seconds = began.elapsed().as_secs_f64();
        println!("== {name}: {seconds:.1} s\n");
        times.push(format!("{name} {seconds:.0}"));
    }
    println!("Everything passed in {:.0} s ({}).", start.elapsed().as_secs_f64(), times.join(", "));
    Ok(())
}

/// What can be missing is missed now, not after minutes of compiling.
fn tools() -> Result {
    for component in ["fmt", "clippy"] {
        if !succeeds(&mut cargo(&format!("{component} --version"))) {
            return Err(format!(
                "cargo {component} is missing: rustup component add rustfmt clippy"
            ));
        }
    }
    let python = packages::python()?;
    println!("   {} serves", python.display());
    for need in [AVR_TOOLS, ARM_TOOLS, RUST_SOURCES, SIMAVR, QEMU, ARDUINO, NODE, VALGRIND] {
        need.meet()?;
    }
    second_simulator()
}

/// The packages of the second simulator.
fn second_simulator() -> Result {
    let folder = folders::workspace().join("tests").join("avr8js");
    if folder.join("node_modules").exists() {
        return Ok(());
    }
    run(command("npm").args(["ci", "--no-audit", "--no-fund", "--silent"]).current_dir(folder))
}

fn documentation() -> Result {
    run(cargo("doc --workspace --no-deps").env("RUSTDOCFLAGS", "-D warnings"))
}

/// The README's first command, as a fresh user runs it, once it is built.
fn demo() -> Result {
    let folder = folders::scratch("demo")?;
    let start = Instant::now();
    run(cargo("run --release -- demo --out").arg(&folder))?;
    let seconds = start.elapsed().as_secs_f64();
    println!("   the demo took {seconds:.1} s");
    if seconds > DEMO_SECONDS {
        return Err(format!("the demo took {seconds:.1} s; at most {DEMO_SECONDS} s are promised"));
    }
    has_results(&folder)
}

/// Figures and report are there and not empty.
fn has_results(folder: &Path) -> Result {
    let failed = |e: std::io::Error| format!("{}: {e}", folder.display());
    let mut files = 0;
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        files += 1;
        if entry.metadata().map_err(failed)?.len() == 0 {
            return Err(format!("the demo left {} empty", entry.path().display()));
        }
    }
    if files == 0 {
        Err(format!("the demo wrote nothing into {}", folder.display()))
    } else {
        Ok(())
    }
}
