//! The surfaces at the two ends of the photoreceptor outer segments, from the mean intensity (paper lines 709-711).
//!
//! ```text
//! mean volume ── tiles ─> coarse surface ─> mean A-line ── sharpened ─> peaks ─> which is which
//!   ─> band around them ─> shift of the IS/OS in every A-line (likelihood, cheapest paths)
//!   ─> mean A-line along the IS/OS ─> shift of the tips
//! ```
//! A surface is the middle of its layer, as the mean A-line shows it without the axial point
//! spread. All smoothing over the field happens along the surface known so far, so that neither
//! tilt nor curvature biases it.

mod flatten;
mod label;
mod lateral;
mod peaks;
mod profile;
mod track;
mod volume;

pub use peaks::{Layer, Peak};

use crate::error::{Error, Result};
use flatten::Tiles;
use label::Choice;
use profile::Profile;
use rayon::prelude::*;
use track::Search;
use volume::{Band, Volume};

/// Least number of pixels in each direction.
const LEAST_DEPTHS: usize = 16;
const LEAST_SIDE: usize = 8;
/// Depths kept before the IS/OS and behind the last layer, pixels.
const BEFORE_PX: f64 = 12.0;
const BEHIND_PX: f64 = 10.0;
/// Smoothing of the local brightness, pixels.
const BRIGHTNESS_SIGMA_PX: f64 = 6.0;
/// A layer stands out when it rises this many times the noise of the mean A-line above the floor.
const STANDS_OUT: f64 = 8.0;
/// First the whole group of layers within this range, then each end alone.
const WIDE_RANGE_PX: f64 = 4.0;
const CLOSE_RANGE_PX: f64 = 1.25;
/// How far the intensities of a single layer reach, pixels.
const LAYER_PX: f64 = 1.6;
/// .. and behind the tips, where the brighter pigment epithelium begins.
const BEHIND_TIPS_PX: f64 = 1.1;
/// Rounds in which the mean A-line gets sharper along the better surface.
const ROUNDS: usize = 2;

/// What is known beforehand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hints {
    /// Depth of the IS/OS at the centre of the field, depth pixels.
    pub isos_px: Option<f64>,
    /// Distance from IS/OS to tips in µm.
    pub outer_segment_um: Option<f64>,
}

/// The two surfaces and what led to them.
#[derive(Clone, Debug)]
pub struct Surfaces {
    /// Depth of the junction of inner and outer segments, depth pixels, shape (y, x).
    pub isos: Vec<f32>,
    /// Depth of the outer-segment tips, depth pixels, shape (y, x).
    pub ost: Vec<f32>,
    /// Mean A-line along the IS/OS, one value per depth pixel.
    pub profile: Vec<f32>,
    /// Index of the IS/OS in `profile`.
    pub origin: f64,
    /// The layers found, in order of depth from the IS/OS.
    pub peaks: Vec<Peak>,
    /// One line: which layers were chosen, and why.
    pub reason: String,
}

/// Finds IS/OS and tips in the mean intensity `mean` of shape (z, y, x).
///
/// `depth_px_um` is one depth pixel in tissue in µm.
///
/// # Errors
/// A volume too small, of another size than `shape`, without light or with values that are not
/// finite; nothing that stands out of the noise; no two layers at the distance of an outer segment.
pub fn segment(
    mean: &[f32],
    shape: [usize; 3],
    depth_px_um: f64,
    hints: &Hints,
) -> Result<Surfaces> {
    let volume = checked(mean, shape, depth_px_um)?;
    let tiles = Tiles::new(volume);
    let terms = tiles.second_order();
    let smooth = tiles.surface(&terms, &[]);
    stands_out(&profile::of_volume(volume, &smooth))?;
    let coarse = tiles.surface(&terms, &tiles.remainders(&terms));
    let profile = profile::of_volume(volume, &coarse);
    let mut peaks = peaks::find(&profile);
    let centre = (volume.rows / 2) * volume.columns + volume.columns / 2;
    let hint_px = hints.isos_px.map(|depth| depth - f64::from(coarse[centre]));
    let choice = label::choose(&peaks, depth_px_um, hints, hint_px)
        .ok_or_else(|| no_layers(&peaks, depth_px_um, hints))?;
    choice.label(&mut peaks);
    let hinted = *hints != Hints::default();
    let reason = choice.reason(&peaks, depth_px_um, hinted);
    let (isos, ost) = follow(volume, &coarse, &peaks, &choice);
    Ok(report(volume, isos, ost, peaks, reason))
}

