//! The method in one picture: a long jump through the cross-spectrum against a walk of short steps.

use ndarray::ArrayView2;
use num_complex::Complex32;

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, Stroke, TextStyle};
use super::colormap::{ColorMap, Rgb, phase_position};
use super::geometry::{Point, Rect};
use super::keys;
use super::raster::{Rgb8, percentiles};
use super::scale::Span;
use super::style;

/// What the picture is made of: one pixel's cross-spectrum, the averaged one, and what follows.
#[derive(Clone, Debug)]
pub struct Method<'a> {
    /// C(t, Δt) without averaging, axes (t, Δt); 0 or NaN where t + Δt lies behind the last frame.
    pub single: ArrayView2<'a, Complex32>,
    /// ⟨C(t, Δt)⟩ averaged over an ensemble, axes (t, Δt).
    pub averaged: ArrayView2<'a, Complex32>,
    /// The phase that was put in, radians.
    pub truth: &'a [f64],
    /// Phase difference to the first frame.
    pub direct: &'a [f64],
    /// Phase by walking through the averaged cross-spectrum.
    pub walked: &'a [f64],
    /// Frames per drawn step of the walk: inside the valid band, large enough to be seen.
    pub step: usize,
    /// Range of the curves; by truth and walk when absent.
    pub range: Option<(f64, f64)>,
}

const SIDE: f64 = 330.0;
const TOP: f64 = 74.0;
const SINGLE_X: f64 = 72.0;
const AVERAGED_X: f64 = SINGLE_X + SIDE + 28.0;
const BAR_X: f64 = AVERAGED_X + SIDE + 20.0;
const CURVES_X: f64 = BAR_X + 16.0 + 112.0;
const CURVES_WIDTH: f64 = 380.0;

impl Method<'_> {
    /// Draws the picture.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let (width, height) = (CURVES_X + CURVES_WIDTH + 20.0, TOP + SIDE + 50.0);
        let title = "Phase beyond the correlation time: a long jump through the cross-spectrum \
                     lands in noise, a walk of short averaged steps arrives";
        let mut canvas = Canvas::new(width, height, title);
        self.draw_single(&mut canvas);
        self.draw_averaged(&mut canvas);
        self.draw_curves(&mut canvas);
        let bar = Rect::new(BAR_X, TOP + 24.0, 16.0, SIDE - 24.0);
        keys::phase_bar(&mut canvas, bar);
        canvas
    }

    fn draw_single(&self, canvas: &mut Canvas) {
        let area = Rect::new(SINGLE_X, TOP, SIDE, SIDE);
        heading(canvas, area, "One pixel", "Two frames compared: speckle noise everywhere");
        let axes = spectrum(canvas, area, self.single);
        axes.y_axis(canvas, Some("time difference Δt / frames"));
        let lines = [("phase of U(t)·U*(t+Δt)", style::INK), ("pale where weak", style::FAINT)];
        note(canvas, &axes, &lines);
    }

    fn draw_averaged(&self, canvas: &mut Canvas) {
        let area = Rect::new(AVERAGED_X, TOP, SIDE, SIDE);
        heading(
            canvas,
            area,
            "Averaged over pixels",
            "Small Δt: the noise cancels, the motion stays",
        );
        let axes = spectrum(canvas, area, self.averaged);
        axes.y_axis(canvas, None);
        let last = self.averaged.nrows().saturating_sub(1);
        if last > 0 {
            path(canvas, &axes, &direct(last), style::DIRECT);
            path(canvas, &axes, &walk(last, self.step), style::EXTENDED);
        }
        let lines = [
            ("phase of ⟨U(t)·U*(t+Δt)⟩", style::INK),
            ("direct: one long jump", style::DIRECT),
            ("walk: short steps, added up", style::EXTENDED),
        ];
        note(canvas, &axes, &lines);
    }

    fn draw_curves(&self, canvas: &mut Canvas) {
        let area = Rect::new(CURVES_X, TOP, CURVES_WIDTH, SIDE);
        heading(canvas, area, "Phase over time", "The jump loses the motion, the walk follows it");
        let lengths = [self.truth, self.direct, self.walked].map(<[f64]>::len);
        let last = lengths.into_iter().max().unwrap_or(0).saturating_sub(1);
        let axes = Axes::new(area, Span::new(0.0, last as f64), self.span());
        let entries = [
            ("truth", self.truth, Stroke::dashed(style::TRUTH, 1.8)),
            ("direct", self.direct, Stroke::solid(style::DIRECT, 2.0)),
            ("walk", self.walked, Stroke::solid(style::EXTENDED, 2.4)),
        ];
        for n in [1, 2, 0] {
            let (_, values, stroke) = entries[n];
            let points = values.iter().enumerate().map(|(t, &v)| (t as f64, v));
            axes.curve(canvas, points, stroke);
        }
        axes.x_axis(canvas, Some("time t / frames"));
        axes.y_axis(canvas, Some("phase / rad"));
        axes.frame(canvas);
        let key = entries.map(|(label, _, stroke)| (label, stroke));
        keys::line_key(canvas, (area.x + 14.0, area.y + 18.0), &key);
    }

    /// Range of the curves, with room for the key above them.
    fn span(&self) -> Span {
        let data = || Span::of(self.truth.iter().chain(self.walked).copied());
        let span = self.range.map_or_else(data, |(low, high)| Span::new(low, high));
        let height = span.high - span.low;
        Span::new(span.low - 0.06 * height, span.high + 0.16 * height)
    }
}

