//! What the image logs: defmt's frames, taken out of its memory as a debug probe does (RTT).

use super::Machine;
use super::elf::symbol;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Turns frames into lines; a program of its own (see its Cargo.toml).
const PROGRAM: &str = "defmt-lines";

/// Where the control block holds the buffer's address, its size and the place of the next byte.
const BLOCK_BYTES: usize = 48;
const BUFFER: usize = 28;
const SIZE: usize = 32;
const WRITE: usize = 36;

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Logged {
    /// The board's clock, in ticks.
    pub tick: u64,
    /// Its words.
    pub words: String,
}

/// Reads the log as it grows; asked before the board's buffer is full again, it misses nothing.
pub struct Log {
    image: PathBuf,
    block: u32,
    read: usize,
    /// All frames so far.
    frames: Vec<u8>,
}

impl Log {
    /// From the beginning.
    pub(super) fn new(image: &Path) -> Self {
        let block = symbol(image, "_SEGGER_RTT").expect("the image logs through RTT");
        Self { image: image.to_owned(), block, read: 0, frames: Vec::new() }
    }

    /// All that has been logged.
    ///
    /// # Panics
    /// When what is found are no frames.
    pub fn lines(&mut self, machine: &mut Machine) -> Vec<Logged> {
        self.take(machine);
        let mut command = Command::new(super::image(PROGRAM));
        command.arg(&self.image).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("`cargo xtask firmware` has built defmt-lines");
        let mut input = child.stdin.take().expect("a pipe");
        let frames = self.frames.clone();
        let writer = std::thread::spawn(move || input.write_all(&frames));
        let output = child.wait_with_output().expect("it ends");
        writer.join().expect("it writes").expect("it is read");
        assert!(output.status.success(), "the log is damaged");
        String::from_utf8_lossy(&output.stdout).lines().map(line).collect()
    }

    fn take(&mut self, machine: &mut Machine) {
        let block = machine.memory(self.block, BLOCK_BYTES);
        let word =
            |at: usize| u32::from_le_bytes(block[at..at + 4].try_into().expect("four bytes"));
        let write = word(WRITE) as usize;
        let buffer = machine.memory(word(BUFFER), word(SIZE) as usize);
        if write < self.read {
            self.frames.extend_from_slice(&buffer[self.read..]);
            self.read = 0;
        }
        self.frames.extend_from_slice(&buffer[self.read..write]);
        self.read = write;
    }
}

fn line(line: &str) -> Logged {
    let (tick, words) = line.split_once(' ').expect("time and words");
    Logged {
        tick: tick.parse().expect("the image says the time in ticks"),
        words: words.to_owned(),
    }
}
