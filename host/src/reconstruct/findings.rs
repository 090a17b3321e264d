//! What a reconstruction has found, as it is kept with the volumes and told to the user.

use super::analysis::Analysis;
use super::preparation::Preparation;
use super::register::{MATCHED, Motion};
use super::segment::Surfaces;
use super::settings::Settings;
use crate::io::{Attributes, Companions};
use serde_json::json;
use std::path::PathBuf;

/// What was found on the way.
pub struct Findings {
    /// The recording.
    pub name: PathBuf,
    /// Before the passes.
    pub plan: Preparation,
    /// Between them.
    pub analysis: Analysis,
    /// In words, per sweep.
    pub verdicts: Vec<String>,
    /// Predicted memory, bytes.
    pub memory: u64,
    /// Wall time of preparation, first pass, analysis and second pass, seconds.
    pub seconds: [f64; 4],
}

/// What the first pass has seen: for the pictures.
pub struct Survey {
    /// How the layers were chosen.
    pub surfaces: Surfaces,
    /// Mean intensity (z, y, x) of the depths of the first pass.
    pub mean: Vec<f32>,
}

impl Findings {
    /// Put together, with the verdicts in words.
    #[must_use]
    pub fn new(
        name: PathBuf,
        plan: Preparation,
        analysis: Analysis,
        memory: u64,
        seconds: [f64; 4],
    ) -> Self {
        let verdicts = verdicts(&plan, &analysis);
        Self { name, plan, analysis, verdicts, memory, seconds }
    }

    /// The arrays beside the field.
    #[must_use]
    pub fn companions(&self, time_s: Option<Vec<f64>>) -> Companions {
        let Self { plan, analysis, .. } = self;
        let motions = || analysis.motions.iter();
        let shift = |motion: &Option<Motion>| motion.map_or([f64::NAN; 3], |m| m.shift);
        Companions {
            shift_px: motions().flat_map(shift).collect(),
            rotation_rad: motions().map(|m| m.map_or(f64::NAN, |m| m.rotation_rad)).collect(),
            sweep_ok: motions().map(Option::is_some).collect(),
            match_quality: analysis.quality.clone(),
            first_image: plan.sweeps.iter().map(|s| s.first_image as f64).collect(),
            start_jitter_images: analysis.jitter.clone(),
            surface_isos_px: analysis.isos.clone(),
            surface_ost_px: analysis.ost.clone(),
            dispersion_rad: vec![analysis.dispersion.a2, analysis.dispersion.a3],
            dead_pixel: plan.illumination.dead.clone(),
            time_s,
        }
    }

    /// The attributes of the group.
    #[must_use]
    pub fn attributes(&self, settings: &Settings) -> Attributes {
        let Self { plan, analysis, verdicts, .. } = self;
        let [tips, isos] = analysis.layers;
        let values = [
            ("software", json!(concat!("phasewalk ", env!("CARGO_PKG_VERSION")))),
            ("recording", json!(self.name)),
            ("wavelength_nm", json!(settings.wavelength_nm)),
            ("bandwidth_nm", json!(settings.bandwidth_nm)),
            ("depth_px_um", json!(settings.depth_px_um())),
            ("sweep", json!(settings.direction)),
            ("images_per_sweep", json!(settings.images)),
            ("layer_ost_z", json!(tips)),
            ("layer_isos_z", json!(isos)),
            ("flat_isos_z", json!(analysis.flat - analysis.depths.start)),
            ("dispersion_reliable", json!(plan.estimate.is_reliable())),
            ("start_jitter_sigma_images", json!(analysis.jitter_sigma)),
            ("verdicts", json!(verdicts)),
        ];
        values.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }
}

/// What became of each sweep, in words.
fn verdicts(plan: &Preparation, analysis: &Analysis) -> Vec<String> {
    let sweeps = plan.sweeps.iter().zip(&analysis.motions).zip(&analysis.quality);
    sweeps
        .map(|((sweep, motion), quality)| match motion {
            None if sweep.is_ok() => {
                format!(
                    "matches no other sweep (saccade or blink): {quality:.1} of {MATCHED} sigma"
                )
            }
            _ => sweep.verdict.to_string(),
        })
        .collect()
}
