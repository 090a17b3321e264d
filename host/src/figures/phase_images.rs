//! Phase images of several conditions side by side, and the speckle they came from (the paper's
//! Figure 2).

use ndarray::ArrayView2;

use super::canvas::{Anchor, Canvas, TextStyle};
use super::geometry::Rect;
use super::keys;
use super::raster::{Indexed, percentiles};
use super::style;

/// One condition: the same frame evaluated both ways, phases in radians, axes (y, x).
#[derive(Clone, Debug)]
pub struct PhaseColumn<'a> {
    /// Heading, such as `σ = λ/32, frame 69`.
    pub label: &'a str,
    /// Phase difference to the first frame.
    pub direct: ArrayView2<'a, f32>,
    /// Extended Knox-Thompson.
    pub extended: ArrayView2<'a, f32>,
}

/// The amplitude of one frame.
#[derive(Clone, Debug)]
pub struct SpeckleImage<'a> {
    /// Heading, such as `σ = λ/32, frame 10`.
    pub label: &'a str,
    /// Amplitude in any unit, axes (y, x).
    pub amplitude: ArrayView2<'a, f32>,
}

/// A length in the images.
#[derive(Clone, Debug)]
pub struct ScaleBar<'a> {
    /// Length in pixels of the images.
    pub pixels: f64,
    /// Its length in words, such as `500 λ`.
    pub label: &'a str,
}

/// The figure: any number of columns, any number of speckle images.
#[derive(Clone, Debug)]
pub struct PhaseImages<'a> {
    /// Conditions, from left to right.
    pub columns: Vec<PhaseColumn<'a>>,
    /// Speckle amplitudes for the third row; all share one grey scale.
    pub speckle: Vec<SpeckleImage<'a>>,
    /// Scale bar, drawn into every image.
    pub scale_bar: Option<ScaleBar<'a>>,
}

const LEFT: f64 = 44.0;
const TOP: f64 = 38.0;
const GAP: f64 = 12.0;
const RIGHT: f64 = 96.0;
const WIDTH: f64 = 320.0;
/// Room for the headings of the speckle images.
const HEADING: f64 = 34.0;

