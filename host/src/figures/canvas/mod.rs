//! A drawing as a list of marks, played back to PNG or SVG from the same list.
//!
//! Lengths are points: one pixel of an SVG on screen, [`PNG_SCALE`] pixels of a PNG.

mod bitmap;
pub mod font;
mod svg;

pub use svg::escape;

use super::colormap::Rgb;
use super::geometry::{Point, Rect};
use super::raster::Rgb8;
use super::style;
use crate::error::Result;

/// Pixels of a PNG per point.
pub const PNG_SCALE: u32 = 2;

/// How a line looks.
#[derive(Clone, Copy, Debug)]
pub struct Stroke {
    /// Its colour.
    pub color: Rgb,
    /// Its width.
    pub width: f64,
    /// Lengths of dash and gap, when dashed.
    pub dash: Option<(f64, f64)>,
}

impl Stroke {
    /// An unbroken line.
    #[must_use]
    pub fn solid(color: Rgb, width: f64) -> Self {
        Self { color, width, dash: None }
    }

    /// A dashed line.
    #[must_use]
    pub fn dashed(color: Rgb, width: f64) -> Self {
        Self { color, width, dash: Some((3.5 * width + 1.0, 2.0 * width + 1.0)) }
    }
}

/// Which part of a text lies at the given point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Its beginning.
    Start,
    /// Its middle.
    Middle,
    /// Its end.
    End,
}

/// How a text looks. The given point lies on its baseline.
#[derive(Clone, Copy, Debug)]
pub struct TextStyle {
    /// Em size.
    pub size: f64,
    /// Its colour.
    pub color: Rgb,
    /// Bold face.
    pub bold: bool,
    /// Which part lies at the given point.
    pub anchor: Anchor,
    /// Turned to be read from the bottom upwards.
    pub upright: bool,
}

impl TextStyle {
    /// Plain text of a size.
    #[must_use]
    pub fn new(size: f64, anchor: Anchor) -> Self {
        Self { size, color: style::INK, bold: false, anchor, upright: false }
    }

    /// The same in bold.
    #[must_use]
    pub fn bold(self) -> Self {
        Self { bold: true, ..self }
    }

    /// The same in another colour.
    #[must_use]
    pub fn colored(self, color: Rgb) -> Self {
        Self { color, ..self }
    }

    /// The same, read from the bottom upwards.
    #[must_use]
    pub fn upright(self) -> Self {
        Self { upright: true, ..self }
    }
}

/// One thing drawn.
#[derive(Clone, Debug)]
enum Mark {
    Image(Rect, Rgb8),
    Line(Vec<Point>, Stroke),
    Fill(Vec<Point>, Rgb),
    Disc(Point, f64, Rgb),
    Text(Point, String, TextStyle),
}

/// A drawing.
#[derive(Clone, Debug)]
pub struct Canvas {
    width: f64,
    height: f64,
    title: String,
    marks: Vec<Mark>,
}

impl Canvas {
    /// An empty drawing; the title is read to those who cannot see it.
    #[must_use]
    pub fn new(width: f64, height: f64, title: &str) -> Self {
        Self { width, height, title: title.to_owned(), marks: Vec::new() }
    }

    /// Width and height in points.
    #[must_use]
    pub fn size(&self) -> (f64, f64) {
        (self.width, self.height)
    }

