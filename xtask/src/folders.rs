//! Where things are.

use crate::Result;
use std::path::{Path, PathBuf};

/// The workspace's folder.
pub(crate) fn workspace() -> PathBuf {
    // cargo sets the variable for what it runs; the compiled-in one serves a direct call.
    let package = std::env::var_os("CARGO_MANIFEST_DIR")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    package.parent().map(Path::to_owned).unwrap_or(package)
}

/// cargo's target folder, wherever it has been configured to be: this program runs from
/// `<target>/<profile>/xtask`.
pub(crate) fn target() -> Result<PathBuf> {
    let program = std::env::current_exe().map_err(|e| format!("cannot find myself: {e}"))?;
    let folder = program.ancestors().nth(2).map(Path::to_owned);
    folder.ok_or_else(|| format!("{}: not inside a target folder", program.display()))
}

/// The program under test, as `cargo build --release` leaves it.
pub(crate) fn phasewalk() -> Result<PathBuf> {
    let name = format!("phasewalk{}", std::env::consts::EXE_SUFFIX);
    Ok(target()?.join("release").join(name))
}

/// An example, as `cargo build --example` leaves it.
pub(crate) fn example(name: &str) -> Result<PathBuf> {
    let name = format!("{name}{}", std::env::consts::EXE_SUFFIX);
    Ok(target()?.join("debug").join("examples").join(name))
}

/// A script, or its requirements.
pub(crate) fn peer(name: &str) -> PathBuf {
    workspace().join("tests").join("peers").join(name)
}

/// An empty folder of this name under the target folder; what a former run left is removed.
pub(crate) fn scratch(name: &str) -> Result<PathBuf> {
    let folder = target()?.join("xtask").join(name);
    let failed = |e: std::io::Error| format!("cannot empty {}: {e}", folder.display());
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(failed)?;
    }
    std::fs::create_dir_all(&folder).map_err(failed)?;
    Ok(folder)
}