impl PhaseImages<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let across = self.columns.len().max(self.speckle.len()).max(1);
        let width = LEFT + across as f64 * (WIDTH + GAP) - GAP + RIGHT;
        let height = self.below() + 12.0;
        let title = "Phase images by direct phase difference and by extended Knox-Thompson";
        let mut canvas = Canvas::new(width, height, title);
        self.draw_phases(&mut canvas);
        self.draw_speckle(&mut canvas);
        self.draw_keys(&mut canvas, across);
        canvas
    }

    fn draw_phases(&self, canvas: &mut Canvas) {
        for (n, column) in self.columns.iter().enumerate() {
            heading(canvas, self.panel(0, n), column.label);
            for (row, field) in [column.direct, column.extended].into_iter().enumerate() {
                let letter = row * self.columns.len() + n;
                self.draw_panel(canvas, self.panel(row, n), &Indexed::phase(field), letter);
            }
        }
    }

    fn draw_speckle(&self, canvas: &mut Canvas) {
        let fields: Vec<_> = self.speckle.iter().map(|s| s.amplitude).collect();
        let range = percentiles(&fields, 0.0, 0.995);
        for (n, speckle) in self.speckle.iter().enumerate() {
            let image = Indexed::amplitude(speckle.amplitude, (0.0_f32.min(range.0), range.1));
            let panel = self.panel(2, n);
            heading(canvas, panel, speckle.label);
            self.draw_panel(canvas, panel, &image, 2 * self.columns.len() + n);
        }
    }

    fn draw_panel(&self, canvas: &mut Canvas, panel: Rect, image: &Indexed, letter: usize) {
        canvas.image(panel, image.to_rgb8());
        keys::panel_letter(canvas, panel, letter);
        let (across, _) = image.size();
        if let Some(bar) = self.scale_bar.as_ref().filter(|bar| bar.pixels > 0.0) {
            let length = bar.pixels * WIDTH / across.max(1) as f64;
            keys::scale_bar(canvas, panel, length.min(WIDTH - 30.0), bar.label);
        }
    }

    fn draw_keys(&self, canvas: &mut Canvas, across: usize) {
        let side = TextStyle::new(style::TEXT, Anchor::Middle).upright();
        let mut row_name = |row: usize, name: &str| {
            let (_, middle) = self.panel(row, 0).center();
            canvas.label((LEFT - 20.0, middle), name, side);
        };
        if !self.columns.is_empty() {
            row_name(0, "direct difference");
            row_name(1, "extended Knox\u{2013}Thompson");
        }
        if !self.speckle.is_empty() {
            row_name(2, "speckle amplitude");
        }
        if self.columns.is_empty() {
            return;
        }
        let (first, second) = (self.panel(0, across - 1), self.panel(1, across - 1));
        let (top, bottom) = (first.y + 24.0, second.bottom());
        keys::phase_bar(canvas, Rect::new(first.right() + 20.0, top, 18.0, bottom - top));
    }

    /// Where a panel lies.
    fn panel(&self, row: usize, column: usize) -> Rect {
        let height = self.panel_height();
        let phases = if self.columns.is_empty() { 0 } else { row.min(2) };
        let extra = if row == 2 && phases > 0 { HEADING - GAP } else { 0.0 };
        let x = LEFT + column as f64 * (WIDTH + GAP);
        let y = TOP + phases as f64 * (height + GAP) + extra;
        Rect::new(x, y, WIDTH, height)
    }

    fn below(&self) -> f64 {
        match (self.columns.is_empty(), self.speckle.is_empty()) {
            (_, false) => self.panel(2, 0).bottom(),
            (false, true) => self.panel(1, 0).bottom(),
            (true, true) => TOP,
        }
    }

    /// Height of every panel: as the first image wants it.
    fn panel_height(&self) -> f64 {
        let phases = self.columns.first().map(|column| column.extended.dim());
        let size = phases.or(self.speckle.first().map(|speckle| speckle.amplitude.dim()));
        let (rows, across) = size.unwrap_or((1, 1));
        let ratio = rows.max(1) as f64 / across.max(1) as f64;
        (WIDTH * ratio).clamp(0.2 * WIDTH, 2.0 * WIDTH)
    }
}

fn heading(canvas: &mut Canvas, panel: Rect, label: &str) {
    let text = TextStyle::new(style::HEADING, Anchor::Middle);
    canvas.text((panel.center().0, panel.y - 9.0), label, text);
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn every_panel_has_its_letter_and_label() {
        let field = Array2::from_elem((8, 16), 0.5_f32);
        let missing = Array2::from_elem((8, 16), f32::NAN);
        let column = |label| PhaseColumn { label, direct: field.view(), extended: missing.view() };
        let figure = PhaseImages {
            columns: vec![column("σ = 0"), column("σ < λ/16")],
            speckle: vec![SpeckleImage { label: "frame 10", amplitude: field.view() }],
            scale_bar: Some(ScaleBar { pixels: 4.0, label: "500 λ" }),
        };
        let svg = figure.draw().svg().unwrap();
        for text in ["σ = 0", "σ &lt; λ/16", "frame 10", ">e<", ">π<", "phase / rad"] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.matches("500 λ").count(), 5);
        assert_eq!(svg.matches("<image").count(), 6);
        assert!(figure.draw().png().is_ok());
    }

    #[test]
    fn empty_figures_are_drawn() {
        let nothing = Array2::<f32>::zeros((0, 0));
        let mut figure = PhaseImages { columns: vec![], speckle: vec![], scale_bar: None };
        assert!(figure.draw().png().is_ok());
        figure.speckle.push(SpeckleImage { label: "", amplitude: nothing.view() });
        assert!(figure.draw().png().is_ok());
    }
}
