//! From depth planes to spectral samples: the fringes that the scatterers of a pixel make.
//!
//! The planes of a pixel are transformed to equally spaced wavenumbers, and these are interpolated
//! to the wavenumber of every image. Both steps use the same compact kernel, the first for points
//! between planes (its transform is divided out here), the second between wavenumbers.

use super::geometry::{Geometry, PLANES_PER_PX, good_length};
use super::kernel::{Kernel, TAPS, transform};
use super::sweep::Sweep;
use num_complex::Complex32;
use rustfft::{Fft, FftDirection, FftPlannerScalar};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

/// Pixels that are worked on together.
pub const LANES: usize = 32;
/// The largest wavenumber, over half the band: delays and nonlinear sweeps reach beyond 1.
const LARGEST_WAVENUMBER: f64 = 1.2;

/// The transform from planes to wavenumbers, the same for all sweeps.
pub struct Axial {
    planes: usize,
    /// The plane that the transform counts from.
    middle: usize,
    len: usize,
    /// First wavenumber that is kept, in steps of the transform, and their number.
    first_node: i32,
    nodes: usize,
    kernel: Kernel,
    /// What each plane is multiplied with: the second kernel divided out.
    plane_gain: Vec<f32>,
    inverse: Arc<dyn Fft<f32>>,
    /// Depth of the middle plane, depth pixels.
    middle_px: f64,
}

/// How one image is interpolated from the wavenumbers: first node, and the weights' real and
/// imaginary parts, which hold the phase that all scatterers share.
pub struct Sample {
    node: usize,
    re: [f32; TAPS],
    im: [f32; TAPS],
}

/// Work space of one thread.
pub struct Scratch {
    pixel: Vec<Complex32>,
    fft: Vec<Complex32>,
    /// Spectra of [`LANES`] pixels, shape (node, pixel).
    re: Vec<[f32; LANES]>,
    im: Vec<[f32; LANES]>,
}

impl Axial {
    pub fn new(geometry: &Geometry) -> Self {
        let planes = geometry.planes;
        let middle = planes / 2;
        let len = good_length(2 * planes);
        let steps = LARGEST_WAVENUMBER * len as f64 / (2.0 * PLANES_PER_PX as f64);
        let first_node = -(steps.ceil() as i32) - TAPS as i32;
        let nodes = ((-2 * first_node + 1) as usize).min(len);
        let plane_gain = |plane: usize| {
            let f = (plane as f64 - middle as f64) / len as f64;
            (1.0 / transform(f)) as f32
        };
        Self {
            planes,
            middle,
            len,
            first_node,
            nodes,
            kernel: Kernel::new(),
            plane_gain: (0..planes).map(plane_gain).collect(),
            inverse: FftPlannerScalar::new().plan_fft(len, FftDirection::Inverse),
            middle_px: geometry.first_plane_px + middle as f64 / PLANES_PER_PX as f64,
        }
    }

    /// The interpolation of the images `images` of `sweep`.
    pub fn samples(&self, sweep: &Sweep, images: Range<usize>) -> Vec<Sample> {
        images.map(|m| self.sample(sweep, sweep.band_coordinate(m))).collect()
    }

    fn sample(&self, sweep: &Sweep, q: f64) -> Sample {
        let wavenumber = sweep.wavenumber(q);
        // πdκ with d in planes is 2π d f, f in cycles per plane.
        let f = wavenumber / (2.0 * PLANES_PER_PX as f64);
        let (node, weights) =
            self.kernel.spread((f * self.len as f64 - f64::from(self.first_node)) as f32);
        let phase = sweep.common_phase(q) + PI * self.middle_px * wavenumber;
        let (sine, cosine) = libm::sincos(phase);
        let scale = 1.0 / transform(f);
        Sample {
            node: node.max(0) as usize,
            re: weights.map(|w| w * (cosine * scale) as f32),
            im: weights.map(|w| w * (sine * scale) as f32),
        }
    }

    pub fn scratch(&self) -> Scratch {
        Scratch {
            pixel: vec![Complex32::ZERO; self.len],
            fft: vec![Complex32::ZERO; self.inverse.get_inplace_scratch_len()],
            re: vec![[0.0; LANES]; self.nodes],
            im: vec![[0.0; LANES]; self.nodes],
        }
    }

    /// Transform up to [`LANES`] pixels, the columns `columns` of `planes`, shape (plane, x).
    pub fn transform(
        &self,
        planes: &[Complex32],
        width: usize,
        columns: Range<usize>,
        scratch: &mut Scratch,
    ) {
        let Scratch { pixel, fft, re, im } = scratch;
        re.iter_mut().chain(im.iter_mut()).for_each(|lanes| *lanes = [0.0; LANES]);
        for (lane, x) in columns.enumerate().take(LANES) {
            pixel.fill(Complex32::ZERO);
            for (plane, gain) in self.plane_gain.iter().enumerate() {
                pixel[(plane + self.len - self.middle) % self.len] =
                    planes[plane * width + x] * gain;
            }
            self.inverse.process_with_scratch(pixel, fft);
            for node in 0..self.nodes {
                let k = (self.first_node + node as i32).rem_euclid(self.len as i32) as usize;
                re[node][lane] = pixel[k].re;
                im[node][lane] = pixel[k].im;
            }
        }
    }

    /// Number of planes of a pixel.
    pub const fn planes(&self) -> usize {
        self.planes
    }
}

impl Sample {
    /// Re Σ A exp(iφ) of the pixels in `scratch`.
    #[inline(always)]
    pub fn fringe(&self, scratch: &Scratch) -> [f32; LANES] {
        let mut sum = [0.0; LANES];
        let nodes = self.node..self.node + TAPS;
        if let (Some(re), Some(im)) = (scratch.re.get(nodes.clone()), scratch.im.get(nodes)) {
            for tap in 0..TAPS {
                let (a, b) = (self.re[tap], self.im[tap]);
                for lane in 0..LANES {
                    sum[lane] += a * re[tap][lane] - b * im[tap][lane];
                }
            }
        }
        sum
    }
}
