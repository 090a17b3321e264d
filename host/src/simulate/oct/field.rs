//! The complex field of all depth planes: scatterers spread over a regular grid, seen through the
//! aperture.
//!
//! Shape of the grid (y, plane, x). Spreading, transform along x, transform along y, aperture (with
//! the kernel divided out) and back along y happen here; back along x is left to the reader, row by
//! row.

use super::geometry::{Geometry, PLANES_PER_PX};
use super::kernel::{Kernel, TAPS, transform};
use super::pose::Pose;
use super::scene::OctScene;
use super::tissue::{CELL, Strip, Tissue};
use crate::allocate::zeros;
use crate::error::Result;
use crate::progress;
use crate::simulate::vector_math::{fixed, sin_cos_turns};
use num_complex::Complex32;
use rayon::prelude::*;
use rustfft::{Fft, FftDirection, FftPlannerScalar};
use std::ops::Range;
use std::sync::Arc;

/// Rows of the grid that one task fills.
const BAND: usize = 16;
/// Rows that change places with columns together: 64 bytes of a column.
pub const ROWS: usize = 8;

/// Where and how the tissue appears during one piece of a sweep.
pub struct Appearance {
    /// Lateral position.
    pub pose: Pose,
    /// Tilt of the bulk phase along y and x, turns per pixel.
    pub tilt_turns: [f64; 2],
    /// Elongation of the stimulated outer segments, turns.
    pub elongation_turns: f64,
    /// Whether the recording shows the conjugate field.
    pub conjugate: bool,
}

/// The field of one piece of a sweep.
pub struct Field {
    geometry: Geometry,
    kernel: Kernel,
    depth_px_per_turn: f32,
    /// Shape (y, plane, x).
    grid: Vec<Complex32>,
    /// The frequencies kx inside the aperture.
    columns: Vec<usize>,
    /// Shape (plane, column, y).
    spectrum: Vec<Complex32>,
    /// The aperture over kx, ky with the kernel divided out, shape (column, ky).
    filter: Vec<f32>,
    forward_x: Arc<dyn Fft<f32>>,
    inverse_x: Arc<dyn Fft<f32>>,
    forward_y: Arc<dyn Fft<f32>>,
    inverse_y: Arc<dyn Fft<f32>>,
}

impl Field {
    /// # Errors
    /// When there is no memory for it.
    pub fn new(scene: &OctScene, geometry: &Geometry) -> Result<Self> {
        let [height, width] = geometry.field;
        let mut planner = FftPlannerScalar::new();
        let mut plan = |len, direction| planner.plan_fft(len, direction);
        let columns = columns(width, scene.aperture_cycles_per_pixel);
        Ok(Self {
            kernel: Kernel::new(),
            depth_px_per_turn: scene.depth_px_per_turn() as f32,
            grid: zeros(height * geometry.planes * width, "the depth planes")?,
            spectrum: zeros(geometry.planes * columns.len() * height, "their spectra")?,
            filter: filter(&columns, geometry.field, scene.aperture_cycles_per_pixel),
            columns,
            geometry: geometry.clone(),
            forward_x: plan(width, FftDirection::Forward),
            inverse_x: plan(width, FftDirection::Inverse),
            forward_y: plan(height, FftDirection::Forward),
            inverse_y: plan(height, FftDirection::Inverse),
        })
    }

    /// Memory of grid and spectra, bytes.
    pub fn memory_bytes(scene: &OctScene, geometry: &Geometry) -> u64 {
        let [height, width] = geometry.field;
        let columns = columns(width, scene.aperture_cycles_per_pixel).len();
        (height * geometry.planes * (width + columns) * size_of::<Complex32>()) as u64
    }

