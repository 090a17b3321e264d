//! A synthetic retina for the tests: speckle of moving, decorrelating layers with known motion.

use super::Motion;
use crate::simulate::philox::{key, philox4x32};
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner, num_complex::Complex32};
use std::f64::consts::PI;
use std::sync::Arc;

/// What is seen and how badly.
#[derive(Clone)]
pub struct Eye {
    /// Depth, height, width of a volume.
    pub size: [usize; 3],
    /// Pixels of scene around the image.
    pub margin: usize,
    /// Correlation of the field from sweep to sweep.
    pub rho: f64,
    /// Amplitude of the brightest layer over the rms noise.
    pub snr: f64,
    /// Tilt of the layers across the field (y, x), depth pixels.
    pub tilt: [f64; 2],
    /// Their sag at the edges, depth pixels.
    pub sag: f64,
    /// Share of vignetting at the corners.
    pub vignetting: f64,
    /// Fixed fringes: amplitude relative to the brightest layer.
    pub fixed: f64,
    /// Cut-off of the lateral aperture, cycles per px.
    pub aperture: f64,
    /// Key of all random numbers.
    pub seed: u64,
}

/// Layers: depth relative to the volume's, thickness in px, reflectance (intensity).
const LAYERS: [(f64, f64, f64); 6] = [
    (0.25, 4.0, 0.15),
    (0.36, 5.0, 0.08),
    (0.45, 3.0, 0.05),
    (0.58, 1.5, 0.6),
    (0.64, 1.5, 0.5),
    (0.70, 4.0, 1.0),
];
const FINE: usize = 2;
const REACH: i64 = 4;

/// The scatterers between two sweeps.
pub struct Scene {
    eye: Eye,
    grid: [usize; 2],
    planes: Vec<Vec<Complex32>>,
    sweep: u32,
    fft: [Arc<dyn Fft<f32>>; 4],
}

fn gauss(counter: [u32; 4], seed: u64) -> Complex32 {
    let w = philox4x32(counter, key(seed));
    let u = (f64::from(w[0]) + 1.0) / 4_294_967_297.0;
    let r = (-u.ln()).sqrt();
    let (s, c) = (2.0 * PI * f64::from(w[1]) / 4_294_967_296.0).sin_cos();
    Complex32::new((r * c) as f32, (r * s) as f32)
}

fn nice(n: usize) -> usize {
    (n..)
        .find(|&m| {
            [2, 3, 5].iter().fold(m, |mut k, &p| {
                while k % p == 0 {
                    k /= p
                }
                k
            }) == 1
        })
        .unwrap_or(n)
}

impl Scene {
    pub fn new(eye: Eye) -> Self {
        let grid = [nice(eye.size[1] + 2 * eye.margin), nice(eye.size[2] + 2 * eye.margin)];
        let mut p = FftPlanner::new();
        let fft = [
            p.plan_fft_forward(grid[0]),
            p.plan_fft_forward(grid[1]),
            p.plan_fft_inverse(grid[0]),
            p.plan_fft_inverse(grid[1]),
        ];
        let fine = (eye.size[0] + 40) * FINE;
        let mut scene = Self { eye, grid, planes: vec![Vec::new(); fine], sweep: 0, fft };
        scene.renew(0.0);
        scene
    }

    /// The next sweep's scatterers: what is left of the last ones and new ones.
    pub fn advance(&mut self) {
        self.sweep += 1;
        self.renew(self.eye.rho as f32);
    }

    fn renew(&mut self, rho: f32) {
        let (eye, grid, sweep, fft) = (&self.eye, self.grid, self.sweep, &self.fft);
        let fresh = (1.0 - rho * rho).sqrt();
        self.planes.par_iter_mut().enumerate().for_each(|(z, plane)| {
            let envelope = envelope(eye, grid, z);
            let peak = envelope.iter().fold(0.0f32, |a, &b| a.max(b));
            if peak < 1e-3 {
                return;
            }
            let mut new: Vec<Complex32> = envelope
                .iter()
                .enumerate()
                .map(|(i, &e)| {
                    if e == 0.0 {
                        Complex32::ZERO
                    } else {
                        gauss([z as u32, i as u32, sweep, 1], eye.seed) * e
                    }
                })
                .collect();
            let scale = (0.24 / eye.aperture) as f32 / (grid[0] * grid[1]) as f32;
            spectrum(&mut new, grid, fft, |ky, kx| {
                if ky * ky + kx * kx < eye.aperture * eye.aperture {
                    Complex32::new(scale, 0.0)
                } else {
                    Complex32::ZERO
                }
            });
            if plane.is_empty() {
                *plane = vec![Complex32::ZERO; new.len()];
            }
            for (p, n) in plane.iter_mut().zip(new) {
                *p = *p * rho + n * fresh;
            }
        });
    }

