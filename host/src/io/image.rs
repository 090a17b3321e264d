//! Phase images, strip by strip.

use super::npy::{NpyWriter, sibling};
use super::shape::byte_count;
use super::zarr::{ArrayWriter, Compression, GroupWriter, Layout};
use super::{Attributes, Format, format};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Frames in one chunk: enough to compress well, few enough to look at one frame quickly.
const CHUNK_FRAMES: usize = 128;

/// What an [`ImageWriter`] will receive.
#[derive(Debug, Clone)]
pub struct ImageLayout {
    /// Number of frames.
    pub frames: usize,
    /// Rows of a frame.
    pub height: usize,
    /// Columns of a frame.
    pub width: usize,
    /// Rows of a strip; the last one may have fewer.
    pub strip_rows: usize,
    /// Whether the standard deviation comes with the phase.
    pub sigma: bool,
    /// Provenance, kept by Zarr.
    pub attributes: Attributes,
    /// Acquisition times in seconds, kept by Zarr.
    pub times_s: Option<Vec<f64>>,
}

impl ImageLayout {
    /// Refuse an empty or impossible layout; else the bytes of one series of images.
    fn check(&self, path: &Path) -> Result<u64> {
        let shape = [self.frames, self.height, self.width];
        if shape.contains(&0) || self.strip_rows == 0 {
            let rows = self.strip_rows;
            return Err(Error::file(
                path,
                format!("no image to write: {shape:?} in strips of {rows}"),
            ));
        }
        if self.times_s.as_ref().is_some_and(|times| times.len() != self.frames) {
            return Err(Error::file(path, format!("{} frames need as many times", self.frames)));
        }
        let bytes = byte_count(&shape, size_of::<f32>());
        let bytes = bytes.and_then(|n| n.checked_mul(1 + usize::from(self.sigma)));
        let too_large = || Error::file(path, format!("images of shape {shape:?} fit on no disk"));
        bytes.map(|n| n as u64).ok_or_else(too_large)
    }
}

/// Writes float32 images (time, y, x) whose strips arrive in any order, from several threads.
///
/// `F.npy` holds the phase and `F.sigma.npy` its standard deviation; `F.zarr` holds `phase_rad`,
/// `sigma_rad`, `valid` and `time_s`, and what else belongs to the images ([`Self::write_map`],
/// [`Self::write_quality`]). Phases are stored as given: the caller puts NaN where a pixel
/// is not valid.
pub struct ImageWriter {
    layout: ImageLayout,
    rows_written: AtomicUsize,
    sink: Sink,
}

enum Sink {
    Npy { phase: NpyWriter<f32>, sigma: Option<NpyWriter<f32>> },
    Zarr(Box<ZarrSink>),
}

struct ZarrSink {
    group: GroupWriter,
    phase: ArrayWriter<f32>,
    sigma: Option<ArrayWriter<f32>>,
    valid: ArrayWriter<bool>,
}

impl ImageWriter {
    /// Begin the files under temporary names.
    ///
    /// # Errors
    /// When the extension of `path` is unknown, the layout is empty, or the folder cannot be
    /// written to.
    pub fn create(path: &Path, layout: ImageLayout) -> Result<Self> {
        let bytes = layout.check(path)?;
        let sink = match Format::of(path)? {
            Format::Npy => npy_sink(path, &layout)?,
            Format::Zarr => Sink::Zarr(Box::new(ZarrSink::create(path, &layout, bytes)?)),
            Format::Csv => return Err(format::not_a_table(path)),
        };
        Ok(Self { layout, rows_written: AtomicUsize::new(0), sink })
    }

    /// Write the strip of all frames that begins at row `y0`: `phase` and `sigma` have axes
    /// (time, rows, x), `valid` (rows, x).
    ///
    /// # Errors
    /// When the strip does not fit the layout, or the disk is full.
    pub fn write_strip(
        &self,
        y0: usize,
        phase: &[f32],
        sigma: Option<&[f32]>,
        valid: &[bool],
    ) -> Result<()> {
        let rows = self.rows_of_strip(y0, phase, sigma, valid)?;
        match &self.sink {
            Sink::Npy { phase: phase_file, sigma: sigma_file } => {
                self.write_npy(phase_file, y0, rows, phase)?;
                if let (Some(file), Some(sigma)) = (sigma_file, sigma) {
                    self.write_npy(file, y0, rows, sigma)?;
                }
            }
            Sink::Zarr(zarr) => {
                let start = [0, y0, 0];
                let shape = [self.layout.frames, rows, self.layout.width];
                zarr.phase.write(&start, &shape, phase)?;
                if let (Some(array), Some(sigma)) = (&zarr.sigma, sigma) {
                    array.write(&start, &shape, sigma)?;
                }
                zarr.valid.write(&start[1..], &shape[1..], valid)?;
            }
        }
        self.rows_written.fetch_add(rows, Ordering::Relaxed);
        Ok(())
    }

