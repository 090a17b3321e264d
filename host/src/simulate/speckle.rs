//! The simulation itself, frame after frame (paper, lines 612–645).
//!
//! Only the scatterers and a few images are in memory: frames are handed out one by one.

use super::SpeckleScene;
use super::aperture::Aperture;
use super::memory::{reserve, zeros};
use super::philox;
use super::scatterers::{BLOCK, Block, Raster, Walk};
use super::simd::{Kernel, Simd};
use super::stimulus::movement_wavelengths;
use crate::error::Result;
use crate::progress::{self, Progress};
use num_complex::Complex32;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Blocks a thread takes at a time: 256 KiB of scatterers.
const BLOCKS_PER_TASK: usize = 64;
/// Pixels a thread converts at a time.
const PIXELS_PER_TASK: usize = 4096;

impl SpeckleScene {
    /// Simulate and call `each(t, field)` for t = 0, 1, … with the field U(t), shape (y, x).
    ///
    /// It works on all threads of the ambient rayon pool; the fields are the same, byte for byte,
    /// for any number of them. `progress` moves by one per frame. The memory needed is
    /// [`memory_bytes`](Self::memory_bytes).
    ///
    /// # Errors
    /// Those of [`validate`](Self::validate), lack of memory,
    /// [`Error::Interrupted`](crate::error::Error::Interrupted), and whatever `each` returns.
    pub fn for_each_frame(
        &self,
        progress: &Progress,
        each: impl FnMut(usize, &[Complex32]) -> Result<()>,
    ) -> Result<()> {
        self.for_each_frame_with(Simd::widest(), progress, each)
    }

    /// [`for_each_frame`](Self::for_each_frame) in a chosen instruction set.
    fn for_each_frame_with(
        &self,
        simd: Simd,
        progress: &Progress,
        mut each: impl FnMut(usize, &[Complex32]) -> Result<()>,
    ) -> Result<()> {
        self.validate()?;
        let cutoff = self.aperture_cycles_per_wavelength * self.pitch_wavelengths;
        let mut aperture = Aperture::new(self.width, self.height, cutoff)?;
        let mut scatterers = Scatterers::new(self, simd)?;
        let mut field = zeros(self.pixels(), "the images")?;
        for t in 0..self.frames {
            scatterers.advance(self.walk_into(t).as_ref())?;
            scatterers.draw(&mut field);
            aperture.apply(&mut field);
            each(t, &field)?;
            progress.advance(1)?;
        }
        Ok(())
    }

    /// The step that makes frame t; none makes frame 0.
    fn walk_into(&self, t: usize) -> Option<Walk> {
        let sigma = self.sigma_wavelengths;
        let over_side = |side: usize| (sigma / (side as f64 * self.pitch_wavelengths)) as f32;
        let turns = |z: f64| 2.0 * z; // 2kz/2π with z in wavelengths
        (t > 0).then(|| Walk {
            key: philox::key(self.seed),
            frame: t as u32,
            sigma_turns: [over_side(self.width), over_side(self.height), turns(sigma) as f32],
            drift: (turns(movement_wavelengths(t)) * 2f64.powi(32)) as u32,
        })
    }
}

/// All scatterers, and for each thread the image it adds them to.
struct Scatterers {
    kernel: Kernel,
    raster: Raster,
    blocks: Vec<Block>,
    sums: Vec<Mutex<Vec<i64>>>,
}

impl Scatterers {
    /// The scatterers of `scene` at the start.
    fn new(scene: &SpeckleScene, simd: Simd) -> Result<Self> {
        let mut blocks = reserve(scene.blocks(), "the scatterers")?;
        let (count, key) = (scene.scatterers(), philox::key(scene.seed));
        (0..scene.blocks())
            .into_par_iter()
            .map(|block| Block::start(block, count, key))
            .collect_into_vec(&mut blocks);
        let image = |_| Ok(Mutex::new(zeros(scene.pixels(), "the images")?));
        Ok(Self {
            kernel: Kernel::new(simd),
            raster: Raster {
                width: scene.width as u32,
                height: scene.height as u32,
                mask: scene.mask(),
                scale: Raster::scale_for(scene.scatterers_per_pixel),
            },
            blocks,
            sums: (0..rayon::current_num_threads()).map(image).collect::<Result<_>>()?,
        })
    }

    /// Move all scatterers into the next frame and sum them up, each thread in its own image.
    fn advance(&mut self, walk: Option<&Walk>) -> Result<()> {
        let Self { kernel, raster, blocks, sums } = self;
        sums.par_iter_mut().for_each(|image| image_of(image).fill(0));
        blocks.par_chunks_mut(BLOCKS_PER_TASK).enumerate().try_for_each(|(task, blocks)| {
            progress::check()?;
            let thread = rayon::current_thread_index().unwrap_or(0) % sums.len();
            let mut image = sums[thread].lock().unwrap_or_else(PoisonError::into_inner);
            kernel.advance(blocks, task * BLOCKS_PER_TASK * BLOCK, walk, raster, &mut image);
            Ok(())
        })
    }

    /// The field of all threads' images together, before the aperture.
    fn draw(&mut self, field: &mut [Complex32]) {
        let Self { raster, sums, .. } = self;
        let images: Vec<&[i64]> = sums.iter_mut().map(|image| &*image_of(image)).collect();
        field.par_chunks_mut(PIXELS_PER_TASK).enumerate().for_each(|(task, field)| {
            for (i, value) in field.iter_mut().enumerate() {
                let pixel = task * PIXELS_PER_TASK + i;
                let add = |sum: i64, image: &&[i64]| sum.wrapping_add(image[pixel]);
                *value = raster.field(images.iter().fold(0, add));
            }
        });
    }
}

/// The image behind a lock that nobody else can hold.
fn image_of(image: &mut Mutex<Vec<i64>>) -> &mut [i64] {
    image.get_mut().unwrap_or_else(PoisonError::into_inner)
}
