//! The spectral axis of one sweep: wavenumber, dispersion, motion along z, light of the source.
//!
//! q is the band coordinate, −1 … 1 over the sweep. A sweep that begins late is sampled at
//! q + Δ, Δ = 2δ/K with δ the delay in images.

use super::motion::Motion;
use super::random::{Purpose, Random};
use super::scene::OctScene;
use std::f64::consts::{PI, TAU};

/// Dip of the source's spectrum at both ends of the band, and its slope.
const SOURCE: [f64; 2] = [0.35, 0.08];

/// The spectral axis of one sweep.
pub struct Sweep<'a> {
    scene: &'a OctScene,
    motion: &'a Motion,
}

impl<'a> Sweep<'a> {
    pub const fn new(scene: &'a OctScene, motion: &'a Motion) -> Self {
        Self { scene, motion }
    }

    /// Δ, what the start of the sweep adds to q.
    fn delay(&self) -> f64 {
        2.0 * self.motion.jitter_images / self.scene.images as f64
    }

    /// The band coordinate at which image `m` is really taken.
    pub fn band_coordinate(&self, m: usize) -> f64 {
        let half = self.scene.images as f64 / 2.0;
        (m as f64 - half + 0.5) / half + self.delay()
    }

    /// κ(q) = q + ε(q² − 1): a scatterer at depth d turns the phase by πdκ.
    pub fn wavenumber(&self, q: f64) -> f64 {
        q + self.scene.nonlinearity * (q * q - 1.0)
    }

    /// Phase that all scatterers share: dispersion, axial displacement, velocity and acceleration,
    /// radians.
    ///
    /// A velocity that shifts the depth by D moves the retina by DqΔλ/2λ depth pixels during the
    /// sweep, which turns the phase by πDq, and by a little more where the wavenumber is larger.
    pub fn common_phase(&self, q: f64) -> f64 {
        let [a2, a3] = self.scene.dispersion_rad;
        let displaced = PI * self.motion.shift_px[0] * self.wavenumber(q);
        let bulk = TAU * self.motion.shift_px[0] / self.scene.depth_px_per_turn();
        let bulk = if self.scene.down_sweep { -bulk } else { bulk };
        let moving = PI * self.motion.doppler_px * q;
        bulk + displaced + moving + (a2 + self.motion_chirp()) * q * q + a3 * q * q * q
    }

    /// Quadratic phase by motion during the sweep, radians.
    fn motion_chirp(&self) -> f64 {
        let faster = PI * self.motion.doppler_px * self.scene.depth_px_per_turn() / 2.0;
        self.motion.chirp_rad + faster
    }

    /// Where the recording shows depth `d`: the part of the phase that is linear in the nominal q,
    /// over π, depth pixels.
    pub fn apparent_depth(&self, d: f64) -> f64 {
        let [a2, a3] = self.scene.dispersion_rad;
        let delay = self.delay();
        let stretch = 1.0 + 2.0 * self.scene.nonlinearity * delay;
        let dispersed = 2.0 * (a2 + self.motion_chirp()) * delay + 3.0 * a3 * delay * delay;
        (d + self.motion.shift_px[0]) * stretch + self.motion.doppler_px + dispersed / PI
    }

    /// Light of the source while image `m` is taken; the mean over the band is 1.
    pub fn source(&self, m: usize) -> f64 {
        source(self.band_coordinate(m)) / (1.0 - SOURCE[0] / 3.0)
    }
}

/// (1 − a q²)(1 + b q).
fn source(q: f64) -> f64 {
    (1.0 - SOURCE[0] * q * q) * (1.0 + SOURCE[1] * q)
}

/// Power of the source in sweep `t`; about 1.
pub fn power(scene: &OctScene, t: usize) -> f64 {
    let random = Random::new(scene.seed, Purpose::Power);
    let time = t as f64 / scene.sweeps as f64;
    let slow = libm::sin(TAU * (0.8 * time + random.uniform(0, 1)));
    1.0 + scene.power_drift * (slow + 0.2 * random.normal(t, 0).clamp(-3.0, 3.0))
}

/// The phase a₂q² + a₃q³ that the recording shows at depth `d`, radians: the nonlinear sweep adds
/// πdε to a₂, the mean delay of the sweeps 3a₃Δ.
pub fn apparent_dispersion(scene: &OctScene, d: f64) -> [f64; 2] {
    let [a2, a3] = scene.dispersion_rad;
    let mean_delay = scene.start_jitter_images / scene.images as f64;
    [a2 + PI * d * scene.nonlinearity + 3.0 * a3 * mean_delay, a3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::oct::motion::motions;
    use crate::simulate::oct::presets::Preset;
    use crate::simulate::oct::schedule::events;

    #[test]
    fn the_band_is_centred() {
        let scene = OctScene::default();
        let motions = motions(&scene, &events(&scene));
        let sweep = Sweep::new(&scene, &motions[0]);
        assert!((sweep.band_coordinate(0) + sweep.band_coordinate(255)).abs() < 1e-15);
        assert!((sweep.band_coordinate(255) - 127.5 / 128.0).abs() < 1e-15);
        let mean = (0..256).map(|m| sweep.source(m)).sum::<f64>() / 256.0;
        assert!((mean - 1.0).abs() < 1e-4, "{mean}");
    }

    /// The linear and quadratic coefficients of the whole phase over the nominal band coordinate.
    #[test]
    fn depth_and_dispersion_are_those_of_the_phase() {
        let scene = OctScene { seed: 5, ..Preset::Human.scene() };
        let motions = motions(&scene, &events(&scene));
        let d = 66.0;
        let phase = |sweep: &Sweep, nominal: f64| {
            let q = nominal + sweep.delay();
            sweep.common_phase(q) + PI * d * sweep.wavenumber(q)
        };
        for motion in &motions {
            let sweep = Sweep::new(&scene, motion);
            let step = 0.01;
            let [minus, zero, plus] = [-step, 0.0, step].map(|q| phase(&sweep, q));
            let linear = (plus - minus) / (2.0 * step) - scene.dispersion_rad[1] * step * step;
            let quadratic = (plus + minus - 2.0 * zero) / (2.0 * step * step);
            assert!((linear / PI - sweep.apparent_depth(d)).abs() < 1e-6);
            let [a2, _] = apparent_dispersion(&scene, d);
            let by_motion = sweep.motion_chirp()
                + PI * motion.shift_px[0] * scene.nonlinearity
                + 3.0 * scene.dispersion_rad[1] * (sweep.delay() - 1.0 / 256.0);
            assert!((quadratic - a2 - by_motion).abs() < 1e-6, "{quadratic} {a2} {by_motion}");
        }
    }
}
