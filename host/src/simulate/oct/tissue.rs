//! The scatterers of all layers: where they are, and how they walk.
//!
//! The tissue is cut into square cells, each with the same number of scatterers of every layer. A
//! row of cells lies together in memory: cell after cell, in a cell layer after layer.

use super::elongation::stimulated;
use super::geometry::Geometry;
use super::random::{Purpose, Random};
use super::scene::OctScene;
use crate::allocate::reserve;
use crate::error::Result;
use crate::progress;
use crate::simulate::vector_math::{TURN, fixed, normal_pair};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Side of a cell, pixels.
pub const CELL: usize = 8;

/// All scatterers.
pub struct Tissue {
    /// The rows of cells.
    pub strips: Vec<Strip>,
    /// Scatterers of one cell.
    pub per_cell: usize,
    /// Position of the first cell, (y, x), pixels of the first sweep.
    pub origin: [f64; 2],
    /// Cells along x.
    pub columns: usize,
    per_layer: usize,
    /// Random step of each layer, wavelengths.
    sigma: Vec<f64>,
    pitch_wavelengths: f64,
    depth_px_per_turn: f64,
    random: Random,
}

/// The scatterers of a row of cells as a structure of arrays.
pub struct Strip {
    /// Pixels of the first sweep.
    pub x: Vec<f32>,
    /// Pixels of the first sweep.
    pub y: Vec<f32>,
    /// Depth in the first sweep and what the random walk adds, depth pixels.
    pub depth: Vec<f32>,
    /// 2k₀z/2π modulo 1, unit 2⁻³².
    pub phase: Vec<u32>,
    /// Amplitude relative to the light of a pixel.
    pub amplitude: Vec<f32>,
    /// Whether it moves with the tips of the stimulated outer segments.
    pub moves: Vec<bool>,
}

impl Tissue {
    /// Bytes of one scatterer.
    const BYTES: usize = 5 * 4 + 1;

    /// The scatterers at the time of the first sweep: x, y and phase uniform, depth uniform over the
    /// layer's thickness, amplitude uniform between 0 and that which gives the layer its brightness.
    pub fn start(scene: &OctScene, geometry: &Geometry) -> Result<Self> {
        let (origin, cells) = extent(geometry);
        let per_layer = CELL * CELL * scene.scatterers_per_pixel;
        let [stay, grow] = scene.micro_motion_wavelengths;
        let mut tissue = Self {
            strips: Vec::new(),
            per_cell: per_layer * scene.layers.len(),
            origin,
            columns: cells[1],
            per_layer,
            sigma: scene.layers.iter().map(|l| if l.elongates { grow } else { stay }).collect(),
            pitch_wavelengths: scene.pitch_wavelengths,
            depth_px_per_turn: scene.depth_px_per_turn(),
            random: Random::new(scene.seed, Purpose::Start),
        };
        let strip = |row| tissue.strip(scene, geometry, row);
        tissue.strips = (0..cells[0]).into_par_iter().map(strip).collect::<Result<_>>()?;
        tissue.random = Random::new(scene.seed, Purpose::Walk);
        Ok(tissue)
    }

    /// Memory of all scatterers, bytes.
    pub fn memory_bytes(scene: &OctScene, geometry: &Geometry) -> u64 {
        let (_, cells) = extent(geometry);
        let per_cell = CELL * CELL * scene.scatterers_per_pixel * scene.layers.len();
        (cells[0] * cells[1] * per_cell * Self::BYTES) as u64
    }

