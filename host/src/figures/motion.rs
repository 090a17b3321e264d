//! Where every sweep lies relative to the first: shifts, rotation, and the sweeps left out.

use ndarray::ArrayView2;

use super::axes::Axes;
use super::canvas::{Canvas, Stroke};
use super::colormap::Rgb;
use super::geometry::Rect;
use super::keys;
use super::scale::Span;
use super::style;
use super::verdicts;

/// The figure; every array has an entry per sweep.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// Shifts in pixels, axes (sweep, 3): z, y, x; NaN where there is none.
    pub shift_px: ArrayView2<'a, f64>,
    /// Rotation about the image centre in radians; empty where it was not looked for.
    pub rotation_rad: &'a [f64],
    /// `ok`, or why the sweep was left out.
    pub verdicts: &'a [String],
}

const LEFT: f64 = 74.0;
const TOP: f64 = 40.0;
const WIDTH: f64 = 820.0;
const HEIGHT: f64 = 290.0;
const ROTATION_HEIGHT: f64 = 150.0;
const GAP: f64 = 18.0;
const RIGHT: f64 = 20.0;
/// Below the lowest panel: its axis.
const FOOT: f64 = 52.0;
/// Names and colours of the shifts, in the order of the array.
const KEY: [(&str, Rgb); 3] =
    [("depth dz", style::AXES[0]), ("row dy", style::AXES[1]), ("column dx", style::AXES[2])];

impl Motion<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let lines = verdicts::lines(self.verdicts, WIDTH);
        let bottom = self.panels().1.unwrap_or(self.panels().0).bottom();
        let height = bottom + FOOT + verdicts::height(&lines);
        let title = "Motion: shift and rotation of every sweep relative to the first";
        let mut canvas = Canvas::new(LEFT + WIDTH + RIGHT, height, title);
        self.draw_shifts(&mut canvas);
        self.draw_rotation(&mut canvas);
        let key = KEY.map(|(name, color)| (name, Stroke::solid(color, 1.8)));
        keys::line_key(&mut canvas, (LEFT, 22.0), &key);
        verdicts::list(&mut canvas, (LEFT, bottom + FOOT + 5.0), &lines);
        canvas
    }

    fn draw_shifts(&self, canvas: &mut Canvas) {
        let (area, below) = self.panels();
        let used = self.shift_px.outer_iter().enumerate().filter(|(n, _)| !self.is_bad(*n));
        let span = Span::of(used.flat_map(|(_, shift)| shift.to_vec()).chain([0.0]));
        let axes = Axes::new(area, self.sweeps(), span.padded(0.08));
        verdicts::shade(canvas, &axes, self.verdicts, true);
        axes.level(canvas, 0.0, Stroke::solid(style::tint(style::INK, 0.3), 1.0));
        for (column, (_, color)) in self.shift_px.columns().into_iter().zip(KEY) {
            marked(canvas, &axes, &column.to_vec(), color);
        }
        axes.x_axis(canvas, below.is_none().then_some("sweep"));
        axes.y_axis(canvas, Some("shift / px"));
        axes.frame(canvas);
    }

    fn draw_rotation(&self, canvas: &mut Canvas) {
        let (_, Some(area)) = self.panels() else {
            return;
        };
        let angles: Vec<_> = self.rotation_rad.iter().map(|angle| 1e3 * angle).collect();
        let used = angles.iter().enumerate().filter(|(n, _)| !self.is_bad(*n));
        let span = Span::of(used.map(|(_, &angle)| angle).chain([0.0])).padded(0.1);
        let axes = Axes::new(area, self.sweeps(), span);
        verdicts::shade(canvas, &axes, self.verdicts, false);
        axes.level(canvas, 0.0, Stroke::solid(style::tint(style::INK, 0.3), 1.0));
        marked(canvas, &axes, &angles, style::INK);
        axes.x_axis(canvas, Some("sweep"));
        axes.y_axis(canvas, Some("rotation / mrad"));
        axes.frame(canvas);
    }

    /// The panel of the shifts, and that of the rotation where there is any.
    fn panels(&self) -> (Rect, Option<Rect>) {
        let shifts = Rect::new(LEFT, TOP, WIDTH, HEIGHT);
        let rotated = self.rotation_rad.iter().any(|a| a.is_finite() && *a != 0.0);
        let below = Rect::new(LEFT, shifts.bottom() + GAP, WIDTH, ROTATION_HEIGHT);
        (shifts, rotated.then_some(below))
    }

    fn sweeps(&self) -> Span {
        let lengths = [self.shift_px.nrows(), self.rotation_rad.len(), self.verdicts.len()];
        let count = lengths.into_iter().max().unwrap_or(0);
        Span::new(-0.5, count.max(1) as f64 - 0.5)
    }

    fn is_bad(&self, sweep: usize) -> bool {
        verdicts::is_bad(self.verdicts, sweep)
    }
}

/// A curve with a dot at every value: one between two missing neighbours is seen as well.
fn marked(canvas: &mut Canvas, axes: &Axes, values: &[f64], color: Rgb) {
    let points = || values.iter().enumerate().map(|(n, &value)| (n as f64, value));
    axes.curve(canvas, points(), Stroke::solid(color, 1.4));
    axes.dots(canvas, points(), color);
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn shifts_rotation_and_verdicts_are_named() {
        let shift = Array2::from_shape_fn((12, 3), |(t, axis)| (t * axis) as f64 * 0.1);
        let mut verdicts = vec!["ok".to_owned(); 12];
        verdicts[4] = "short: 37 of 256 images".to_owned();
        let mut figure =
            Motion { shift_px: shift.view(), rotation_rad: &[0.0, 0.002], verdicts: &verdicts };
        let svg = figure.draw().svg().unwrap();
        for text in ["depth dz", "shift / px", ">sweep<", ">short<", "sweep 4 short: 37 of 256"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.contains("rotation / mrad"));
        figure.rotation_rad = &[0.0; 12];
        assert!(!figure.draw().svg().unwrap().contains("rotation / mrad"));
    }

    #[test]
    fn odd_motion_is_drawn() {
        for (size, value) in [((0, 3), 0.0), ((4, 3), f64::NAN), ((2, 0), 1.0), ((1, 5), 1e300)] {
            let shift = Array2::from_elem(size, value);
            let verdicts = vec![String::new(); 3];
            let rotation_rad = &[value, f64::INFINITY];
            let figure = Motion { shift_px: shift.view(), rotation_rad, verdicts: &verdicts };
            assert!(figure.draw().png().is_ok());
        }
    }
}
