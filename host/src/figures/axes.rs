//! A pair of axes: values to places, ticks, titles, curves and bands clipped to the frame.

use super::canvas::{Anchor, Canvas, Stroke, TextStyle, font};
use super::colormap::Rgb;
use super::geometry::{Point, Rect};
use super::scale::{Span, Tick};
use super::style;

/// Length of a tick.
const TICK: f64 = 4.0;

/// A frame and the ranges along its sides.
#[derive(Clone, Copy, Debug)]
pub struct Axes {
    /// The frame.
    pub area: Rect,
    /// Range from left to right.
    pub x: Span,
    /// Range from the bottom upwards.
    pub y: Span,
}

impl Axes {
    /// Axes over a frame.
    #[must_use]
    pub fn new(area: Rect, x: Span, y: Span) -> Self {
        Self { area, x, y }
    }

    /// Place of a pair of values.
    #[must_use]
    pub fn place(&self, (x, y): Point) -> Point {
        (
            self.area.x + self.x.position(x) * self.area.w,
            self.area.bottom() - self.y.position(y) * self.area.h,
        )
    }

    /// The frame itself; drawn last, it hides the ends of the curves.
    pub fn frame(&self, canvas: &mut Canvas) {
        canvas.outline(self.area, Stroke::solid(style::INK, 1.0));
    }

    /// Round ticks below the frame, with numbers and a title unless another panel below has them.
    pub fn x_axis(&self, canvas: &mut Canvas, title: Option<&str>) {
        let ticks = self.x.ticks((self.area.w / 55.0) as usize);
        self.x_ticks(canvas, &ticks, title);
    }

    /// Given ticks below the frame.
    pub fn x_ticks(&self, canvas: &mut Canvas, ticks: &[Tick], title: Option<&str>) {
        let bottom = self.area.bottom();
        let note = TextStyle::new(style::SMALL, Anchor::Middle);
        for tick in ticks {
            let (x, _) = self.place((tick.value, self.y.low));
            canvas.line([(x, bottom), (x, bottom + TICK)], Stroke::solid(style::INK, 1.0));
            if title.is_some() {
                canvas.text((x, bottom + 17.0), &tick.label, note);
            }
        }
        if let Some(title) = title {
            let at = (self.area.center().0, bottom + 35.0);
            canvas.text(at, title, TextStyle::new(style::TEXT, Anchor::Middle));
        }
    }

    /// Round ticks left of the frame, with numbers and a title unless the panel beside has them.
    pub fn y_axis(&self, canvas: &mut Canvas, title: Option<&str>) {
        let ticks = self.y.ticks((self.area.h / 28.0) as usize);
        self.y_ticks(canvas, &ticks, title);
    }

    /// Given ticks left of the frame.
    pub fn y_ticks(&self, canvas: &mut Canvas, ticks: &[Tick], title: Option<&str>) {
        let left = self.area.x;
        let note = TextStyle::new(style::SMALL, Anchor::End);
        for tick in ticks {
            let (_, y) = self.place((self.x.low, tick.value));
            canvas.line([(left - TICK, y), (left, y)], Stroke::solid(style::INK, 1.0));
            if title.is_some() {
                canvas.label((left - 7.0, y), &tick.label, note);
            }
        }
        if let Some(title) = title {
            let widths = ticks.iter().map(|tick| font::width(&tick.label, style::SMALL, false));
            let at = (left - widths.fold(24.0, f64::max) - 20.0, self.area.center().1);
            canvas.label(at, title, TextStyle::new(style::TEXT, Anchor::Middle).upright());
        }
    }

    /// Round ticks left of the frame, counted downwards as the rows of an image.
    pub fn y_down_axis(&self, canvas: &mut Canvas, title: Option<&str>) {
        self.y_ticks(canvas, &self.y.ticks_down((self.area.h / 30.0) as usize), title);
    }

    /// Round ticks right of the frame, counted downwards.
    pub fn y_down_axis_right(&self, canvas: &mut Canvas, title: &str) {
        let ticks = self.y.ticks_down((self.area.h / 30.0) as usize);
        let placed = ticks.iter().map(|tick| (self.place((self.x.high, tick.value)).1, tick));
        self.right_ticks(canvas, placed, title);
    }

    /// Round ticks right of the frame, for the values times `factor`, with numbers and a title.
    pub fn right_axis(&self, canvas: &mut Canvas, factor: f64, title: &str) {
        let scaled = Span::new(self.y.low * factor, self.y.high * factor);
        let ticks = scaled.ticks((self.area.h / 28.0) as usize);
        let height = |value| self.area.bottom() - scaled.position(value) * self.area.h;
        self.right_ticks(canvas, ticks.iter().map(|tick| (height(tick.value), tick)), title);
    }

    /// Ticks at given heights right of the frame.
    fn right_ticks<'t>(
        &self,
        canvas: &mut Canvas,
        ticks: impl Iterator<Item = (f64, &'t Tick)>,
        title: &str,
    ) {
        let right = self.area.right();
        let note = TextStyle::new(style::SMALL, Anchor::Start);
        for (y, tick) in ticks {
            canvas.line([(right, y), (right + TICK, y)], Stroke::solid(style::INK, 1.0));
            canvas.label((right + 7.0, y), &tick.label, note);
        }
        let at = (right + 50.0, self.area.center().1);
        canvas.label(at, title, TextStyle::new(style::TEXT, Anchor::Middle).upright());
    }

    /// A line across the frame at one value.
    pub fn level(&self, canvas: &mut Canvas, value: f64, stroke: Stroke) {
        let ends = [(self.x.low, value), (self.x.high, value)];
        self.curve(canvas, ends, stroke);
    }

    /// A curve, broken where it has no value and cut at the frame.
    pub fn curve(
        &self,
        canvas: &mut Canvas,
        values: impl IntoIterator<Item = Point>,
        stroke: Stroke,
    ) {
        let points: Vec<_> = values.into_iter().map(|value| self.place(value)).collect();
        for piece in self.area.clip_curve(&points) {
            canvas.line(piece, stroke);
        }
    }

    /// Dots, those outside the frame left out.
    pub fn dots(&self, canvas: &mut Canvas, values: impl IntoIterator<Item = Point>, color: Rgb) {
        for point in values.into_iter().map(|value| self.place(value)) {
            if self.area.clip(point, point).is_some() {
                canvas.disc(point, 1.6, color);
            }
        }
    }

    /// The area between two curves `(x, low, high)`, cut at the frame.
    pub fn band(&self, canvas: &mut Canvas, values: &[(f64, f64, f64)], color: Rgb) {
        let inside = |y: f64| y.clamp(self.y.low, self.y.high);
        let known = |v: &(f64, f64, f64)| v.0.is_finite() && v.1.is_finite() && v.2.is_finite();
        for run in values.split(|value| !known(value)).filter(|run| run.len() > 1) {
            let lower = run.iter().map(|&(x, low, _)| (x, inside(low)));
            let upper = run.iter().rev().map(|&(x, _, high)| (x, inside(high)));
            let edge: Vec<_> = lower.chain(upper).map(|value| self.place(value)).collect();
            canvas.fill(edge, color);
        }
    }
}
