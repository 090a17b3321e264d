//! Complex frames, one after the other.

use super::npy::{NpyWriter, sibling};
use super::shape::byte_count;
use super::zarr::{ArrayWriter, Compression, GroupWriter, Layout};
use super::{Attributes, Format, format};
use crate::error::{Error, Result};
use num_complex::Complex32;
use std::path::{Path, PathBuf};

/// Bytes of one shard of the field: one file on disk, one buffer in memory.
const SHARD_BYTES: usize = 60_000_000;

/// Rows of one chunk inside a shard: what a reader of a strip decodes.
const CHUNK_ROWS: usize = 64;

/// What a [`FieldWriter`] will receive.
#[derive(Debug, Clone)]
pub struct FieldLayout {
    /// Number of frames.
    pub frames: usize,
    /// Rows of a frame.
    pub height: usize,
    /// Columns of a frame.
    pub width: usize,
    /// Provenance, kept by Zarr.
    pub attributes: Attributes,
    /// Acquisition times in seconds, if they are not even.
    pub times_s: Option<Vec<f64>>,
}

/// What the simulator knows and a measurement would have to find.
#[derive(Debug, Clone, Copy)]
pub struct Truth<'a> {
    /// Where the path changes (y, x).
    pub mask: &'a [bool],
    /// True phase inside the mask, one per frame, in radians.
    pub phase_rad: &'a [f64],
}

/// Writes complex64 frames (time, y, x) with the truth about them.
///
/// `F.npy` has `F.mask.npy` and `F.phase.npy` beside it, and `F.times.npy` where there are times. `F.zarr` holds `field`, its modulus
/// `amplitude` (float32: viewers do not show complex numbers; it adds half the size of the field
/// and no noticeable time), `mask`, `truth_phase_rad` and `time_s`. The raw phase is not stored:
/// in speckle it is noise to look at and one `numpy.angle` away.
pub struct FieldWriter {
    layout: FieldLayout,
    frames_pushed: usize,
    sink: Sink,
}

enum Sink {
    Npy { field: NpyWriter<Complex32>, truth: Box<TruthFiles> },
    Zarr(Box<ZarrSink>),
}

/// The truth, written at once and named at the end.
struct TruthFiles {
    mask: NpyWriter<bool>,
    phase: NpyWriter<f64>,
    times: Option<NpyWriter<f64>>,
}

impl FieldWriter {
    /// Begin the files under temporary names.
    ///
    /// # Errors
    /// When the extension of `path` is unknown, the truth does not fit the layout, or the folder
    /// cannot be written to.
    pub fn create(path: &Path, layout: FieldLayout, truth: Truth<'_>) -> Result<Self> {
        let bytes = check(path, &layout, truth)?;
        let sink = match Format::of(path)? {
            Format::Npy => Sink::Npy {
                field: NpyWriter::create(path, &[layout.frames, layout.height, layout.width])?
                    .flushed(),
                truth: Box::new(TruthFiles::create(path, &layout, truth)?),
            },
            Format::Zarr => Sink::Zarr(Box::new(ZarrSink::create(path, &layout, truth, bytes)?)),
            Format::Csv => return Err(format::not_a_table(path)),
        };
        Ok(Self { layout, frames_pushed: 0, sink })
    }

    /// Append one frame (y, x).
    ///
    /// # Errors
    /// When the frame does not fit the layout, or the disk is full.
    pub fn push_frame(&mut self, frame: &[Complex32]) -> Result<()> {
        let FieldLayout { frames, height, width, .. } = self.layout;
        if self.frames_pushed == frames || frame.len() != height * width {
            return Err(Error::failed(format!(
                "frame {} of {} pixels does not fit {frames} frames of {height} x {width}",
                self.frames_pushed,
                frame.len()
            )));
        }
        match &mut self.sink {
            Sink::Npy { field, .. } => field.write_at(self.frames_pushed * frame.len(), frame)?,
            Sink::Zarr(zarr) => zarr.push(frame)?,
        }
        self.frames_pushed += 1;
        Ok(())
    }

