//! What is said before the first frame and after the last.

use super::Task;
use super::arguments::MethodName;
use crate::cli::{list, megabytes, print};
use crate::error::{Error, Result};
use crate::watch::Ended;
use num_complex::Complex32;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::Instant;

/// Numbers of frames left out that are listed.
const LISTED: usize = 10;

/// What has come so far.
pub(super) struct Tally {
    /// Predicted bytes whatever the number of frames, and for each frame.
    memory: [u64; 2],
    frames: usize,
    left_out: usize,
    /// The first of those left out.
    listed: Vec<usize>,
    /// Pixels of all images that no pair said anything of.
    pub(super) unmeasured: usize,
    /// When the first frame came.
    first: Option<Instant>,
    /// Seconds from there to the last.
    seconds: f64,
}

impl Tally {
    pub(super) fn new(memory: [u64; 2]) -> Self {
        Self {
            memory,
            frames: 0,
            left_out: 0,
            listed: Vec::new(),
            unmeasured: 0,
            first: None,
            seconds: 0.0,
        }
    }

    /// A frame has come.
    pub(super) fn count(&mut self, number: usize, usable: bool) {
        self.seconds = self.first.get_or_insert_with(Instant::now).elapsed().as_secs_f64();
        self.frames += 1;
        if !usable {
            self.left_out += 1;
            if self.listed.len() < LISTED {
                self.listed.push(number);
            }
        }
    }

    /// Frames per second between the first and the last one.
    fn rate(&self) -> f64 {
        if self.seconds > 0.0 { (self.frames - 1) as f64 / self.seconds } else { f64::NAN }
    }

    fn left_out_in_words(&self) -> Option<String> {
        if self.left_out == 0 {
            return None;
        }
        let numbers: Vec<String> = self.listed.iter().map(usize::to_string).collect();
        let more = if self.left_out > self.listed.len() { ", ..." } else { "" };
        Some(format!(
            "{} of {} frames left out (nothing in them is finite and not 0): {}{more}",
            self.left_out,
            self.frames,
            numbers.join(", ")
        ))
    }
}

impl Task<'_> {
    /// The frame that is read, what the source holds of it, and what the first frame is looked at with.
    pub(super) fn frame_bytes(&self) -> u64 {
        (5 * self.format.pixels() * size_of::<Complex32>()) as u64
    }

    /// Say what will be done and the memory that it takes.
    pub(super) fn announce(&self, what: &str, [bytes, per_frame]: [u64; 2]) {
        if self.common.json {
            return;
        }
        let lags = match self.arguments.method() {
            MethodName::Paper => format!(", pairs up to {} frames apart", self.arguments.max_lag()),
            MethodName::Linked => String::new(),
        };
        let grows = match per_frame {
            0 => ", whatever the number of frames".to_owned(),
            _ => format!(" and {per_frame} bytes for every frame"),
        };
        print(&format!("{what}{lags}; {} of memory{grows}", megabytes(bytes)));
    }

    /// Say what was done, also where it ended in an error.
    pub(super) fn finish(
        &self,
        ended: Result<Ended>,
        tally: &Tally,
        region: &str,
        files: Vec<PathBuf>,
    ) -> Result<()> {
        let ended = ended?;
        if tally.frames == tally.left_out && ended != Ended::Interrupted {
            let frames = tally.frames;
            return Err(Error::failed(format!("no usable frame has come, {frames} in all")));
        }
        if self.common.json {
            print(&self.summary(ended, tally, &files).to_string());
        } else {
            self.print_report(tally, region, &files);
        }
        match ended {
            Ended::Source | Ended::Idle => Ok(()),
            Ended::Interrupted => Err(Error::Kept(format!(
                "interrupted: what came of the {} frames so far is kept",
                tally.frames
            ))),
        }
    }

    fn print_report(&self, tally: &Tally, region: &str, files: &[PathBuf]) {
        if let Some(line) = tally.left_out_in_words() {
            print(&line);
        }
        let resident =
            peak_resident().map(|bytes| format!("; at most {} resident", megabytes(bytes)));
        print(&format!(
            "{} frames, {region}; {:.1} frames/s{}",
            tally.frames,
            tally.rate(),
            resident.unwrap_or_default()
        ));
        if !files.is_empty() {
            print(&format!("wrote {}", list(files)));
        }
    }

    fn summary(&self, ended: Ended, tally: &Tally, files: &[PathBuf]) -> Value {
        json!({
            "software": concat!("phasewalk ", env!("CARGO_PKG_VERSION")),
            "series": self.arguments.source,
            "method": match self.arguments.method() {
                MethodName::Paper => "paper",
                MethodName::Linked => "linked",
            },
            "frames": tally.frames,
            "frames_left_out": tally.left_out,
            "pixels_without_weight": tally.unmeasured,
            "ended": ended.word(),
            "seconds": tally.seconds,
            "frames_per_second": tally.rate(),
            "memory_bytes": tally.memory[0],
            "memory_bytes_per_frame": tally.memory[1],
            "peak_resident_bytes": peak_resident(),
            "files": files,
        })
    }
}

/// The most memory that the program has had at once, where the system tells (Linux).
fn peak_resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kilobytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_left_out_are_listed_up_to_ten() {
        let mut tally = Tally::new([0, 0]);
        assert_eq!(tally.left_out_in_words(), None);
        for number in 0..30 {
            tally.count(number, number % 2 == 0);
        }
        let words = tally.left_out_in_words().unwrap();
        assert!(words.starts_with("15 of 30 frames") && words.ends_with("17, 19, ..."), "{words}");
    }

    #[test]
    fn linux_tells_the_peak() {
        let told = peak_resident();
        assert!(!cfg!(target_os = "linux") || told.is_some_and(|bytes| bytes > 1_000_000));
    }
}
