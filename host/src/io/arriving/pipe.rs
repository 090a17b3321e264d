//! Raw frames through a pipe: one line of JSON, then the frames, nothing between them.
//!
//! ```text
//! {"format":"phasewalk-frames/1","height":368,"width":640,"dtype":"complex64"}\n
//! 368 * 640 times (re, im), little-endian float32, row after row; the next frame; ...
//! ```
//! `interval_s` (seconds from frame to frame) and `wavelength_nm` may stand in the line, too; other keys are ignored.
//! The pipe ends between two frames.

use super::{Arrival, ArrivingFrames, FrameFormat};
use crate::error::{Error, Result};
use crate::io::shape::byte_count;
use num_complex::Complex32;
use serde::Deserialize;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// What the line names as its format.
pub const PIPE_FORMAT: &str = "phasewalk-frames/1";

/// Bytes of a frame that are no mistake in the line: more than any camera has, and room for them.
const LARGEST_FRAME: usize = 2_000_000_000;

/// The line has about a hundred characters.
const LONGEST_LINE: u64 = 65_536;
/// Frames read ahead.
const AHEAD: usize = 1;
/// How long asking waits, so that an interruption is noticed.
const WAIT: Duration = Duration::from_millis(20);
/// What messages call standard input.
const NAME: &str = "standard input";

#[derive(Deserialize)]
struct Line {
    format: String,
    height: usize,
    width: usize,
    dtype: String,
    interval_s: Option<f64>,
    wavelength_nm: Option<f64>,
}

/// What the reading thread has found.
enum Found {
    Frame(Vec<u8>),
    End,
    CutShort { bytes: usize },
    Failed(std::io::Error),
}

/// Frames that a thread of their own reads: a read of a pipe lasts until something comes.
pub(super) struct PipedFrames {
    format: FrameFormat,
    frames: usize,
    found: Receiver<Found>,
}

impl PipedFrames {
    /// Read the line and begin to read the frames.
    pub(super) fn open(source: impl Read + Send + 'static) -> Result<Self> {
        let mut source = BufReader::new(source);
        let format = read_line(&mut source)?;
        let (sender, found) = sync_channel(AHEAD);
        let bytes = format.pixels() * size_of::<Complex32>();
        std::thread::Builder::new()
            .name("frames".to_owned())
            .spawn(move || read_frames(&mut source, bytes, &sender))
            .map_err(|error| Error::failed(format!("cannot start the threads: {error}")))?;
        Ok(Self { format, frames: 0, found })
    }
}

impl ArrivingFrames for PipedFrames {
    fn format(&self) -> FrameFormat {
        self.format
    }

    fn next(&mut self, frame: &mut [Complex32]) -> Result<Arrival> {
        let found = match self.found.recv_timeout(WAIT) {
            Ok(found) => found,
            Err(RecvTimeoutError::Timeout) => return Ok(Arrival::Nothing),
            Err(RecvTimeoutError::Disconnected) => return Ok(Arrival::End),
        };
        match found {
            Found::Frame(bytes) => {
                decode(&bytes, frame);
                self.frames += 1;
                Ok(Arrival::Frame)
            }
            Found::End => Ok(Arrival::End),
            Found::CutShort { bytes } => Err(cut_short(
                Path::new(NAME),
                self.frames,
                bytes as u64,
                (self.format.pixels() * size_of::<Complex32>()) as u64,
            )),
            Found::Failed(error) => Err(wrong(format!("cannot be read: {error}"))),
        }
    }

    /// What the thread holds is not known before the pipe ends, and then [`Self::next`] tells.
    fn check_whole(&self) -> Result<()> {
        Ok(())
    }
}

/// A frame that ends too early.
pub(super) fn cut_short(path: &Path, frame: usize, bytes: u64, needed: u64) -> Error {
    Error::file(
        path,
        format!("frame {frame} is cut short: {bytes} of its {needed} bytes are there"),
    )
}

fn wrong(what: impl std::fmt::Display) -> Error {
    Error::file(Path::new(NAME), what)
}

