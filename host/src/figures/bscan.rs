//! B-scans on one scale of decibels: before and after a step, with the surfaces that were found.

use ndarray::ArrayView2;

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, Stroke, TextStyle, font};
use super::colormap::ColorMap;
use super::decibel::{Decibels, NOISE};
use super::geometry::Rect;
use super::grid::Grid;
use super::keys;
use super::layer::Layer;
use super::raster::Indexed;
use super::scale::Span;
use super::style;

/// One B-scan.
#[derive(Clone, Debug)]
pub struct BScan<'a> {
    /// Heading, such as `before dispersion`.
    pub label: &'a str,
    /// Amplitude in any unit, axes (z, x), the smallest depth first.
    pub amplitude: ArrayView2<'a, f32>,
    /// Surfaces drawn over it.
    pub surfaces: Vec<Surface<'a>>,
}

/// A surface cut by a B-scan.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// Which one.
    pub layer: Layer,
    /// Depth in pixels by column, NaN where it was not found.
    pub depth_px: &'a [f32],
}

/// The figure: B-scans of one size, side by side or one above the other.
#[derive(Clone, Debug)]
pub struct BScans<'a> {
    /// What is common to them, such as `row 48 of sweep 0`.
    pub label: &'a str,
    /// The images; all share one grey scale.
    pub scans: Vec<BScan<'a>>,
    /// Depth in pixels of the first row.
    pub first_depth_px: f64,
    /// Size of a depth pixel in µm, where it is known.
    pub depth_px_um: Option<f64>,
}

/// Right of the images: depth in µm.
const MICROMETRES: f64 = 62.0;
/// Right of that: colour bar and its numbers.
const BAR: f64 = 118.0;
/// Below the images: their axis and a note.
const FOOT: f64 = 62.0;

impl BScans<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let grid = self.grid();
        let amplitudes: Vec<_> = self.scans.iter().map(|scan| scan.amplitude).collect();
        let scale = Decibels::of(&amplitudes);
        let right = grid.right() + self.depth_px_um.map_or(0.0, |_| MICROMETRES);
        let head = self.key_start() + keys::line_key_width(&self.key()) + 10.0;
        let title = format!("B-scans: {}", self.label);
        let size = ((right + BAR).max(head), grid.bottom() + FOOT);
        let mut canvas = Canvas::new(size.0, size.1, &title);
        for n in 0..self.scans.len() {
            self.draw_scan(&mut canvas, &grid, n, &scale);
        }
        self.draw_head(&mut canvas);
        draw_bar(&mut canvas, right, &grid, &scale);
        canvas
    }

    fn draw_scan(&self, canvas: &mut Canvas, grid: &Grid, n: usize, scale: &Decibels) {
        let (scan, area) = (&self.scans[n], grid.panel(n));
        let image = scale.convert(scan.amplitude);
        canvas.image(area, Indexed::amplitude(image.view(), (0.0, scale.top)).to_rgb8());
        let axes = self.axes(area, scan.amplitude.dim());
        for surface in &scan.surfaces {
            let depths = surface.depth_px.iter().enumerate();
            let points = depths.map(|(x, &depth)| (x as f64, axes.y.mirrored(f64::from(depth))));
            axes.curve(canvas, points, stroke(surface.layer));
        }
        axes.x_axis(canvas, grid.is_lowest(n).then_some("column x / px"));
        axes.y_down_axis(canvas, grid.is_first(n).then_some("depth z / px"));
        if let Some(um) = self.depth_px_um.filter(|_| grid.is_last(n)) {
            micrometres(canvas, &axes, um);
        }
        axes.frame(canvas);
        keys::heading(canvas, area, scan.label, n);
    }

    /// Pixels are centred on whole numbers.
    fn axes(&self, area: Rect, (depths, columns): (usize, usize)) -> Axes {
        let x = Span::new(-0.5, columns.max(1) as f64 - 0.5);
        let first = self.first_depth_px;
        Axes::new(area, x, Span::new(first - 0.5, first + depths.max(1) as f64 - 0.5))
    }

    fn draw_head(&self, canvas: &mut Canvas) {
        let at = (self.grid().panel(0).x, 22.0);
        canvas.text(at, self.label, TextStyle::new(style::TEXT, Anchor::Start));
        keys::line_key(canvas, (self.key_start(), 17.5), &self.key());
    }

    /// Where the key begins, beside what is common.
    fn key_start(&self) -> f64 {
        let gap = if self.label.is_empty() { 0.0 } else { 30.0 };
        self.grid().panel(0).x + font::width(self.label, style::TEXT, false) + gap
    }

    /// The surfaces that are drawn, each once.
    fn key(&self) -> Vec<(&'static str, Stroke)> {
        let drawn = |layer: Layer| {
            let mut surfaces = self.scans.iter().flat_map(|scan| &scan.surfaces);
            surfaces.any(|surface| surface.layer == layer)
        };
        let layers = [Layer::IsOs, Layer::Tips].into_iter().filter(|&layer| drawn(layer));
        layers.map(|layer| (layer.name(), stroke(layer))).collect()
    }

    fn grid(&self) -> Grid {
        Grid::headed(self.scans.iter().map(|scan| (scan.label, scan.amplitude.dim())))
    }
}

