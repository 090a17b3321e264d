//! Complex series to be evaluated: made of `f32`, as files are, and seen by the oracle as `f64`.

use crate::npy;
use crate::oracle;
use crate::random::Random;
use num_complex::{Complex, Complex32};
use phasewalk::io::Shape;
use phasewalk::series::HeldSeries;
use std::path::Path;

/// A series with axes (time, z, y, x).
#[derive(Clone, Debug)]
pub struct Recording {
    /// Lengths of the axes.
    pub shape: Shape,
    /// Complex field in C order.
    pub field: Vec<Complex32>,
}

impl Recording {
    /// Speckle that decorrelates: every pixel is an independent process a(t) = rho a(t-1) +
    /// sqrt(1 - rho^2) noise, turned by the systematic `phase(t, z, y, x)`, in radians.
    #[must_use]
    pub fn decorrelating(
        shape: Shape,
        rho: f64,
        seed: u64,
        phase: impl Fn(usize, [usize; 3]) -> f64,
    ) -> Self {
        let mut random = Random::new(seed);
        let Shape { frames, depth, height, width } = shape;
        let mut speckle: Vec<_> = (0..depth * height * width).map(|_| random.speckle()).collect();
        let mut field = Vec::new();
        for t in 0..frames {
            for (i, a) in speckle.iter_mut().enumerate() {
                let place = [i / (height * width), i / width % height, i % width];
                field.push(narrow(*a * Complex::from_polar(1.0, phase(t, place))));
                *a = *a * rho + random.speckle() * (1.0 - rho * rho).sqrt();
            }
        }
        Self { shape, field }
    }

    /// A phase that grows to several turns, differently in every place: 0.25 rad per frame in the
    /// middle of the image, a third of that at its left and five thirds at its right edge, and
    /// less with depth.
    #[must_use]
    pub fn moving(shape: Shape, rho: f64, seed: u64) -> Self {
        let slope = |[z, _, x]: [usize; 3]| {
            let across = (x as f64 + 0.5) / shape.width as f64;
            0.25 * (1.0 / 3.0 + 4.0 / 3.0 * across) / (1.0 + z as f64)
        };
        Self::decorrelating(shape, rho, seed, |t, place| {
            slope(place) * t as f64 + 0.3 * (0.5 * t as f64).sin()
        })
    }

    /// Nothing but chance: every frame is fresh speckle, every phase uniform over the circle.
    #[must_use]
    pub fn random(shape: Shape, seed: u64) -> Self {
        Self::decorrelating(shape, 0.0, seed, |_, _| 0.0)
    }

    /// Frame t, depth z, (y, x).
    pub fn image_mut(&mut self, t: usize, z: usize) -> &mut [Complex32] {
        let pixels = self.pixels();
        &mut self.field[(t * self.shape.depth + z) * pixels..][..pixels]
    }

    /// Pixels of one image.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.shape.height * self.shape.width
    }

    /// Put `value` into a pixel at all frames and depths.
    pub fn fill_pixel(&mut self, pixel: usize, value: Complex32) {
        for t in 0..self.shape.frames {
            for z in 0..self.shape.depth {
                self.image_mut(t, z)[pixel] = value;
            }
        }
    }

    /// As the library takes it.
    ///
    /// # Panics
    /// If `field` has been given another length than `shape` says.
    #[must_use]
    pub fn held(&self) -> HeldSeries {
        HeldSeries::new(self.shape, self.field.clone()).expect("shape and field agree")
    }

    /// As the oracle takes it: one series per depth.
    #[must_use]
    pub fn layers(&self) -> Vec<oracle::Series> {
        (0..self.shape.depth).map(|z| self.layer(z)).collect()
    }

    /// The series of one depth.
    #[must_use]
    pub fn layer(&self, z: usize) -> oracle::Series {
        let Shape { frames, depth, height, width } = self.shape;
        let images = self.field.chunks_exact(height * width).skip(z).step_by(depth);
        let field = images.flatten().map(|u| Complex::new(f64::from(u.re), f64::from(u.im)));
        oracle::Series { frames, height, width, field: field.collect() }
    }

    /// As a user has it: an .npy file of axes (time, y, x), or (time, z, y, x) if there are depths.
    pub fn save(&self, path: &Path) {
        let Shape { frames, depth, height, width } = self.shape;
        if depth == 1 {
            npy::save_complex(path, &[frames, height, width], &self.field);
        } else {
            npy::save_complex(path, &[frames, depth, height, width], &self.field);
        }
    }
}

fn narrow(u: Complex<f64>) -> Complex32 {
    Complex32::new(u.re as f32, u.im as f32)
}
