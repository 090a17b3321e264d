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
    emulated_board(&folder)
}

/// The emulated board, as `--port sim:` starts it.
fn emulated_board(folder: &Path) -> Result {
    SIMAVR.meet()?;
    let build =
        "build --release -p phasewalk-tests --features emulated-boards --bin emulated-board";
    run(&mut cargo(build))?;
    let built = folders::target()?.join("release").join("emulated-board");
    let copy = folder.join("emulated-board");
    fs::copy(&built, &copy).map_err(|e| format!("cannot copy {}: {e}", built.display()))?;
    Ok(())
}
