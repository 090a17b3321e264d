//! Phase images of several conditions or times side by side, and the speckle they came from (the
//! paper's Figures 2 and 4).

use ndarray::ArrayView2;

use super::canvas::{Anchor, Canvas, TextStyle, font};
use super::colormap::ColorMap;
use super::geometry::Rect;
use super::keys;
use super::raster::{Indexed, percentiles};
use super::style;

/// One condition or time, phases in radians, axes (y, x).
#[derive(Clone, Debug)]
pub struct PhaseColumn<'a> {
    /// Heading, such as `σ = λ/32, frame 69`.
    pub label: &'a str,
    /// The same frame by each method of the figure.
    pub phases: Vec<ArrayView2<'a, f32>>,
    /// Standard deviation of the last method's phase, radians, where it is known; all share one scale.
    pub sigma: Option<ArrayView2<'a, f32>>,
}

/// The amplitude of one frame.
#[derive(Clone, Debug)]
pub struct SpeckleImage<'a> {
    /// Heading, such as `σ = λ/32, frame 10`; empty where that of the column above says it.
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
    /// Names of the methods, one row of phases each.
    pub methods: Vec<&'a str>,
    /// Conditions, from left to right.
    pub columns: Vec<PhaseColumn<'a>>,
    /// Speckle amplitudes for the last row; all share one grey scale.
    pub speckle: Vec<SpeckleImage<'a>>,
    /// Scale bar, drawn into every image.
    pub scale_bar: Option<ScaleBar<'a>>,
}

const LEFT: f64 = 44.0;
const TOP: f64 = 38.0;
const GAP: f64 = 12.0;
const RIGHT: f64 = 96.0;
/// Widest panel, and widest row of panels.
const WIDTH: f64 = 320.0;
const ROW: f64 = 1700.0;
/// Name of the row of standard deviations.
const SIGMA: &str = "standard deviation";
/// Room for the headings of the speckle images.
const HEADING: f64 = 34.0;

impl PhaseImages<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let across = self.across() as f64;
        let width = LEFT + across * (self.panel_width() + GAP) - GAP + RIGHT;
        let height = self.below() + 12.0;
        let mut canvas = Canvas::new(width, height, &self.title());
        self.draw_phases(&mut canvas);
        self.draw_sigmas(&mut canvas);
        self.draw_speckle(&mut canvas);
        self.draw_keys(&mut canvas);
        canvas
    }

    fn title(&self) -> String {
        format!("Phase images by {}", self.methods.join(" and by "))
    }

    fn draw_phases(&self, canvas: &mut Canvas) {
        for (n, column) in self.columns.iter().enumerate() {
            heading(canvas, self.panel(0, n), column.label);
            for (row, &field) in column.phases.iter().take(self.rows()).enumerate() {
                let letter = row * self.columns.len() + n;
                self.draw_panel(canvas, self.panel(row, n), &Indexed::phase(field), letter);
            }
        }
    }

    fn draw_sigmas(&self, canvas: &mut Canvas) {
        let range = (0.0, self.highest_sigma());
        for (n, column) in self.columns.iter().enumerate() {
            if let Some(sigma) = column.sigma {
                let letter = self.rows() * self.columns.len() + n;
                let image = Indexed::sigma(sigma, range);
                self.draw_panel(canvas, self.panel(self.rows(), n), &image, letter);
            }
        }
    }

    /// Where the scale of the standard deviations ends: few pixels lie above.
    fn highest_sigma(&self) -> f32 {
        let sigmas: Vec<_> = self.columns.iter().filter_map(|column| column.sigma).collect();
        percentiles(&sigmas, 0.0, 0.995).1
    }

    fn draw_speckle(&self, canvas: &mut Canvas) {
        let fields: Vec<_> = self.speckle.iter().map(|s| s.amplitude).collect();
        let range = percentiles(&fields, 0.0, 0.995);
        for (n, speckle) in self.speckle.iter().enumerate() {
            let image = Indexed::amplitude(speckle.amplitude, (0.0_f32.min(range.0), range.1));
            let panel = self.panel(self.rows_above(), n);
            heading(canvas, panel, speckle.label);
            self.draw_panel(canvas, panel, &image, self.rows_above() * self.columns.len() + n);
        }
    }

    fn draw_panel(&self, canvas: &mut Canvas, panel: Rect, image: &Indexed, letter: usize) {
        canvas.image(panel, image.to_rgb8());
        keys::panel_letter(canvas, panel, letter);
        let (across, _) = image.size();
        if let Some(bar) = self.scale_bar.as_ref().filter(|bar| bar.pixels > 0.0) {
            let length = bar.pixels * panel.w / across.max(1) as f64;
            keys::scale_bar(canvas, panel, length.min(panel.w - 30.0), bar.label);
        }
    }

    fn draw_keys(&self, canvas: &mut Canvas) {
        let speckle = (!self.speckle.is_empty()).then_some("speckle amplitude");
        let sigma = (self.rows_above() > self.rows()).then_some(SIGMA);
        let methods = self.methods.iter().copied().take(self.rows());
        for (row, name) in methods.chain(sigma).chain(speckle).enumerate() {
            row_name(canvas, self.panel(row, 0), name);
        }
        let Some(last) = self.rows().checked_sub(1) else {
            return;
        };
        let right = self.across() - 1;
        let (first, last) = (self.panel(0, right), self.panel(last, right));
        let (top, bottom) = (first.y + 24.0, last.bottom());
        keys::phase_bar(canvas, Rect::new(first.right() + 20.0, top, 18.0, bottom - top));
        if sigma.is_some() {
            self.draw_sigma_bar(canvas, self.panel(self.rows(), right));
        }
    }

    fn draw_sigma_bar(&self, canvas: &mut Canvas, panel: Rect) {
        let label = |share: f32| format!("{:.2}", share * self.highest_sigma());
        let labels = [0.0, 0.5, 1.0].map(label);
        let labels: Vec<&str> = labels.iter().map(String::as_str).collect();
        let (top, bottom) = (panel.y + 24.0, panel.bottom() - 4.0);
        let bar = Rect::new(panel.right() + 20.0, top, 18.0, bottom - top);
        keys::color_bar(canvas, bar, ColorMap::Sigma, &labels, "σ / rad");
    }

    /// Rows of phases.
    fn rows(&self) -> usize {
        if self.columns.is_empty() { 0 } else { self.methods.len() }
    }

    /// Rows above the speckle: those of phases, and that of their standard deviations.
    fn rows_above(&self) -> usize {
        self.rows() + usize::from(self.columns.iter().any(|column| column.sigma.is_some()))
    }

    /// Panels beside each other.
    fn across(&self) -> usize {
        self.columns.len().max(self.speckle.len()).max(1)
    }

    /// Where a panel lies.
    fn panel(&self, row: usize, column: usize) -> Rect {
        let (width, height) = (self.panel_width(), self.panel_height());
        let named = self.speckle.iter().any(|speckle| !speckle.label.is_empty());
        let below = row > 0 && row == self.rows_above() && named;
        let extra = if below { HEADING - GAP } else { 0.0 };
        let x = LEFT + column as f64 * (width + GAP);
        let y = TOP + row as f64 * (height + GAP) + extra;
        Rect::new(x, y, width, height)
    }

    fn below(&self) -> f64 {
        let rows = self.rows_above() + usize::from(!self.speckle.is_empty());
        rows.checked_sub(1).map_or(TOP, |last| self.panel(last, 0).bottom())
    }

    /// Width of every panel: many share the row.
    fn panel_width(&self) -> f64 {
        ((ROW + GAP) / self.across() as f64 - GAP).clamp(120.0, WIDTH)
    }

    /// Height of every panel: as the first image wants it.
    fn panel_height(&self) -> f64 {
        let phases = self.columns.first().and_then(|column| column.phases.first());
        let size = phases.or(self.speckle.first().map(|speckle| &speckle.amplitude));
        let (rows, across) = size.map_or((1, 1), |field| field.dim());
        let ratio = rows.max(1) as f64 / across.max(1) as f64;
        self.panel_width() * ratio.clamp(0.2, 2.0)
    }
}