    /// Add a map (y, x) of what belongs to all frames; `.npy` files have no place for it.
    ///
    /// # Errors
    /// When it does not fit the layout, or the disk is full.
    pub fn write_map(&self, name: &str, values: &[f32]) -> Result<()> {
        let ImageLayout { height, width, .. } = self.layout;
        match &self.sink {
            Sink::Npy { .. } => Ok(()),
            Sink::Zarr(zarr) => zarr.group.write_whole(name, &["y", "x"], &[height, width], values),
        }
    }

    /// Add the quality of the frames in each tile of the image, (time, tile_y, tile_x); `tile_y` and `tile_x` hold the
    /// first row and column of each. `.npy` files have no place for it.
    ///
    /// # Errors
    /// When it does not fit the layout, or the disk is full.
    pub fn write_quality(&self, quality: &[f32], origins: [&[usize]; 2]) -> Result<()> {
        let Sink::Zarr(zarr) = &self.sink else { return Ok(()) };
        for (axis, first) in ["tile_y", "tile_x"].into_iter().zip(origins) {
            let first: Vec<f64> = first.iter().map(|&pixel| pixel as f64).collect();
            zarr.group.write_whole(axis, &[axis], &[first.len()], &first)?;
        }
        let shape = [self.layout.frames, origins[0].len(), origins[1].len()];
        zarr.group.write_whole("quality", &["time", "tile_y", "tile_x"], &shape, quality)
    }

    /// Give the results their final names, which are returned.
    ///
    /// # Errors
    /// When strips are missing, or the disk is full.
    pub fn finish(self) -> Result<Vec<PathBuf>> {
        let (written, height) = (self.rows_written.into_inner(), self.layout.height);
        if written != height {
            return Err(Error::failed(format!(
                "{written} of {height} rows of the images were written"
            )));
        }
        match self.sink {
            Sink::Npy { phase, sigma } => {
                // Where the phase is, its standard deviation is complete already.
                let sigma = sigma.map(NpyWriter::finish).transpose()?;
                Ok([phase.finish()?].into_iter().chain(sigma).collect())
            }
            Sink::Zarr(zarr) => Ok(vec![zarr.group.finish()?]),
        }
    }

    /// Rows of the strip at `y0`, once every length is right.
    fn rows_of_strip(
        &self,
        y0: usize,
        phase: &[f32],
        sigma: Option<&[f32]>,
        valid: &[bool],
    ) -> Result<usize> {
        let ImageLayout { frames, height, width, strip_rows, .. } = self.layout;
        let rows = strip_rows.min(height.saturating_sub(y0));
        let fits = rows > 0
            && y0.is_multiple_of(strip_rows)
            && valid.len() == rows * width
            && phase.len() == frames * rows * width
            && sigma.map_or(!self.layout.sigma, |s| self.layout.sigma && s.len() == phase.len());
        if fits {
            Ok(rows)
        } else {
            Err(Error::failed(format!(
                "the strip at row {y0} does not fit {frames} images of {height} x {width} in strips of {strip_rows}"
            )))
        }
    }

    fn write_npy(
        &self,
        file: &NpyWriter<f32>,
        y0: usize,
        rows: usize,
        strip: &[f32],
    ) -> Result<()> {
        let ImageLayout { height, width, .. } = self.layout;
        for (frame, image) in strip.chunks_exact(rows * width).enumerate() {
            file.write_at((frame * height + y0) * width, image)?;
        }
        Ok(())
    }
}

fn npy_sink(path: &Path, layout: &ImageLayout) -> Result<Sink> {
    let shape = [layout.frames, layout.height, layout.width];
    let phase = NpyWriter::create(path, &shape)?.flushed();
    let sigma = layout.sigma.then(|| NpyWriter::create(&sibling(path, "sigma"), &shape));
    Ok(Sink::Npy { phase, sigma: sigma.transpose()?.map(NpyWriter::flushed) })
}

impl ZarrSink {
    fn create(path: &Path, layout: &ImageLayout, bytes: u64) -> Result<Self> {
        let shape = [layout.frames, layout.height, layout.width];
        let rows = layout.strip_rows.min(layout.height);
        let chunk = [layout.frames.min(CHUNK_FRAMES), rows, layout.width];
        let images = Layout {
            axes: &["time", "y", "x"],
            shape: &shape,
            chunk: &chunk,
            shard: None,
            compression: Compression::Zstd,
        };
        let pixels =
            Layout { axes: &images.axes[1..], shape: &shape[1..], chunk: &chunk[1..], ..images };
        let group = GroupWriter::create(path, layout.attributes.clone(), bytes)?;
        if let Some(times) = &layout.times_s {
            group.write_whole("time_s", &["time"], &[layout.frames], times)?;
        }
        Ok(Self {
            phase: group.array("phase_rad", &images)?,
            sigma: layout.sigma.then(|| group.array("sigma_rad", &images)).transpose()?,
            valid: group.array("valid", &pixels)?,
            group,
        })
    }
}
