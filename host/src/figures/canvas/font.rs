//! The embedded typeface (DejaVu Sans): widths of texts, and their pixels.

use std::sync::OnceLock;

use plotters::style::{FontDesc, FontFamily, FontStyle, register_font};

/// Name under which the typeface is registered and asked for.
pub const FAMILY: &str = "DejaVu Sans";

/// Half the height of a capital, in em: lowers a baseline so that the text is centred.
pub const HALF_CAP: f64 = 0.364;

/// Ascent plus descent in em: the height by which plotters measures a size.
const LINE: f64 = (1901.0 + 483.0) / 2048.0;

/// Registers the typeface, once; false when it cannot be read.
fn registered() -> bool {
    static REGISTERED: OnceLock<bool> = OnceLock::new();
    *REGISTERED.get_or_init(|| {
        register_font(FAMILY, FontStyle::Normal, dejavu::sans::regular()).is_ok()
            && register_font(FAMILY, FontStyle::Bold, dejavu::sans::bold()).is_ok()
    })
}

/// The typeface at an em size.
pub(super) fn face(size: f64, bold: bool) -> Option<FontDesc<'static>> {
    let style = match bold {
        true => FontStyle::Bold,
        false => FontStyle::Normal,
    };
    registered().then(|| FontDesc::new(FontFamily::Name(FAMILY), size * LINE, style))
}

/// Width of a text at an em size.
#[must_use]
pub fn width(text: &str, size: f64, bold: bool) -> f64 {
    /// Widths come in whole pixels: measured large, they are exact enough.
    const FINE: f64 = 16.0;
    let measured = face(FINE * size, bold).and_then(|face| face.box_size(text).ok());
    match measured {
        Some((pixels, _)) => f64::from(pixels) / FINE,
        None => 0.6 * size * text.chars().count() as f64,
    }
}

/// Visits every pixel a text covers, with its coverage, relative to the start of its baseline.
/// False when the typeface cannot be read.
pub(super) fn visit(
    text: &str,
    size: f64,
    bold: bool,
    mut pixel: impl FnMut(i32, i32, f32),
) -> bool {
    let Some(face) = face(size, bold) else {
        return false;
    };
    // plotters puts the baseline half a size below the point it is given.
    let rise = (size * LINE / 2.0) as i32;
    let drawn = face.draw(text, (0, -rise), |x, y, coverage| {
        pixel(x, y, coverage);
        Ok::<(), std::convert::Infallible>(())
    });
    drawn.is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_grow_with_text_and_size() {
        assert_eq!(width("", 12.0, false), 0.0);
        assert!(width("φ(t)", 12.0, false) < width("φ(t) / rad", 12.0, false));
        let (one, two) = (width("phase", 10.0, true), width("phase", 20.0, true));
        assert!((two - 2.0 * one).abs() < 1.0);
    }
}
