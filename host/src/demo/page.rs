//! The report: one page that explains what is shown, with a slider over the frames.

use super::errors::{ErrorRow, table};
use super::scene::SceneResult;
use super::setup::{Setup, sigma_label};
use crate::error::Result;
use crate::figures::Canvas;
use crate::report::{Page, Role, Scene, SceneCurve, Still};

const TITLE: &str = "Phasewalk: the phase of speckle that falls apart";

const EXPLANATION: &str = "\
A simulation, so that the truth is known. Point scatterers seen through a small aperture make a \
speckle pattern. An x-shaped region moves along the line of sight by a sixth of a wavelength; that \
motion is to be measured from the phase. But every scatterer also moves at random, by a standard \
deviation σ per frame and axis, until nothing is left of the first pattern. The direct difference \
compares each frame with the fifth: it is lost once the two patterns have nothing in common. A walk \
adds up phase changes over short times, while the pattern hardly changes: frame by frame (one-step), \
or over all pairs of frames that still agree (extended Knox\u{2013}Thompson method). Move the slider \
or press the arrow keys.";

const ABOUT_ERRORS: &str = "\
In the table, curve is the mean over the x, in all frames (rms) and in the last one (end); image is the \
pixels of the x in the last frame, once with the error wrapped to \u{2212}π..π, where noise has 1.81, and \
once as it is. At its edges a pixel sees x and surroundings together: at σ = 0 that is the only error.";

const ABOUT_METHOD: &str = "\
The method in one picture. Left and middle: the cross-spectrum, how the phase changes from frame t to \
frame t + Δt. In one pixel it is noise; averaged over the x it shows the motion wherever Δt is short, \
and noise again where the pattern has changed. Right: what follows for the phase of the x; the direct \
difference is drawn between \u{2212}π and π. The scene is";

const ABOUT_IMAGES: &str = "\
Phase images by direct difference and by the extended method, and the speckle they were made from \
(the paper's Figure 2). Each pixel is a Gaussian average with a standard deviation, in pixels, of";

const ABOUT_CURVES: &str = "\
Phase averaged over the x (the paper's Figure 3). Bands: one standard deviation, predicted from the \
coherence; that of the direct difference does not know of lost turns, and the extended method has none, \
because the prediction takes pairs of frames as independent and comes out too narrow. Bottom: how much \
of the field is left after a time.";

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
    let explanation = format!("{EXPLANATION} {ABOUT_ERRORS}");
    let (moving, still): (Vec<_>, Vec<_>) =
        scenes.iter().partition(|scene| scene.sigma_wavelengths > 0.0);
    let scenes: Vec<&SceneResult> = moving.into_iter().chain(still).collect();
    let captions: Vec<String> = scenes.iter().map(|scene| caption(scene)).collect();
    let explained = setup.sigmas_wavelengths.get(setup.explained).copied().unwrap_or_default();
    let about_method = format!("{ABOUT_METHOD} {}.", sigma_label(explained));
    let about_images = format!("{ABOUT_IMAGES} {}.", setup.gaussian_px);
    let still = |canvas, caption| Still { canvas, caption };
    let page = Page {
        title: TITLE,
        explanation: &explanation,
        tables: vec![table(rows, setup.scene.frames)],
        scenes: scenes.iter().zip(&captions).map(|(s, caption)| scene(s, caption)).collect(),
        figures: vec![
            still(&figures.method, &about_method),
            still(&figures.phase_images, &about_images),
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
        Some(lag) => format!("after {lag} frames less than half of the field is left"),
        None => "most of the field stays to the end".to_owned(),
    };
    format!(
        "Random motion in x, y and z with a standard deviation of {} per frame: {lost}.",
        scene.label.trim_start_matches("σ = ")
    )
}
