//! Phases of the board's on-line solver beside the host's.

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, Stroke, TextStyle};
use super::geometry::Rect;
use super::keys;
use super::scale::Span;
use super::style;

/// Phases of one series, one per volume, in radians.
#[derive(Clone, Copy, Debug)]
pub struct Online<'a> {
    /// Heading, such as `50 speckles, 70 volumes`.
    pub label: &'a str,
    /// What the board said.
    pub board: &'a [f64],
    /// Its standard deviations; infinite where nothing was measured.
    pub sigma: &'a [f64],
    /// What the host found in `f64`.
    pub host: &'a [f64],
}

const AREA: Rect = Rect { x: 80.0, y: 74.0, w: 560.0, h: 300.0 };
const BOARD: Stroke = Stroke { color: style::EXTENDED, width: 2.4, dash: None };
const HOST: Stroke = Stroke { color: style::INK, width: 1.4, dash: Some((6.0, 4.0)) };

impl Online<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let title = "Phase by the board's on-line solver";
        let mut canvas = Canvas::new(AREA.right() + 20.0, AREA.bottom() + 50.0, title);
        let heading = TextStyle::new(style::HEADING, Anchor::Start).bold();
        canvas.text((AREA.x, 24.0), title, heading);
        let faint = TextStyle::new(style::TEXT, Anchor::Start).colored(style::FAINT);
        canvas.text((AREA.x, 42.0), self.label, faint);
        self.curves(&mut canvas);
        let key = [("board, ± one standard deviation", BOARD), ("host, f64", HOST)];
        keys::line_key(&mut canvas, (AREA.x, 60.0), &key);
        canvas
    }

    fn curves(&self, canvas: &mut Canvas) {
        let last = self.board.len().max(self.host.len()).saturating_sub(1);
        let phases = self.board.iter().chain(self.host).copied();
        let axes = Axes::new(AREA, Span::new(0.0, last as f64), Span::of(phases).padded(0.1));
        let band = self.board.iter().zip(self.sigma).enumerate();
        let band: Vec<_> = band.map(|(t, (phase, s))| (t as f64, phase - s, phase + s)).collect();
        axes.band(canvas, &band, style::tint(style::EXTENDED, 0.25));
        let points = |values: &[f64]| -> Vec<_> {
            values.iter().enumerate().map(|(t, &value)| (t as f64, value)).collect()
        };
        axes.curve(canvas, points(self.board), BOARD);
        axes.curve(canvas, points(self.host), HOST);
        axes.x_axis(canvas, Some("volume"));
        axes.y_axis(canvas, Some("phase / rad"));
        axes.frame(canvas);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_curves_are_named() {
        let (board, sigma) = ([0.0, 0.1, 0.3], [f64::INFINITY, 0.1, 0.1]);
        let figure = Online { label: "3 volumes", board: &board, sigma: &sigma, host: &board };
        let svg = figure.draw().svg().unwrap();
        for text in ["3 volumes", "host, f64", "phase / rad", "volume"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn odd_series_are_drawn() {
        for board in [&[][..], &[f64::NAN], &[f64::INFINITY, 1.0]] {
            let figure = Online { label: "", board, sigma: board, host: &[] };
            assert!(figure.draw().png().is_ok());
        }
    }
}