    fn strip(&self, scene: &OctScene, geometry: &Geometry, row: usize) -> Result<Strip> {
        progress::check()?;
        let mut strip = Strip::reserve(self.columns * self.per_cell)?;
        let size = [scene.width, scene.height];
        let scales: Vec<f64> = scene.layers.iter().map(|l| scale(scene, l.brightness)).collect();
        for column in 0..self.columns {
            for (layer, scale) in scene.layers.iter().zip(&scales) {
                for _ in 0..self.per_layer {
                    let words = self.random.words(strip.x.len() as u32, row as u32, 0);
                    let more = self.random.words(strip.x.len() as u32, row as u32, 1);
                    let [x, y, across, strength] = [words[0], words[1], words[2], more[0]]
                        .map(|word| f64::from(word) / f64::from(TURN));
                    let x = self.origin[1] + (column as f64 + x) * CELL as f64;
                    let y = self.origin[0] + (row as f64 + y) * CELL as f64;
                    let sheet = layer.offset_px + layer.thickness_px * (across - 0.5);
                    strip.x.push(x as f32);
                    strip.y.push(y as f32);
                    strip.depth.push((geometry.surface.depth_px([y, x]) + sheet) as f32);
                    strip.phase.push(words[3]);
                    strip.amplitude.push((scale * strength) as f32);
                    strip.moves.push(layer.elongates && stimulated([x as f32, y as f32], size));
                }
            }
        }
        Ok(strip)
    }

    /// All scatterers take their random step into sweep `t`.
    pub fn walk(&mut self, t: usize) -> Result<()> {
        let Self { strips, per_layer, sigma, random, .. } = self;
        let steps: Vec<Step> = sigma
            .iter()
            .map(|&sigma| Step {
                lateral_px: (sigma / self.pitch_wavelengths) as f32,
                turns: (2.0 * sigma) as f32, // 2kz/2π with z in wavelengths
                depth_px_per_turn: self.depth_px_per_turn as f32,
            })
            .collect();
        if sigma.iter().all(|&sigma| sigma == 0.0) {
            return Ok(());
        }
        strips.par_iter_mut().enumerate().try_for_each(|(row, strip)| {
            progress::check()?;
            strip.walk(&steps, *per_layer, |i| random.words(i as u32, row as u32, t as u32));
            Ok(())
        })
    }
}

/// Position of the first cell and number of cells along y and x.
fn extent(geometry: &Geometry) -> ([f64; 2], [usize; 2]) {
    let cell = CELL as f64;
    let [low, high] = geometry.tissue;
    let origin = low.map(|p| ((p - geometry.walk_px) / cell).floor() * cell);
    let cells =
        [0, 1].map(|axis| ((high[axis] + geometry.walk_px - origin[axis]) / cell).ceil() as usize);
    (origin, cells)
}

/// Largest amplitude of a scatterer: a layer of density ρ, amplitudes uniform in [0, a] and an
/// aperture f has the mean square amplitude ρ a²/3 π f² behind the aperture.
fn scale(scene: &OctScene, brightness: f64) -> f64 {
    let relative = scene.isos_fringe_dn / (scene.mean_dn - scene.offset_dn);
    let aperture = PI * scene.aperture_cycles_per_pixel * scene.aperture_cycles_per_pixel;
    relative * brightness / libm::sqrt(scene.scatterers_per_pixel as f64 / 3.0 * aperture)
}

/// Standard deviations of the random step of one layer.
struct Step {
    lateral_px: f32,
    turns: f32,
    depth_px_per_turn: f32,
}

impl Strip {
    fn reserve(len: usize) -> Result<Self> {
        let what = "the scatterers";
        Ok(Self {
            x: reserve(len, what)?,
            y: reserve(len, what)?,
            depth: reserve(len, what)?,
            phase: reserve(len, what)?,
            amplitude: reserve(len, what)?,
            moves: reserve(len, what)?,
        })
    }

    /// The random step of every scatterer, `words(i)` its random words.
    fn walk(&mut self, steps: &[Step], per_layer: usize, words: impl Fn(usize) -> [u32; 4]) {
        let layers = steps.iter().cycle();
        for (block, step) in (0..self.x.len().div_ceil(per_layer)).zip(layers) {
            for i in block * per_layer..(block + 1) * per_layer {
                let words = words(i);
                let [x, y] = normal_pair([words[0], words[1]]);
                let [z, _] = normal_pair([words[2], words[3]]);
                let turns = step.turns * z;
                self.x[i] += step.lateral_px * x;
                self.y[i] += step.lateral_px * y;
                self.phase[i] = self.phase[i].wrapping_add(fixed(turns));
                self.depth[i] += step.depth_px_per_turn * turns;
            }
        }
    }
}
