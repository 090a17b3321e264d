//! System packages: installed where we may, named where we may not.

use crate::Result;
use crate::command::{command, run, succeeds};
use std::path::{Path, PathBuf};

/// What Debian splits off from its Python and our virtual environment needs.
const PACKAGES: &str = "python3 python3-venv python3-pip";

/// numpy, scipy and zarr of tests/peers/requirements.txt need this one; so does the check below.
const VERSION: &str = "3.11";
const CHECK: &str = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))";

/// A Python that can make virtual environments.
///
/// As root on Debian it is installed if missing.
pub(crate) fn python() -> Result<PathBuf> {
    if let Some(python) = find_python() {
        return Ok(python);
    }
    if !Path::new("/etc/debian_version").exists() {
        return Err(format!("Python {VERSION} or newer with venv and pip is missing: install it"));
    }
    if !is_root() {
        return Err(format!(
            "Python {VERSION} or newer with venv and pip is missing: sudo apt-get install --yes {PACKAGES}"
        ));
    }
    install()?;
    find_python().ok_or_else(|| {
        format!("the installed python3 is older than {VERSION} or cannot make virtual environments")
    })
}

/// The first of the user's own and the system's Python that serves.
fn find_python() -> Option<PathBuf> {
    let candidates = ["python3", "/usr/bin/python3"].map(PathBuf::from);
    candidates.into_iter().find(|python| succeeds(command(python).args(["-c", CHECK])))
}

fn is_root() -> bool {
    let id = command("id").arg("-u").output();
    id.is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

fn install() -> Result {
    run(apt_get().arg("update"))?;
    let install = ["install", "--yes", "--no-install-recommends"];
    run(apt_get().args(install).args(PACKAGES.split_whitespace()))
}

fn apt_get() -> std::process::Command {
    let mut apt_get = command("apt-get");
    apt_get.env("DEBIAN_FRONTEND", "noninteractive");
    apt_get
}
