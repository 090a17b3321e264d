//! A strip of rows in lane-block layout.
//!
//! A row of W columns is cut into `WIDTH` blocks of B = ceil(W / 16) 16 / `WIDTH` columns, so that blocks of few
//! lanes are made of whole blocks of many; vector i holds column
//! l B + i in lane l. The neighbour of every column of vector i is then in vector i+1, aligned, so
//! the horizontal filter reads whole vectors. Columns at and beyond W repeat the row from its
//! beginning (the average is circular); R vectors of halo on each side are copied lane by lane.

use crate::lanes::Lanes;
use std::ops::Range;

/// The most lanes of any path.
const MOST_LANES: usize = 16;

/// The fewest lanes of any path that images are computed on.
const FEWEST_LANES: usize = 8;

/// Columns that every path keeps in whole blocks: what differs from place to place may change at multiples of it.
#[must_use]
pub const fn common_block(width: usize) -> usize {
    width.div_ceil(MOST_LANES) * (MOST_LANES / FEWEST_LANES)
}

/// Where the columns of a row are.
#[derive(Clone, Debug)]
pub struct Layout {
    /// W.
    pub width: usize,
    /// B: vectors per row.
    pub blocks: usize,
    /// R: vectors of halo on each side in the filter's row buffer.
    pub halo: usize,
    /// For each halo vector (left ones, then right ones) and lane: the vector and lane to copy from.
    halo_sources: Vec<(usize, usize)>,
}

impl Layout {
    /// Layout of rows of `width` columns in `lanes` lanes.
    #[must_use]
    pub fn new(width: usize, lanes: usize, halo: usize) -> Self {
        let blocks = width.div_ceil(MOST_LANES) * (MOST_LANES / lanes).max(1);
        let position = |vector: isize, lane: usize| {
            let column = (lane * blocks) as isize + vector - halo as isize;
            let column = column.rem_euclid(width as isize) as usize;
            (halo + column % blocks, column / blocks)
        };
        let halo_vectors = (0..halo).chain(halo + blocks..2 * halo + blocks);
        let halo_sources = halo_vectors
            .flat_map(|vector| (0..lanes).map(move |lane| position(vector as isize, lane)))
            .collect();
        Self { width, blocks, halo, halo_sources }
    }

    /// The same rows with another number of rows of halo, to load them with.
    #[must_use]
    pub fn with_rows_of_halo(&self, halo: usize) -> Self {
        Self { halo, halo_sources: Vec::new(), ..*self }
    }

    /// Fill the halo of a row buffer of B + 2R positions with `CH` vectors each.
    #[inline(always)]
    pub fn fill_halo<L: Lanes, const CH: usize>(&self, row: &mut [[L; CH]]) {
        let Self { halo, blocks, .. } = *self;
        if halo > blocks {
            return self.copy_halo(row, 0..L::WIDTH);
        }
        // The neighbours of a lane's ends are in the lanes beside it.
        for vector in 0..halo {
            let (above, below) = (row[vector + blocks], row[vector + halo]);
            for (number, above) in row[vector].iter_mut().zip(above) {
                *number = above.rotate_up();
            }
            for (number, below) in row[vector + blocks + halo].iter_mut().zip(below) {
                *number = below.rotate_down();
            }
        }
        if L::WIDTH * blocks != self.width {
            self.copy_halo(row, 0..1);
            self.copy_halo(row, L::WIDTH - 1..L::WIDTH);
        }
    }

    /// The same number by number, for some of the lanes.
    #[inline(always)]
    fn copy_halo<L: Lanes, const CH: usize>(&self, row: &mut [[L; CH]], lanes: Range<usize>) {
        let numbers = L::flat_mut(row.as_flattened_mut());
        let targets = (0..self.halo).chain(self.halo + self.blocks..2 * self.halo + self.blocks);
        for (target, sources) in targets.zip(self.halo_sources.chunks_exact(L::WIDTH)) {
            for lane in lanes.clone() {
                let (vector, from) = sources[lane];
                for channel in 0..CH {
                    numbers[(target * CH + channel) * L::WIDTH + lane] =
                        numbers[(vector * CH + channel) * L::WIDTH + from];
                }
            }
        }
    }
}

/// How the fields of a frame lie in memory: vector after vector, each with all its lines, as the filter along y reads
/// them. (Row after row a pair's products would wait for every line: the third cache is far.)
#[derive(Clone, Copy, Debug)]
pub struct Columns {
    /// Vectors of a row.
    pub blocks: usize,
    /// Lines, those of the halo too.
    pub tall: usize,
}

impl Columns {
    /// Those of `rows` rows with their halo.
    #[must_use]
    pub const fn new(layout: &Layout, rows: usize) -> Self {
        Self { blocks: layout.blocks, tall: rows + 2 * layout.halo }
    }

    /// Where a vector of a line is.
    #[inline(always)]
    #[must_use]
    pub const fn place(self, line: usize, vector: usize) -> usize {
        vector * self.tall + line
    }

    /// Places of one depth.
    #[inline(always)]
    #[must_use]
    pub const fn plane(self) -> usize {
        self.blocks * self.tall
    }

    /// The places of a line.
    #[inline(always)]
    pub fn line<T>(self, plane: &mut [T], line: usize) -> impl Iterator<Item = &mut T> {
        plane.iter_mut().skip(line).step_by(self.tall)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Array;
    use phasewalk_core::Scalar;

    /// After the halo has been filled, each lane reads its row circularly, whatever the width.
    #[test]
    fn every_neighbour_is_where_the_filter_looks() {
        for width in [1, 3, 8, 13, 16, 37, 64] {
            for halo in [1, 5, 40] {
                let layout = Layout::new(width, 8, halo);
                let vectors = layout.blocks + 2 * halo;
                let mut row = vec![[Array::<f32, 8>::zero(); 2]; vectors];
                for i in 0..layout.blocks {
                    for lane in 0..8 {
                        let column = (lane * layout.blocks + i) % width;
                        for (channel, offset) in [0.5, 100.5].into_iter().enumerate() {
                            let at = &mut row[halo + i][channel..=channel];
                            Array::flat_mut(at)[lane] = column as f32 + offset;
                        }
                    }
                }
                layout.fill_halo(&mut row);
                for (vector, channels) in row.iter().enumerate() {
                    for (channel, offset) in [0.5, 100.5].into_iter().enumerate() {
                        for (lane, &x) in
                            Array::flat(&channels[channel..=channel]).iter().enumerate()
                        {
                            let column = (lane * layout.blocks + vector) as isize - halo as isize;
                            let expected = column.rem_euclid(width as isize) as f32 + offset;
                            assert_eq!(x, expected, "width {width}, vector {vector}, lane {lane}");
                        }
                    }
                }
            }
        }
    }
}
