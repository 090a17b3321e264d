//! The programs that speak to the boards' boot loaders.

use super::{Image, Target};
use crate::error::{Error, Result};
use std::io::ErrorKind;
use std::process::{Command, Stdio};

/// Speaks to an Uno's boot loader.
const AVRDUDE: &str = "avrdude";

/// Speaks to the boot loader in the STM32's ROM.
const DFU_UTIL: &str = "dfu-util";

/// USB numbers of that boot loader.
const DFU_MODE: &str = "[0483:df11]";

impl Image {
    /// The command that writes it to the board: an Uno at `port`, an STM32F405 in DFU mode.
    #[must_use]
    pub fn command(&self, port: &str) -> Vec<String> {
        let path = self.path.display().to_string();
        let words = |fixed: &[&str], last: String| {
            fixed.iter().map(|&word| word.to_owned()).chain([last]).collect()
        };
        match self.target {
            Target::Uno => words(
                &[AVRDUDE, "-p", "m328p", "-c", "arduino", "-P", port, "-b", "115200", "-D", "-U"],
                format!("flash:w:{path}:i"),
            ),
            Target::F405 => words(&[DFU_UTIL, "-a", "0", "-s", "0x08000000:leave", "-D"], path),
        }
    }

    /// Run that command; what the tool says goes to standard error.
    ///
    /// # Errors
    /// When the tool is missing or fails, or no STM32 is in DFU mode.
    pub fn write(&self, port: &str) -> Result<()> {
        if self.target == Target::F405 {
            in_dfu_mode()?;
        }
        let command = self.command(port);
        let Some((tool, arguments)) = command.split_first() else { return Ok(()) };
        let outcome = Command::new(tool).args(arguments).stdout(Stdio::null()).status();
        let status = outcome.map_err(|error| cannot_run(tool, &error))?;
        if status.success() {
            return Ok(());
        }
        let hint = match self.target {
            Target::Uno => format!("is {port} the board's port, and does no other program use it?"),
            Target::F405 => "leave the board in DFU mode and try again".to_owned(),
        };
        Err(Error::failed(format!("{tool} failed ({status}): {hint}")))
    }
}

/// Whether the boot loader of an STM32 is there.
fn in_dfu_mode() -> Result<()> {
    let listed = Command::new(DFU_UTIL).arg("-l").stderr(Stdio::null()).output();
    let listed = listed.map_err(|error| cannot_run(DFU_UTIL, &error))?;
    if String::from_utf8_lossy(&listed.stdout).contains(DFU_MODE) {
        return Ok(());
    }
    Err(Error::failed(
        "no board in DFU mode at the USB: connect BOOT0 to 3.3 V, press reset, and see that `dfu-util \
         -l` lists 0483:df11",
    ))
}

fn cannot_run(tool: &str, error: &std::io::Error) -> Error {
    if error.kind() == ErrorKind::NotFound {
        return Error::failed(format!(
            "{tool} is not installed: `sudo apt install {tool}` (Debian, Ubuntu) or `brew install \
             {tool}` (macOS)"
        ));
    }
    Error::failed(format!("{tool}: {error}"))
}
