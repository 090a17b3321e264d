//! The pictures of evaluated scenes: the paper's Figures 2 and 3, and the method in one picture.

use super::errors::wrapped;
use super::evaluation::PhaseCurve;
use super::scene::{SceneResult, Snapshot};
use super::setup::Setup;
use crate::figures::{
    Canvas, Curve, CurveColumn, Curves, Method, PhaseColumn, PhaseImages, ScaleBar, SpeckleImage,
    style,
};
use std::f64::consts::PI;

/// Coherence left at the end of a drawn step of the walk.
const STEP_COHERENCE: f64 = 0.12;

/// Figure 2: the phase by direct difference and by the extended method, early and late, and the
/// speckle it came from (paper lines 431-438).
#[must_use]
pub fn phase_images(setup: &Setup, scenes: &[SceneResult]) -> Canvas {
    let phases: Vec<(String, &Snapshot)> = scenes.iter().flat_map(changed).collect();
    let moving = scenes.iter().find(|scene| scene.sigma_wavelengths > 0.0);
    let speckle: Vec<(String, &Snapshot)> = moving.into_iter().flat_map(labelled).collect();
    let length = bar_wavelengths(setup);
    let columns = phases.iter().map(|(label, snapshot)| PhaseColumn {
        label,
        phases: vec![snapshot.direct.view(), snapshot.extended.view()],
        sigma: None,
    });
    let amplitudes = speckle
        .iter()
        .map(|(label, snapshot)| SpeckleImage { label, amplitude: snapshot.amplitude.view() });
    let figure = PhaseImages {
        methods: vec![style::DIRECT_NAME, style::EXTENDED_NAME],
        columns: columns.collect(),
        speckle: amplitudes.collect(),
        scale_bar: Some(ScaleBar {
            pixels: length / setup.scene.pitch_wavelengths,
            label: &format!("{length} λ"),
        }),
    };
    figure.draw()
}

/// Figure 3: the phase of the x over time and the autocorrelation (paper lines 473-482).
///
/// The extended curve has no band: the standard deviation that goes with it takes all pairs of
/// frames as independent, and those that share frames are not.
#[must_use]
pub fn curves(scenes: &[SceneResult]) -> Canvas {
    let columns = scenes.iter().map(curve_column).collect();
    Curves { columns, direct_range: None, apart: false }.draw()
}

/// The method in one picture, from the cross-spectrum of one scene whose phase stays below π.
#[must_use]
pub fn method(scene: &SceneResult) -> Canvas {
    let direct: Vec<f64> = scene.curves.direct.phase_rad.iter().map(|&p| wrapped(p)).collect();
    let figure = Method {
        single: scene.spectra.single.view(),
        averaged: scene.spectra.averaged.view(),
        truth: &scene.truth_rad,
        direct: &direct,
        walked: &scene.curves.extended.phase_rad,
        step: coherent_lag(&scene.autocorrelation),
        range: Some((-PI, PI)),
    };
    figure.draw()
}

fn curve_column(scene: &SceneResult) -> CurveColumn<'_> {
    CurveColumn {
        label: &scene.label,
        truth: &scene.truth_rad,
        direct: with_band(&scene.curves.direct),
        one_step: Some(with_band(&scene.curves.one_step)),
        extended: Curve { values: &scene.curves.extended.phase_rad, deviation: None },
        linked: None,
        autocorrelation: Some(Curve { values: &scene.autocorrelation, deviation: None }),
    }
}

fn with_band(curve: &PhaseCurve) -> Curve<'_> {
    Curve { values: &curve.phase_rad, deviation: Some(&curve.sigma_rad) }
}

/// The snapshots of a scene with their headings.
fn labelled(scene: &SceneResult) -> impl Iterator<Item = (String, &Snapshot)> {
    let label = |snapshot: &Snapshot| format!("{}, frame {}", scene.label, snapshot.frame);
    scene.snapshots.iter().map(move |snapshot| (label(snapshot), snapshot))
}

/// Those after the first frame; without random motion the last one says it all.
fn changed(scene: &SceneResult) -> impl Iterator<Item = (String, &Snapshot)> {
    let still = scene.sigma_wavelengths == 0.0;
    let last = scene.snapshots.last().map_or(0, |snapshot| snapshot.frame);
    let wanted = move |frame| if still { frame == last } else { frame > 0 };
    labelled(scene).filter(move |(_, snapshot)| wanted(snapshot.frame))
}

/// Length of the scale bar, wavelengths: a fifth of the image, rounded; 500 as in the paper for its
/// images.
pub(crate) fn bar_wavelengths(setup: &Setup) -> f64 {
    let across = setup.scene.width as f64 * setup.scene.pitch_wavelengths;
    50.0 * (across / 250.0).round().max(1.0)
}

/// Number of frames after which the coherence has fallen to [`STEP_COHERENCE`]; at least 1.
pub(crate) fn coherent_lag(autocorrelation: &[f64]) -> usize {
    let lost = autocorrelation.iter().position(|&coherence| coherence < STEP_COHERENCE);
    lost.unwrap_or(autocorrelation.len()).saturating_sub(1).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drawn_step_stays_coherent() {
        assert_eq!(coherent_lag(&[1.0, 0.8, 0.5, 0.2, 0.1, 0.05]), 3);
        assert_eq!(coherent_lag(&[1.0, 0.1]), 1);
        assert_eq!(coherent_lag(&[]), 1);
    }

    #[test]
    fn the_scale_bar_is_a_round_part_of_the_image() {
        assert_eq!(bar_wavelengths(&Setup::paper(1, 1)), 500.0);
        assert_eq!(bar_wavelengths(&Setup::small(1, 1)), 250.0);
    }
}
