//! The camera: vignetting, fixed fringes, noise, counts, dead pixels.

use super::axial::LANES;
use super::random::{Purpose, Random};
use super::scene::{FULL_SCALE, OctScene};
use crate::allocate::reserve;
use crate::error::Result;
use crate::simulate::vector_math::normal_pair;
use std::f64::consts::{PI, TAU};

/// Random words give four numbers; this many groups make a block of pixels.
const QUADS: usize = LANES / 4;
/// A float plus 1.5·2²³ shows its nearest integer in its last bits.
const ROUND: f32 = 12_582_912.0;
/// Parasitic fringes come from these parts of the depths, one after the other; the second lies
/// between the layers.
const FRINGE_DEPTHS: [[f64; 2]; 3] = [[0.08, 0.2], [0.42, 0.6], [0.7, 0.92]];

/// What stays the same for all images.
pub struct Camera {
    width: usize,
    offset_dn: f32,
    /// Counts² of shot noise per count.
    shot: f32,
    /// Counts² of read noise.
    read: f32,
    /// Counts of light per pixel, shape (y, x).
    gain: Vec<f32>,
    fringes: Vec<FixedFringe>,
    /// Pixels that always show the same count.
    dead: Vec<(usize, u16)>,
    noise: Random,
}

/// A parasitic interference pattern: cos(πdκ + ψ(y, x)) with a smooth ψ.
struct FixedFringe {
    depth_px: f64,
    cosine: Vec<f32>,
    sine: Vec<f32>,
}

/// What all pixels of one image have in common.
pub struct Exposure {
    /// Sweep and image in it: the counter of the noise.
    sweep: u32,
    image: u32,
    light: f32,
    /// cos πdκ and sin πdκ of each parasitic pattern.
    fringes: Vec<[f32; 2]>,
}

impl Camera {
    /// # Errors
    /// When there is no memory for its maps.
    pub fn new(scene: &OctScene) -> Result<Self> {
        let [electrons, read] = [scene.electrons_per_dn, scene.read_noise_electrons];
        let fringe = |number| FixedFringe::new(scene, number);
        Ok(Self {
            width: scene.width,
            offset_dn: scene.offset_dn as f32,
            shot: (1.0 / electrons) as f32,
            read: (read / electrons).powi(2) as f32,
            gain: gain(scene)?,
            fringes: (0..scene.fixed_fringes).map(fringe).collect::<Result<_>>()?,
            dead: dead_pixels(scene),
            noise: Random::new(scene.seed, Purpose::Noise),
        })
    }

    /// Memory of the maps, bytes.
    pub fn memory_bytes(scene: &OctScene) -> u64 {
        (scene.pixels() * size_of::<f32>() * (1 + 2 * scene.fixed_fringes)) as u64
    }

    /// Image `image` of sweep `sweep` at the wavenumber κ, with `light` times the usual light.
    pub fn exposure(&self, sweep: usize, image: usize, wavenumber: f64, light: f64) -> Exposure {
        let fringe = |fringe: &FixedFringe| {
            let (sine, cosine) = libm::sincos(PI * fringe.depth_px * wavenumber);
            [cosine as f32, sine as f32]
        };
        Exposure {
            sweep: sweep as u32,
            image: image as u32,
            light: light as f32,
            fringes: self.fringes.iter().map(fringe).collect(),
        }
    }

    /// Counts of the pixels from (y, x) on, as many as `counts` has, at most [`LANES`]. `signal` is
    /// the fringe of the retina over the light of the pixel.
    #[inline(always)]
    pub fn expose(
        &self,
        exposure: &Exposure,
        [y, x]: [usize; 2],
        signal: &[f32; LANES],
        counts: &mut [u16],
    ) {
        let first = y * self.width + x;
        let pixels = first..first + counts.len();
        let mut relative = *signal;
        for (fringe, [c, s]) in self.fringes.iter().zip(&exposure.fringes) {
            let maps = fringe.cosine[pixels.clone()].iter().zip(&fringe.sine[pixels.clone()]);
            relative.iter_mut().zip(maps).for_each(|(r, (a, b))| *r += c * a - s * b);
        }
        let block = (y * self.width.div_ceil(LANES) + x / LANES) * QUADS;
        let noise = self.normals(block, exposure);
        let values = relative.iter().zip(&noise).zip(&self.gain[pixels]);
        for (count, ((relative, noise), gain)) in counts.iter_mut().zip(values) {
            let light = (exposure.light * gain * (1.0 + relative)).max(0.0);
            let deviation = (light * self.shot + self.read).sqrt();
            let value = (self.offset_dn + light + deviation * noise).clamp(0.0, FULL_SCALE.into());
            *count = (value + ROUND).to_bits() as u16;
        }
    }

