//! Phase curves over time for several strengths of decorrelation (the paper's Figure 3).

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, Stroke, TextStyle};
use super::colormap::Rgb;
use super::geometry::Rect;
use super::keys;
use super::scale::Span;
use super::style::{self, tint};

/// A curve, one value per frame, NaN where it has none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Curve<'a> {
    /// The values.
    pub values: &'a [f64],
    /// Standard deviation of each value, drawn as a band.
    pub deviation: Option<&'a [f64]>,
}

/// One strength of decorrelation; phases in radians.
#[derive(Clone, Copy, Debug)]
pub struct CurveColumn<'a> {
    /// Heading, such as `σ = λ/32`.
    pub label: &'a str,
    /// The phase that was put in.
    pub truth: &'a [f64],
    /// Phase difference to the first frame.
    pub direct: Curve<'a>,
    /// One-step Knox-Thompson.
    pub one_step: Option<Curve<'a>>,
    /// Extended Knox-Thompson.
    pub extended: Curve<'a>,
    /// Amplitude of the autocorrelation by lag, 1 at lag 0.
    pub autocorrelation: Option<Curve<'a>>,
}

/// The figure: direct, walked, autocorrelation, one column per condition.
#[derive(Clone, Debug)]
pub struct Curves<'a> {
    /// Conditions, from left to right.
    pub columns: Vec<CurveColumn<'a>>,
    /// Range of the row of direct differences; by the data when absent.
    pub direct_range: Option<(f64, f64)>,
}

const LEFT: f64 = 86.0;
const TOP: f64 = 66.0;
const GAP_X: f64 = 20.0;
const GAP_Y: f64 = 58.0;
const RIGHT: f64 = 18.0;
/// Least width of a panel.
const WIDTH: f64 = 250.0;
const HEIGHT: f64 = 170.0;

const TRUTH: Stroke = Stroke { color: style::TRUTH, width: 1.5, dash: Some((6.0, 4.0)) };

impl Curves<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let rows = if self.has_autocorrelation() { 3 } else { 2 };
        let across = self.columns.len().max(1) as f64;
        let key = self.key();
        let width = across * (self.panel_width() + GAP_X) - GAP_X;
        let height = TOP + f64::from(rows) * (HEIGHT + GAP_Y);
        let title = "Phase curves by direct difference and by Knox-Thompson, and autocorrelation";
        let mut canvas = Canvas::new(LEFT + width + RIGHT, height, title);
        for (n, column) in self.columns.iter().enumerate() {
            self.draw_direct(&mut canvas, n, column);
            self.draw_walked(&mut canvas, n, column);
            self.draw_autocorrelation(&mut canvas, n, column);
        }
        keys::line_key(&mut canvas, (LEFT, 20.0), &key);
        canvas
    }

    fn draw_direct(&self, canvas: &mut Canvas, n: usize, column: &CurveColumn<'_>) {
        let axes = Axes::new(self.panel(0, n), self.frames(), self.direct_span());
        let text = TextStyle::new(style::HEADING, Anchor::Middle);
        canvas.text((axes.area.center().0, axes.area.y - 9.0), column.label, text);
        band(canvas, &axes, &column.direct, style::DIRECT);
        line(canvas, &axes, column.direct.values, Stroke::solid(style::DIRECT, 1.8));
        line(canvas, &axes, column.truth, TRUTH);
        self.finish(canvas, &axes, (0, n), ["frame", "direct phase / rad"]);
    }

    fn draw_walked(&self, canvas: &mut Canvas, n: usize, column: &CurveColumn<'_>) {
        let axes = Axes::new(self.panel(1, n), self.frames(), self.walked_span());
        if let Some(one_step) = &column.one_step {
            band(canvas, &axes, one_step, style::ONE_STEP);
        }
        band(canvas, &axes, &column.extended, style::EXTENDED);
        if let Some(one_step) = &column.one_step {
            line(canvas, &axes, one_step.values, Stroke::solid(style::ONE_STEP, 1.8));
        }
        line(canvas, &axes, column.extended.values, Stroke::solid(style::EXTENDED, 1.8));
        line(canvas, &axes, column.truth, TRUTH);
        self.finish(canvas, &axes, (1, n), ["frame", "walked phase / rad"]);
    }

    fn draw_autocorrelation(&self, canvas: &mut Canvas, n: usize, column: &CurveColumn<'_>) {
        let Some(curve) = &column.autocorrelation else {
            return;
        };
        let axes = Axes::new(self.panel(2, n), self.frames(), Span::new(0.0, 1.05));
        band(canvas, &axes, curve, style::INK);
        axes.level(canvas, 0.5, Stroke::dashed(style::FAINT, 1.0));
        line(canvas, &axes, curve.values, Stroke::solid(style::INK, 1.8));
        self.mark_half(canvas, &axes, curve.values);
        let first = self.columns.iter().position(|c| c.autocorrelation.is_some());
        let names = ["lag Δt / frames", "autocorrelation"];
        self.finish(canvas, &axes, (2, n - first.unwrap_or(0).min(n)), names);
    }

    /// Says at which lag the autocorrelation has fallen to one half.
    fn mark_half(&self, canvas: &mut Canvas, axes: &Axes, values: &[f64]) {
        let Some(lag) = half_lag(values) else {
            return;
        };
        let place = axes.place((lag, 0.5));
        canvas.disc(place, 3.5, style::INK);
        let text = format!("½ at {lag:.1} frames");
        let at = (axes.area.right() - 8.0, axes.area.y + 18.0);
        canvas.text(at, &text, TextStyle::new(style::SMALL, Anchor::End));
    }

    /// Ticks, titles, frame and letter; titles of the vertical axis only in the first panel.
    fn finish(&self, canvas: &mut Canvas, axes: &Axes, (row, n): (usize, usize), names: [&str; 2]) {
        axes.x_axis(canvas, Some(names[0]));
        axes.y_axis(canvas, (n == 0).then_some(names[1]));
        axes.frame(canvas);
        keys::outer_letter(canvas, axes.area, row * self.columns.len() + n);
    }

    fn panel(&self, row: usize, column: usize) -> Rect {
        let width = self.panel_width();
        let x = LEFT + column as f64 * (width + GAP_X);
        Rect::new(x, TOP + row as f64 * (HEIGHT + GAP_Y), width, HEIGHT)
    }

    /// Few panels are wide enough for the key above them.
    fn panel_width(&self) -> f64 {
        let across = self.columns.len().max(1) as f64;
        let room = keys::line_key_width(&self.key()) - (across - 1.0) * GAP_X;
        (room / across).max(WIDTH)
    }

    /// What the lines are.
    fn key(&self) -> Vec<(&'static str, Stroke)> {
        let mut entries = vec![
            ("truth", TRUTH),
            (style::DIRECT_NAME, Stroke::solid(style::DIRECT, 2.0)),
            (style::ONE_STEP_NAME, Stroke::solid(style::ONE_STEP, 2.0)),
            (style::EXTENDED_NAME, Stroke::solid(style::EXTENDED, 2.0)),
        ];
        if self.columns.iter().all(|column| column.one_step.is_none()) {
            entries.remove(2);
        }
        entries
    }

    fn has_autocorrelation(&self) -> bool {
        self.columns.iter().any(|column| column.autocorrelation.is_some())
    }

    /// Frames of the longest curve, the same in all panels.
    fn frames(&self) -> Span {
        let lengths = self.columns.iter().map(|column| {
            let curves = [column.truth, column.direct.values, column.extended.values];
            curves.map(<[f64]>::len).into_iter().max().unwrap_or(0)
        });
        Span::new(0.0, lengths.max().unwrap_or(0).saturating_sub(1) as f64)
    }

    fn direct_span(&self) -> Span {
        match self.direct_range {
            Some((low, high)) => Span::new(low, high),
            None => {
                let all = self.columns.iter().flat_map(|c| [c.direct, plain(c.truth)]);
                Span::of(all.flat_map(|curve| reach(&curve))).padded(0.06)
            }
        }
    }

    /// One range for all walked curves: made to hold truth and extended with their bands.
    fn walked_span(&self) -> Span {
        let all = self.columns.iter().flat_map(|c| {
            [c.extended, plain(c.truth), plain(c.one_step.unwrap_or_default().values)]
        });
        Span::of(all.flat_map(|curve| reach(&curve))).padded(0.06)
    }
}

