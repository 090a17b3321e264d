//! Figure 2: phase images early and late, by every method, and the speckle they came from (lines
//! 431-438).

use super::methods::NAMES;
use super::scene::Scene;
use super::settings::Settings;
use crate::demo::figures::bar_wavelengths;
use crate::figures::{Canvas, PhaseColumn, PhaseImages, ScaleBar, SpeckleImage};

/// Scene, an index into the scenes, and frame of each column (a-d and e-h of the paper).
const COLUMNS: [(usize, usize); 4] = [(0, 69), (1, 10), (1, 60), (2, 69)];

/// The same for the speckle (i-k).
const SPECKLE: [(usize, usize); 3] = [(1, 0), (1, 10), (1, 69)];

/// From the scenes of σ = 0, λ/32 and λ/16.
#[must_use]
pub fn figure2(settings: &Settings, scenes: &[Scene; 3]) -> Canvas {
    let label = |(scene, frame): (usize, usize)| format!("{}, frame {frame}", scenes[scene].label);
    let (phase_labels, speckle_labels) = (COLUMNS.map(label), SPECKLE.map(label));
    let column = |(&(scene, frame), label): (&(usize, usize), _)| PhaseColumn {
        label,
        phases: scenes[scene].snapshot(frame).phases.iter().map(|image| image.view()).collect(),
        sigma: Some(scenes[scene].snapshot(frame).linked_sigma.view()),
    };
    let speckle = |(&(scene, frame), label): (&(usize, usize), _)| SpeckleImage {
        label,
        amplitude: scenes[scene].snapshot(frame).amplitude.view(),
    };
    let wavelengths = bar_wavelengths(&settings.setup);
    let figure = PhaseImages {
        methods: NAMES.to_vec(),
        columns: COLUMNS.iter().zip(phase_labels.iter().map(String::as_str)).map(column).collect(),
        speckle: SPECKLE
            .iter()
            .zip(speckle_labels.iter().map(String::as_str))
            .map(speckle)
            .collect(),
        scale_bar: Some(ScaleBar {
            pixels: wavelengths / settings.setup.scene.pitch_wavelengths,
            label: &format!("{wavelengths} λ"),
        }),
    };
    figure.draw()
}
