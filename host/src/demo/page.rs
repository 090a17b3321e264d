//! The report: one page that explains what is shown, with a slider over the frames.

use super::errors::{ErrorRow, table};
use super::scene::SceneResult;
use super::setup::Setup;
use crate::error::Result;
use crate::figures::Canvas;
use crate::report::{Page, Role, Scene, SceneCurve, Still};

const TITLE: &str = "Phasewalk: the phase of speckle that falls apart";

const EXPLANATION: &str = "\
Simulated, so that the truth is known: point scatterers seen through a small aperture give a speckle \
pattern. An x-shaped region in the middle moves along the line of sight by less than a fifth of a \
wavelength, and that motion is to be measured from the phase. At the same time every scatterer moves at random, by a standard \
deviation σ per frame and axis, so that the pattern changes until nothing of it is left. The direct \
difference compares each frame with the fifth: it fails once the two patterns have nothing in common. A \
walk adds up phase changes over short times, during which the pattern hardly changes: in steps of one \
frame (one-step), or over all pairs of frames that still agree (extended Knox\u{2013}Thompson method). \
Move the slider, or press the arrow keys.";

const ABOUT_ERRORS: &str = "\
Curve: mean over the x, all frames (rms) and last frame (end). Image: the pixels of the x in the last \
frame; for the direct difference, which is known modulo 2π only, the wrapped error, which is 1.81 for \
noise. At the edges of the x a pixel also sees the resting surroundings: that alone makes the errors at \
σ = 0.";

const ABOUT_METHOD: &str = "\
The method in one picture. Left and middle: the cross-spectrum, how the phase changes \
from frame t to frame t + Δt. In one pixel it is noise; averaged over the x it shows the motion wherever \
Δt is short, and noise again where the pattern has changed.";

const ABOUT_IMAGES: &str = "\
Phase images (Gaussian average over neighbouring pixels) by direct difference and by the extended \
method, and the speckle they were made from. Compare the paper's Figure 2.";

const ABOUT_CURVES: &str = "\
Phase averaged over the x. Bands: one standard deviation, predicted from the coherence; the extended \
method has none here, because its noise is correlated between pairs. Bottom: how much of the field is \
left after a time. Compare the paper's Figure 3.";

/// The pictures of the page.
pub struct Figures {
    /// The method in one picture.
    pub method: Canvas,
    /// Figure 2.
    pub phase_images: Canvas,
    /// Figure 3.
    pub curves: Canvas,
}

/// The page as HTML.
///
/// # Errors
/// When an image cannot be encoded.
pub fn html(
    setup: &Setup,
    scenes: &[SceneResult],
    rows: &[ErrorRow],
    figures: &Figures,
) -> Result<String> {
    let mut table = table(rows, setup.scene.frames);
    table.caption += ".";
    let captions: Vec<String> = scenes.iter().map(caption).collect();
    let still = |canvas, caption| Still { canvas, caption };
    let page = Page {
        title: TITLE,
        explanation: EXPLANATION,
        table,
        scenes: scenes.iter().zip(&captions).map(|(s, caption)| scene(s, caption)).collect(),
        figures: vec![
            still(&figures.method, ABOUT_METHOD),
            still(&figures.phase_images, ABOUT_IMAGES),
            still(&figures.curves, ABOUT_CURVES),
        ],
    };
    page.html()
}

fn scene<'a>(scene: &'a SceneResult, caption: &'a str) -> Scene<'a> {
    let curve = |label, role, values| SceneCurve { label, role, values };
    let curves = &scene.curves;
    Scene {
        label: &scene.label,
        caption,
        stacks: scene.stacks.clone(),
        curves: vec![
            curve("truth", Role::Truth, &scene.truth_rad),
            curve("direct difference", Role::Direct, &curves.direct.phase_rad),
            curve("one-step walk", Role::OneStep, &curves.one_step.phase_rad),
            curve("extended walk", Role::Extended, &curves.extended.phase_rad),
        ],
    }
}

/// What is special about a scene.
fn caption(scene: &SceneResult) -> String {
    if scene.sigma_wavelengths == 0.0 {
        return "No random motion: the pattern stays, and every method works.".to_owned();
    }
    let half = scene.autocorrelation.iter().position(|&coherence| coherence < 0.5);
    let lost = match half {
        Some(lag) => format!("half of the field has changed after {lag} frames"),
        None => "most of the field stays to the end".to_owned(),
    };
    format!("Random motion in x, y and z with a standard deviation of {} per frame: {lost}.",
        scene.label.trim_start_matches("σ = "))
}
