//! The numbers behind the figures.

use crate::demo::Setup;
use crate::demo::setup::sigma_label;
use crate::error::{Error, Result};
use crate::image::Kernel;
use crate::simulate::SpeckleScene;

/// σ of Figure 3's random motion, wavelengths per frame. The paper names the first, the second and the
/// last (lines 485-497); the third it does not, λ/24 is ours.
pub const SIGMAS: [f64; 4] = [0.0, 1.0 / 32.0, 1.0 / 24.0, 1.0 / 16.0];

/// Which of [`SIGMAS`] Figures 1 and 2 show.
pub const SHOWN: [usize; 3] = [0, 1, 3];

/// Frames whose images are kept: the first, and those the paper speaks of (lines 462-469).
pub const FRAMES: [usize; 4] = [0, 10, 60, 69];

/// σ_Gauss of the images, pixels. The paper gives none (line 750). With 3 pixels its threshold, which takes
/// pixels for independent looks, lets so much noise pass at λ/16 that the x is lost.
pub const GAUSSIAN_PX: f64 = 5.0;

/// Smallest side: below, the x is a few speckles.
const SMALLEST: usize = 32;

/// Trials of the Monte Carlo for each run.
const TRIALS_PER_RUN: usize = 4;

/// Everything that can be chosen.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Scene and imaging; its seed is that of run 0.
    pub setup: Setup,
    /// Scenes for each σ of Figure 3 (line 479: 100).
    pub runs: usize,
    /// Trials of each entry of the table against the bound.
    pub trials: usize,
}

impl Settings {
    /// The paper's scene in the given size.
    ///
    /// # Errors
    /// A size that cannot be simulated or in which the x is too small, a Gaussian that does not fit, or
    /// no run.
    pub fn new(
        [width, height]: [usize; 2],
        seed: u64,
        runs: usize,
        gaussian_px: f64,
        threads: usize,
    ) -> Result<Self> {
        let mut setup = Setup::paper(seed, threads);
        setup.scene = SpeckleScene { width, height, ..setup.scene };
        setup.gaussian_px = gaussian_px;
        setup.scene.validate()?;
        for (flag, side) in [("--width", width), ("--height", height)] {
            if side < SMALLEST {
                let why = "the x would be a few speckles";
                return Err(Error::usage(format!("{flag} {side}: at least {SMALLEST}, {why}")));
            }
        }
        Kernel::new(gaussian_px, height, width, false)?;
        if runs == 0 {
            return Err(Error::usage("--runs 0: at least 1 scene for each σ is needed"));
        }
        Ok(Self { setup, runs, trials: TRIALS_PER_RUN * runs })
    }

    /// The scene of a run: run 0 is the one that Figures 1 and 2 show.
    #[must_use]
    pub fn scene(&self, sigma: usize, run: usize) -> SpeckleScene {
        let seed = self.setup.scene.seed.wrapping_add(run as u64);
        SpeckleScene { seed, ..self.setup.scene(SIGMAS[sigma]) }
    }

    /// What the runs depend on, for the head of their file: `key=value`, separated by spaces.
    #[must_use]
    pub fn of_runs(&self) -> String {
        let scene = &self.setup.scene;
        format!(
            "width={} height={} seed={} frames={} scatterers={} aperture={} pitch={} version={}",
            scene.width,
            scene.height,
            scene.seed,
            scene.frames,
            scene.scatterers_per_pixel,
            scene.aperture_cycles_per_wavelength,
            scene.pitch_wavelengths,
            env!("CARGO_PKG_VERSION")
        )
    }

    /// The same for people.
    #[must_use]
    pub fn words(&self) -> String {
        let scene = &self.setup.scene;
        let runs = if self.runs == 1 { "1 run".to_owned() } else { format!("{} runs", self.runs) };
        format!(
            "{} x {} pixels, {} frames, {} scatterers, seed {}; Figure 3: {runs} for each σ; images: \
             Gaussian of {} pixels; bound: {} trials",
            scene.width,
            scene.height,
            scene.frames,
            scene.pixels() * scene.scatterers_per_pixel,
            scene.seed,
            self.setup.gaussian_px,
            self.trials
        )
    }
}

/// `σ = λ/32` and the like.
#[must_use]
pub fn label(sigma: usize) -> String {
    sigma_label(SIGMAS[sigma])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_shown_exists() {
        let settings = Settings::new([640, 368], 1, 100, 3.0, 2).unwrap();
        assert!(FRAMES.iter().all(|&frame| frame < settings.setup.scene.frames));
        assert_eq!(SHOWN.map(label), ["σ = 0", "σ = λ/32", "σ = λ/16"]);
        assert_eq!((settings.scene(1, 5).seed, settings.trials), (6, 400));
    }

    #[test]
    fn impossible_settings_are_refused() {
        for (size, runs, word) in
            [([8, 368], 1, "--width 8"), ([640, 8], 1, "--height 8"), ([640, 368], 0, "--runs 0")]
        {
            let error = Settings::new(size, 1, runs, 3.0, 2).unwrap_err();
            assert!(error.to_string().contains(word) && error.exit_status() == 2, "{error}");
        }
    }
}
