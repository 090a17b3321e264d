//! The emulated board: another program that runs the very image which is flashed.

mod simulator;

use crate::error::{Error, Result};
use simulator::Simulator;
use std::env;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

pub use simulator::PROGRAM_VARIABLE;

/// What stands for the image of the STM32F405 that was built last.
const F405: &str = "f405";

/// The images that `cargo xtask firmware` makes.
const UNO_IMAGE: &str = "uno.elf";
const F405_IMAGE: &str = "f405.elf";

/// Where `cargo xtask firmware` puts what it makes.
const FOLDER: &str = "target/firmware";

/// It must say where it listens within this time.
const PATIENCE: Duration = Duration::from_secs(10);

/// A running emulated board; dropped, it ends.
#[derive(Debug)]
pub struct EmulatedBoard {
    child: Child,
    /// Closed, it tells the program to end; so does the end of ours.
    stdin: Option<ChildStdin>,
    /// The terminal that it listens to.
    pub port: String,
}

impl EmulatedBoard {
    /// Start `image`, the image of the STM32F405 that was built last (`f405`), or that of the Uno,
    /// with `jumpers` such as `D9-D8`.
    ///
    /// # Errors
    /// When program or image is not found, or does not start.
    pub fn start(image: Option<&Path>, jumpers: &[&str]) -> Result<Self> {
        let image = match image {
            None => built(UNO_IMAGE)?,
            Some(image) if image == Path::new(F405) => built(F405_IMAGE)?,
            Some(image) if image.is_file() => image.to_owned(),
            Some(image) => return Err(Error::file(image, "no such image: check the name")),
        };
        let simulator = Simulator::of(&image)?;
        let mut command = simulator.command(&image, jumpers)?;
        let program = PathBuf::from(command.get_program());
        // In a process group of its own, so that Ctrl-C leaves it alive to be aborted properly.
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).process_group(0);
        let spawned = command.spawn();
        let mut child = spawned.map_err(|error| simulator.cannot_start(&program, &error))?;
        let stdin = child.stdin.take();
        let mut board = Self { child, stdin, port: String::new() };
        board.port = board.listens(simulator, &program)?;
        Ok(board)
    }

    /// The terminal, as the program says on its outputs.
    fn listens(&mut self, simulator: Simulator, program: &Path) -> Result<String> {
        let lines = self.lines();
        let give_up = Instant::now() + PATIENCE;
        let mut said = String::new();
        loop {
            match lines.recv_timeout(give_up.saturating_duration_since(Instant::now())) {
                Ok(line) => match simulator.terminal(&line) {
                    Some(terminal) => return Ok(terminal),
                    None => said = line,
                },
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                    let said = if said.is_empty() { said } else { format!(" ({said})") };
                    let what = format!("did not say where its board listens{said}");
                    return Err(Error::file(program, what));
                }
            }
        }
    }

    fn lines(&mut self) -> Receiver<String> {
        let (sender, receiver) = channel();
        if let Some(stdout) = self.child.stdout.take() {
            read_on(stdout, sender.clone());
        }
        if let Some(stderr) = self.child.stderr.take() {
            read_on(stderr, sender);
        }
        receiver
    }
}

/// Read to the end, so that it never waits for a reader.
fn read_on(output: impl Read + Send + 'static, sender: Sender<String>) {
    std::thread::spawn(move || {
        for line in BufReader::new(output).lines().map_while(std::result::Result::ok) {
            let _ = sender.send(line);
        }
    });
}

impl Drop for EmulatedBoard {
    fn drop(&mut self) {
        let asked = self.stdin.take().is_some();
        let give_up = Instant::now() + Duration::from_secs(2);
        while asked && Instant::now() < give_up {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
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
