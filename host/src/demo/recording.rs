//! A simulated recording with its truth, in memory.

use crate::error::Result;
use crate::io::Shape;
use crate::progress::Progress;
use crate::series::HeldSeries;
use crate::simulate::{SpeckleScene, coherence_at_lags};

/// The frames of one scene and what is known about them.
pub struct Recording {
    /// What was simulated.
    pub scene: SpeckleScene,
    /// U(t, y, x).
    pub series: HeldSeries,
    /// The x-shaped region that moves, (y, x).
    pub mask: Vec<bool>,
    /// The phase put in, radians, one per frame.
    pub truth_rad: Vec<f64>,
    /// Amplitude of the autocorrelation inside the x by lag, 1 at lag 0 (Figure 3, i-k).
    pub autocorrelation: Vec<f64>,
}

impl Recording {
    /// Simulate `scene`; `progress` moves by one per frame.
    ///
    /// # Errors
    /// Those of [`SpeckleScene::for_each_frame`].
    pub fn simulate(scene: SpeckleScene, progress: &Progress) -> Result<Self> {
        scene.validate()?;
        let (mask, truth_rad) = (scene.mask(), scene.true_phase_rad());
        let mut fields = Vec::with_capacity(scene.frames * scene.pixels());
        scene.for_each_frame(progress, |_, field| {
            fields.extend_from_slice(field);
            Ok(())
        })?;
        let lags: Vec<usize> = (0..scene.frames).collect();
        let autocorrelation = coherence_at_lags(&fields, scene.pixels(), &lags, Some(&mask))?;
        let series = HeldSeries::new(shape(&scene), fields)?;
        Ok(Self { scene, series, mask, truth_rad, autocorrelation })
    }

    /// The phase put in, in the last frame, radians.
    #[must_use]
    pub fn final_truth_rad(&self) -> f64 {
        self.truth_rad.last().copied().unwrap_or(f64::NAN)
    }
}

fn shape(scene: &SpeckleScene) -> Shape {
    Shape { frames: scene.frames, depth: 1, height: scene.height, width: scene.width }
}
