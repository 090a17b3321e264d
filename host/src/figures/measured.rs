//! A measured example: the walked phase over a region, and profiles through it against their fits.

use ndarray::ArrayView2;

use super::axes::Axes;
use super::canvas::{Canvas, Stroke};
use super::geometry::Rect;
use super::keys;
use super::raster::Indexed;
use super::scale::Span;
use super::style;

/// A line through the region; phases in radians.
#[derive(Clone, Copy, Debug)]
pub struct Profile<'a> {
    /// Heading, such as `along x: 2.31 rad/mm`.
    pub label: &'a str,
    /// Title of the axis, such as `x / mm`.
    pub axis: &'a str,
    /// Places along the axis.
    pub positions: &'a [f64],
    /// Phase by walking.
    pub walked: &'a [f64],
    /// Phase by direct difference, drawn as dots.
    pub direct: &'a [f64],
    /// What was fitted to the walked phase.
    pub fit: &'a [f64],
}

/// The figure: the phase image on the left, the profiles one above the other on the right.
#[derive(Clone, Debug)]
pub struct Measured<'a> {
    /// Heading of the image, such as `walked phase, sweep 60 against 0`.
    pub label: &'a str,
    /// Walked phase in radians, axes (down, across).
    pub phase: ArrayView2<'a, f32>,
    /// Place of the first pixel's edge, (down, across).
    pub origin: (f64, f64),
    /// Pixel pitch, (down, across).
    pub pitch: (f64, f64),
    /// Titles of the image's axes, (down, across), such as `("z / mm", "x / mm")`.
    pub axes: (&'a str, &'a str),
    /// Profiles through the region.
    pub profiles: Vec<Profile<'a>>,
}

const LEFT: f64 = 76.0;
const TOP: f64 = 72.0;
const HEIGHT: f64 = 430.0;
const PROFILE_WIDTH: f64 = 440.0;
const PROFILE_GAP: f64 = 84.0;
/// From the image's right edge to the profiles' left: colour bar, its labels, axis numbers.
const BETWEEN: f64 = 166.0;

impl Measured<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let image = self.image_area();
        let width = image.right() + BETWEEN + PROFILE_WIDTH + 20.0;
        let mut canvas = Canvas::new(width, TOP + HEIGHT + 50.0, self.label);
        self.draw_image(&mut canvas, image);
        for n in 0..self.profiles.len() {
            self.draw_profile(&mut canvas, image.right() + BETWEEN, n);
        }
        if !self.profiles.is_empty() {
            let key = KEY.map(|(label, stroke)| (label, stroke));
            keys::line_key(&mut canvas, (image.right() + BETWEEN, 18.0), &key);
        }
        canvas
    }

    fn draw_image(&self, canvas: &mut Canvas, area: Rect) {
        canvas.image(area, Indexed::phase(self.phase).to_rgb8());
        let (rows, columns) = self.phase.dim();
        let span = |start: f64, pitch: f64, count: usize| {
            Span::new(start, start + pitch.abs() * count.max(1) as f64)
        };
        let across = span(self.origin.1, self.pitch.1, columns);
        let down = span(self.origin.0, self.pitch.0, rows);
        let axes = Axes::new(area, across, down);
        axes.x_axis(canvas, Some(self.axes.1));
        axes.y_down_axis(canvas, Some(self.axes.0));
        axes.frame(canvas);
        keys::heading(canvas, area, self.label, 0);
        let bar = Rect::new(area.right() + 18.0, area.y + 24.0, 16.0, area.h - 24.0);
        keys::phase_bar(canvas, bar);
    }

    fn draw_profile(&self, canvas: &mut Canvas, left: f64, n: usize) {
        let profile = &self.profiles[n];
        let count = self.profiles.len() as f64;
        let height = ((HEIGHT - (count - 1.0) * PROFILE_GAP) / count).max(60.0);
        let top = TOP + n as f64 * (height + PROFILE_GAP);
        let area = Rect::new(left, top, PROFILE_WIDTH, height);
        let x = Span::of(profile.positions.iter().copied());
        let values = profile.walked.iter().chain(profile.direct).chain(profile.fit);
        let axes = Axes::new(area, x, Span::of(values.copied()).padded(0.08));
        let [walked, direct, fit] = [profile.walked, profile.direct, profile.fit]
            .map(|values| profile.positions.iter().copied().zip(values.iter().copied()));
        axes.dots(canvas, direct, style::DIRECT);
        axes.curve(canvas, walked, WALKED);
        axes.curve(canvas, fit, FIT);
        axes.x_axis(canvas, Some(profile.axis));
        axes.y_axis(canvas, Some("phase / rad"));
        axes.frame(canvas);
        keys::heading(canvas, area, profile.label, n + 1);
    }

    /// The image in true proportions, as far as the page allows.
    fn image_area(&self) -> Rect {
        let (rows, columns) = self.phase.dim();
        let ratio = (columns as f64 * self.pitch.1) / (rows as f64 * self.pitch.0);
        let width = match ratio.is_finite() && ratio > 0.0 {
            true => (HEIGHT * ratio).clamp(0.5 * HEIGHT, 1.6 * HEIGHT),
            false => HEIGHT,
        };
        Rect::new(LEFT, TOP, width, HEIGHT)
    }
}

const WALKED: Stroke = Stroke { color: style::EXTENDED, width: 2.0, dash: None };
const FIT: Stroke = Stroke { color: style::INK, width: 1.5, dash: Some((6.0, 4.0)) };
/// Dots in the figure, dots in the key.
const DOTS: Stroke = Stroke { color: style::DIRECT, width: 3.2, dash: Some((3.2, 4.5)) };
const KEY: [(&str, Stroke); 3] = [("walked", WALKED), ("fit", FIT), ("direct difference", DOTS)];

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn image_and_profiles_have_units() {
        let phase = Array2::from_shape_fn((30, 40), |(z, x)| 0.1 * x as f32 + 0.2 * z as f32);
        let line: Vec<f64> = (0..40).map(f64::from).collect();
        let profile = Profile {
            label: "along x",
            axis: "x / mm",
            positions: &line,
            walked: &line,
            direct: &[1.0, f64::NAN, -2.0],
            fit: &line,
        };
        let figure = Measured {
            label: "walked phase",
            phase: phase.view(),
            origin: (0.0, -1.0),
            pitch: (0.05, 0.05),
            axes: ("z / mm", "x / mm"),
            profiles: vec![profile, profile],
        };
        let svg = figure.draw().svg().unwrap();
        for text in ["walked phase", "z / mm", "x / mm", "phase / rad", ">c<"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(figure.draw().png().is_ok());
    }

    #[test]
    fn odd_regions_are_drawn() {
        for (size, pitch) in [(0, 1.0), (1, 0.0), (2, f64::NAN), (3, -1.0)] {
            let phase = Array2::from_elem((size, size), f32::NAN);
            let figure = Measured {
                label: "",
                phase: phase.view(),
                origin: (0.0, f64::INFINITY),
                pitch: (pitch, pitch),
                axes: ("", ""),
                profiles: vec![],
            };
            assert!(figure.draw().png().is_ok());
        }
    }
}
