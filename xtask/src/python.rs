//! The virtual environment of the scripts in tests/peers.

use crate::command::{command, run};
use crate::{Result, folders, packages};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A Python with the packages that tests/peers/requirements.txt pins.
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

    /// The requirements that were installed, written once they all are.
    fn stamp(&self) -> PathBuf {
        self.folder.join("installed-requirements.txt")
    }
}

/// The environment, made anew only when its requirements have changed.
pub(crate) fn environment() -> Result<Environment> {
    let environment = Environment { folder: folders::target()?.join("peers-venv") };
    let requirements = folders::peer("requirements.txt");
    let wanted = read(&requirements)?;
    if std::fs::read_to_string(environment.stamp()).is_ok_and(|installed| installed == wanted) {
        return Ok(environment);
    }
    let python = packages::python()?;
    run(command(python).args(["-m", "venv", "--clear"]).arg(&environment.folder))?;
    let install = "-m pip --quiet --disable-pip-version-check install --requirement";
    run(environment.python().args(install.split_whitespace()).arg(&requirements))?;
    let stamp = environment.stamp();
    std::fs::write(&stamp, wanted).map_err(|e| format!("cannot write {}: {e}", stamp.display()))?;
    Ok(environment)
}

fn read(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|e| format!("cannot read {}: {e}", path.display()))
}
