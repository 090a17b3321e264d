//! Which program emulates which board, and how it is called.

use super::built;
use crate::error::{Error, Result};
use std::env;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Names the emulated Uno's program.
pub const PROGRAM_VARIABLE: &str = "PHASEWALK_EMULATED_BOARD";

const UNO: &str = "emulated-board";

const QEMU: &str = "qemu-system-arm";

/// A machine with an STM32F405, its clock that of the instructions, 8 ns each; the board's line is its sixth
/// serial one.
const QEMU_ARGUMENTS: &str = "-M netduinoplus2 -icount shift=3,align=on,sleep=on -nographic \
    -monitor none -serial null -serial null -serial null -serial null -serial null -serial pty";

/// QEMU does not listen to its standard input. So a shell does, and ends it when this program has ended,
/// however that was.
const UNTIL_STDIN_ENDS: &str =
    "exec 3<&0; \"$0\" \"$@\" </dev/null & exec >&- 2>&-; read _ <&3; kill $!";

/// `e_machine` of ARM in an ELF file.
const ARM: u16 = 40;

/// A program that emulates a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Simulator {
    /// The Arduino Uno, by libsimavr.
    Simavr,
    /// The STM32F405, by QEMU.
    Qemu,
}

impl Simulator {
    /// The one for an image.
    pub(super) fn of(image: &Path) -> Result<Self> {
        let mut header = [0; 20];
        let file = File::open(image);
        let read = file.and_then(|mut file| file.read_exact(&mut header));
        match read {
            Err(error) if error.kind() != ErrorKind::UnexpectedEof => {
                Err(Error::file(image, format!("cannot be read: {error}")))
            }
            _ if is_arm(&header) => Ok(Self::Qemu),
            _ => Ok(Self::Simavr),
        }
    }

    /// What starts it.
    pub(super) fn command(self, image: &Path, jumpers: &[&str]) -> Result<Command> {
        match self {
            Self::Simavr => {
                let program = env::var_os(PROGRAM_VARIABLE).map(PathBuf::from);
                let mut command = Command::new(program.map_or_else(|| built(UNO), Ok)?);
                command.arg(image).args(jumpers.iter().flat_map(|jumper| ["--jumper", jumper]));
                Ok(command)
            }
            Self::Qemu if jumpers.is_empty() => {
                let version = Command::new(QEMU).arg("--version").stdout(Stdio::null()).status();
                version.map_err(|error| self.cannot_start(Path::new(QEMU), &error))?;
                let mut command = Command::new("sh");
                command.args(["-c", UNTIL_STDIN_ENDS, QEMU]);
                command.args(QEMU_ARGUMENTS.split_whitespace()).arg("-kernel").arg(image);
                // Newer ones tell the terminal there.
                command.stderr(Stdio::piped());
                Ok(command)
            }
            Self::Qemu => Err(Error::file(
                image,
                format!("the emulated STM32F405 has no pins for the jumper {}", jumpers.join(", ")),
            )),
        }
    }

    /// The terminal at which its board listens, if this line names it.
    pub(super) fn terminal(self, line: &str) -> Option<String> {
        let terminal = match self {
            Self::Simavr => line.trim(),
            Self::Qemu => {
                let (_, rest) = line.split_once("char device redirected to ")?;
                rest.split_whitespace().next()?
            }
        };
        (!terminal.is_empty()).then(|| terminal.to_owned())
    }

    /// Why it did not start.
    pub(super) fn cannot_start(self, program: &Path, error: &std::io::Error) -> Error {
        if self == Self::Qemu && error.kind() == ErrorKind::NotFound {
            return Error::failed(format!(
                "{QEMU} is not installed: `sudo apt install {QEMU}` (Debian, Ubuntu) or `brew install \
                 qemu` (macOS)"
            ));
        }
        Error::file(program, format!("cannot be started: {error}"))
    }
}

/// An ELF file for ARM, low bytes first.
fn is_arm(header: &[u8; 20]) -> bool {
    let [rest @ .., low, high] = header;
    rest.starts_with(b"\x7fELF") && u16::from_le_bytes([*low, *high]) == ARM
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simulator(bytes: &[u8]) -> Simulator {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.elf");
        std::fs::write(&path, bytes).unwrap();
        Simulator::of(&path).unwrap()
    }

    #[test]
    fn images_are_told_apart_by_their_header() {
        let elf = |machine: u8| [b"\x7fELF\x01\x01\x01", &[0; 11][..], &[machine, 0]].concat();
        assert_eq!(simulator(&elf(40)), Simulator::Qemu);
        assert_eq!(simulator(&elf(83)), Simulator::Simavr, "AVR");
        assert_eq!(simulator(b":00000001FF\n"), Simulator::Simavr, "Intel HEX, short");
        assert!(Simulator::of(Path::new("/nowhere/image.elf")).is_err());
    }

    #[test]
    fn the_terminal_is_found_in_what_they_say() {
        let line = "char device redirected to /dev/pts/7 (label serial5)";
        assert_eq!(Simulator::Qemu.terminal(line).as_deref(), Some("/dev/pts/7"));
        assert_eq!(Simulator::Qemu.terminal("qemu-system-arm: warning: x"), None);
        assert_eq!(Simulator::Simavr.terminal("/dev/pts/3\n").as_deref(), Some("/dev/pts/3"));
        assert_eq!(Simulator::Simavr.terminal(" "), None);
    }

    #[test]
    fn qemu_has_no_pins() {
        let refused = Simulator::Qemu.command(Path::new("f405.elf"), &["D9-D8"]).unwrap_err();
        assert!(refused.to_string().contains("D9-D8"), "{refused}");
    }
}
