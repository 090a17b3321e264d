//! What makes a picture readable: colour bar, scale bar, line key, panel letter.

use super::canvas::{Anchor, Canvas, Stroke, TextStyle, font};
use super::colormap::{COLORS, ColorMap};
use super::geometry::{Point, Rect};
use super::raster::Rgb8;
use super::style;

/// An upright colour bar with evenly spaced labels, lowest first, and a title above.
pub fn color_bar(canvas: &mut Canvas, at: Rect, map: ColorMap, labels: &[&str], title: &str) {
    let colors = map.palette()[1..].iter().rev().flatten().copied();
    let image = Rgb8 { width: 1, height: COLORS, pixels: colors.collect() };
    canvas.image(at, image);
    canvas.outline(at, Stroke::solid(style::INK, 1.0));
    let note = TextStyle::new(style::SMALL, Anchor::Start);
    for (n, label) in labels.iter().enumerate() {
        let part = n as f64 / (labels.len().max(2) - 1) as f64;
        let y = at.bottom() - part * at.h;
        canvas.line([(at.right(), y), (at.right() + 4.0, y)], Stroke::solid(style::INK, 1.0));
        canvas.label((at.right() + 8.0, y), label, note);
    }
    canvas.text((at.x, at.y - 12.0), title, note);
}

/// The colour bar of wrapped phase.
pub fn phase_bar(canvas: &mut Canvas, at: Rect) {
    color_bar(canvas, at, ColorMap::Phase, &["\u{2212}π", "0", "π"], "phase / rad");
}

/// A bar of known length in the lower right corner of an image, on a white ground.
pub fn scale_bar(canvas: &mut Canvas, image: Rect, length: f64, label: &str) {
    let width = length.max(font::width(label, style::SMALL, true)) + 14.0;
    let ground = Rect::new(image.right() - width - 6.0, image.bottom() - 33.0, width, 27.0);
    canvas.fill(ground.corners(), style::PAPER);
    let middle = ground.center().0;
    let bar = Rect::new(middle - length / 2.0, ground.bottom() - 7.5, length, 3.0);
    canvas.fill(bar.corners(), style::INK);
    let text = TextStyle::new(style::SMALL, Anchor::Middle).bold();
    canvas.text((middle, ground.y + 13.5), label, text);
}

/// The letter of panel `n` (0 is a) in the upper left corner of a panel, on a white ground.
pub fn panel_letter(canvas: &mut Canvas, panel: Rect, n: usize) {
    let ground = Rect::new(panel.x, panel.y, 20.0, 20.0);
    canvas.fill(ground.corners(), style::PAPER);
    let text = TextStyle::new(style::HEADING, Anchor::Middle).bold();
    canvas.label(ground.center(), &letter(n), text);
}

/// The letter of panel `n` left of and above a panel.
pub fn outer_letter(canvas: &mut Canvas, panel: Rect, n: usize) {
    let text = TextStyle::new(style::HEADING, Anchor::Start).bold();
    canvas.text((panel.x, panel.y - 8.0), &letter(n), text);
}

/// The letter of panel `n` above a panel and its heading beside it.
pub fn heading(canvas: &mut Canvas, panel: Rect, label: &str, n: usize) {
    outer_letter(canvas, panel, n);
    let text = TextStyle::new(style::HEADING, Anchor::Start);
    canvas.text((panel.x + 20.0, panel.y - 8.0), label, text);
}

/// Width of a [`heading`] with its letter.
#[must_use]
pub fn heading_width(label: &str) -> f64 {
    20.0 + font::width(label, style::HEADING, false)
}

/// a, b … z, then numbers.
fn letter(n: usize) -> String {
    match u8::try_from(n) {
        Ok(n @ 0..26) => char::from(b'a' + n).to_string(),
        _ => (n + 1).to_string(),
    }
}

/// A key to lines, one beside the other, starting at `at`; returns where it ends.
pub fn line_key(canvas: &mut Canvas, at: Point, entries: &[(&str, Stroke)]) -> f64 {
    let text = TextStyle::new(style::TEXT, Anchor::Start);
    let mut x = at.0;
    for &(label, stroke) in entries {
        canvas.line([(x, at.1), (x + 26.0, at.1)], stroke);
        canvas.label((x + 32.0, at.1), label, text);
        x += 32.0 + font::width(label, style::TEXT, false) + 24.0;
    }
    x - 24.0
}

/// Width of a [`line_key`].
#[must_use]
pub fn line_key_width(entries: &[(&str, Stroke)]) -> f64 {
    let widths = entries.iter().map(|(label, _)| 56.0 + font::width(label, style::TEXT, false));
    (widths.sum::<f64>() - 24.0).max(0.0)
}
