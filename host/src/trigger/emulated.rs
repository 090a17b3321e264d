//! The emulated board: another program that runs the very image which is flashed.

use crate::error::{Error, Result};
use std::env;
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// Names the emulated board's program.
pub const PROGRAM_VARIABLE: &str = "PHASEWALK_EMULATED_BOARD";

const PROGRAM: &str = "emulated-board";
const IMAGE: &str = "uno.elf";

/// Where `cargo xtask firmware` puts what it makes.
const FOLDER: &str = "target/firmware";

/// It must say where it listens within this time, and end within it.
const PATIENCE: Duration = Duration::from_secs(10);

/// A running emulated board; dropped, it ends.
#[derive(Debug)]
pub struct EmulatedBoard {
    child: Child,
    stdin: Option<ChildStdin>,
    /// The terminal that it listens to.
    pub port: String,
}

impl EmulatedBoard {
    /// Start `image`, or the image of the Uno that was built last, with `jumpers` such as `D9-D8`.
    ///
    /// # Errors
    /// When program or image is not found, or does not start.
    pub fn start(image: Option<&Path>, jumpers: &[&str]) -> Result<Self> {
        let program = program()?;
        let image = match image {
            Some(image) if image.is_file() => image.to_owned(),
            Some(image) => return Err(Error::file(image, "no such image: check the name")),
            None => built(IMAGE)?,
        };
        // In a process group of its own, so that Ctrl-C leaves it alive to be aborted properly.
        let spawned = Command::new(&program)
            .arg(&image)
            .args(jumpers.iter().flat_map(|jumper| ["--jumper", jumper]))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .process_group(0)
            .spawn();
        let mut child = spawned
            .map_err(|error| Error::file(&program, format!("cannot be started: {error}")))?;
        let stdin = child.stdin.take();
        let mut board = Self { child, stdin, port: String::new() };
        board.port = board.first_line(&program)?;
        Ok(board)
    }

    fn first_line(&mut self, program: &Path) -> Result<String> {
        let nothing = || Error::file(program, "did not say where its board listens");
        let stdout = self.child.stdout.take().ok_or_else(nothing)?;
        let (sender, receiver) = channel();
        std::thread::spawn(move || {
            let mut lines = BufReader::new(stdout).lines();
            let _ = sender.send(lines.next());
            // Read on, so that it never waits for a reader.
            lines.for_each(drop);
        });
        match receiver.recv_timeout(PATIENCE) {
            Ok(Some(Ok(line))) if !line.trim().is_empty() => Ok(line.trim().to_owned()),
            _ => Err(nothing()),
        }
    }
}

impl Drop for EmulatedBoard {
    fn drop(&mut self) {
        drop(self.stdin.take());
        let give_up = Instant::now() + Duration::from_secs(2);
        while Instant::now() < give_up {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn program() -> Result<PathBuf> {
    match env::var_os(PROGRAM_VARIABLE) {
        Some(path) => Ok(PathBuf::from(path)),
        None => built(PROGRAM),
    }
}

/// A file that the build of the firmware leaves: in the folder of the build, upward from here and
/// beside this program.
///
/// # Errors
/// When it is nowhere; the message says how to make it.
pub fn built(name: &str) -> Result<PathBuf> {
    let here = env::current_dir().unwrap_or_default();
    let upward = here.ancestors().map(|folder| folder.join(FOLDER));
    let program = env::current_exe().unwrap_or_default();
    let beside = program.parent().map(Path::to_owned);
    // Beside `target/release/phasewalk` lies `target/firmware`.
    let sibling = program.ancestors().nth(2).map(|folder| folder.join("firmware"));
    let mut folders = upward.chain(beside).chain(sibling);
    folders.find_map(|folder| Some(folder.join(name)).filter(|path| path.is_file())).ok_or_else(
        || {
            Error::failed(format!(
                "{name}: not found in {FOLDER} here or above, nor beside this program: build the \
                 firmware (`cargo xtask firmware`) or name the file"
            ))
        },
    )
}
