//! En-face amplitude images of layers, with the camera's dead pixels marked.

use ndarray::ArrayView2;

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, Stroke, TextStyle, font};
use super::geometry::Rect;
use super::grid::Grid;
use super::keys;
use super::raster::{Indexed, Rgb8, percentiles};
use super::scale::{Span, round_below};
use super::style;

/// One layer.
#[derive(Clone, Copy, Debug)]
pub struct EnFace<'a> {
    /// Heading, such as `IS/OS, depths 12 to 14`.
    pub label: &'a str,
    /// Amplitude in any unit, axes (y, x), NaN where there is none.
    pub amplitude: ArrayView2<'a, f32>,
}

/// The figure: layers of one size, each from black at 0 to its own white.
#[derive(Clone, Debug)]
pub struct EnFaces<'a> {
    /// What is common to them, such as `mean of 21 sweeps`.
    pub label: &'a str,
    /// The images.
    pub layers: Vec<EnFace<'a>>,
    /// Which pixels are dead, axes (y, x), where they were looked for.
    pub dead: Option<ArrayView2<'a, bool>>,
    /// Distance of two pixels on the sample in µm, where it is known.
    pub pitch_um: Option<f64>,
}

const FOOT: f64 = 62.0;
const RIGHT: f64 = 18.0;
/// Narrowest figure: the note below has room.
const LEAST: f64 = 460.0;
/// Share of an image's pixels that are not yet white.
const WHITE: f32 = 0.995;
/// Pixels of less than so many points are ringed when dead.
const SMALL_PX: f64 = 3.0;
/// Side of a ring in points.
const RING: f64 = 6.0;
/// More rings would hide the image.
const MOST_RINGS: usize = 500;
/// Most of an image's width that the scale bar takes.
const BAR_SHARE: f64 = 0.25;

