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
    /// Linked phases.
    pub linked: Option<Curve<'a>>,
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
    /// A row for each walk, so that their bands do not hide each other, instead of one for all.
    pub apart: bool,
}

/// How a phase was obtained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    Direct,
    OneStep,
    Extended,
    Linked,
}

impl Line {
    /// In the order they are drawn.
    const WALKS: [Self; 3] = [Self::OneStep, Self::Extended, Self::Linked];

    fn of<'a>(self, column: &CurveColumn<'a>) -> Option<Curve<'a>> {
        match self {
            Self::Direct => Some(column.direct),
            Self::OneStep => column.one_step,
            Self::Extended => Some(column.extended),
            Self::Linked => column.linked,
        }
    }

    fn look(self) -> (&'static str, Rgb) {
        match self {
            Self::Direct => (style::DIRECT_NAME, style::DIRECT),
            Self::OneStep => (style::ONE_STEP_NAME, style::ONE_STEP),
            Self::Extended => (style::EXTENDED_NAME, style::EXTENDED),
            Self::Linked => (style::LINKED_NAME, style::LINKED),
        }
    }

    /// Title of the vertical axis of a row of its own.
    fn axis(self) -> &'static str {
        match self {
            Self::Direct => "direct phase / rad",
            Self::OneStep => "one-step phase / rad",
            Self::Extended => "extended phase / rad",
            Self::Linked => "linked phase / rad",
        }
    }
}

/// A row of panels with phases.
struct Row {
    lines: Vec<Line>,
    axis: &'static str,
    span: Span,
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
        let rows = self.rows();
        let count = rows.len() + usize::from(self.has_autocorrelation());
        let across = self.columns.len().max(1) as f64;
        let width = across * (self.panel_width() + GAP_X) - GAP_X;
        let height = TOP + count as f64 * (HEIGHT + GAP_Y);
        let title = "Phase curves by direct difference and by Knox-Thompson, and autocorrelation";
        let mut canvas = Canvas::new(LEFT + width + RIGHT, height, title);
        for (n, column) in self.columns.iter().enumerate() {
            for (place, row) in rows.iter().enumerate() {
                self.draw_phases(&mut canvas, (place, n), row, column);
            }
            let heading = TextStyle::new(style::HEADING, Anchor::Middle);
            let area = self.panel(0, n);
            canvas.text((area.center().0, area.y - 9.0), column.label, heading);
            self.draw_autocorrelation(&mut canvas, (rows.len(), n), column);
        }
        keys::line_key(&mut canvas, (LEFT, 20.0), &self.key());
        canvas
    }

    /// The rows of phases, from the top.
    fn rows(&self) -> Vec<Row> {
        let walks = Line::WALKS.into_iter().filter(|&line| self.has(line));
        let direct = Line::Direct;
        let mut rows =
            vec![Row { lines: vec![direct], axis: direct.axis(), span: self.direct_span() }];
        let span = self.walked_span();
        if self.apart {
            rows.extend(walks.map(|line| Row { lines: vec![line], axis: line.axis(), span }));
        } else {
            rows.push(Row { lines: walks.collect(), axis: "walked phase / rad", span });
        }
        rows
    }

    fn has(&self, line: Line) -> bool {
        self.columns.iter().any(|column| line.of(column).is_some())
    }

    fn draw_phases(
        &self,
        canvas: &mut Canvas,
        place: (usize, usize),
        row: &Row,
        column: &CurveColumn<'_>,
    ) {
        let axes = Axes::new(self.panel(place.0, place.1), self.frames(), row.span);
        let curves = row.lines.iter().filter_map(|line| Some((line.of(column)?, line.look().1)));
        let curves: Vec<_> = curves.collect();
        for (curve, color) in &curves {
            band(canvas, &axes, curve, *color);
        }
        for (curve, color) in &curves {
            line(canvas, &axes, curve.values, Stroke::solid(*color, 1.8));
        }
        line(canvas, &axes, column.truth, TRUTH);
        self.finish(canvas, &axes, place, ["frame", row.axis]);
    }

    fn draw_autocorrelation(
        &self,
        canvas: &mut Canvas,
        (row, n): (usize, usize),
        column: &CurveColumn<'_>,
    ) {
        let Some(curve) = &column.autocorrelation else {
            return;
        };
        let axes = Axes::new(self.panel(row, n), self.frames(), Span::new(0.0, 1.05));
        band(canvas, &axes, curve, style::INK);
        axes.level(canvas, 0.5, Stroke::dashed(style::FAINT, 1.0));
        line(canvas, &axes, curve.values, Stroke::solid(style::INK, 1.8));
        self.mark_half(canvas, &axes, curve.values);
        let first = self.columns.iter().position(|c| c.autocorrelation.is_some());
        let names = ["lag Δt / frames", "autocorrelation"];
        self.finish(canvas, &axes, (row, n - first.unwrap_or(0).min(n)), names);
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
        let lines = [Line::Direct].into_iter().chain(Line::WALKS).filter(|&line| self.has(line));
        let entry = |line: Line| {
            let (name, color) = line.look();
            (name, Stroke::solid(color, 2.0))
        };
        std::iter::once(("truth", TRUTH)).chain(lines.map(entry)).collect()
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

    /// One range for all walked curves: made to hold truth, and extended and linked with their bands.
    fn walked_span(&self) -> Span {
        let all = self.columns.iter().flat_map(|c| {
            let one_step = plain(c.one_step.unwrap_or_default().values);
            [c.extended, c.linked.unwrap_or_default(), plain(c.truth), one_step]
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

/// Lag at which the autocorrelation first falls to one half, between the frames; none if it never does.
#[must_use]
pub fn half_lag(values: &[f64]) -> Option<f64> {
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
                linked: None,
                autocorrelation: Some(plain(&decay)),
            }],
            direct_range: Some((-4.0, 4.0)),
            apart: false,
        };
        let svg = figure.draw().svg().unwrap();
        for text in ["σ = λ/32", "frame", "phase / rad", "½ at 6.9", ">c<"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("one-step"));
        assert!(figure.draw().png().is_ok());
    }

    #[test]
    fn walks_apart_have_a_row_each() {
        let phase = [0.0, 1.0, 2.0];
        let column = CurveColumn {
            label: "σ = 0",
            truth: &phase,
            direct: plain(&phase),
            one_step: Some(plain(&phase)),
            extended: plain(&phase),
            linked: Some(plain(&phase)),
            autocorrelation: None,
        };
        let mut figure = Curves { columns: vec![column], direct_range: None, apart: true };
        let apart = figure.draw();
        let svg = apart.svg().unwrap();
        for text in ["one-step phase / rad", "linked phase / rad", "linked phases", ">d<"] {
            assert!(svg.contains(text), "{text}");
        }
        figure.apart = false;
        assert!(figure.draw().size().1 < apart.size().1 - 2.0 * HEIGHT);
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
            linked: None,
            autocorrelation: Some(plain(values)),
        };
        let columns = vec![column(&nan), column(&[])];
        let figure = Curves { columns, direct_range: None, apart: false };
        assert!(figure.draw().png().is_ok());
    }
}
