//! One phase curve with its standard deviation, the direct difference beside it (the curve that
//! goes with the paper's Figure 4).

use std::f64::consts::PI;

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, Stroke, TextStyle};
use super::colormap::Rgb;
use super::geometry::Rect;
use super::keys;
use super::scale::Span;
use super::style;

/// The curve of a region; phases in radians, NaN where a frame has none.
#[derive(Clone, Copy, Debug)]
pub struct PhaseCurve<'a> {
    /// Heading, such as `V.zarr: 1,204 pixels less 1,310 of the control`.
    pub label: &'a str,
    /// What the method is called, and its colour.
    pub method: (&'a str, Rgb),
    /// Acquisition times, in ascending order.
    pub times: &'a [f64],
    /// Title of the time axis, such as `time / s`.
    pub time_axis: &'a str,
    /// Phase of each frame.
    pub phase: &'a [f64],
    /// Its standard deviation.
    pub sigma: &'a [f64],
    /// The phase by direct difference, unless that is the method.
    pub direct: Option<&'a [f64]>,
    /// When the stimulus began.
    pub onset: Option<f64>,
    /// Optical path length of one radian, for the axis on the right.
    pub nm_per_rad: Option<f64>,
}

const AREA: Rect = Rect { x: 80.0, y: 88.0, w: 600.0, h: 320.0 };
/// Room for the axis on the right.
const RIGHT: f64 = 76.0;
const DIRECT: Stroke = Stroke { color: style::DIRECT, width: 1.4, dash: Some((5.0, 3.0)) };

impl PhaseCurve<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let title = "Phase over time";
        let mut canvas = Canvas::new(AREA.right() + RIGHT, AREA.bottom() + 50.0, title);
        let heading = TextStyle::new(style::TEXT, Anchor::Start);
        canvas.text((AREA.x, 24.0), self.label, heading);
        keys::line_key(&mut canvas, (AREA.x, 46.0), &self.key());
        let axes = Axes::new(AREA, Span::of(self.times.iter().copied()), self.span());
        self.draw_curves(&mut canvas, &axes);
        axes.x_axis(&mut canvas, Some(self.time_axis));
        axes.y_axis(&mut canvas, Some("phase / rad"));
        if let Some(nm) = self.nm_per_rad {
            axes.right_axis(&mut canvas, nm, "optical path length / nm");
        }
        axes.frame(&mut canvas);
        canvas
    }

    fn draw_curves(&self, canvas: &mut Canvas, axes: &Axes) {
        let band = self.times.iter().zip(self.phase).zip(self.sigma);
        let band: Vec<_> = band.map(|((&t, phase), s)| (t, phase - s, phase + s)).collect();
        axes.band(canvas, &band, style::tint(self.method.1, 0.25));
        axes.level(canvas, 0.0, Stroke::solid(style::FAINT, 0.8));
        self.draw_onset(canvas, axes);
        let points = |values| self.times.iter().copied().zip(copied(values));
        if let Some(direct) = self.direct {
            axes.curve(canvas, points(direct), DIRECT);
            axes.dots(canvas, points(direct), DIRECT.color);
        }
        axes.curve(canvas, points(self.phase), self.stroke());
        // A frame between two bad ones has no line.
        axes.dots(canvas, points(self.phase), self.method.1);
    }

    fn draw_onset(&self, canvas: &mut Canvas, axes: &Axes) {
        let Some(onset) = self.onset.filter(|&t| (0.0..=1.0).contains(&axes.x.position(t))) else {
            return;
        };
        let ends = [(onset, axes.y.low), (onset, axes.y.high)];
        axes.curve(canvas, ends, Stroke::dashed(style::INK, 1.0));
        let (x, _) = axes.place((onset, 0.0));
        let note = TextStyle::new(style::SMALL, Anchor::Middle);
        canvas.text((x.clamp(AREA.x + 24.0, AREA.right() - 24.0), AREA.y - 7.0), "stimulus", note);
    }

    fn stroke(&self) -> Stroke {
        Stroke::solid(self.method.1, 2.0)
    }

    fn key(&self) -> Vec<(&str, Stroke)> {
        let mut entries = vec![(self.method.0, self.stroke())];
        entries.extend(self.direct.map(|_| (style::DIRECT_NAME, DIRECT)));
        entries
    }

    /// Holds both curves, and the band where it says anything: a frame that nothing measures has a
    /// deviation of hundreds of radians.
    fn span(&self) -> Span {
        let known = self.phase.iter().zip(self.sigma).filter(|(_, sigma)| **sigma < PI);
        let band = known.flat_map(|(phase, sigma)| [phase - sigma, phase + sigma]);
        let direct = self.direct.into_iter().flat_map(copied);
        Span::of(band.chain(copied(self.phase)).chain(direct)).padded(0.06)
    }
}

fn copied(values: &[f64]) -> std::iter::Copied<std::slice::Iter<'_, f64>> {
    values.iter().copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMES: [f64; 5] = [0.0, 1.0, 2.0, 3.0, 4.0];

    fn figure<'a>(phase: &'a [f64], sigma: &'a [f64]) -> PhaseCurve<'a> {
        PhaseCurve {
            label: "120 pixels",
            method: (style::EXTENDED_NAME, style::EXTENDED),
            times: &TIMES,
            time_axis: "time / s",
            phase,
            sigma,
            direct: Some(phase),
            onset: Some(1.5),
            nm_per_rad: Some(67.0),
        }
    }

    #[test]
    fn axes_and_curves_are_named() {
        let phase = [0.0, 0.1, f64::NAN, 0.3, 1.0];
        let svg = figure(&phase, &[0.1; 5]).draw().svg().unwrap();
        let words = ["120 pixels", "time / s", "phase / rad", "path length / nm", "stimulus"];
        for text in words.into_iter().chain([style::EXTENDED_NAME, style::DIRECT_NAME]) {
            assert!(svg.contains(text), "{text}");
        }
        let plain = PhaseCurve {
            direct: None,
            onset: Some(9.0),
            nm_per_rad: None,
            ..figure(&phase, &phase)
        };
        let svg = plain.draw().svg().unwrap();
        for text in ["stimulus", " nm", style::DIRECT_NAME] {
            assert!(!svg.contains(text), "{text}");
        }
    }

    #[test]
    fn a_frame_that_nothing_measures_does_not_set_the_scale() {
        let span =
            figure(&[0.0, 0.1, 0.2, 0.3, 0.4], &[0.1, 0.1, 707.0, f64::INFINITY, 0.1]).span();
        assert!(span.low > -1.0 && span.high < 1.0, "{span:?}");
    }

    #[test]
    fn odd_curves_are_drawn() {
        let nan = [f64::NAN; 5];
        assert!(figure(&nan, &nan).draw().png().is_ok());
        assert!(PhaseCurve { times: &[], ..figure(&[], &[]) }.draw().png().is_ok());
    }
}
