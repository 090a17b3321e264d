//! Images of one size in rows and columns, as large as a page allows.

use super::geometry::Rect;
use super::keys;

/// Where the images of a figure lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Images in the figure.
    pub count: usize,
    /// Images side by side.
    pub across: usize,
    /// Width of an image in points.
    pub width: f64,
    /// Height of an image in points.
    pub height: f64,
    /// From the left edge of an image to that of its neighbour.
    pub pitch: f64,
}

/// Left of the images: numbers and title of their axes.
const LEFT: f64 = 66.0;
/// Above the images: what is common to them.
const HEAD: f64 = 26.0;
/// Above every image: its heading.
const TOP: f64 = 34.0;
/// Narrowest cell: its axis has a title.
const LEAST: f64 = 180.0;
/// Between neighbours.
const GAP: f64 = 18.0;
/// Most points for the images side by side, and one below the other.
const ROOM: (f64, f64) = (1150.0, 820.0);
/// Largest side of an image pixel in points.
const LARGEST: f64 = 4.0;
/// Points per pixel of a drawing's PNG: an image pixel is a whole number of them.
const STEP: f64 = 1.0 / super::canvas::PNG_SCALE as f64;

impl Grid {
    /// A grid for images with their headings; all are drawn in the size of the first.
    #[must_use]
    pub fn headed<'a>(images: impl Iterator<Item = (&'a str, (usize, usize))> + Clone) -> Self {
        let size = images.clone().next().map_or((1, 1), |(_, size)| size);
        let widths = images.clone().map(|(label, _)| keys::heading_width(label));
        Self::new(images.count(), size, widths.fold(LEAST, f64::max))
    }

    /// As many images side by side as show the pixels largest; no cell narrower than `least`.
    ///
    /// `size` is (rows, columns) of an image. Flat or narrow images are stretched along their
    /// shorter side, by a whole factor.
    #[must_use]
    pub fn new(count: usize, size: (usize, usize), least: f64) -> Self {
        let (rows, columns) = (size.0.max(1) as f64, size.1.max(1) as f64);
        let high = (columns / (2.0 * rows)).floor().max(1.0);
        let wide = (rows / (2.0 * columns)).floor().max(1.0);
        let unit = (columns * wide, rows * high);
        let room = |across: usize| ROOM.0 / across as f64 - GAP;
        let pixel = |across: usize| {
            let down = count.max(1).div_ceil(across) as f64;
            whole((room(across) / unit.0).min((ROOM.1 / down - TOP) / unit.1))
        };
        let rank = |across: usize| (room(across) >= least, pixel(across));
        let best = (1..=count.max(1)).fold(1, |a, b| if rank(b) >= rank(a) { b } else { a });
        let pixel = pixel(best);
        let (width, height) = (unit.0 * pixel, unit.1 * pixel);
        Self { count, across: best, width, height, pitch: width.max(least) + GAP }
    }

    /// The place of image `n`, row by row.
    #[must_use]
    pub fn panel(&self, n: usize) -> Rect {
        let (row, column) = (n / self.across, n % self.across);
        let x = LEFT + column as f64 * self.pitch;
        let y = HEAD + TOP + row as f64 * (self.height + TOP);
        Rect::new(x, y, self.width, self.height)
    }

    /// Right edge of the images' cells.
    #[must_use]
    pub fn right(&self) -> f64 {
        LEFT + self.across as f64 * self.pitch - GAP
    }

    /// Lower edge of the lowest images.
    #[must_use]
    pub fn bottom(&self) -> f64 {
        self.panel(self.count.max(1) - 1).bottom()
    }

    /// Whether an image is the first of its row.
    #[must_use]
    pub fn is_first(&self, n: usize) -> bool {
        n.is_multiple_of(self.across)
    }

    /// Whether an image is the last of its row.
    #[must_use]
    pub fn is_last(&self, n: usize) -> bool {
        (n + 1).is_multiple_of(self.across) || n + 1 == self.count
    }

    /// Whether no image lies below.
    #[must_use]
    pub fn is_lowest(&self, n: usize) -> bool {
        n + self.across >= self.count
    }
}

/// The largest side of an image pixel that is whole in a PNG; less only where nothing else fits.
fn whole(room: f64) -> f64 {
    match room >= STEP {
        true => ((room / STEP).floor() * STEP).min(LARGEST),
        false => room.max(1e-3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_images_are_stacked_and_narrow_ones_stand_side_by_side() {
        assert_eq!(Grid::new(2, (256, 640), 100.0).across, 1);
        assert_eq!(Grid::new(3, (128, 144), 100.0).across, 3);
        assert_eq!(Grid::new(2, (128, 144), 100.0).width, 3.5 * 144.0);
    }

    #[test]
    fn flat_images_are_stretched() {
        let grid = Grid::new(1, (64, 640), 100.0);
        assert_eq!(grid.height / 64.0, 5.0 * grid.width / 640.0);
    }

    #[test]
    fn odd_sizes_have_a_place() {
        for size in [(0, 0), (1, 100_000), (100_000, 1), (3, 3)] {
            for count in [0, 1, 7] {
                let grid = Grid::new(count, size, 200.0);
                assert!(grid.width > 0.0 && grid.height > 0.0 && grid.across > 0);
                assert!(grid.right() < 2000.0 && grid.bottom() < 2000.0, "{size:?} {grid:?}");
            }
        }
    }
}
