//! The simulation itself, frame after frame (paper, lines 613–642).
//!
//! Only the scatterers and a few images are in memory: frames are handed out one by one.

use super::SpeckleScene;
use super::aperture::Aperture;
use super::philox;
use super::scatterers::{BLOCK, Block, Raster, Walk};
use super::simd::{Kernel, Simd};
use crate::allocate::{reserve, zeros};
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
        if t == 0 {
            return None;
        }
        let sigma = self.sigma_wavelengths * self.interval(t).sqrt();
        let over_side = |side: usize| (sigma / (side as f64 * self.pitch_wavelengths)) as f32;
        let turns = |z: f64| 2.0 * z; // 2kz/2π with z in wavelengths
        Some(Walk {
            key: philox::key(self.seed),
            frame: t as u32,
            sigma_turns: [over_side(self.width), over_side(self.height), turns(sigma) as f32],
            drift: (turns(self.movement(t)).rem_euclid(1.0) * 2f64.powi(32)) as u32,
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
                unit: Raster::unit_for(scene.scatterers_per_pixel),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::simulate::coherence_at_lags;
    use std::f64::consts::TAU;

    fn scene(width: usize, height: usize, frames: usize, sigma: f64) -> SpeckleScene {
        let sigma_wavelengths = sigma;
        SpeckleScene { width, height, frames, sigma_wavelengths, ..SpeckleScene::default() }
    }

    /// All frames one after the other.
    fn record(scene: &SpeckleScene, simd: Simd) -> Vec<Complex32> {
        let mut fields = Vec::new();
        let keep = |t: usize, field: &[Complex32]| {
            assert_eq!(fields.len(), t * field.len());
            fields.extend_from_slice(field);
            Ok(())
        };
        scene.for_each_frame_with(simd, &Progress::hidden(), keep).unwrap();
        fields
    }

    /// The frames before the aperture: what each pixel's own scatterers add up to.
    fn record_unfiltered(scene: &SpeckleScene) -> Vec<Vec<Complex32>> {
        let mut scatterers = Scatterers::new(scene, Simd::widest()).unwrap();
        let frame = |t| {
            let mut field = vec![Complex32::ZERO; scene.pixels()];
            scatterers.advance(scene.walk_into(t).as_ref()).unwrap();
            scatterers.draw(&mut field);
            field
        };
        (0..scene.frames).map(frame).collect()
    }

    fn bits(fields: &[Complex32]) -> Vec<[u32; 2]> {
        fields.iter().map(|u| [u.re.to_bits(), u.im.to_bits()]).collect()
    }

    #[test]
    fn bytes_do_not_depend_on_the_number_of_threads() {
        let scene = scene(61, 37, 8, 1.0 / 32.0);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            bits(&pool.install(|| record(&scene, Simd::widest())))
        };
        let expected = on(1);
        for threads in [2, 5] {
            assert!(on(threads) == expected, "{threads} threads");
        }
    }

    #[test]
    fn bytes_do_not_depend_on_the_instruction_set() {
        let scene = scene(61, 37, 8, 1.0 / 16.0);
        let expected = bits(&record(&scene, Simd::Portable));
        for simd in Simd::available() {
            assert!(bits(&record(&scene, simd)) == expected, "{simd:?}");
        }
    }

    /// The same scene on every machine and in every later version: a hash (FNV-1a) of all frames
    /// before the aperture.
    #[test]
    fn bytes_do_not_change_with_time() {
        let frames = record_unfiltered(&scene(61, 37, 8, 1.0 / 32.0));
        let hash = bits(&frames.concat())
            .as_flattened()
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, &word| {
                (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
            });
        assert_eq!(hash, 0xd049_2f31_7e52_9471, "{hash:#018x}");
    }

    #[test]
    fn the_seed_changes_the_scene() {
        let first = scene(8, 6, 2, 0.0);
        let second = SpeckleScene { seed: 2, ..first.clone() };
        assert_ne!(record(&first, Simd::Portable), record(&second, Simd::Portable));
    }

    /// Theory: γ(l) = exp(−l (2kσ)²/2) for the steps in z; those in x and y, which carry scatterers
    /// into the next pixel, take off less than 0.006. Reference: an independent plain
    /// implementation, printed with two digits.
    ///
    /// 160 × 92 pixels less the x hold L = π 0.24² · 11,870 = 2150 speckles, so one pair of frames
    /// has a standard deviation of about (1 − γ²)/√(2L) = 0.015, and the mean over t, with few
    /// independent pairs among 50 to 69, 0.003 to 0.008. Unrelated frames have an amplitude of
    /// √(π/4L) = 0.019. Hence 0.03 against theory, 0.035 against the rounded reference.
    #[test]
    fn speckles_decorrelate_as_in_theory_and_as_the_reference_does() {
        let lags = [1, 2, 5, 10, 20];
        let reference = [[0.92, 0.86, 0.67, 0.46, 0.19], [0.73, 0.54, 0.20, 0.03, 0.01]];
        for (sigma, reference) in [1.0 / 32.0, 1.0 / 16.0].into_iter().zip(reference) {
            let scene = scene(160, 92, 70, sigma);
            let outside: Vec<bool> = scene.mask().iter().map(|inside| !inside).collect();
            let fields = record(&scene, Simd::widest());
            let got = coherence_at_lags(&fields, scene.pixels(), &lags, Some(&outside)).unwrap();
            for ((got, lag), reference) in got.into_iter().zip(lags).zip(reference) {
                let theory = (-(lag as f64) * (2.0 * TAU * sigma).powi(2) / 2.0).exp();
                assert!((got - theory).abs() < 0.03, "lag {lag}: {got}, theory {theory}");
                assert!((got - reference).abs() < 0.035, "lag {lag}: {got}, reference {reference}");
            }
        }
    }

    /// Without random motion nothing moves before frame 5, nothing ever moves outside the x, and
    /// inside it the field turns by the true phase.
    #[test]
    fn without_random_motion_only_the_x_turns() {
        let scene = scene(64, 48, 70, 0.0);
        let frames = record_unfiltered(&scene);
        let mask = scene.mask();
        assert!(frames[1..5].iter().all(|frame| bits(frame) == bits(&frames[0])));
        for (frame, phase) in frames.iter().zip(scene.true_phase_rad()) {
            let turn = Complex32::from_polar(1.0, phase as f32);
            for ((&now, &start), &inside) in frame.iter().zip(&frames[0]).zip(&mask) {
                if inside {
                    assert!((now - start * turn).norm() < 1e-4);
                } else {
                    assert_eq!(now, start);
                }
            }
        }
    }

    /// Sign and size of the movement under random motion and behind the aperture: the phase of
    /// Σ U_t U*_{t−1} over the x, summed over t, follows the truth. The reference's rms error of this
    /// one-step walk at frame 69 is 0.16 rad; the limit is four times that.
    #[test]
    fn the_one_step_walk_finds_the_true_phase() {
        let scene = scene(160, 92, 70, 1.0 / 32.0);
        let (fields, mask) = (record(&scene, Simd::widest()), scene.mask());
        let frames: Vec<&[Complex32]> = fields.chunks_exact(scene.pixels()).collect();
        let step = |pair: &[&[Complex32]]| {
            let inside = (0..mask.len()).filter(|&i| mask[i]);
            f64::from(inside.map(|i| pair[1][i] * pair[0][i].conj()).sum::<Complex32>().arg())
        };
        let walked: f64 = frames.windows(2).map(step).sum();
        let truth = scene.true_phase_rad()[69];
        assert!((walked - truth).abs() < 0.64, "{walked}, truth {truth}");
    }

    /// Fully developed speckle: contrast σ_I/⟨I⟩ = 1, and ⟨I⟩ = n ⟨A²⟩ times the part of the
    /// spectrum inside the aperture, 50/3 · π 0.24². With L = π 0.24² · 58,880 = 10,650 speckles
    /// both have a standard deviation of about 1/√L = 1 %; the limits are five times that.
    #[test]
    fn the_first_frame_is_fully_developed_speckle() {
        let fields = record(&scene(320, 184, 2, 0.0), Simd::widest());
        let intensity: Vec<f64> =
            fields[..320 * 184].iter().map(|u| f64::from(u.norm_sqr())).collect();
        let count = intensity.len() as f64;
        let mean = intensity.iter().sum::<f64>() / count;
        let variance = intensity.iter().map(|i| (i - mean).powi(2)).sum::<f64>() / count;
        let expected = 50.0 / 3.0 * TAU / 2.0 * 0.24 * 0.24;
        assert!((mean / expected - 1.0).abs() < 0.05, "mean {mean}, expected {expected}");
        assert!((variance.sqrt() / mean - 1.0).abs() < 0.05, "contrast {}", variance.sqrt() / mean);
    }

    /// Discrete Fourier transform by its definition: nothing outside the aperture.
    #[test]
    fn the_spectrum_ends_at_the_aperture() {
        let (width, height) = (20, 14);
        let fields = record(&scene(width, height, 2, 1.0 / 32.0), Simd::widest());
        let signed = |k: usize, len: usize| k as f64 - if 2 * k > len { len as f64 } else { 0.0 };
        let mut within = 0;
        for (kx, ky) in (0..height).flat_map(|ky| (0..width).map(move |kx| (kx, ky))) {
            let (fx, fy) = (signed(kx, width) / width as f64, signed(ky, height) / height as f64);
            let mut amplitude = num_complex::Complex64::ZERO;
            for (i, u) in fields[..width * height].iter().enumerate() {
                let angle = -TAU * (fx * (i % width) as f64 + fy * (i / width) as f64);
                let u = num_complex::Complex64::new(f64::from(u.re), f64::from(u.im));
                amplitude += u * num_complex::Complex64::from_polar(1.0, angle);
            }
            let inside = fx.hypot(fy) <= 0.24;
            within += usize::from(inside);
            assert_eq!(amplitude.norm() > 1e-3, inside, "({kx}, {ky}): {amplitude}");
        }
        assert!((40..60).contains(&within), "{within} frequencies, expected about 0.181 · 280");
    }

    #[test]
    fn tiny_and_odd_images_work() {
        for (width, height) in [(1, 1), (8, 6), (1, 7), (13, 2), (31, 17)] {
            let scene = SpeckleScene { scatterers_per_pixel: 3, ..scene(width, height, 7, 10.0) };
            let fields = record(&scene, Simd::widest());
            assert_eq!(fields.len(), 7 * width * height);
            assert!(fields.iter().all(|u| u.is_finite()));
        }
    }

    #[test]
    fn the_callers_error_ends_the_run() {
        let mut calls = 0;
        let refuse = |t: usize, _: &[Complex32]| {
            calls += 1;
            if t == 1 { Err(Error::failed("disk full")) } else { Ok(()) }
        };
        let error = scene(8, 6, 9, 0.0).for_each_frame(&Progress::hidden(), refuse).unwrap_err();
        assert_eq!((error.to_string().as_str(), calls), ("disk full", 2));
    }

    #[test]
    fn a_bad_scene_is_refused_before_any_work() {
        let unreachable = |_: usize, _: &[Complex32]| Err(Error::failed("called"));
        let error = scene(0, 6, 9, 0.0).for_each_frame(&Progress::hidden(), unreachable);
        assert!(error.unwrap_err().to_string().contains("--width 0"));
    }
}
