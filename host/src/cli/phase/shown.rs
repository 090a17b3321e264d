//! The frames that the figure of images shows, in the manner of the paper's Figure 4 (lines 502-516):
//! phases against the reference frame, direct and by the method, the standard deviation where it is known, and the
//! speckle of one layer.

use super::Task;
use crate::error::{Error, Result};
use crate::figures::scale::{number, round_step};
use crate::figures::{Canvas, PhaseColumn, PhaseImages, ScaleBar, SpeckleImage, style};
use crate::frames::ChosenFrames;
use crate::image::{HeldImages, Images, Imaging, StripResult};
use crate::io::{Series, Shape};
use crate::method::{Method, Plan};
use crate::notes;
use ndarray::{Array2, Array3, Axis};

/// Columns of the figure when the user names no frames.
const COLUMNS: usize = 7;
/// The most that can be told apart.
const MOST_COLUMNS: usize = 12;

/// The frames of the figure while the images are computed.
pub(super) struct Shown {
    /// The reference, then the frames shown, as numbers among the good ones.
    frames: Vec<usize>,
    held: HeldImages,
    /// Scale bar, in pixels and in words.
    bar: Option<(f64, String)>,
}

impl Shown {
    /// The frames asked for by `--at`, or frames spread from the reference to the last.
    pub(super) fn new(task: &Task<'_>) -> Result<Self> {
        let Shape { height, width, .. } = task.good.shape();
        let asked = &task.arguments.at;
        if asked.len() > MOST_COLUMNS {
            let count = asked.len();
            return Err(Error::usage(format!("--at: {count} frames, show at most {MOST_COLUMNS}")));
        }
        let mut frames = vec![task.plan.direct_frame];
        if asked.is_empty() {
            frames.extend(spread(task.plan.direct_frame, task.plan.frames() - 1));
        } else {
            for &frame in asked {
                frames.push(task.good.position(frame, "--at")?);
            }
        }
        let bar = bar(task).map_err(|error| task.arguments.about(error))?;
        let sigma = task.arguments.sigma || task.plan.method == Method::Linked;
        Ok(Self { held: HeldImages::new(frames.clone(), height, width, sigma), frames, bar })
    }

    /// Take what the figure needs from a strip.
    pub(super) fn keep(&self, strip: &StripResult<'_>) -> Result<()> {
        self.held.keep(strip)
    }

    /// The figure, once all strips are there; `imaging` is how they were computed, of the good frames.
    pub(super) fn draw(self, task: &Task<'_>, imaging: &Imaging<'_>) -> Result<Canvas> {
        let Images { phases, sigmas } = self.held.into_images();
        let mut rows = vec![];
        if task.plan.method != Method::Direct {
            rows.push((style::DIRECT_NAME, direct(task, imaging, &self.frames)?));
        }
        rows.push((task.method_name().0, less_first(phases)));
        let shown = &self.frames[1..];
        let labels: Vec<String> = shown.iter().map(|&frame| label(task, frame)).collect();
        let amplitudes = shown.iter().map(|&frame| amplitude(task, frame));
        let amplitudes: Vec<Array2<f32>> = amplitudes.collect::<Result<_>>()?;
        let columns = labels.iter().enumerate().map(|(n, label)| PhaseColumn {
            label,
            phases: rows.iter().map(|(_, images)| images.index_axis(Axis(0), n + 1)).collect(),
            sigma: sigmas.as_ref().map(|images| images.index_axis(Axis(0), n + 1)),
        });
        let speckle =
            amplitudes.iter().map(|image| SpeckleImage { label: "", amplitude: image.view() });
        let figure = PhaseImages {
            methods: rows.iter().map(|(name, _)| *name).collect(),
            columns: columns.collect(),
            speckle: speckle.collect(),
            scale_bar: self.bar.as_ref().map(|(pixels, label)| ScaleBar { pixels: *pixels, label }),
        };
        Ok(figure.draw())
    }
}

/// Up to seven frames, evenly from the reference to the last one; from the first where the reference
/// is the last.
fn spread(reference: usize, last: usize) -> Vec<usize> {
    let first = if reference < last { reference } else { 0 };
    let steps = COLUMNS - 1;
    let mut frames: Vec<usize> =
        (0..=steps).map(|n| first + (n * (last - first) + steps / 2) / steps).collect();
    frames.dedup();
    frames
}

/// The direct difference of each frame to the first, one pair of frames for each.
fn direct(task: &Task<'_>, imaging: &Imaging<'_>, frames: &[usize]) -> Result<Array3<f32>> {
    let pairs = ChosenFrames::new(&task.good, frames.to_vec())?;
    let planes = task.plan.depths.clone();
    let mut plan = Plan::new(Method::Direct, frames.len(), None, Some(0), planes)?;
    plan.params.reference_frames = 1;
    plan.average = task.plan.average;
    Ok(Imaging { series: &pairs, ..*imaging }.images(&plan, "direct difference")?.phases)
}

/// Phases against the first of the images, which is the reference.
fn less_first(mut images: Array3<f32>) -> Array3<f32> {
    let reference = images.index_axis(Axis(0), 0).to_owned();
    for mut image in images.outer_iter_mut() {
        image -= &reference;
    }
    images
}

/// Time since the reference where times are known, else the number of the frame.
fn label(task: &Task<'_>, frame: usize) -> String {
    let times = &task.plan.times_s;
    if task.good.times_s().is_none() {
        return format!("frame {}", task.good.numbers()[frame]);
    }
    let interval = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let decimals = (-interval.log10()).ceil().clamp(0.0, 4.0) as usize;
    format!("t = {} s", number(times[frame] - times[task.plan.direct_frame], decimals))
}

/// |U| in the middle of the first layer.
fn amplitude(task: &Task<'_>, frame: usize) -> Result<Array2<f32>> {
    let Shape { height, width, .. } = task.good.shape();
    let layer = task.first_layer();
    let middle = layer.get(layer.len().saturating_sub(1) / 2).copied().unwrap_or_default();
    let mut field = vec![num_complex::Complex32::default(); height * width];
    task.good.read_rows(frame, middle, 0..height, &mut field)?;
    Ok(Array2::from_shape_fn((height, width), |(y, x)| field[y * width + x].norm()))
}

/// A round length of about a fifth of the image, in pixels and in words, where the pitch is known.
fn bar(task: &Task<'_>) -> Result<Option<(f64, String)>> {
    let Some(pitch) = notes::pixel_pitch_um(&task.good)? else { return Ok(None) };
    let length = round_step(0.15 * pitch * task.good.shape().width as f64);
    let label = if length < 1000.0 {
        format!("{length} \u{b5}m")
    } else {
        format!("{} mm", length / 1000.0)
    };
    Ok(Some((length / pitch, label)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_spread_from_the_reference() {
        assert_eq!(spread(4, 69), [4, 15, 26, 37, 47, 58, 69]);
        assert_eq!(spread(4, 7), [4, 5, 6, 7]);
        assert_eq!(spread(3, 3), [0, 1, 2, 3]);
        assert_eq!(spread(1, 1), [0, 1]);
    }
}
