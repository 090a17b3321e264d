//! The mean flattened A-line, the peaks in it, and the depths taken as the two layers.

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, Stroke, TextStyle, font};
use super::colormap::Rgb;
use super::geometry::Rect;
use super::keys;
use super::layer::Layer;
use super::scale::Span;
use super::style::{self, tint};

/// A peak with its name.
#[derive(Clone, Copy, Debug)]
pub struct Peak<'a> {
    /// Depth in pixels, as the axis counts them.
    pub depth_px: f64,
    /// Its name.
    pub label: &'a str,
}

/// Depths averaged as one layer.
#[derive(Clone, Copy, Debug)]
pub struct LayerDepths {
    /// Which one.
    pub layer: Layer,
    /// First and last index into the A-line, both included.
    pub depths: (usize, usize),
}

/// The figure.
#[derive(Clone, Copy, Debug)]
pub struct DepthProfile<'a> {
    /// What was averaged, such as `21 sweeps, flattened to the IS/OS`.
    pub label: &'a str,
    /// Mean amplitude by depth in any unit, NaN where there is none.
    pub amplitude: &'a [f64],
    /// Depth in pixels of the first amplitude.
    pub first_depth_px: f64,
    /// Size of a depth pixel in µm, where it is known.
    pub depth_px_um: Option<f64>,
    /// The two layers.
    pub layers: &'a [LayerDepths],
    /// Peaks to be named.
    pub peaks: &'a [Peak<'a>],
}

const LEFT: f64 = 74.0;
const TOP: f64 = 64.0;
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 320.0;
const FOOT: f64 = 50.0;
/// From a peak to the beginning of its name.
const FLAG: f64 = 4.0;
/// Distance of two names above one another.
const LINE: f64 = 17.0;

