//! The frames of a strip in memory: its rows with R rows of circular halo above and below, in lane blocks.
//!
//! A thread goes from strip to strip beside each other where it can (`turns`): of the next one it then holds most rows
//! already, as its own or in the halo, and only the others are read.

use super::strip::{Columns, Layout};
use super::worker::STRIPS;
use crate::allocate::filled;
use crate::error::Result;
use crate::io::{Series, Shape};
use crate::lanes::Lanes;
use num_complex::{Complex, Complex32};
use std::ops::Range;

/// The frames of the strip that was loaded last.
pub(super) struct Fields<L> {
    /// (frame, depth, vector, line), see [`Columns`], scaled, unusable pixels 0.
    pub numbers: Vec<Complex<L>>,
    /// Rows of the strip that is held; none before the first.
    rows: Range<usize>,
    /// Lines on their way from the file.
    buffer: Vec<Complex32>,
}

/// How the numbers of a series enter the strips.
pub(super) struct Source<'a> {
    /// The frames.
    pub series: &'a dyn Series,
    /// Depths, Z1 first.
    pub depths: &'a [usize],
    /// Usable pixels (y, x).
    pub valid: &'a [bool],
    /// Factor on every number.
    pub scale: f32,
}

impl<L: Lanes> Fields<L> {
    /// Buffers for strips of at most `rows` rows of so many planes: frames times depths.
    pub fn new(planes: usize, layout: &Layout, rows: usize) -> Result<Self> {
        let zero = Complex { re: L::zero(), im: L::zero() };
        let numbers = filled(zero, planes * Columns::new(layout, rows).plane(), STRIPS)?;
        Ok(Self { numbers, rows: 0..0, buffer: Vec::new() })
    }

    /// Load the strip of `rows`.
    #[inline(always)]
    pub fn load(&mut self, source: &Source<'_>, layout: &Layout, rows: Range<usize>) -> Result<()> {
        let Shape { frames, height, width, .. } = source.series.shape();
        let columns = Columns::new(layout, rows.len());
        let (moved, missing) = kept(&self.rows, &rows, columns.tall);
        // Should reading fail halfway, nothing counts as held.
        self.rows = 0..0;
        self.buffer.resize(missing.len() * width, Complex32::default());
        let mut planes = self.numbers.chunks_exact_mut(columns.plane());
        for frame in 0..frames {
            for &depth in source.depths {
                let Some(plane) = planes.next() else { return Ok(()) };
                if let Some((from, to)) = &moved {
                    for column in plane.chunks_exact_mut(columns.tall) {
                        column.copy_within(from.clone(), *to);
                    }
                }
                let y = circular(rows.start, missing.start, layout.halo, height);
                read_circular(source.series, frame, depth, y, &mut self.buffer)?;
                for (i, line) in missing.clone().zip(self.buffer.chunks_exact_mut(width)) {
                    let y = circular(rows.start, i, layout.halo, height);
                    scale_usable(line, &source.valid[y * width..], source.scale);
                    scatter(line, layout, columns.line(plane, i));
                }
            }
        }
        self.rows = rows;
        Ok(())
    }

    /// Hold nothing, so that the next strip is read whole.
    pub fn forget(&mut self) {
        self.rows = 0..0;
    }
}

/// Which lines of the strip that is held are lines of the next one, and where they go; and the lines that are missing.
fn kept(
    held: &Range<usize>,
    next: &Range<usize>,
    tall: usize,
) -> (Option<(Range<usize>, usize)>, Range<usize>) {
    let shift = held.start.abs_diff(next.start);
    if held.len() != next.len() || shift >= tall {
        return (None, 0..tall);
    }
    if next.start >= held.start {
        (Some((shift..tall, 0)), tall - shift..tall)
    } else {
        (Some((0..tall - shift, shift)), 0..shift)
    }
}

/// Image row of line i of a strip that begins `halo` rows above `start`.
pub(super) fn circular(start: usize, i: usize, halo: usize, height: usize) -> usize {
    ((start + i) as isize - halo as isize).rem_euclid(height as isize) as usize
}

/// Fill the lines of the buffer with the rows from y on, circularly, in as few requests as the image's edge allows.
fn read_circular(
    series: &dyn Series,
    frame: usize,
    depth: usize,
    y: usize,
    buffer: &mut [Complex32],
) -> Result<()> {
    let Shape { height, width, .. } = series.shape();
    let (mut y, mut rest) = (y, buffer);
    while !rest.is_empty() {
        let count = (height - y).min(rest.len() / width);
        let (part, others) = rest.split_at_mut(count * width);
        series.read_rows(frame, depth, y..y + count, part)?;
        (y, rest) = (0, others);
    }
    Ok(())
}

/// Scale the numbers of a line, and leave 0 where the pixel is not usable.
#[inline(always)]
pub(super) fn scale_usable(line: &mut [Complex32], valid: &[bool], scale: f32) {
    for (u, &valid) in line.iter_mut().zip(valid) {
        u.re = if valid { u.re * scale } else { 0.0 };
        u.im = if valid { u.im * scale } else { 0.0 };
    }
}

/// One line into lane blocks.
#[inline(always)]
pub(super) fn scatter<'a, L: Lanes>(
    line: &[Complex32],
    layout: &Layout,
    vectors: impl Iterator<Item = &'a mut Complex<L>>,
) {
    for (i, Complex { re, im }) in vectors.enumerate() {
        let re = L::flat_mut(std::slice::from_mut(re)).iter_mut();
        let im = L::flat_mut(std::slice::from_mut(im)).iter_mut();
        for (lane, (re, im)) in re.zip(im).enumerate() {
            let column = lane * layout.blocks + i;
            let column = if column < line.len() { column } else { column % line.len() };
            let u = line[column];
            *re = L::Element::from(u.re);
            *im = L::Element::from(u.im);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Array;
    use crate::series::HeldSeries;

    /// From whichever strip to whichever other, the same numbers as of a strip that is read whole.
    #[test]
    fn strips_beside_each_other_hold_what_strips_read_whole_do() {
        let shape = Shape { frames: 2, depth: 2, height: 11, width: 9 };
        let field = (0..2 * 2 * 11 * 9).map(|i| Complex32::new(i as f32, -(i as f32))).collect();
        let series = HeldSeries::new(shape, field).unwrap();
        let valid: Vec<bool> = (0..11 * 9).map(|i| i % 7 != 0).collect();
        let source = Source { series: &series, depths: &[1, 0], valid: &valid, scale: 0.5 };
        for halo in [0, 1, 3, 14] {
            let layout = Layout::new(9, 8, halo);
            let new = || Fields::<Array<f32, 8>>::new(4, &layout, 4).unwrap();
            let mut kept = new();
            for rows in [0..4, 4..8, 8..11, 4..8, 0..4, 4..8, 3..7, 3..7, 7..11] {
                kept.load(&source, &layout, rows.clone()).unwrap();
                let mut whole = new();
                whole.load(&source, &layout, rows.clone()).unwrap();
                let size = 4 * Columns::new(&layout, rows.len()).plane();
                let flat = |fields: &Fields<Array<f32, 8>>| -> Vec<f32> {
                    let numbers = fields.numbers[..size].iter();
                    numbers
                        .flat_map(|u| [Array::flat(&[u.re]), Array::flat(&[u.im])].concat())
                        .collect()
                };
                assert_eq!(flat(&kept), flat(&whole), "halo {halo}, rows {rows:?}");
                assert!(flat(&whole).iter().any(|&number| number != 0.0));
            }
        }
    }
}
