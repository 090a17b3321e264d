//! How fast each part of an image decorrelates, what stays and what is noise, side by side.

use ndarray::ArrayView2;

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, TextStyle};
use super::colormap::ColorMap;
use super::geometry::Rect;
use super::grid::Grid;
use super::keys;
use super::raster::{Indexed, percentiles};
use super::scale::Span;
use super::style;

/// One map.
#[derive(Clone, Copy, Debug)]
pub struct CoherenceMap<'a> {
    /// Heading, with the unit.
    pub label: &'a str,
    /// Values, axes (y, x), not below 0.
    pub values: ArrayView2<'a, f32>,
    /// End of the colour bar; the largest value where there is none.
    pub top: Option<f32>,
}

/// The figure: maps of one size, each with its own colour bar from 0.
#[derive(Clone, Debug)]
pub struct CoherenceMaps<'a> {
    /// What is common to them.
    pub label: &'a str,
    /// The maps.
    pub maps: Vec<CoherenceMap<'a>>,
}

/// Below the images: axis titles.
const FOOT: f64 = 52.0;
/// Right of the images, beside the last bar.
const RIGHT: f64 = 18.0;
/// Narrowest cell: image, bar and its numbers.
const LEAST: f64 = 300.0;
/// Width of a bar and its distance from the image.
const BAR: f64 = 12.0;
/// Room for bar and numbers beside an image.
const BESIDE: f64 = 78.0;

impl CoherenceMaps<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let size = self.maps.first().map_or((1, 1), |map| map.values.dim());
        let mut grid = Grid::new(self.maps.len(), size, LEAST);
        grid.across = 1;
        let height = grid.panel(self.maps.len().max(1) - 1).bottom() + FOOT;
        let width = grid.panel(0).right() + BESIDE + RIGHT;
        let mut canvas = Canvas::new(width.max(LEAST), height, self.label);
        let text = TextStyle::new(style::TEXT, Anchor::Start);
        canvas.text((grid.panel(0).x, 22.0), self.label, text);
        for (n, map) in self.maps.iter().enumerate() {
            draw_map(&mut canvas, grid.panel(n), n, map, n + 1 == self.maps.len());
        }
        canvas
    }
}

fn draw_map(canvas: &mut Canvas, area: Rect, n: usize, map: &CoherenceMap<'_>, last: bool) {
    let (rows, columns) = map.values.dim();
    let (_, most) = percentiles(&[map.values], 0.0, 1.0);
    let high = map.top.unwrap_or(if most > 0.0 { most } else { 1.0 });
    canvas.image(area, Indexed::sigma(map.values, (0.0, high)).to_rgb8());
    let span = |count: usize| Span::new(-0.5, count.max(1) as f64 - 0.5);
    let axes = Axes::new(area, span(columns), span(rows));
    axes.x_axis(canvas, last.then_some("x / px"));
    axes.y_down_axis(canvas, Some("y / px"));
    axes.frame(canvas);
    keys::heading(canvas, area, map.label, n);
    let labels = [0.0, 0.5, 1.0]
        .map(|share| format!("{:.*}", if high < 10.0 { 3 } else { 1 }, share * high));
    let labels: Vec<&str> = labels.iter().map(String::as_str).collect();
    let bar = Rect::new(area.right() + BAR, area.y, BAR, area.h);
    keys::color_bar(canvas, bar, ColorMap::Sigma, &labels, "");
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn maps_have_headings_axes_and_bars() {
        let rate = Array2::from_shape_fn((12, 30), |(_, x)| if x < 15 { 0.1 } else { 0.3 });
        let nothing = Array2::zeros((12, 30));
        let map = |label, values: &'static Array2<f32>| CoherenceMap {
            label,
            values: values.view(),
            top: (label == "noise").then_some(1.0),
        };
        let (rate, nothing) = (Box::leak(Box::new(rate)), Box::leak(Box::new(nothing)));
        let figure = CoherenceMaps {
            label: "F.npy",
            maps: vec![map("decay rate", rate), map("noise", nothing)],
        };
        let svg = figure.draw().svg().unwrap();
        for text in ["F.npy", "decay rate", "noise", "0.300", "1.000", "x / px", "y / px"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