fn read_line(source: &mut impl BufRead) -> Result<FrameFormat> {
    let expected = format!(
        "{{\"format\":\"{PIPE_FORMAT}\",\"height\":H,\"width\":W,\"dtype\":\"complex64\"}}"
    );
    let mut line = Vec::new();
    source
        .take(LONGEST_LINE)
        .read_until(b'\n', &mut line)
        .map_err(|error| wrong(format!("cannot be read: {error}")))?;
    if line.pop() != Some(b'\n') {
        return Err(wrong(format!("must begin with a line {expected}")));
    }
    let line: Line = serde_json::from_slice(&line)
        .map_err(|error| wrong(format!("must begin with a line {expected}: {error}")))?;
    if line.format != PIPE_FORMAT || line.dtype != "complex64" {
        let Line { format, dtype, .. } = line;
        return Err(wrong(format!(
            "format {format:?} of {dtype:?} is not known: {PIPE_FORMAT} of complex64 is"
        )));
    }
    let Line { height, width, interval_s, wavelength_nm, .. } = line;
    let bytes = byte_count(&[height, width], size_of::<Complex32>());
    if !bytes.is_some_and(|bytes| (1..=LARGEST_FRAME).contains(&bytes)) {
        return Err(wrong(format!(
            "frames of {width} x {height} pixels cannot be: they have from 1 pixel to {} MB",
            LARGEST_FRAME / 1_000_000
        )));
    }
    for (key, value) in [("interval_s", interval_s), ("wavelength_nm", wavelength_nm)] {
        if let Some(value) = value.filter(|&value| !value.is_finite() || value <= 0.0) {
            return Err(wrong(format!("{key} is {value}: a number above 0 is needed")));
        }
    }
    Ok(FrameFormat { height, width, interval_s, wavelength_nm })
}

/// Read until the pipe ends or nobody listens any more.
fn read_frames(source: &mut impl Read, bytes: usize, sender: &SyncSender<Found>) {
    loop {
        let found = read_frame(source, bytes);
        let last = !matches!(found, Found::Frame(_));
        if sender.send(found).is_err() || last {
            return;
        }
    }
}

fn read_frame(source: &mut impl Read, bytes: usize) -> Found {
    let mut frame = Vec::with_capacity(bytes);
    match source.take(bytes as u64).read_to_end(&mut frame) {
        Err(error) => Found::Failed(error),
        Ok(0) => Found::End,
        Ok(read) if read < bytes => Found::CutShort { bytes: read },
        Ok(_) => Found::Frame(frame),
    }
}

fn decode(bytes: &[u8], frame: &mut [Complex32]) {
    let (numbers, _) = bytes.as_chunks::<4>();
    for (value, pair) in frame.iter_mut().zip(numbers.chunks_exact(2)) {
        *value = Complex32::new(f32::from_le_bytes(pair[0]), f32::from_le_bytes(pair[1]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    const LINE: &str =
        "{\"format\":\"phasewalk-frames/1\",\"height\":1,\"width\":2,\"dtype\":\"complex64\"}\n";

    fn frames(line: &str, numbers: &[f32], beyond: usize) -> Result<PipedFrames> {
        let mut bytes = line.as_bytes().to_vec();
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        bytes.extend(vec![0; beyond]);
        PipedFrames::open(Cursor::new(bytes))
    }

    /// The next that is not nothing.
    fn next(frames: &mut PipedFrames, frame: &mut [Complex32]) -> Result<Arrival> {
        loop {
            match frames.next(frame)? {
                Arrival::Nothing => {}
                other => return Ok(other),
            }
        }
    }

    #[test]
    fn frames_follow_the_line() {
        let mut piped = frames(LINE, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], 0).unwrap();
        assert_eq!((piped.format().height, piped.format().width), (1, 2));
        let mut frame = [Complex32::default(); 2];
        assert_eq!(next(&mut piped, &mut frame).unwrap(), Arrival::Frame);
        assert_eq!(frame, [Complex32::new(1.0, 2.0), Complex32::new(3.0, 4.0)]);
        assert_eq!(next(&mut piped, &mut frame).unwrap(), Arrival::Frame);
        assert_eq!(frame[1], Complex32::new(7.0, 8.0));
        assert_eq!(next(&mut piped, &mut frame).unwrap(), Arrival::End);
    }

    #[test]
    fn a_frame_that_ends_early_is_told() {
        let mut piped = frames(LINE, &[0.0; 4], 5).unwrap();
        let mut frame = [Complex32::default(); 2];
        assert_eq!(next(&mut piped, &mut frame).unwrap(), Arrival::Frame);
        let error = next(&mut piped, &mut frame).unwrap_err().to_string();
        assert!(error.contains("frame 1") && error.contains("5 of its 16 bytes"), "{error}");
    }

    #[test]
    fn wrong_lines_are_refused() {
        for (wrong, word) in [
            ("", "must begin"),
            ("no end of line", "must begin"),
            ("{}\n", "must begin"),
            ("\u{1}\u{2}\n", "must begin"),
            (&LINE.replace("frames/1", "frames/2"), "is not known"),
            (&LINE.replace("complex64", "complex128"), "is not known"),
            (&LINE.replace("\"width\":2", "\"width\":0"), "cannot be"),
            (&LINE.replace("\"width\":2", "\"width\":18446744073709551615"), "cannot be"),
            (&LINE.replace("}", ",\"interval_s\":-1}"), "interval_s"),
        ] {
            let error = frames(wrong, &[], 0).err().unwrap();
            assert!(error.to_string().contains(word), "{wrong}: {error}");
            assert_eq!(error.exit_status(), 1);
        }
    }
}