impl EnFaces<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let grid = self.grid();
        let words = grid.panel(0).x + font::width(self.label, style::TEXT, false) + RIGHT;
        let size = ((grid.right() + RIGHT).max(words).max(LEAST), grid.bottom() + FOOT);
        let title = format!("En-face images: {}", self.label);
        let mut canvas = Canvas::new(size.0, size.1, &title);
        for n in 0..self.layers.len() {
            self.draw_layer(&mut canvas, &grid, n);
        }
        self.draw_words(&mut canvas, &grid);
        canvas
    }

    fn draw_layer(&self, canvas: &mut Canvas, grid: &Grid, n: usize) {
        let layer = &self.layers[n];
        let (area, (rows, columns)) = (grid.panel(n), layer.amplitude.dim());
        canvas.image(area, self.image(layer.amplitude));
        let span = |count: usize| Span::new(-0.5, count.max(1) as f64 - 0.5);
        let axes = Axes::new(area, span(columns), span(rows));
        if n == 0 {
            self.ring(canvas, &axes);
        }
        axes.x_axis(canvas, grid.is_lowest(n).then_some("x / px"));
        axes.y_down_axis(canvas, grid.is_first(n).then_some("y / px"));
        axes.frame(canvas);
        keys::heading(canvas, area, layer.label, n);
        if let Some(pitch) = self.pitch_um.filter(|pitch| pitch.is_finite() && *pitch > 0.0) {
            let length = round_below(BAR_SHARE * columns.max(1) as f64 * pitch);
            let points = length / pitch * area.w / columns.max(1) as f64;
            keys::scale_bar(canvas, area, points, &format!("{length} µm"));
        }
    }

    /// Grey amplitudes, dead pixels in colour.
    fn image(&self, amplitude: ArrayView2<'_, f32>) -> Rgb8 {
        let (_, white) = percentiles(&[amplitude], 0.0, WHITE);
        let mut image = Indexed::amplitude(amplitude, (0.0, white)).to_rgb8();
        let Some(dead) = self.dead.filter(|dead| dead.dim() == amplitude.dim()) else {
            return image;
        };
        for (color, _) in image.pixels.as_chunks_mut().0.iter_mut().zip(dead).filter(|p| *p.1) {
            *color = style::DIRECT;
        }
        image
    }

    fn draw_words(&self, canvas: &mut Canvas, grid: &Grid) {
        let left = grid.panel(0).x;
        canvas.text((left, 22.0), self.label, TextStyle::new(style::TEXT, Anchor::Start));
        let faint = TextStyle::new(style::SMALL, Anchor::Start).colored(style::FAINT);
        let bottom = grid.bottom() + FOOT - 9.0;
        let scale = "each image on a scale of its own";
        let Some(dead) = self.dead else {
            canvas.text((left, bottom), scale, faint);
            return;
        };
        canvas.fill(Rect::new(left, bottom - 9.0, 9.0, 9.0).corners(), style::DIRECT);
        let count = dead.iter().filter(|dead| **dead).count();
        let share = 100.0 * count as f64 / dead.len().max(1) as f64;
        let text = format!("dead pixels: {count} ({share:.2} %) · {scale}");
        canvas.text((left + 15.0, bottom), &text, faint);
    }

    /// Squares around dead pixels that are too small to be seen, unless there are too many; in one
    /// image, the others show what the squares hide.
    fn ring(&self, canvas: &mut Canvas, axes: &Axes) {
        let pixel = axes.area.w / (axes.x.high - axes.x.low);
        let dead = self.dead.into_iter().flat_map(ArrayView2::into_indexed_iter);
        let places = || dead.clone().filter(|(_, dead)| **dead).map(|(place, _)| place);
        if pixel >= SMALL_PX || places().count() > MOST_RINGS {
            return;
        }
        let half = RING / (2.0 * pixel);
        let corners = [(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)];
        for (y, x) in places() {
            let (x, y) = (x as f64, axes.y.mirrored(y as f64));
            let ring = corners.map(|(dx, dy)| (x + dx, y + dy));
            axes.curve(canvas, ring, Stroke::solid(style::DIRECT, 0.8));
        }
    }

    fn grid(&self) -> Grid {
        Grid::headed(self.layers.iter().map(|layer| (layer.label, layer.amplitude.dim())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn layers_have_axes_bars_and_dead_pixels() {
        let image = Array2::from_shape_fn((20, 30), |(y, x)| (y + x) as f32);
        let mut dead = Array2::from_elem((20, 30), false);
        dead[[3, 4]] = true;
        let layer = |label| EnFace { label, amplitude: image.view() };
        let mut figure = EnFaces {
            label: "mean of 21 sweeps",
            layers: vec![layer("IS/OS"), layer("tips")],
            dead: Some(dead.view()),
            pitch_um: Some(10.0),
        };
        let svg = figure.draw().svg().unwrap();
        for text in ["IS/OS", "tips", "x / px", "y / px", "50 µm", "dead pixels: 1 (0.17 %)"] {
            assert!(svg.contains(text), "{text}");
        }
        let at = 3 * (3 * 30 + 4);
        assert_eq!(figure.image(image.view()).pixels[at..at + 3], style::DIRECT);
        figure.dead = None;
        assert!(figure.draw().svg().unwrap().contains("scale of its own"));
    }

    #[test]
    fn odd_layers_are_drawn() {
        let dead = Array2::from_elem((2, 2), true);
        for size in [(0, 0), (1, 1), (2, 3)] {
            for value in [f32::NAN, f32::INFINITY, -1.0] {
                let image = Array2::from_elem(size, value);
                let layer = EnFace { label: "", amplitude: image.view() };
                let figure = EnFaces {
                    label: "",
                    layers: vec![layer; 2],
                    dead: Some(dead.view()),
                    pitch_um: Some(f64::from(value)),
                };
                assert!(figure.draw().png().is_ok());
            }
        }
        let nothing = EnFaces { label: "", layers: vec![], dead: None, pitch_um: None };
        assert!(nothing.draw().png().is_ok());
    }
}