/// A cross-spectrum as an image: phase as colour, magnitude as strength of the colour.
fn spectrum(canvas: &mut Canvas, area: Rect, values: ArrayView2<'_, Complex32>) -> Axes {
    let (frames, lags) = values.dim();
    canvas.image(area, image(values));
    let range = |count: usize| Span::new(0.0, count.max(1) as f64);
    let axes = Axes::new(area, range(frames), range(lags));
    axes.x_axis(canvas, Some("time t / frames"));
    axes.frame(canvas);
    axes
}

/// t to the right, Δt upwards; white where there is nothing.
fn image(values: ArrayView2<'_, Complex32>) -> Rgb8 {
    let (frames, lags) = values.dim();
    let magnitudes = values.mapv(|c| if c.norm() > 0.0 { c.norm() } else { f32::NAN });
    let (_, strong) = percentiles(&[magnitudes.view()], 0.0, 0.9);
    let color = |lag: usize, t: usize| {
        let magnitude = magnitudes[[t, lag]];
        if !magnitude.is_finite() {
            return style::PAPER;
        }
        let share = (magnitude / strong).clamp(0.12, 1.0);
        let color = ColorMap::Phase.at(phase_position(values[[t, lag]].arg()));
        style::tint(color, f64::from(share))
    };
    let places = (0..lags).rev().flat_map(|lag| (0..frames).map(move |t| (lag, t)));
    Rgb8 {
        width: frames,
        height: lags,
        pixels: places.flat_map(|(lag, t)| color(lag, t)).collect(),
    }
}

/// From frame 0 straight to the last frame.
pub(super) fn direct(last: usize) -> Vec<Point> {
    vec![(0.5, 0.5), (0.5, last as f64 + 0.5)]
}

/// Up to Δt = step, which reads the phase of that step, and down to where it has led.
pub(super) fn walk(last: usize, step: usize) -> Vec<Point> {
    let step = step.clamp(1, last.max(1));
    let mut points = vec![(0.5, 0.5)];
    for t in (0..last).step_by(step) {
        let reached = (t + step).min(last);
        points.push((t as f64 + 0.5, (reached - t) as f64 + 0.5));
        points.push((reached as f64 + 0.5, 0.5));
    }
    points
}