/// A name left of a row, in two lines where the panel is too low for one.
fn row_name(canvas: &mut Canvas, panel: Rect, name: &str) {
    let long = font::width(name, style::TEXT, false) > panel.h;
    let lines = match name.split_once(' ').filter(|_| long) {
        Some((first, second)) => vec![(30.0, first), (14.0, second)],
        None => vec![(20.0, name)],
    };
    for (left, line) in lines {
        let fits = panel.h / font::width(line, style::TEXT, false).max(1.0);
        let text = TextStyle::new(style::TEXT * fits.min(1.0), Anchor::Middle).upright();
        canvas.label((panel.x - left, panel.center().1), line, text);
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
        let column =
            |label, sigma| PhaseColumn { label, phases: vec![field.view(), missing.view()], sigma };
        let figure = PhaseImages {
            methods: vec!["direct difference", "extended"],
            columns: vec![column("σ = 0", None), column("σ < λ/16", Some(field.view()))],
            speckle: vec![SpeckleImage { label: "frame 10", amplitude: field.view() }],
            scale_bar: Some(ScaleBar { pixels: 4.0, label: "500 λ" }),
        };
        let svg = figure.draw().svg().unwrap();
        for text in ["σ = 0", "σ &lt; λ/16", "frame 10", ">g<", ">π<", "phase / rad", "σ / rad"]
        {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.contains(">0.25<"), "half of the largest standard deviation");
        assert_eq!(svg.matches("500 λ").count(), 6);
        assert_eq!(svg.matches("<image").count(), 8);
        assert!(figure.draw().png().is_ok());
    }

    #[test]
    fn many_columns_share_the_row() {
        let field = Array2::from_elem((8, 16), 0.5_f32);
        let columns =
            vec![PhaseColumn { label: "5 s", phases: vec![field.view()], sigma: None }; 9];
        let speckle = vec![SpeckleImage { label: "", amplitude: field.view() }; 9];
        let methods = vec!["direct difference"];
        let figure = PhaseImages { methods, columns, speckle, scale_bar: None };
        let (width, height) = figure.draw().size();
        assert!(width <= LEFT + ROW + RIGHT + 1.0, "{width}");
        let svg = figure.draw().svg().unwrap();
        assert!(svg.contains(">direct<") && svg.contains(">difference<"), "low panels: two lines");
        let gap = figure.panel(1, 0).y - figure.panel(0, 0).bottom();
        assert!((gap - GAP).abs() < 1e-9 && height > figure.panel(1, 0).bottom());
    }

    #[test]
    fn empty_figures_are_drawn() {
        let nothing = Array2::<f32>::zeros((0, 0));
        let (columns, speckle, methods) = (vec![], vec![], vec!["direct difference"]);
        let mut figure = PhaseImages { methods, columns, speckle, scale_bar: None };
        assert!(figure.draw().png().is_ok());
        figure.speckle.push(SpeckleImage { label: "", amplitude: nothing.view() });
        assert!(figure.draw().png().is_ok());
    }
}