    /// Give the results their final names, which are returned.
    ///
    /// # Errors
    /// When frames are missing, or the disk is full.
    pub fn finish(self) -> Result<Vec<PathBuf>> {
        let (pushed, frames) = (self.frames_pushed, self.layout.frames);
        if pushed != frames {
            return Err(Error::failed(format!("{pushed} of {frames} frames were written")));
        }
        match self.sink {
            Sink::Npy { field, truth } => {
                // Where the field is, its truth is complete already.
                let mut files = vec![truth.mask.finish()?, truth.phase.finish()?];
                files.extend(truth.times.map(NpyWriter::finish).transpose()?);
                files.insert(0, field.finish()?);
                Ok(files)
            }
            Sink::Zarr(mut zarr) => {
                zarr.flush()?;
                Ok(vec![zarr.group.finish()?])
            }
        }
    }
}

/// Refuse what does not fit together; else the bytes of field and amplitude.
fn check(path: &Path, layout: &FieldLayout, truth: Truth) -> Result<u64> {
    let shape = [layout.frames, layout.height, layout.width];
    if shape.contains(&0) {
        return Err(Error::file(path, format!("no field to write: shape {shape:?}")));
    }
    let bytes = byte_count(&shape, size_of::<Complex32>() + size_of::<f32>());
    let bytes = bytes
        .ok_or_else(|| Error::file(path, format!("a field of shape {shape:?} fits on no disk")))?;
    let fits = truth.mask.len() == layout.height * layout.width
        && truth.phase_rad.len() == layout.frames
        && layout.times_s.as_ref().is_none_or(|times| times.len() == layout.frames);
    if fits {
        Ok(bytes as u64)
    } else {
        Err(Error::file(path, format!("truth and times do not fit a field of shape {shape:?}")))
    }
}

impl TruthFiles {
    fn create(path: &Path, layout: &FieldLayout, truth: Truth) -> Result<Self> {
        let mask = NpyWriter::create(&sibling(path, "mask"), &[layout.height, layout.width])?;
        let phase = NpyWriter::create(&sibling(path, "phase"), &[layout.frames])?;
        mask.write_at(0, truth.mask)?;
        phase.write_at(0, truth.phase_rad)?;
        let times = match &layout.times_s {
            Some(times) => {
                let file = NpyWriter::create(&sibling(path, "times"), &[layout.frames])?;
                file.write_at(0, times)?;
                Some(file)
            }
            None => None,
        };
        Ok(Self { mask, phase, times })
    }
}

/// Frames are collected until they fill a shard.
struct ZarrSink {
    group: GroupWriter,
    field: ArrayWriter<Complex32>,
    amplitude: ArrayWriter<f32>,
    height: usize,
    width: usize,
    shard_frames: usize,
    frames_stored: usize,
    buffer: Vec<Complex32>,
}

impl ZarrSink {
    fn create(path: &Path, layout: &FieldLayout, truth: Truth, bytes: u64) -> Result<Self> {
        let FieldLayout { frames, height, width, .. } = *layout;
        let group = GroupWriter::create(path, layout.attributes.clone(), bytes)?;
        group.write_whole("mask", &["y", "x"], &[height, width], truth.mask)?;
        group.write_whole("truth_phase_rad", &["time"], &[frames], truth.phase_rad)?;
        if let Some(times) = &layout.times_s {
            group.write_whole("time_s", &["time"], &[frames], times)?;
        }
        let frame_bytes = height * width * size_of::<Complex32>();
        let shard_frames = (SHARD_BYTES / frame_bytes).clamp(1, frames);
        let rows = CHUNK_ROWS.min(height);
        let arrays = Layout {
            axes: &["time", "y", "x"],
            shape: &[frames, height, width],
            chunk: &[1, rows, width],
            shard: Some(&[shard_frames, height.next_multiple_of(rows), width]),
            compression: Compression::None,
        };
        Ok(Self {
            field: group.array("field", &arrays)?,
            amplitude: group.array("amplitude", &arrays)?,
            group,
            height,
            width,
            shard_frames,
            frames_stored: 0,
            buffer: Vec::new(),
        })
    }

    fn push(&mut self, frame: &[Complex32]) -> Result<()> {
        self.buffer.extend_from_slice(frame);
        if self.buffer.len() == self.shard_frames * frame.len() { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        let frames = self.buffer.len() / (self.height * self.width);
        if frames == 0 {
            return Ok(());
        }
        let start = [self.frames_stored, 0, 0];
        let shape = [frames, self.height, self.width];
        let amplitude: Vec<f32> = self.buffer.iter().map(|value| value.norm()).collect();
        self.field.write(&start, &shape, &self.buffer)?;
        self.amplitude.write(&start, &shape, &amplitude)?;
        self.frames_stored += frames;
        self.buffer.clear();
        Ok(())
    }
}