    /// Compute the field of `tissue` as it appears now.
    ///
    /// # Errors
    /// [`Error::Interrupted`](crate::error::Error::Interrupted).
    pub fn compute(&mut self, tissue: &Tissue, appearance: &Appearance) -> Result<()> {
        let mut grid = std::mem::take(&mut self.grid);
        let band = BAND * self.geometry.planes * self.geometry.field[1];
        let filled: Result<()> = grid.par_chunks_mut(band).enumerate().try_for_each(|(i, band)| {
            progress::check()?;
            band.fill(Complex32::ZERO);
            self.fill(band, i * BAND, tissue, appearance);
            self.forward_x.process(band);
            Ok(())
        });
        self.grid = grid;
        filled?;
        self.apply_aperture()
    }

    /// Add all scatterers that reach the rows of `band`, which begins at row `first`.
    fn fill(&self, band: &mut [Complex32], first: usize, tissue: &Tissue, look: &Appearance) {
        let rows = band.len() / (self.geometry.planes * self.geometry.field[1]);
        let half = [rows as f64 / 2.0, self.geometry.field[1] as f64 / 2.0];
        let middle = [first as f64 + half[0], half[1]];
        let reach = CELL as f64 * 0.75 + TAPS as f64 / 2.0 + self.geometry.walk_px + 1.0;
        for (row, strip) in tissue.strips.iter().enumerate() {
            for column in 0..tissue.columns {
                let cell = [row, column];
                let at = [0, 1]
                    .map(|axis| tissue.origin[axis] + (cell[axis] as f64 + 0.5) * CELL as f64);
                let at = look.pose.place(at);
                let near = |axis: usize| {
                    let place = at[axis] + self.geometry.corner[axis] as f64;
                    (place - middle[axis]).abs() < half[axis] + reach
                };
                if near(0) && near(1) {
                    let range = column * tissue.per_cell..(column + 1) * tissue.per_cell;
                    self.add(band, first, strip, range, look);
                }
            }
        }
    }

    /// Add A exp(i 2k₀z) of some scatterers to the nodes around them, as far as they lie in `band`.
    fn add(
        &self,
        band: &mut [Complex32],
        first: usize,
        strip: &Strip,
        range: Range<usize>,
        look: &Appearance,
    ) {
        let [_, width] = self.geometry.field;
        let planes = self.geometry.planes;
        let rows = (band.len() / (planes * width)) as i32;
        for i in range {
            let Point { node: [y, plane, x], phase } = self.point(strip, i, look);
            let (row, along_y) = self.kernel.spread(y - first as f32);
            if row + TAPS as i32 <= 0 || row >= rows {
                continue;
            }
            let (plane, along_z) = self.kernel.spread(plane);
            let (column, along_x) = self.kernel.spread(x);
            let inside = |from: i32, len: usize| from >= 0 && from as usize + TAPS <= len;
            if !inside(plane, planes) || !inside(column, width) {
                continue;
            }
            let (sine, cosine) = sin_cos_turns(phase);
            let value = Complex32::new(cosine, sine) * strip.amplitude[i];
            for (row, weight_y) in (row..).zip(along_y) {
                if !(0..rows).contains(&row) {
                    continue;
                }
                for (plane, weight_z) in (plane as usize..).zip(along_z) {
                    let start = (row as usize * planes + plane) * width + column as usize;
                    let value = value * (weight_y * weight_z);
                    if let Some(nodes) = band.get_mut(start..start + TAPS) {
                        nodes.iter_mut().zip(along_x).for_each(|(node, w)| *node += value * w);
                    }
                }
            }
        }
    }

    /// Where scatterer `i` appears on the grid, and its phase.
    #[inline(always)]
    fn point(&self, strip: &Strip, i: usize, look: &Appearance) -> Point {
        let place = look.pose.place([strip.y[i].into(), strip.x[i].into()]);
        let from_middle = look.pose.offset(place);
        let tilt = look.tilt_turns[0] * from_middle[0] + look.tilt_turns[1] * from_middle[1];
        let moved = if strip.moves[i] { look.elongation_turns } else { 0.0 };
        let turns = (tilt + moved) as f32;
        let depth = strip.depth[i] + turns * self.depth_px_per_turn;
        let phase = strip.phase[i].wrapping_add(fixed(turns));
        let corner = self.geometry.corner;
        Point {
            node: [
                (place[0] + corner[0] as f64) as f32,
                (depth - self.geometry.first_plane_px as f32) * PLANES_PER_PX as f32,
                (place[1] + corner[1] as f64) as f32,
            ],
            phase: if look.conjugate { phase.wrapping_neg() } else { phase },
        }
    }

