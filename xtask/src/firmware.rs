//! `cargo xtask firmware`: the images of the boards, and the emulated board.

mod f405;
mod size;
mod sources;
mod toolchain;
mod uno;

use crate::command::{cargo, run};
use crate::packages::SIMAVR;
use crate::{Result, folders};
use std::fs;
use std::path::Path;

pub(crate) use toolchain::find as toolchain;

/// Images and emulated board into `<target>/firmware`.
pub(crate) fn build() -> Result {
    let folder = folders::target()?.join("firmware");
    fs::create_dir_all(&folder).map_err(|e| format!("cannot make {}: {e}", folder.display()))?;
    uno::build(&folder)?;
    f405::build(&folder)?;
    defmt_lines(&folder)?;
    emulated_board(&folder)
}

/// The reader of what the STM32F405 logs.
fn defmt_lines(folder: &Path) -> Result {
    let build = folder.join("build");
    let arguments = "build --release --locked --manifest-path tests/defmt-lines/Cargo.toml";
    run(cargo(arguments).arg("--target-dir").arg(&build))?;
    copy(&build.join("release").join("defmt-lines"), &folder.join("defmt-lines"))
}

fn copy(from: &Path, to: &Path) -> Result {
    fs::copy(from, to).map_err(|e| format!("cannot copy {}: {e}", from.display()))?;
    Ok(())
}

/// The emulated board, as `--port sim:` starts it.
fn emulated_board(folder: &Path) -> Result {
    SIMAVR.meet()?;
    // As for the tests, which so find most of it compiled.
    let build = "build --workspace --features phasewalk-tests/emulated-boards --bin emulated-board";
    run(&mut cargo(build))?;
    let built = folders::target()?.join("debug").join("emulated-board");
    copy(&built, &folder.join("emulated-board"))
}