    /// Complex field (z, y, x) of the retina moved by `motion`.
    pub fn field(&self, motion: Motion) -> Vec<Complex32> {
        let [depth, height, width] = self.eye.size;
        let moved: Vec<Vec<Complex32>> = self
            .planes
            .par_iter()
            .map(|p| if p.is_empty() { Vec::new() } else { self.moved(p, motion) })
            .collect();
        let mut out = vec![Complex32::ZERO; depth * height * width];
        out.par_chunks_mut(height * width).enumerate().for_each(|(z, plane)| {
            for (f, content) in moved.iter().enumerate().filter(|(_, c)| !c.is_empty()) {
                let u = z as f64 - (f as f64 / FINE as f64 - 20.0 + motion.shift[0]);
                if u.abs() > REACH as f64 {
                    continue;
                }
                let weight = hann(u) as f32 / FINE as f32;
                for (o, c) in plane.iter_mut().zip(content) {
                    *o += c * weight;
                }
            }
        });
        out
    }

    /// Field seen by the camera: vignetted, with fixed fringes and noise; dead pixels are 0.1 %.
    pub fn detect(&self, mut field: Vec<Complex32>) -> Vec<f32> {
        let [_, height, width] = self.eye.size;
        let eye = &self.eye;
        let sweep = self.sweep;
        let level = 0.37;
        let fixed: Vec<Complex32> =
            (0..height * width).map(|i| gauss([7, i as u32, 0, 5], eye.seed)).collect();
        field.par_chunks_mut(height * width).enumerate().for_each(|(z, plane)| {
            for (i, f) in plane.iter_mut().enumerate() {
                let y = (i / width) as f64 / height as f64 - 0.5;
                let x = (i % width) as f64 / width as f64 - 0.5;
                let v = 1.0 - eye.vignetting * 2.0 * (x * x + y * y);
                *f *= v as f32;
                let fringe = eye.fixed * level * (if z % 9 == 4 { 1.0 } else { 0.0 });
                if eye.fixed > 0.0 {
                    let (s, c) = (0.5 * y * height as f64 + 0.3 * x * width as f64).sin_cos();
                    *f += Complex32::new((c * fringe) as f32, (s * fringe) as f32)
                        + fixed[i] * (0.3 * eye.fixed * level) as f32;
                    if philox4x32([i as u32, 0, 0, 9], key(eye.seed))[0] < u32::MAX / 1000 {
                        *f = Complex32::ZERO;
                    }
                }
                *f += gauss([z as u32, i as u32, sweep, 3], eye.seed) * (level / eye.snr) as f32;
            }
        });
        field.iter().map(|f| f.norm()).collect()
    }

    pub fn amplitude(&self, motion: Motion) -> Vec<f32> {
        self.detect(self.field(motion))
    }

    /// A plane of the scene moved by three exact shears and a shift, cropped to the image.
    fn moved(&self, plane: &[Complex32], m: Motion) -> Vec<Complex32> {
        let [gh, gw] = self.grid;
        let [_, height, width] = self.eye.size;
        let top = (gh - height) / 2;
        let left = (gw - width) / 2;
        let centre =
            [top as f64 + (height as f64 - 1.0) / 2.0, left as f64 + (width as f64 - 1.0) / 2.0];
        let mut p = plane.to_vec();
        let a = m.rotation_rad;
        // x' = x cos a - y sin a, y' = y cos a + x sin a
        let (t, s) = ((a / 2.0).tan(), a.sin());
        if a != 0.0 {
            self.shear_x(&mut p, |y| -t * (y - centre[0]));
            self.shear_y(&mut p, |x| s * (x - centre[1]));
            self.shear_x(&mut p, |y| -t * (y - centre[0]));
        }
        let scale = 1.0 / (gh * gw) as f32;
        spectrum(&mut p, self.grid, &self.fft, |ky, kx| {
            let (sine, cosine) = (-2.0 * PI * (ky * m.shift[1] + kx * m.shift[2])).sin_cos();
            Complex32::new(cosine as f32, sine as f32) * scale
        });
        (0..height).flat_map(|y| p[(y + top) * gw + left..][..width].to_vec()).collect()
    }