/// A path with a light edge, a dot at its start and a head at its end.
pub(super) fn path(canvas: &mut Canvas, axes: &Axes, points: &[Point], color: Rgb) {
    let places: Vec<_> = points.iter().map(|&p| axes.place(p)).collect();
    let (Some(&start), Some(&[before, end])) = (places.first(), places.last_chunk()) else {
        return;
    };
    canvas.disc(start, 6.0, style::PAPER);
    canvas.line(places.clone(), Stroke::solid(style::PAPER, 6.0));
    canvas.fill(head(before, end, 10.5), style::PAPER);
    canvas.disc(start, 4.5, color);
    canvas.line(places, Stroke::solid(color, 3.0));
    canvas.fill(head(before, end, 8.0), color);
}

/// A triangle around `end`, pointing away from `before`.
fn head(before: Point, end: Point, size: f64) -> [Point; 3] {
    let (dx, dy) = (end.0 - before.0, end.1 - before.1);
    let unit = size / dx.hypot(dy).max(f64::MIN_POSITIVE);
    let (dx, dy) = (dx * unit, dy * unit);
    let back = (end.0 - dx, end.1 - dy);
    let side = (-0.75 * dy, 0.75 * dx);
    [
        (end.0 + 0.5 * dx, end.1 + 0.5 * dy),
        (back.0 + side.0, back.1 + side.1),
        (back.0 - side.0, back.1 - side.1),
    ]
}

fn heading(canvas: &mut Canvas, area: Rect, title: &str, explanation: &str) {
    let bold = TextStyle::new(style::HEADING + 2.0, Anchor::Start).bold();
    canvas.text((area.x, area.y - 36.0), title, bold);
    let plain = TextStyle::new(style::TEXT, Anchor::Start).colored(style::FAINT);
    canvas.text((area.x, area.y - 13.0), explanation, plain);
}

/// Lines of text in the empty upper right corner, where t + Δt lies behind the last frame.
fn note(canvas: &mut Canvas, axes: &Axes, lines: &[(&str, Rgb)]) {
    for (n, &(line, color)) in lines.iter().enumerate() {
        let at = (axes.area.right() - 10.0, axes.area.y + 22.0 + 21.0 * n as f64);
        let mut text = TextStyle::new(style::TEXT, Anchor::End).colored(color);
        text.bold = color == style::DIRECT || color == style::EXTENDED;
        canvas.text(at, line, text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    fn figure<'a>(values: &'a Array2<Complex32>, curve: &'a [f64]) -> Method<'a> {
        Method {
            single: values.view(),
            averaged: values.view(),
            truth: curve,
            direct: curve,
            walked: curve,
            step: 4,
            range: None,
        }
    }

    #[test]
    fn the_picture_names_both_ways() {
        let values = Array2::from_shape_fn((20, 20), |(t, lag)| match t + lag < 20 {
            true => Complex32::from_polar(1.0, lag as f32 * 0.3),
            false => Complex32::new(f32::NAN, 0.0),
        });
        let svg = figure(&values, &[0.0, 1.0, 2.0]).draw().svg().unwrap();
        for text in ["direct: one long jump", "walk: short steps", "Δt / frames", "truth"] {
            assert!(svg.contains(text), "{text}");
        }
        let image = image(values.view());
        assert_eq!((image.width, image.height), (20, 20));
        assert_eq!(image.pixels[57..60], style::PAPER);
    }

    #[test]
    fn the_walk_ends_at_the_last_frame() {
        for step in [0, 1, 4, 7, 100] {
            assert_eq!(walk(19, step).last(), Some(&(19.5, 0.5)));
        }
    }

    #[test]
    fn empty_spectra_are_drawn() {
        for size in [0, 1, 2] {
            let values = Array2::zeros((size, size));
            assert!(figure(&values, &[f64::NAN]).draw().png().is_ok());
        }
    }
}
