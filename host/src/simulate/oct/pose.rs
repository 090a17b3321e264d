//! Where a point of the retina appears in an image.

/// Shift and rotation about the middle of the image.
///
/// A point at the offset (ry, rx) from the middle appears at middle + shift +
/// (ry cos α + rx sin α, rx cos α − ry sin α), pixels.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    middle: [f64; 2],
    shift: [f64; 2],
    sine: f64,
    cosine: f64,
}

impl Pose {
    /// For an image of `size` (height, width), a shift (y, x) in pixels and a rotation in radians.
    pub fn new(size: [usize; 2], shift: [f64; 2], rotation_rad: f64) -> Self {
        let (sine, cosine) = libm::sincos(rotation_rad);
        let middle = size.map(|n| (n as f64 - 1.0) / 2.0);
        Self { middle, shift, sine, cosine }
    }

    /// Where the point (y, x) of the first sweep appears.
    #[inline(always)]
    pub fn place(&self, [y, x]: [f64; 2]) -> [f64; 2] {
        let (ry, rx) = (y - self.middle[0], x - self.middle[1]);
        [
            self.middle[0] + self.shift[0] + ry * self.cosine + rx * self.sine,
            self.middle[1] + self.shift[1] + rx * self.cosine - ry * self.sine,
        ]
    }

    /// The point of the first sweep that appears at (y, x).
    pub fn origin(&self, [y, x]: [f64; 2]) -> [f64; 2] {
        let (ry, rx) = (y - self.middle[0] - self.shift[0], x - self.middle[1] - self.shift[1]);
        [
            self.middle[0] + ry * self.cosine - rx * self.sine,
            self.middle[1] + rx * self.cosine + ry * self.sine,
        ]
    }

    /// Offset of an image point from the middle of the image.
    #[inline(always)]
    pub fn offset(&self, [y, x]: [f64; 2]) -> [f64; 2] {
        [y - self.middle[0], x - self.middle[1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_comes_back() {
        let pose = Pose::new([96, 144], [3.0, -7.5], 0.02);
        let [y, x] = pose.origin(pose.place([11.0, 97.25]));
        assert!((y - 11.0).abs() < 1e-12 && (x - 97.25).abs() < 1e-12);
    }

    #[test]
    fn a_positive_rotation_is_as_defined() {
        let pose = Pose::new([11, 11], [1.0, 2.0], 0.1);
        let [y, x] = pose.place([5.0, 9.0]);
        assert!((y - (6.0 + 4.0 * 0.1f64.sin())).abs() < 1e-12);
        assert!((x - (7.0 + 4.0 * 0.1f64.cos())).abs() < 1e-12);
    }
}