    fn shear_x(&self, p: &mut [Complex32], by: impl Fn(f64) -> f64) {
        let gw = self.grid[1];
        for (y, row) in p.chunks_mut(gw).enumerate() {
            self.fft[1].process(row);
            ramp(row, by(y as f64));
            self.fft[3].process(row);
        }
    }

    fn shear_y(&self, p: &mut [Complex32], by: impl Fn(f64) -> f64) {
        let [gh, gw] = self.grid;
        let mut column = vec![Complex32::ZERO; gh];
        for x in 0..gw {
            (0..gh).for_each(|y| column[y] = p[y * gw + x]);
            self.fft[0].process(&mut column);
            ramp(&mut column, by(x as f64));
            self.fft[2].process(&mut column);
            (0..gh).for_each(|y| p[y * gw + x] = column[y]);
        }
    }
}

fn ramp(line: &mut [Complex32], by: f64) {
    let n = line.len();
    for (k, v) in line.iter_mut().enumerate() {
        let f = if 2 * k < n { k as f64 } else { k as f64 - n as f64 } / n as f64;
        let (s, c) = (-2.0 * PI * f * by).sin_cos();
        *v *= Complex32::new(c as f32, s as f32) / n as f32;
    }
}

/// Axial point spread of a Hann-windowed band, u in unpadded bins.
fn hann(u: f64) -> f64 {
    let sinc = |u: f64| if u.abs() < 1e-9 { 1.0 } else { (PI * u).sin() / (PI * u) };
    sinc(u) + 0.5 * sinc(u - 1.0) + 0.5 * sinc(u + 1.0)
}

fn envelope(eye: &Eye, grid: [usize; 2], z: usize) -> Vec<f32> {
    let z = z as f64 / FINE as f64 - 20.0;
    let depth = (eye.size[0] as f64).min(90.0);
    let z0 = (eye.size[0] as f64 - depth) / 2.0;
    (0..grid[0] * grid[1])
        .map(|i| {
            let y = ((i / grid[1]) as f64 - grid[0] as f64 / 2.0) / eye.size[1] as f64;
            let x = ((i % grid[1]) as f64 - grid[1] as f64 / 2.0) / eye.size[2] as f64;
            let surface = eye.tilt[0] * y + eye.tilt[1] * x + eye.sag * (x * x + y * y);
            let e: f64 = LAYERS
                .iter()
                .map(|&(at, thick, bright)| {
                    let d = (z - z0 - at * depth - surface) / thick;
                    if d.abs() > 3.0 { 0.0 } else { bright * (-d * d).exp() }
                })
                .sum();
            if e < 1e-4 { 0.0 } else { e.sqrt() as f32 }
        })
        .collect()
}

/// Multiplies the spectrum of a plane by `filter(ky, kx)` (cycles per px); unscaled.
fn spectrum(
    p: &mut [Complex32],
    [gh, gw]: [usize; 2],
    fft: &[Arc<dyn Fft<f32>>; 4],
    filter: impl Fn(f64, f64) -> Complex32,
) {
    let f = |k: usize, n: usize| if 2 * k < n { k as f64 } else { k as f64 - n as f64 } / n as f64;
    fft[1].process(p);
    let mut t = vec![Complex32::ZERO; p.len()];
    transpose(p, &mut t, gh, gw);
    fft[0].process(&mut t);
    for (kx, column) in t.chunks_mut(gh).enumerate() {
        for (ky, v) in column.iter_mut().enumerate() {
            *v *= filter(f(ky, gh), f(kx, gw));
        }
    }
    fft[2].process(&mut t);
    transpose(&t, p, gw, gh);
    fft[3].process(p);
}

fn transpose(from: &[Complex32], to: &mut [Complex32], rows: usize, columns: usize) {
    for y in 0..rows {
        for x in 0..columns {
            to[x * rows + y] = from[y * columns + x];
        }
    }
}
