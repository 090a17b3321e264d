//! The data.

use num_complex::Complex;

/// A series of complex fields U(t, y, x) of one layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// N, the number of frames.
    pub frames: usize,
    /// Number of rows (y).
    pub height: usize,
    /// Number of columns (x).
    pub width: usize,
    /// U, of shape (time, y, x) in C order: `frames · height · width` values.
    pub field: Vec<Complex<f64>>,
}

impl Series {
    /// U(t), of shape (y, x).
    ///
    /// # Panics
    /// If there is no frame `t`.
    pub fn frame(&self, t: usize) -> &[Complex<f64>] {
        let pixels = self.height * self.width;
        &self.field[t * pixels..(t + 1) * pixels]
    }
}