/// Both surfaces, by ever closer searches around the coarse one.
fn follow(volume: Volume, coarse: &[f32], peaks: &[Peak], choice: &Choice) -> (Vec<f32>, Vec<f32>) {
    let near = peaks[choice.isos].depth_px;
    let gap = peaks[choice.tips].depth_px - near;
    let last = choice.epithelium.map_or(gap, |at| peaks[at].depth_px - near);
    let start: Vec<f32> = coarse.iter().map(|depth| depth + near as f32).collect();
    let depths = (BEFORE_PX + last + BEHIND_PX).ceil() as usize;
    let band = Band::cut(volume, &start, BEFORE_PX, depths);
    let wide = Search {
        window_px: [-WIDE_RANGE_PX, last + 2.0],
        range_px: WIDE_RANGE_PX,
        sigma_px: 2.5,
        smooth_px: 3.0,
    };
    let isos = followed(&band, start, &wide, 1);
    let close = |before: f64, behind: f64| Search {
        window_px: [-before, behind],
        range_px: CLOSE_RANGE_PX,
        sigma_px: 3.5,
        smooth_px: 3.5,
    };
    let isos = followed(&band, isos, &close(LAYER_PX, LAYER_PX.min(0.5 * gap)), ROUNDS);
    let isos = centred(&band, isos, 0.0);
    let tips: Vec<f32> = isos.iter().map(|depth| depth + gap as f32).collect();
    let tips = centred(&band, tips, 0.0);
    let tips = followed(&band, tips, &close(LAYER_PX.min(0.5 * gap), BEHIND_TIPS_PX), ROUNDS);
    let tips = centred(&band, tips, 0.0);
    (isos, tips)
}

/// Adds the shifts of `rounds` searches to a surface.
fn followed(band: &Band, mut surface: Vec<f32>, search: &Search, rounds: usize) -> Vec<f32> {
    for _ in 0..rounds {
        let profile = band_profile(band, &surface);
        let brightness = brightness(band, &surface, &profile, search);
        let shifts = track::shifts(band, &surface, &brightness, &profile, search);
        surface.iter_mut().zip(shifts).for_each(|(depth, shift)| *depth += shift);
    }
    surface
}

/// Moves a surface onto the middle of the peak nearest to `distance_px` from it.
fn centred(band: &Band, mut surface: Vec<f32>, distance_px: f64) -> Vec<f32> {
    let peaks = peaks::find(&band_profile(band, &surface));
    let nearest = peaks
        .iter()
        .map(|peak| peak.depth_px)
        .min_by(|a, b| (a - distance_px).abs().total_cmp(&(b - distance_px).abs()));
    if let Some(move_px) = nearest.filter(|at| (at - distance_px).abs() < CLOSE_RANGE_PX) {
        surface.iter_mut().for_each(|depth| *depth += move_px as f32);
    }
    surface
}

fn band_profile(band: &Band, surface: &[f32]) -> Profile {
    let reach = band.depths as f64;
    profile::of_band(band, surface, -reach, reach)
}

/// Light above the floor within the window, relative to its mean over the field.
fn brightness(band: &Band, surface: &[f32], profile: &Profile, search: &Search) -> Vec<f32> {
    let floor = profile.floor as f32;
    let [from, to] = search.window_px.map(|edge| edge as f32);
    let mut light: Vec<f32> = (0..surface.len())
        .into_par_iter()
        .map(|at| {
            let (line, depth) = band.a_line(at);
            let inside = |i: usize| {
                let distance = depth + i as f32 - surface[at];
                (from..=to).contains(&distance)
            };
            let values =
                line.iter().enumerate().filter(|(i, value)| inside(*i) && value.is_finite());
            values.map(|(_, value)| value - floor).sum()
        })
        .collect();
    lateral::smooth(&mut light, band.rows, band.columns, BRIGHTNESS_SIGMA_PX);
    let mean = light.iter().sum::<f32>() / light.len().max(1) as f32;
    light.iter_mut().for_each(|value| *value = (*value / mean.max(f32::MIN_POSITIVE)).max(0.0));
    light
}