impl DepthProfile<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let area = Rect::new(LEFT, TOP, WIDTH, HEIGHT);
        let peaks = self.inside(area);
        let levels = self.levels(&peaks);
        let axes = Axes::new(area, self.depths(), self.span(levels.iter().copied().max()));
        let end = peaks.iter().map(|(x, peak)| x + FLAG + width(peak)).fold(area.right(), f64::max);
        let title = format!("Mean A-line: {}", self.label);
        let mut canvas = Canvas::new(end + 18.0, area.bottom() + FOOT, &title);
        for layer in self.layers {
            self.shade(&mut canvas, &axes, layer);
        }
        for ((x, peak), level) in peaks.iter().zip(levels) {
            self.name(&mut canvas, &axes, *x, peak, level);
        }
        let values = self.decibels().into_iter().enumerate();
        let points = values.map(|(n, value)| (self.first_depth_px + n as f64, value));
        axes.curve(&mut canvas, points, Stroke::solid(style::INK, 1.8));
        axes.x_axis(&mut canvas, Some(&self.depth_title()));
        axes.y_axis(&mut canvas, Some("mean amplitude / dB"));
        axes.frame(&mut canvas);
        self.head(&mut canvas);
        canvas
    }

    fn head(&self, canvas: &mut Canvas) {
        canvas.text((LEFT, 22.0), self.label, TextStyle::new(style::TEXT, Anchor::Start));
        let name = |layer: &LayerDepths| {
            let (first, last) = layer.depths;
            let depth = |n: usize| self.first_depth_px + n as f64;
            format!("{}, z {} to {}", layer.layer.name(), depth(first), depth(last))
        };
        let names: Vec<_> = self.layers.iter().map(name).collect();
        let strokes = self.layers.iter().map(|layer| Stroke::solid(shade(layer.layer), 12.0));
        let key: Vec<_> = names.iter().map(String::as_str).zip(strokes).collect();
        keys::line_key(canvas, (LEFT, 46.0), &key);
    }

    /// Every depth from half a pixel before to half a pixel behind.
    fn shade(&self, canvas: &mut Canvas, axes: &Axes, layer: &LayerDepths) {
        let edge = |n: usize, half: f64| self.first_depth_px + n as f64 + half;
        let ends = [edge(layer.depths.0, -0.5), edge(layer.depths.1, 0.5)];
        let band = ends.map(|x| (x.clamp(axes.x.low, axes.x.high), axes.y.low, axes.y.high));
        axes.band(canvas, &band, shade(layer.layer));
    }

    /// A line up from the peak and the name at its upper end, like a flag.
    fn name(&self, canvas: &mut Canvas, axes: &Axes, x: f64, peak: &Peak<'_>, level: usize) {
        let y = axes.area.y + 15.0 + LINE * level as f64;
        let nearest = (peak.depth_px - self.first_depth_px).round() as usize;
        let value = self.decibels().get(nearest).copied().filter(|value| value.is_finite());
        let (_, end) = axes.place((0.0, value.unwrap_or(axes.y.low)));
        canvas.line([(x, y - 9.0), (x, end)], Stroke::solid(style::FAINT, 0.8));
        let text = TextStyle::new(style::SMALL, Anchor::Start);
        canvas.text((x + FLAG, y), peak.label, text);
    }

    /// Peaks inside the frame with their places, from left to right.
    fn inside(&self, area: Rect) -> Vec<(f64, Peak<'_>)> {
        let depths = self.depths();
        let place = |peak: &Peak<'_>| area.x + area.w * depths.position(peak.depth_px);
        let mut peaks: Vec<_> = self.peaks.iter().map(|peak| (place(peak), *peak)).collect();
        peaks.retain(|(x, _)| *x >= area.x && *x <= area.right());
        peaks.sort_by(|a, b| a.0.total_cmp(&b.0));
        peaks
    }

    /// Lines of the names: each below all those whose names would run across its own line.
    fn levels(&self, peaks: &[(f64, Peak<'_>)]) -> Vec<usize> {
        let mut levels: Vec<usize> = Vec::with_capacity(peaks.len());
        for (x, _) in peaks {
            let before = peaks.iter().zip(&levels);
            let across = before.filter(|((from, peak), _)| from + FLAG + width(peak) + 4.0 > *x);
            levels.push(across.map(|(_, level)| level + 1).max().unwrap_or(0));
        }
        levels
    }

    /// Decibels above the weakest depth.
    fn decibels(&self) -> Vec<f64> {
        let known = self.amplitude.iter().copied().filter(|a| a.is_finite() && *a > 0.0);
        let weakest = known.fold(f64::INFINITY, f64::min);
        self.amplitude.iter().map(|a| 20.0 * (a / weakest).log10()).collect()
    }

    /// Range of the amplitudes, with room for the names above them.
    fn span(&self, highest: Option<usize>) -> Span {
        let span = Span::of(self.decibels()).padded(0.05);
        let room = highest.map_or(0.0, |level| LINE * (level + 1) as f64 + 6.0).min(0.6 * HEIGHT);
        Span::new(span.low, span.low + (span.high - span.low) * HEIGHT / (HEIGHT - room))
    }

    fn depths(&self) -> Span {
        let last = self.amplitude.len().saturating_sub(1) as f64;
        Span::new(self.first_depth_px - 0.5, self.first_depth_px + last + 0.5)
    }

    fn depth_title(&self) -> String {
        match self.depth_px_um {
            Some(um) => format!("depth z / px (1 px = {um:.2} µm)"),
            None => "depth z / px".to_owned(),
        }
    }
}

fn shade(layer: Layer) -> Rgb {
    tint(layer.color(), 0.4)
}

fn width(peak: &Peak<'_>) -> f64 {
    font::width(peak.label, style::SMALL, false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_and_peaks_are_named() {
        let amplitude: Vec<f64> = (0..30).map(|z| 1.0 + f64::from((z * 7) % 11)).collect();
        let layer = |layer, depths| LayerDepths { layer, depths };
        let layers = [layer(Layer::IsOs, (9, 11)), layer(Layer::Tips, (15, 18))];
        let peak = |depth_px, label| Peak { depth_px, label };
        let figure = DepthProfile {
            label: "21 sweeps",
            amplitude: &amplitude,
            first_depth_px: 0.0,
            depth_px_um: Some(5.1),
            layers: &layers,
            peaks: &[peak(10.0, "IS/OS"), peak(16.0, "tips"), peak(17.0, "RPE"), peak(99.0, "no")],
        };
        let svg = figure.draw().svg().unwrap();
        let texts = ["21 sweeps", "IS/OS, z 9 to 11", "outer-segment tips, z 15 to 18", ">RPE<"];
        for text in texts.into_iter().chain(["depth z / px (1 px = 5.10 µm)", "amplitude / dB"]) {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains(">no<"));
        let peaks = figure.inside(Rect::new(0.0, 0.0, 760.0, 1.0));
        assert_eq!(figure.levels(&peaks), [0, 0, 1]);
    }

    #[test]
    fn odd_profiles_are_drawn() {
        let nan = f64::NAN;
        for amplitude in [&[][..], &[nan], &[0.0, -1.0], &[f64::INFINITY, 1.0, nan]] {
            for first_depth_px in [0.0, nan] {
                let figure = DepthProfile {
                    label: "",
                    amplitude,
                    first_depth_px,
                    depth_px_um: Some(nan),
                    layers: &[LayerDepths { layer: Layer::Tips, depths: (usize::MAX, 2) }],
                    peaks: &[Peak { depth_px: nan, label: "" }, Peak { depth_px: 0.0, label: "a" }],
                };
                assert!(figure.draw().png().is_ok());
            }
        }
    }
}