    /// What the drawing shows, in words.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.title
    }

    /// An image stretched over a rectangle, pixels kept sharp.
    pub fn image(&mut self, at: Rect, image: Rgb8) {
        self.marks.push(Mark::Image(at, image));
    }

    /// A line through points.
    pub fn line(&mut self, points: impl Into<Vec<Point>>, stroke: Stroke) {
        self.marks.push(Mark::Line(points.into(), stroke));
    }

    /// A filled polygon.
    pub fn fill(&mut self, points: impl Into<Vec<Point>>, color: Rgb) {
        self.marks.push(Mark::Fill(points.into(), color));
    }

    /// A filled circle.
    pub fn disc(&mut self, center: Point, radius: f64, color: Rgb) {
        self.marks.push(Mark::Disc(center, radius, color));
    }

    /// The outline of a rectangle.
    pub fn outline(&mut self, rect: Rect, stroke: Stroke) {
        let [a, b, c, d] = rect.corners();
        self.line([a, b, c, d, a], stroke);
    }

    /// A line of text, `at` on its baseline.
    pub fn text(&mut self, at: Point, text: &str, style: TextStyle) {
        self.marks.push(Mark::Text(at, text.to_owned(), style));
    }

    /// A line of text centred vertically on `at`.
    pub fn label(&mut self, at: Point, text: &str, style: TextStyle) {
        let drop = font::HALF_CAP * style.size;
        let at = match style.upright {
            true => (at.0 + drop, at.1),
            false => (at.0, at.1 + drop),
        };
        self.text(at, text, style);
    }

    /// The drawing as a PNG file.
    ///
    /// # Errors
    /// When the drawing is empty or too large to hold, or the embedded font cannot be read.
    pub fn png(&self) -> Result<Vec<u8>> {
        bitmap::render(self)?.png()
    }

    /// The drawing as an SVG file.
    ///
    /// # Errors
    /// When an image in it cannot be encoded.
    pub fn svg(&self) -> Result<String> {
        svg::file(self)
    }

    /// The drawing as an `<svg>` element for an HTML page.
    ///
    /// # Errors
    /// When an image in it cannot be encoded.
    pub fn svg_element(&self) -> Result<String> {
        svg::element(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::raster::tests::decoded;

    fn sample() -> Canvas {
        let mut canvas = Canvas::new(60.0, 40.0, "a <title>");
        let image = Rgb8 { width: 2, height: 1, pixels: vec![255, 0, 0, 0, 0, 255] };
        canvas.image(Rect::new(10.0, 10.0, 20.0, 10.0), image);
        canvas.line([(0.0, 39.0), (59.0, 39.0)], Stroke::dashed(style::INK, 1.0));
        canvas.disc((50.0, 10.0), 4.0, style::DIRECT);
        canvas.text((30.0, 30.0), "σ & λ", TextStyle::new(10.0, Anchor::Middle));
        canvas
    }

    #[test]
    fn a_png_has_the_image_where_it_was_put() {
        let (width, height, pixels) = decoded(&sample().png().unwrap());
        assert_eq!((width, height), (120, 80));
        let at = |x: usize, y: usize| &pixels[3 * (y * 120 + x)..][..3];
        assert_eq!(at(20, 20), [255, 0, 0]);
        assert_eq!(at(39, 39), [255, 0, 0]);
        assert_eq!(at(40, 20), [0, 0, 255]);
        assert_eq!(at(19, 19), [255, 255, 255]);
        assert_eq!(at(100, 20), style::DIRECT);
        assert!(pixels.chunks(3).any(|c| c == style::INK), "no text or line");
    }

    #[test]
    fn an_svg_is_escaped_and_closed() {
        let svg = sample().svg().unwrap();
        assert!(svg.contains("a &lt;title&gt;") && svg.contains("σ &amp; λ"));
        assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
        assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
        assert!(svg.contains("data:image/png;base64,"));
        assert!(!sample().svg_element().unwrap().contains("http"));
    }

    #[test]
    fn odd_drawings_fail_or_pass_but_never_panic() {
        assert!(Canvas::new(0.0, 10.0, "").png().is_err());
        assert!(Canvas::new(f64::NAN, 10.0, "").png().is_err());
        assert!(Canvas::new(1e9, 1e9, "").png().is_err());
        let mut canvas = sample();
        let nan = f64::NAN;
        canvas.line([(nan, 1.0), (1e300, -1e300)], Stroke::dashed(style::INK, 2.0));
        canvas.fill([(nan, 1.0), (5.0, 5.0), (1e12, 0.0)], style::INK);
        canvas.fill([], style::INK);
        canvas.disc((1e300, nan), 1e300, style::INK);
        canvas.text((-1e300, 1e9), "away", TextStyle::new(9.0, Anchor::End));
        let nothing = Rgb8 { width: 0, height: 3, pixels: vec![] };
        canvas.image(Rect::new(0.0, 0.0, 5.0, 5.0), nothing);
        assert!(canvas.png().is_ok() && canvas.svg().is_ok());
    }
}