    /// Transform along y, filter, and back along y, plane by plane.
    fn apply_aperture(&mut self) -> Result<()> {
        let Self { geometry, grid, columns, spectrum, filter, forward_y, inverse_y, .. } = self;
        let ([height, width], planes) = (geometry.field, geometry.planes);
        spectrum.par_chunks_mut(columns.len() * height).enumerate().try_for_each(
            |(plane, spectrum)| {
                progress::check()?;
                for y in (0..height).step_by(ROWS) {
                    for (column, &kx) in columns.iter().enumerate() {
                        for y in y..(y + ROWS).min(height) {
                            spectrum[column * height + y] = grid[(y * planes + plane) * width + kx];
                        }
                    }
                }
                forward_y.process(spectrum);
                spectrum.iter_mut().zip(filter.iter()).for_each(|(value, gain)| *value *= gain);
                inverse_y.process(spectrum);
                Ok(())
            },
        )
    }

    /// The field of up to [`ROWS`] rows of the image from `first` on, into `rows`, shape (y, plane,
    /// x) with x over the whole field.
    pub fn rows(&self, first: usize, rows: &mut [Complex32]) {
        let ([height, width], planes) = (self.geometry.field, self.geometry.planes);
        rows.fill(Complex32::ZERO);
        let first = first + self.geometry.corner[0];
        for (plane, spectrum) in self.spectrum.chunks_exact(self.columns.len() * height).enumerate()
        {
            for (column, &kx) in self.columns.iter().enumerate() {
                let column = &spectrum[column * height + first..];
                for (y, row) in rows.chunks_exact_mut(planes * width).enumerate() {
                    row[plane * width + kx] = column[y];
                }
            }
        }
        self.inverse_x.process(rows);
    }
}

impl Field {
    /// First column of the image in a row of the field, and the row's length.
    pub const fn columns_of_image(&self) -> [usize; 2] {
        [self.geometry.corner[1], self.geometry.field[1]]
    }
}

/// A scatterer on the grid: (y, plane, x) in nodes, and its phase as a 32-bit fraction of a turn.
struct Point {
    node: [f32; 3],
    phase: u32,
}

/// Frequency of bin k of a transform of `len` points, cycles per pixel, −½ … ½.
fn frequency(k: usize, len: usize) -> f64 {
    let signed = if 2 * k > len { k as f64 - len as f64 } else { k as f64 };
    signed / len as f64
}

/// The bins kx that hold any frequency inside the aperture.
fn columns(width: usize, cutoff: f64) -> Vec<usize> {
    (0..width).filter(|&kx| frequency(kx, width).abs() <= cutoff).collect()
}

/// Circular aperture over (column, ky), the kernel's transform divided out, for transforms that are
/// not normalised.
fn filter(columns: &[usize], [height, width]: [usize; 2], cutoff: f64) -> Vec<f32> {
    let along_y: Vec<f64> = (0..height).map(|ky| frequency(ky, height)).collect();
    let kernel_y: Vec<f64> = along_y.iter().map(|&fy| transform(fy)).collect();
    let column = |&kx: &usize| {
        let fx = frequency(kx, width);
        let scale = 1.0 / (transform(fx) * (height * width) as f64);
        let gain = |(fy, kernel): (&f64, &f64)| {
            let inside = fx * fx + fy * fy <= cutoff * cutoff;
            if inside { (scale / kernel) as f32 } else { 0.0 }
        };
        along_y.iter().zip(&kernel_y).map(gain).collect::<Vec<_>>()
    };
    columns.iter().flat_map(column).collect()
}
