//! The light source: the mean spectrum of every sweep, and what is left without it.

use ndarray::{ArrayView1, ArrayView2};

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, Stroke, TextStyle};
use super::geometry::{Point, Rect};
use super::keys;
use super::scale::Span;
use super::style;
use super::verdicts;

/// The figure.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// Mean counts of every image, axes (sweep, image of the sweep); NaN where there is no image.
    pub counts: ArrayView2<'a, f32>,
    /// `ok`, or why the sweep was left out.
    pub verdicts: &'a [String],
    /// Another curve over the images of a sweep, in a panel below.
    pub residual: Option<Residual<'a>>,
}

/// What is left when the source has been taken away.
#[derive(Clone, Copy, Debug)]
pub struct Residual<'a> {
    /// Title of the axis with its unit, such as `fringe rms / DN`.
    pub title: &'a str,
    /// Values by image of the sweep, NaN where there is none.
    pub values: &'a [f64],
}

const LEFT: f64 = 84.0;
const TOP: f64 = 40.0;
const WIDTH: f64 = 780.0;
const HEIGHT: f64 = 270.0;
const RESIDUAL_HEIGHT: f64 = 150.0;
const GAP: f64 = 18.0;
/// Right of the panels: numbers of the sweeps left out.
const RIGHT: f64 = 74.0;
const FOOT: f64 = 52.0;
/// Least distance of two of these numbers, and how many there are room for.
const DISTANCE: f64 = 13.0;
const NUMBERS: usize = 12;

impl Source<'_> {
    /// Draws the figure.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let lines = verdicts::lines(self.verdicts, WIDTH + RIGHT - 10.0);
        let (spectra, below) = self.panels();
        let bottom = below.unwrap_or(spectra).bottom();
        let height = bottom + FOOT + verdicts::height(&lines);
        let title = "Source: mean spectrum of every sweep";
        let mut canvas = Canvas::new(LEFT + WIDTH + RIGHT, height, title);
        self.draw_spectra(&mut canvas, spectra, below.is_none());
        if let (Some(area), Some(residual)) = (below, self.residual) {
            self.draw_residual(&mut canvas, area, &residual);
        }
        keys::line_key(&mut canvas, (LEFT, 22.0), &self.key());
        verdicts::list(&mut canvas, (LEFT, bottom + FOOT + 5.0), &lines);
        canvas
    }

    fn draw_spectra(&self, canvas: &mut Canvas, area: Rect, lowest: bool) {
        let counts = self.counts.iter().map(|&value| f64::from(value));
        let axes = Axes::new(area, self.images(), Span::of(counts.chain([0.0])).padded(0.05));
        let (bad, good): (Vec<_>, Vec<_>) =
            (0..self.counts.nrows()).partition(|&sweep| verdicts::is_bad(self.verdicts, sweep));
        for &sweep in &good {
            axes.curve(canvas, points(self.counts.row(sweep)), GOOD);
        }
        let median = self.median(&good);
        axes.curve(canvas, median.into_iter().enumerate().map(|(m, v)| (m as f64, v)), MEDIAN);
        for &sweep in &bad {
            axes.curve(canvas, points(self.counts.row(sweep)), BAD);
        }
        axes.x_axis(canvas, lowest.then_some(IMAGES));
        axes.y_axis(canvas, Some("mean of the image / DN"));
        axes.frame(canvas);
        self.number(canvas, &axes, &bad);
    }

    fn draw_residual(&self, canvas: &mut Canvas, area: Rect, residual: &Residual<'_>) {
        let values = residual.values.iter().copied();
        let axes = Axes::new(area, self.images(), Span::of(values.chain([0.0])).padded(0.06));
        let points = residual.values.iter().enumerate().map(|(m, &v)| (m as f64, v));
        axes.curve(canvas, points, MEDIAN);
        axes.x_axis(canvas, Some(IMAGES));
        axes.y_axis(canvas, Some(residual.title));
        axes.frame(canvas);
    }

    /// Numbers of the sweeps left out, where their spectra end.
    fn number(&self, canvas: &mut Canvas, axes: &Axes, bad: &[usize]) {
        let ends = bad.iter().filter_map(|&sweep| Some((sweep, self.end(sweep)?)));
        let places = ends.map(|(sweep, end)| (sweep, axes.place(end)));
        let last = axes.place((self.counts.ncols().saturating_sub(1) as f64, 0.0)).0;
        let (full, short): (Vec<_>, Vec<_>) =
            places.take(NUMBERS).partition(|(_, (x, _))| *x >= last - 0.5);
        beside(canvas, axes.area, full);
        for (sweep, (x, y)) in short {
            // The source grows in the first half and falls in the second.
            let below = if x < axes.area.center().0 { 15.0 } else { -15.0 };
            canvas.disc((x, y), 2.5, BAD.color);
            canvas.label((x + 6.0, y + below), &format!("sweep {sweep}"), NUMBER);
        }
    }

    /// The last image of a sweep.
    fn end(&self, sweep: usize) -> Option<Point> {
        let values: Vec<_> = points(self.counts.row(sweep)).collect();
        values.into_iter().rev().find(|(_, value)| value.is_finite())
    }

    /// Median over sweeps, image by image.
    fn median(&self, sweeps: &[usize]) -> Vec<f64> {
        let middle = |column: ArrayView1<'_, f32>| {
            let mut values: Vec<_> = sweeps.iter().map(|&sweep| column[sweep]).collect();
            values.retain(|value| value.is_finite());
            values.sort_by(f32::total_cmp);
            let half = values.len() / 2;
            let lower = values.get(half.saturating_sub(1 - values.len() % 2));
            let pair = (lower, values.get(half));
            pair.0.zip(pair.1).map_or(f64::NAN, |(a, b)| 0.5 * (f64::from(*a) + f64::from(*b)))
        };
        self.counts.columns().into_iter().map(middle).collect()
    }

    fn key(&self) -> Vec<(&'static str, Stroke)> {
        let drawn = |sweep| verdicts::is_bad(self.verdicts, sweep) && self.end(sweep).is_some();
        let bad = (0..self.counts.nrows()).any(drawn);
        let mut entries = vec![("median", MEDIAN), ("every sweep", GOOD)];
        if bad {
            entries.push(("sweeps left out", BAD));
        }
        entries
    }

    /// The panel of the spectra, and that of the residual where there is one.
    fn panels(&self) -> (Rect, Option<Rect>) {
        let spectra = Rect::new(LEFT, TOP, WIDTH, HEIGHT);
        let below = Rect::new(LEFT, spectra.bottom() + GAP, WIDTH, RESIDUAL_HEIGHT);
        (spectra, self.residual.map(|_| below))
    }

    fn images(&self) -> Span {
        let residual = self.residual.map_or(0, |residual| residual.values.len());
        let count = self.counts.ncols().max(residual);
        Span::new(0.0, count.saturating_sub(1) as f64)
    }
}

