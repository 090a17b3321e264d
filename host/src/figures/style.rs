//! The look all figures share: sizes in points, colours that stay apart for the colour-blind.

use super::colormap::Rgb;

/// Ordinary text.
pub const TEXT: f64 = 13.0;
/// Tick labels and notes.
pub const SMALL: f64 = 11.5;
/// Headings of a figure's parts.
pub const HEADING: f64 = 15.0;

/// Lines and text.
pub const INK: Rgb = [34, 34, 34];
/// What should stay in the background.
pub const FAINT: Rgb = [110, 110, 110];
/// The page.
pub const PAPER: Rgb = [255, 255, 255];

/// The truth, where it is known.
pub const TRUTH: Rgb = INK;
/// Direct phase difference to the first frame (Okabe and Ito's vermilion).
pub const DIRECT: Rgb = [213, 94, 0];
/// One-step Knox-Thompson (bluish green).
pub const ONE_STEP: Rgb = [0, 158, 115];
/// Extended Knox-Thompson, the walk (blue).
pub const EXTENDED: Rgb = [0, 114, 178];
/// Linked phases (reddish purple).
pub const LINKED: Rgb = [204, 121, 167];

/// Depth, rows, columns (z, y, x), where their curves stand together.
pub const AXES: [Rgb; 3] = [EXTENDED, DIRECT, ONE_STEP];

/// What [`DIRECT`] is called.
pub const DIRECT_NAME: &str = "direct difference";
/// What [`ONE_STEP`] is called.
pub const ONE_STEP_NAME: &str = "one-step Knox\u{2013}Thompson";
/// What [`EXTENDED`] is called.
pub const EXTENDED_NAME: &str = "extended Knox\u{2013}Thompson";
/// What [`LINKED`] is called.
pub const LINKED_NAME: &str = "linked phases";

/// A colour mixed with the page: `share` 1 is the colour, 0 the page.
#[must_use]
pub fn tint(color: Rgb, share: f64) -> Rgb {
    let share = share.clamp(0.0, 1.0);
    color.map(|part| (255.0 - share * (255.0 - f64::from(part))).round() as u8)
}
