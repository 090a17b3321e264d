//! The numbers of a demonstration: size of the scenes, their random motion, what is shown.

use crate::looks::Looks;
use crate::simulate::SpeckleScene;

/// Bytes that the strips of the phase images may take.
const IMAGE_MEMORY: u64 = 256 << 20;

/// Everything that can be chosen.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Size, density, aperture and seed of all scenes; its random motion is not used.
    pub scene: SpeckleScene,
    /// σ of the random motion, wavelengths per frame, one scene for each.
    pub sigmas_wavelengths: Vec<f64>,
    /// σ_Gauss of the phase images, pixels (paper line 753).
    pub gaussian_px: f64,
    /// What the weights' threshold counts.
    pub looks: Looks,
    /// Frames that Figure 2 shows: the first (speckle only), an early and a late one (lines 462-467).
    pub shown_frames: [usize; 3],
    /// The scene that explains the method, an index into `sigmas_wavelengths`.
    pub explained: usize,
    /// Number of threads of the phase images.
    pub threads: usize,
}

impl Setup {
    /// A quarter of the paper's area, the same speckle: done in seconds.
    ///
    /// σ_Gauss = 3 px would hold 23 speckles only, too few to tell the coherence of strong motion
    /// from noise.
    #[must_use]
    pub fn small(seed: u64, threads: usize) -> Self {
        let scene = SpeckleScene { width: 320, height: 184, seed, ..SpeckleScene::default() };
        Self { scene, gaussian_px: 5.0, looks: Looks::Effective, ..Self::paper(seed, threads) }
    }

    /// The paper's scene at full size (lines 613-642).
    #[must_use]
    pub fn paper(seed: u64, threads: usize) -> Self {
        Self {
            scene: SpeckleScene { seed, ..SpeckleScene::default() },
            sigmas_wavelengths: vec![0.0, 1.0 / 32.0, 1.0 / 16.0],
            gaussian_px: 3.0,
            looks: Looks::Nominal,
            shown_frames: [0, 10, 69],
            explained: 2,
            threads,
        }
    }

    /// The scene with the given random motion, wavelengths per frame.
    #[must_use]
    pub fn scene(&self, sigma_wavelengths: f64) -> SpeckleScene {
        SpeckleScene { sigma_wavelengths, ..self.scene.clone() }
    }

    /// Bytes that the strips of the phase images may take.
    #[must_use]
    pub fn image_memory(&self) -> u64 {
        IMAGE_MEMORY
    }

    /// Upper limit of the memory needed, bytes, without the program itself: the fields of one scene
    /// and either its scatterers or the phase images of all frames and their strips.
    #[must_use]
    pub fn memory_bytes(&self) -> u64 {
        let values = (self.scene.frames * self.scene.pixels()) as u64;
        let phases_and_amplitudes = 4 * 4 * values;
        let evaluation = phases_and_amplitudes + IMAGE_MEMORY;
        8 * values + evaluation.max(self.scene.memory_bytes(self.threads))
    }
}

/// `σ = λ/32` and the like.
#[must_use]
pub fn sigma_label(sigma_wavelengths: f64) -> String {
    let parts = 1.0 / sigma_wavelengths;
    if sigma_wavelengths == 0.0 {
        "σ = 0".to_owned()
    } else if (parts - parts.round()).abs() < 1e-9 {
        format!("σ = λ/{parts:.0}")
    } else {
        format!("σ = {sigma_wavelengths} λ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_of_a_wavelength_are_named_as_such() {
        let labels = [0.0, 1.0 / 32.0, 0.05, 0.3].map(sigma_label);
        assert_eq!(labels, ["σ = 0", "σ = λ/32", "σ = λ/20", "σ = 0.3 λ"]);
    }

    #[test]
    fn what_is_shown_exists() {
        for setup in [Setup::small(1, 2), Setup::paper(1, 2)] {
            setup.scene.validate().unwrap();
            assert!(setup.explained < setup.sigmas_wavelengths.len());
            assert!(setup.shown_frames.iter().all(|&frame| frame < setup.scene.frames));
            assert!(setup.memory_bytes() < 2 << 30);
        }
    }
}