fn stroke(layer: Layer) -> Stroke {
    Stroke::solid(layer.color(), 1.1)
}

/// The depth axis once more on the right, in µm.
fn micrometres(canvas: &mut Canvas, axes: &Axes, pixel: f64) {
    let scaled = Span::new(axes.y.low * pixel, axes.y.high * pixel);
    Axes::new(axes.area, axes.x, scaled).y_down_axis_right(canvas, "depth z / µm");
}

fn draw_bar(canvas: &mut Canvas, left: f64, grid: &Grid, scale: &Decibels) {
    let first = grid.panel(0);
    let area = Rect::new(left + 24.0, first.y + 22.0, 16.0, (first.h - 22.0).clamp(60.0, 300.0));
    let labels = scale.labels();
    let labels: Vec<_> = labels.iter().map(String::as_str).collect();
    keys::color_bar(canvas, area, ColorMap::Grey, &labels, "amplitude / dB");
    let note = format!("0 dB: {:.0} % of all pixels are darker", 100.0 * NOISE);
    let at = (first.x, grid.bottom() + FOOT - 9.0);
    canvas.text(at, &note, TextStyle::new(style::SMALL, Anchor::Start).colored(style::FAINT));
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn scans_have_their_headings_axes_and_surfaces() {
        let image = Array2::from_shape_fn((32, 48), |(z, x)| ((z * x) % 7) as f32);
        let depth = vec![12.0_f32; 48];
        let surfaces =
            [Layer::IsOs, Layer::Tips].map(|layer| Surface { layer, depth_px: &depth }).to_vec();
        let scan = |label, surfaces| BScan { label, amplitude: image.view(), surfaces };
        let figure = BScans {
            label: "row 48 of sweep 0",
            scans: vec![scan("before", vec![]), scan("after", surfaces)],
            first_depth_px: 0.0,
            depth_px_um: Some(5.1),
        };
        let svg = figure.draw().svg().unwrap();
        let axes = ["column x / px", "depth z / px", "depth z / µm", "amplitude / dB"];
        let labels = ["row 48 of sweep 0", "before", "after", "IS/OS", "outer-segment tips"];
        for text in axes.iter().chain(&labels) {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.matches("<image").count(), 3);
        assert!(figure.draw().png().is_ok());
    }

    #[test]
    fn odd_scans_are_drawn() {
        let surfaces = vec![Surface { layer: Layer::Tips, depth_px: &[f32::NAN, 1e30, 3.0] }];
        for size in [(0, 0), (1, 1), (2, 3000)] {
            for value in [f32::NAN, 0.0] {
                let image = Array2::from_elem(size, value);
                let surfaces = surfaces.clone();
                let scan = BScan { label: "", amplitude: image.view(), surfaces };
                let figure = BScans {
                    label: "",
                    scans: vec![scan; 3],
                    first_depth_px: f64::NAN,
                    depth_px_um: Some(f64::NAN),
                };
                assert!(figure.draw().png().is_ok());
            }
        }
        let nothing = BScans { label: "", scans: vec![], first_depth_px: 0.0, depth_px_um: None };
        assert!(nothing.draw().png().is_ok());
    }
}
