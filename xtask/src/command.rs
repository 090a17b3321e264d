//! Run a program: show it, let it speak, stop at its failure.

use crate::{Result, folders};
use std::ffi::OsStr;
use std::process::{Command, Stdio};

/// A command in the workspace's folder, without standard input.
pub(crate) fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(folders::workspace()).stdin(Stdio::null());
    command
}

/// The cargo that runs us.
pub(crate) fn cargo(arguments: &str) -> Command {
    let mut cargo = command(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(arguments.split_whitespace());
    cargo
}

/// Run to the end; its output goes where ours goes.
pub(crate) fn run(command: &mut Command) -> Result {
    let line = line(command);
    println!("   $ {line}");
    let status = command.status().map_err(|e| format!("cannot start `{line}`: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("`{line}` failed ({status})")) }
}

/// Whether it runs and succeeds; it is not heard.
pub(crate) fn succeeds(command: &mut Command) -> bool {
    let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
    quiet.status().is_ok_and(|status| status.success())
}

/// The command as one would type it in the workspace's folder.
fn line(command: &Command) -> String {
    let root = folders::workspace();
    let shown = |word: &OsStr| {
        let path = std::path::Path::new(word);
        path.strip_prefix(&root).unwrap_or(path).display().to_string()
    };
    let variables = command.get_envs().filter_map(|(name, value)| {
        value.map(|value| format!("{}='{}'", name.display(), value.display()))
    });
    let program = std::path::Path::new(command.get_program());
    // The path of the tool chain's cargo is noise.
    let program = if program.file_stem() == Some(OsStr::new("cargo")) {
        "cargo".to_owned()
    } else {
        shown(command.get_program())
    };
    let words = command.get_args().map(shown);
    variables.chain([program]).chain(words).collect::<Vec<_>>().join(" ")
}