    /// Independent standard normals for one block of pixels.
    #[inline(always)]
    fn normals(&self, first: usize, exposure: &Exposure) -> [f32; LANES] {
        let mut words = [[0; QUADS]; 4];
        for i in 0..QUADS {
            let quad = self.noise.words((first + i) as u32, exposure.image, exposure.sweep);
            words.iter_mut().zip(quad).for_each(|(words, word)| words[i] = word);
        }
        let mut normals = [0.0; LANES];
        for i in 0..QUADS {
            for half in 0..2 {
                let [a, b] = normal_pair([words[2 * half][i], words[2 * half + 1][i]]);
                normals[2 * half * QUADS + i] = a;
                normals[(2 * half + 1) * QUADS + i] = b;
            }
        }
        normals
    }

    /// Put the constant counts of the dead pixels into an image (y, x).
    pub fn kill(&self, image: &mut [u16]) {
        self.dead.iter().for_each(|&(pixel, count)| image[pixel] = count);
    }

    /// The dead pixels, shape (y, x).
    pub fn dead_mask(&self) -> Vec<bool> {
        let mut mask = vec![false; self.gain.len()];
        self.dead.iter().for_each(|&(pixel, _)| mask[pixel] = true);
        mask
    }
}

/// Offset of a pixel from the middle over half the side, (v, u), −1 … 1.
fn normalised(scene: &OctScene, pixel: usize) -> [f64; 2] {
    let over_half = |p: usize, n: usize| (2.0 * p as f64 + 1.0) / n as f64 - 1.0;
    [over_half(pixel / scene.width, scene.height), over_half(pixel % scene.width, scene.width)]
}

/// Counts of light: vignetting 1 − v r², r = 1 in the corners, and each pixel's own gain; the mean
/// over the image is that of the scene.
fn gain(scene: &OctScene) -> Result<Vec<f32>> {
    let random = Random::new(scene.seed, Purpose::Gain);
    let mut gain = reserve(scene.pixels(), "the camera's gain")?;
    for pixel in 0..scene.pixels() {
        let [v, u] = normalised(scene, pixel);
        let vignetting = 1.0 - scene.vignetting * (u * u + v * v) / 2.0;
        let own = 1.0 + scene.gain_pattern * random.normal(pixel, 0);
        gain.push((vignetting * own).max(0.0) as f32);
    }
    let mean = gain.iter().copied().map(f64::from).sum::<f64>() / gain.len() as f64;
    let scale = ((scene.mean_dn - scene.offset_dn) / mean) as f32;
    gain.iter_mut().for_each(|g| *g *= scale);
    Ok(gain)
}

impl FixedFringe {
    /// ψ is a plane and a parabola of a few radians over the image, the amplitude varies by 30 %.
    fn new(scene: &OctScene, number: usize) -> Result<Self> {
        let random = Random::new(scene.seed, Purpose::FixedFringes);
        let depths = FRINGE_DEPTHS[number % FRINGE_DEPTHS.len()];
        let brightness = scene.fixed_fringe_brightness * scene.isos_fringe_dn
            / (scene.mean_dn - scene.offset_dn);
        let [start, along_y, along_x, bent, brighter] =
            [1, 2, 3, 4, 5].map(|i| random.symmetric(number, i));
        let mut cosine = reserve(scene.pixels(), "the fixed fringes")?;
        let mut sine = reserve(scene.pixels(), "the fixed fringes")?;
        for pixel in 0..scene.pixels() {
            let [v, u] = normalised(scene, pixel);
            let phase = PI * start + 1.5 * (along_y * v + along_x * u) + bent * (u * u + v * v);
            let amplitude = brightness * (1.0 + 0.3 * libm::cos(TAU * brighter + u + 2.0 * v));
            let (s, c) = libm::sincos(phase);
            cosine.push((amplitude * c) as f32);
            sine.push((amplitude * s) as f32);
        }
        let half = scene.images as f64 / 2.0;
        Ok(Self { depth_px: half * random.between(depths, number, 6), cosine, sine })
    }
}

/// Dead pixels with their counts: half of them 0, a quarter full scale, a quarter anything between.
fn dead_pixels(scene: &OctScene) -> Vec<(usize, u16)> {
    let random = Random::new(scene.seed, Purpose::DeadPixels);
    let wanted = (scene.dead_pixel_fraction * scene.pixels() as f64).round() as usize;
    let mut chosen = std::collections::BTreeSet::new();
    let draws = (0..).map(|i| (random.uniform(i, 0) * scene.pixels() as f64) as usize);
    draws
        .take_while(|&pixel| {
            chosen.insert(pixel);
            chosen.len() < wanted
        })
        .for_each(drop);
    let count = |(i, pixel)| {
        let count = match i % 4 {
            0 | 2 => 0,
            1 => FULL_SCALE,
            _ => (random.uniform(i, 1) * f64::from(FULL_SCALE)) as u16,
        };
        (pixel, count)
    };
    chosen.into_iter().take(wanted).enumerate().map(count).collect()
}