/// The result, with the mean A-line along the final surface.
fn report(
    volume: Volume,
    isos: Vec<f32>,
    ost: Vec<f32>,
    mut peaks: Vec<Peak>,
    reason: String,
) -> Surfaces {
    let fine = profile::of_volume(volume, &isos);
    let zero = peaks.iter().find(|peak| peak.layer == Layer::InnerOuter).map(|peak| peak.depth_px);
    peaks.iter_mut().for_each(|peak| peak.depth_px -= zero.unwrap_or(0.0));
    let first = fine.first.ceil();
    let last = fine.distance((fine.values.len() - 1) as f64).floor();
    let profile =
        (0..=(last - first) as usize).map(|at| fine.at(first + at as f64) as f32).collect();
    Surfaces { isos, ost, profile, origin: -first, peaks, reason }
}

fn checked(mean: &[f32], shape: [usize; 3], depth_px_um: f64) -> Result<Volume<'_>> {
    let [depths, rows, columns] = shape;
    let refuse = |what: String| Err(Error::failed(format!("layers: {what}")));
    if depths * rows * columns != mean.len() {
        return refuse(format!("{} values for {depths} × {rows} × {columns}", mean.len()));
    }
    if depths < LEAST_DEPTHS || rows.min(columns) < LEAST_SIDE {
        return refuse(format!(
            "a volume of {depths} × {rows} × {columns} is too small: at least {LEAST_DEPTHS} \
             depths and {LEAST_SIDE} × {LEAST_SIDE} A-lines"
        ));
    }
    if !(depth_px_um.is_finite() && depth_px_um > 0.0) {
        return refuse(format!("a depth pixel of {depth_px_um} µm: must be above 0"));
    }
    let bad = mean.par_iter().filter(|value| !(value.is_finite() && **value >= 0.0)).count();
    if bad > 0 {
        return refuse(format!("{bad} mean intensities are negative or not finite"));
    }
    if mean.par_iter().all(|&value| value == 0.0) {
        return refuse("the volume is empty: all intensities are 0".into());
    }
    Ok(Volume { data: mean, depths, rows, columns })
}

/// Refuses a mean A-line that is nothing but noise.
fn stands_out(profile: &Profile) -> Result<()> {
    let highest = profile.values.iter().copied().fold(0.0, f64::max);
    let rise = (highest - profile.floor) / highest.max(f64::MIN_POSITIVE);
    if rise > STANDS_OUT * profile.noise && rise > 0.01 {
        return Ok(());
    }
    let (percent, noise) = (100.0 * rise, 100.0 * profile.noise);
    Err(Error::failed(format!(
        "layers: nothing stands out of the noise (the mean A-line rises by {percent:.1}%, its \
         noise is {noise:.1}%): check the dispersion, the depth range and the light"
    )))
}

fn no_layers(peaks: &[Peak], depth_px_um: f64, hints: &Hints) -> Error {
    let near = peaks.first().map_or(0.0, |peak| peak.depth_px);
    let depths: Vec<String> =
        peaks.iter().map(|peak| format!("{:.0}", (peak.depth_px - near) * depth_px_um)).collect();
    let hint = if *hints == Hints::default() {
        "give --isos-px (depth pixels) and --outer-segment-um"
    } else {
        "check --isos-px (depth pixels at the centre of the field) and --outer-segment-um"
    };
    Error::failed(format!(
        "layers: no two of the {} peaks (µm behind the first: {}) can be IS/OS and outer-segment \
         tips: {hint}",
        peaks.len(),
        depths.join(", ")
    ))
}

#[cfg(test)]
mod tests;
