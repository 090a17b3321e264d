//! Magnitude and phase of cross-spectra side by side, with the two ways through them (the paper's
//! Figure 1, b-g).

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, Stroke, TextStyle};
use super::colormap::{ColorMap, Rgb, phase_position};
use super::geometry::Rect;
use super::keys;
use super::method::{direct, path, walk};
use super::raster::{Rgb8, percentiles};
use super::scale::Span;
use super::style;
use ndarray::ArrayView2;
use num_complex::Complex32;

/// C(t, Δt) under one condition.
#[derive(Clone, Debug)]
pub struct CrossSpectrum<'a> {
    /// Heading, such as `no decorrelation`.
    pub label: &'a str,
    /// Second line, such as `σ = 0`.
    pub note: &'a str,
    /// C, axes (t, Δt); 0 or NaN where t + Δt lies behind the last frame.
    pub values: ArrayView2<'a, Complex32>,
}

/// The figure: a row of magnitudes, each on a scale of its own, and a row of phases.
#[derive(Clone, Debug)]
pub struct CrossSpectra<'a> {
    /// Conditions, from left to right.
    pub columns: Vec<CrossSpectrum<'a>>,
    /// Frames per drawn step of the walk.
    pub step: usize,
}

const SIDE: f64 = 300.0;
const LEFT: f64 = 76.0;
const TOP: f64 = 92.0;
const GAP_X: f64 = 26.0;
const GAP_Y: f64 = 34.0;
const RIGHT: f64 = 104.0;
const BELOW: f64 = 50.0;

impl CrossSpectra<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let across = self.columns.len().max(1) as f64;
        let (width, height) =
            (LEFT + across * (SIDE + GAP_X) - GAP_X + RIGHT, TOP + 2.0 * SIDE + GAP_Y + BELOW);
        let mut canvas = Canvas::new(width, height, "Magnitude and phase of the cross-spectrum");
        for (n, column) in self.columns.iter().enumerate() {
            heading(&mut canvas, panel(0, n), column);
            self.draw_panel(&mut canvas, (0, n), magnitude(column.values), column);
            self.draw_panel(&mut canvas, (1, n), phase(column.values), column);
        }
        self.draw_keys(&mut canvas);
        canvas
    }

    fn draw_panel(
        &self,
        canvas: &mut Canvas,
        (row, n): (usize, usize),
        image: Rgb8,
        column: &CrossSpectrum<'_>,
    ) {
        let area = panel(row, n);
        canvas.image(area, image);
        let (frames, lags) = column.values.dim();
        let range = |count: usize| Span::new(0.0, count.max(1) as f64);
        let axes = Axes::new(area, range(frames), range(lags));
        axes.x_axis(canvas, (row == 1).then_some("time t / frames"));
        axes.y_axis(canvas, (n == 0).then_some("time difference Δt / frames"));
        axes.frame(canvas);
        // A large magnitude is as white as the page: where the spectrum ends must be seen.
        let end = [(0.0, lags as f64), (frames as f64, 0.0)];
        axes.curve(canvas, end, Stroke::solid(style::FAINT, 1.0));
        if let Some(last) = frames.checked_sub(1).filter(|&last| last > 0) {
            path(canvas, &axes, &direct(last), style::DIRECT);
            path(canvas, &axes, &walk(last, self.step), style::EXTENDED);
        }
        let letter = TextStyle::new(style::HEADING, Anchor::End).bold();
        let name = ["b", "c", "d", "e", "f", "g"].get(row * self.columns.len() + n);
        canvas.text((area.right() - 10.0, area.y + 22.0), name.unwrap_or(&""), letter);
    }

    fn draw_keys(&self, canvas: &mut Canvas) {
        let ways =
            [("direct difference", style::DIRECT), ("Knox\u{2013}Thompson", style::EXTENDED)];
        let entries = ways.map(|(name, color)| (name, Stroke::solid(color, 3.0)));
        keys::line_key(canvas, (LEFT, 22.0), &entries);
        let right = panel(0, self.columns.len().saturating_sub(1)).right() + 20.0;
        let bar = |row| Rect::new(right, panel(row, 0).y + 24.0, 16.0, SIDE - 24.0);
        let labels = ["0", "largest"];
        keys::color_bar(canvas, bar(0), ColorMap::Grey, &labels, "magnitude");
        keys::phase_bar(canvas, bar(1));
    }
}

fn panel(row: usize, column: usize) -> Rect {
    let x = LEFT + column as f64 * (SIDE + GAP_X);
    Rect::new(x, TOP + row as f64 * (SIDE + GAP_Y), SIDE, SIDE)
}

fn heading(canvas: &mut Canvas, area: Rect, column: &CrossSpectrum<'_>) {
    let bold = TextStyle::new(style::HEADING, Anchor::Start).bold();
    canvas.text((area.x, area.y - 28.0), column.label, bold);
    let plain = TextStyle::new(style::TEXT, Anchor::Start).colored(style::FAINT);
    canvas.text((area.x, area.y - 9.0), column.note, plain);
}

/// Black where |C| is 0, white at nearly its largest.
fn magnitude(values: ArrayView2<'_, Complex32>) -> Rgb8 {
    let magnitudes = values.mapv(|c| if is_there(c) { c.norm() } else { f32::NAN });
    let (_, largest) = percentiles(&[magnitudes.view()], 0.0, 0.995);
    image(values, |c| ColorMap::Grey.at(c.norm() / largest))
}

fn phase(values: ArrayView2<'_, Complex32>) -> Rgb8 {
    image(values, |c| ColorMap::Phase.at(phase_position(c.arg())))
}

/// t to the right, Δt upwards; white where there is nothing.
fn image(values: ArrayView2<'_, Complex32>, color: impl Fn(Complex32) -> Rgb) -> Rgb8 {
    let (frames, lags) = values.dim();
    let at = |place| {
        let c: Complex32 = values[place];
        if is_there(c) { color(c) } else { style::PAPER }
    };
    let places = (0..lags).rev().flat_map(|lag| (0..frames).map(move |t| [t, lag]));
    Rgb8 { width: frames, height: lags, pixels: places.flat_map(at).collect() }
}

fn is_there(c: Complex32) -> bool {
    c.norm() > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    fn figure(values: &Array2<Complex32>) -> Canvas {
        let column = CrossSpectrum { label: "averaged", note: "σ = λ/16", values: values.view() };
        CrossSpectra { columns: vec![column; 3], step: 3 }.draw()
    }

    #[test]
    fn magnitudes_lie_above_phases() {
        let values = Array2::from_shape_fn((20, 20), |(t, lag)| match t + lag < 20 {
            true => Complex32::from_polar(2.0, lag as f32 * 0.3),
            false => Complex32::new(0.0, 0.0),
        });
        let canvas = figure(&values);
        let svg = canvas.svg().unwrap();
        for text in ["averaged", "magnitude", "phase / rad", ">b<", ">g<", "direct difference"] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(magnitude(values.view()).pixels[57..60], style::PAPER);
        assert!(canvas.png().is_ok());
    }

    #[test]
    fn empty_spectra_are_drawn() {
        for size in [0, 1] {
            assert!(figure(&Array2::zeros((size, size))).png().is_ok());
        }
    }
}
