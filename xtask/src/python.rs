//! The virtual environment of the scripts in tests/peers.

use crate::command::{command, run};
use crate::{Result, folders, packages};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What every script needs.
const REQUIREMENTS: &str = "requirements.txt";

/// A Python with the packages that files of tests/peers pin.
pub(crate) struct Environment {
    folder: PathBuf,
}

impl Environment {
    /// A script of tests/peers.
    pub(crate) fn script(&self, name: &str) -> Command {
        let mut python = self.python();
        python.arg(folders::peer(name));
        python
    }

    fn python(&self) -> Command {
        let (scripts, name) =
            if cfg!(windows) { ("Scripts", "python") } else { ("bin", "python3") };
        let mut python = command(self.folder.join(scripts).join(name));
        // No __pycache__ in the source tree.
        python.env("PYTHONDONTWRITEBYTECODE", "1");
        python
    }

    /// What `compare` needs besides; dolphin's own list asks for readers of satellite data too.
    pub(crate) fn add_dolphin(&self) -> Result {
        self.install("requirements-dolphin.txt")
    }

    /// Install what a file of tests/peers pins, without what the packages ask for beyond it.
    fn install(&self, requirements: &str) -> Result {
        if self.has(requirements)? {
            return Ok(());
        }
        let install = "-m pip --quiet --disable-pip-version-check install --no-deps --requirement";
        let file = folders::peer(requirements);
        run(self.python().args(install.split_whitespace()).arg(&file))?;
        let stamp = self.stamp(requirements);
        std::fs::write(&stamp, read(&file)?)
            .map_err(|e| format!("cannot write {}: {e}", stamp.display()))
    }

    /// Whether just these requirements are installed.
    fn has(&self, requirements: &str) -> Result<bool> {
        let wanted = read(&folders::peer(requirements))?;
        let installed = std::fs::read_to_string(self.stamp(requirements));
        Ok(installed.is_ok_and(|installed| installed == wanted))
    }

    /// A copy of the requirements, written once they all are installed.
    fn stamp(&self, requirements: &str) -> PathBuf {
        self.folder.join(format!("installed-{requirements}"))
    }
}

/// The environment, made anew only when its requirements have changed.
pub(crate) fn environment() -> Result<Environment> {
    let environment = Environment { folder: folders::target()?.join("peers-venv") };
    if !environment.has(REQUIREMENTS)? {
        let python = packages::python()?;
        run(command(python).args(["-m", "venv", "--clear"]).arg(&environment.folder))?;
        environment.install(REQUIREMENTS)?;
    }
    Ok(environment)
}

fn read(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|e| format!("cannot read {}: {e}", path.display()))
}
