//! The mean intensity, and the band around the layers cut out of it.

use rayon::prelude::*;

/// A view of an intensity volume in C order (z, y, x).
#[derive(Clone, Copy)]
pub(super) struct Volume<'a> {
    pub data: &'a [f32],
    pub depths: usize,
    pub rows: usize,
    pub columns: usize,
}

impl Volume<'_> {
    /// The pixels of one depth and row.
    pub fn row(&self, z: usize, y: usize) -> &[f32] {
        &self.data[(z * self.rows + y) * self.columns..][..self.columns]
    }
}

/// A few depths of every A-line around a surface, depth fastest: shape (y, x, depths).
pub(super) struct Band {
    /// Intensities; NaN where the band leaves the volume.
    pub data: Vec<f32>,
    /// Depths kept of every A-line.
    pub depths: usize,
    /// Depth in the volume of the first one kept, per A-line.
    pub first: Vec<i32>,
    pub rows: usize,
    pub columns: usize,
}

impl Band {
    /// Cuts `depths` out of `volume`, from `above` pixels before `surface` on.
    pub fn cut(volume: Volume, surface: &[f32], above: f64, depths: usize) -> Self {
        let columns = volume.columns;
        let first: Vec<i32> =
            surface.iter().map(|&depth| (f64::from(depth) - above).floor() as i32).collect();
        let mut data = vec![f32::NAN; first.len() * depths];
        data.par_chunks_mut(columns * depths).enumerate().for_each(|(y, to)| {
            let first = &first[y * columns..][..columns];
            let low = first.iter().copied().min().unwrap_or(0).max(0) as usize;
            let high = first.iter().copied().max().unwrap_or(0) + depths as i32;
            for z in low..high.clamp(0, volume.depths as i32) as usize {
                for ((value, &first), a_line) in
                    volume.row(z, y).iter().zip(first).zip(to.chunks_exact_mut(depths))
                {
                    let at = usize::try_from(z as i32 - first).unwrap_or(usize::MAX);
                    if let Some(to) = a_line.get_mut(at) {
                        *to = *value;
                    }
                }
            }
        });
        Self { data, depths, first, rows: volume.rows, columns }
    }

    /// One A-line and the depth of its first value.
    pub fn a_line(&self, at: usize) -> (&[f32], f32) {
        (&self.data[at * self.depths..][..self.depths], self.first[at] as f32)
    }
}