fn plain(values: &[f64]) -> Curve<'_> {
    Curve { values, deviation: None }
}

/// Lower and upper edge of every value with its deviation.
fn reach(curve: &Curve<'_>) -> Vec<f64> {
    edges(curve).into_iter().flat_map(|(_, low, high)| [low, high]).collect()
}

/// `(frame, low, high)` of every value.
fn edges(curve: &Curve<'_>) -> Vec<(f64, f64, f64)> {
    let deviation = |n: usize| match curve.deviation {
        Some(deviation) => deviation.get(n).map_or(f64::NAN, |d| d.abs()),
        None => 0.0,
    };
    let values = curve.values.iter().enumerate();
    values.map(|(n, v)| (n as f64, v - deviation(n), v + deviation(n))).collect()
}

fn band(canvas: &mut Canvas, axes: &Axes, curve: &Curve<'_>, color: Rgb) {
    if curve.deviation.is_some() {
        axes.band(canvas, &edges(curve), tint(color, 0.25));
    }
}

fn line(canvas: &mut Canvas, axes: &Axes, values: &[f64], stroke: Stroke) {
    let points = values.iter().enumerate().map(|(n, &v)| (n as f64, v));
    axes.curve(canvas, points, stroke);
}

/// Lag at which the autocorrelation first falls to one half, between the frames.
fn half_lag(values: &[f64]) -> Option<f64> {
    let n = values.windows(2).position(|pair| pair[0] > 0.5 && pair[1] <= 0.5)?;
    Some(n as f64 + (values[n] - 0.5) / (values[n] - values[n + 1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_names_its_axes_and_marks_one_half() {
        let phase: Vec<f64> = (0..70).map(|n| f64::from(n) * 0.1).collect();
        let decay: Vec<f64> = phase.iter().map(|p| (-p).exp()).collect();
        let mut broken = phase.clone();
        broken[30] = f64::NAN;
        let curve = |values| Curve { values, deviation: Some(&decay) };
        let figure = Curves {
            columns: vec![CurveColumn {
                label: "σ = λ/32",
                truth: &phase,
                direct: curve(&broken),
                one_step: None,
                extended: curve(&phase),
                autocorrelation: Some(plain(&decay)),
            }],
            direct_range: Some((-4.0, 4.0)),
        };
        let svg = figure.draw().svg().unwrap();
        for text in ["σ = λ/32", "frame", "phase / rad", "½ at 6.9", ">c<"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("one-step"));
        assert!(figure.draw().png().is_ok());
    }

    #[test]
    fn empty_and_missing_curves_are_drawn() {
        let nan = [f64::NAN; 3];
        let column = |values| CurveColumn {
            label: "",
            truth: &[],
            direct: plain(values),
            one_step: Some(Curve::default()),
            extended: plain(values),
            autocorrelation: Some(plain(values)),
        };
        let figure = Curves { columns: vec![column(&nan), column(&[])], direct_range: None };
        assert!(figure.draw().png().is_ok());
    }
}