const IMAGES: &str = "image m of the sweep";
const MEDIAN: Stroke = Stroke { color: style::INK, width: 1.6, dash: None };
const BAD: Stroke = Stroke { color: style::DIRECT, width: 1.2, dash: None };
/// The pale sister of [`style::EXTENDED`].
const GOOD: Stroke = Stroke { color: [150, 197, 224], width: 0.8, dash: None };

const NUMBER: TextStyle = TextStyle {
    size: style::SMALL,
    color: BAD.color,
    bold: false,
    anchor: Anchor::Start,
    upright: false,
};

/// Numbers right of the frame at the height of their spectra, moved apart.
fn beside(canvas: &mut Canvas, area: Rect, mut ends: Vec<(usize, Point)>) {
    ends.sort_by(|a, b| a.1.1.total_cmp(&b.1.1));
    let mut free = area.y;
    for (n, &(sweep, (_, y))) in ends.iter().enumerate() {
        let below = DISTANCE * (ends.len() - 1 - n) as f64;
        let y = y.max(free).min(area.bottom() - below);
        canvas.label((area.right() + 7.0, y), &format!("sweep {sweep}"), NUMBER);
        free = y + DISTANCE;
    }
}

fn points(row: ArrayView1<'_, f32>) -> impl Iterator<Item = (f64, f64)> {
    row.into_iter().enumerate().map(|(m, &value)| (m as f64, f64::from(value)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};

    #[test]
    fn spectra_are_named_and_bad_ones_numbered() {
        let counts = Array2::from_shape_fn((8, 16), |(t, m)| (t + m) as f32);
        let mut verdicts = vec!["ok".to_owned(); 8];
        verdicts[3] = "missing".to_owned();
        let residual = Residual { title: "fringe rms / DN", values: &[1.0, 2.0] };
        let figure =
            Source { counts: counts.view(), verdicts: &verdicts, residual: Some(residual) };
        let svg = figure.draw().svg().unwrap();
        let texts = ["median", "sweeps left out", "left out: sweep 3 missing", ">sweep 3<"];
        for text in texts.iter().chain(&["fringe rms / DN", IMAGES, "mean of the image / DN"]) {
            assert!(svg.contains(text), "{text}");
        }
        assert!(figure.draw().png().is_ok());
    }

    #[test]
    fn the_median_ignores_missing_images() {
        let nan = f32::NAN;
        let counts = array![[1.0, nan, nan], [3.0, 5.0, nan], [8.0, nan, nan], [2.0, 7.0, nan]];
        let figure = Source { counts: counts.view(), verdicts: &[], residual: None };
        let median = figure.median(&[0, 1, 2, 3]);
        assert_eq!(median[..2], [2.5, 6.0]);
        assert!(median[2].is_nan() && figure.median(&[])[0].is_nan());
    }

    #[test]
    fn odd_spectra_are_drawn() {
        let verdicts: Vec<_> = (0..40).map(|n| format!("bad {n}")).collect();
        for (size, value) in [((0, 0), 0.0), ((40, 3), f32::NAN), ((40, 1), 5.0), ((3, 0), 1.0)] {
            let counts = Array2::from_elem(size, value);
            let residual = Some(Residual { title: "", values: &[f64::NAN, 1e300] });
            let figure = Source { counts: counts.view(), verdicts: &verdicts, residual };
            assert!(figure.draw().png().is_ok());
        }
    }
}
