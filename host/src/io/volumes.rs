//! Reconstructed volumes: a Zarr group that grows sweep by sweep and survives an interruption.

use super::Attributes;
use super::unfinished::Unfinished;
use super::zarr::{ArrayWriter, Compression, GroupWriter, Layout};
use crate::error::Result;
use num_complex::Complex32;
use std::path::{Path, PathBuf};

/// Rows of one chunk inside a shard.
const CHUNK_ROWS: usize = 64;
/// Bytes of one shard: one file on disk.
const SHARD_BYTES: usize = 60_000_000;

/// What does not change from sweep to sweep.
#[derive(Debug, Clone)]
pub struct VolumesLayout {
    /// Number of sweeps, bad ones included.
    pub sweeps: usize,
    /// Depths of `field`.
    pub depth: usize,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
}

/// The arrays beside `field`, each with a row per sweep or a value per pixel.
#[derive(Debug, Clone)]
pub struct Companions {
    /// (time, 3): z, y, x in pixels.
    pub shift_px: Vec<f64>,
    /// (time).
    pub rotation_rad: Vec<f64>,
    /// (time).
    pub sweep_ok: Vec<bool>,
    /// (time): how well the sweep matches its neighbours, in standard deviations of chance.
    pub match_quality: Vec<f64>,
    /// (time): first image of the sweep in the recording.
    pub first_image: Vec<f64>,
    /// (time): by what part of an image the camera began late, against the mean.
    pub start_jitter_images: Vec<f64>,
    /// (y, x): depth pixels of the unflattened first volume.
    pub surface_isos_px: Vec<f32>,
    /// (y, x): the same for the outer-segment tips.
    pub surface_ost_px: Vec<f32>,
    /// a2, a3.
    pub dispersion_rad: Vec<f64>,
    /// (y, x).
    pub dead_pixel: Vec<bool>,
    /// (time), where known.
    pub time_s: Option<Vec<f64>>,
}

/// Writes `field` complex64 (time, z, y, x) one sweep at a time, in any order.
pub struct VolumesWriter {
    layout: VolumesLayout,
    group: GroupWriter,
    field: ArrayWriter<Complex32>,
    depths_per_shard: usize,
}

impl VolumesWriter {
    /// Bytes of the whole `field`.
    #[must_use]
    pub fn bytes(layout: &VolumesLayout) -> u64 {
        let VolumesLayout { sweeps, depth, height, width } = *layout;
        (sweeps * depth * height * width * size_of::<Complex32>()) as u64
    }

    /// Begin or go on in `work`: sweeps written by an earlier run are kept.
    ///
    /// # Errors
    /// When the folder cannot be written to.
    pub fn create(
        work: Unfinished,
        layout: VolumesLayout,
        attributes: Attributes,
        companions: &Companions,
    ) -> Result<Self> {
        let VolumesLayout { sweeps, depth, height, width } = layout;
        let group = GroupWriter::go_on(work, attributes)?;
        let plane = height * width * size_of::<Complex32>();
        let depths_per_shard = (SHARD_BYTES / plane).clamp(1, depth);
        let rows = CHUNK_ROWS.min(height);
        let field = group.array(
            "field",
            &Layout {
                axes: &["time", "z", "y", "x"],
                shape: &[sweeps, depth, height, width],
                chunk: &[1, 1, rows, width],
                shard: Some(&[1, depths_per_shard, height.next_multiple_of(rows), width]),
                compression: Compression::None,
            },
        )?;
        companions.write(&group, &layout)?;
        Ok(Self { layout, group, field, depths_per_shard })
    }

    /// Write one sweep (z, y, x).
    ///
    /// # Errors
    /// When the disk is full.
    pub fn write(&self, sweep: usize, field: &[Complex32]) -> Result<()> {
        let VolumesLayout { height, width, .. } = self.layout;
        let shard = self.depths_per_shard * height * width;
        for (i, planes) in field.chunks(shard).enumerate() {
            let depths = planes.len() / (height * width);
            let start = [sweep, i * self.depths_per_shard, 0, 0];
            self.field.write(&start, &[1, depths, height, width], planes)?;
        }
        Ok(())
    }

    /// Keep what a later run needs to go on after this sweep.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn save(&self, name: &str, state: &[u8]) -> Result<()> {
        self.group.save(name, state)
    }

    /// The folder that stays behind when the work ends early.
    #[must_use]
    pub fn folder(&self) -> Option<&Path> {
        self.group.unfinished_folder()
    }

    /// Give the group its final name, which is returned.
    ///
    /// # Errors
    /// When it cannot be renamed.
    pub fn finish(self) -> Result<PathBuf> {
        self.group.finish()
    }
}

impl Companions {
    fn write(&self, group: &GroupWriter, layout: &VolumesLayout) -> Result<()> {
        let VolumesLayout { sweeps, height, width, .. } = *layout;
        let time =
            |name: &str, values: &[f64]| group.write_whole(name, &["time"], &[sweeps], values);
        time("rotation_rad", &self.rotation_rad)?;
        time("match_quality", &self.match_quality)?;
        time("first_image", &self.first_image)?;
        time("start_jitter_images", &self.start_jitter_images)?;
        if let Some(times) = &self.time_s {
            time("time_s", times)?;
        }
        group.write_whole("shift_px", &["time", "axis"], &[sweeps, 3], &self.shift_px)?;
        group.write_whole("sweep_ok", &["time"], &[sweeps], &self.sweep_ok)?;
        group.write_whole("dispersion_rad", &["order"], &[2], &self.dispersion_rad)?;
        let (axes, shape) = (["y", "x"], [height, width]);
        group.write_whole("surface_isos_px", &axes, &shape, &self.surface_isos_px)?;
        group.write_whole("surface_ost_px", &axes, &shape, &self.surface_ost_px)?;
        group.write_whole("dead_pixel", &axes, &shape, &self.dead_pixel)
    }
}
