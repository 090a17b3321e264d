//! Which parts of a volume are compared.

/// Most depths that are kept: the retina and some room to move.
const DEPTHS: usize = 64;
/// Largest block (y, x) in pixels; larger fields are represented by four of them.
const BLOCK: [usize; 2] = [96, 144];
/// Pixels along the edges of a block that the whitening filter spoils.
pub const BORDER: usize = 3;
/// About the side of a cell in pixels: so small that a rotation moves it without blurring it.
const CELL: usize = 64;

/// Blocks and cells for volumes of one size.
pub struct Plan {
    /// Depths, rows and columns of the volume.
    pub size: [usize; 3],
    /// Depths kept.
    pub kept: usize,
    /// Rows and columns of a block.
    pub block: [usize; 2],
    /// First row and column of every block.
    pub blocks: Vec<[usize; 2]>,
    /// Rows and columns of cells in a block.
    pub cells: [usize; 2],
}

impl Plan {
    pub fn new(depth: usize, height: usize, width: usize) -> Self {
        let block = [smooth(height.min(BLOCK[0])), smooth(width.min(BLOCK[1]))];
        let kept = smooth(depth.min(DEPTHS));
        let along = |whole: usize, part: usize| -> Vec<usize> {
            if 2 * part <= whole {
                vec![whole / 4 - part / 2, whole - whole / 4 - part.div_ceil(2)]
            } else {
                vec![(whole - part) / 2]
            }
        };
        let (rows, columns) = (along(height, block[0]), along(width, block[1]));
        let blocks = rows.iter().flat_map(|&y| columns.iter().map(move |&x| [y, x])).collect();
        let cells = block.map(|b| b.div_ceil(CELL));
        Self { size: [depth, height, width], kept, block, blocks, cells }
    }

    /// Voxels kept of a volume.
    pub fn voxels(&self) -> usize {
        self.blocks.len() * self.kept * self.block[0] * self.block[1]
    }

    /// Image centre in pixels (y, x).
    pub fn centre(&self) -> [f64; 2] {
        [self.size[1], self.size[2]].map(|n| (n as f64 - 1.0) / 2.0)
    }
}

/// The largest number up to `n` without prime factors above 5, which transforms fast.
fn smooth(n: usize) -> usize {
    let rest = |n: usize| {
        [2, 3, 5].iter().fold(n, |mut m, p| {
            while m > 1 && m % p == 0 {
                m /= p;
            }
            m
        })
    };
    (1..=n).rev().find(|&m| rest(m) == 1).unwrap_or(n)
}
