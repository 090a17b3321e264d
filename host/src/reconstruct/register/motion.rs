//! Where one sweep lies relative to another.

/// A rigid motion of a volume: content at lateral offset (ry, rx) from the image centre and depth z
/// is found at depth z + dz and offset (dy, dx) + (ry cos a + rx sin a, rx cos a − ry sin a).
///
/// The image centre is ((H − 1)/2, (W − 1)/2).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Motion {
    /// Shift (dz, dy, dx) in pixels.
    pub shift: [f64; 3],
    /// Angle a in radians, positive from +x to +y as above.
    pub rotation_rad: f64,
}

impl Motion {
    /// This motion followed by `next`: shifts turn along, angles add.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        let [dz, dy, dx] = self.shift;
        let [y, x] = next.carry([dy, dx]);
        Self {
            shift: [dz + next.shift[0], y, x],
            rotation_rad: self.rotation_rad + next.rotation_rad,
        }
    }

    /// The motion that undoes this one.
    #[must_use]
    pub fn inverse(self) -> Self {
        let [dz, dy, dx] = self.shift;
        let [y, x] = rotate(-self.rotation_rad, [-dy, -dx]);
        Self { shift: [-dz, y, x], rotation_rad: -self.rotation_rad }
    }

    /// Motion of a sweep that moved by `later` seen from one that moved by `self`.
    #[must_use]
    pub fn to(self, later: Self) -> Self {
        self.inverse().then(later)
    }

    /// Where content at lateral offset `[ry, rx]` from the image centre is found.
    #[must_use]
    pub fn carry(self, offset: [f64; 2]) -> [f64; 2] {
        let [y, x] = rotate(self.rotation_rad, offset);
        [y + self.shift[1], x + self.shift[2]]
    }
}

/// The lateral offset `[y, x]` turned by `angle` in the sense of [`Motion`].
pub(super) fn rotate(angle: f64, [y, x]: [f64; 2]) -> [f64; 2] {
    let (sine, cosine) = angle.sin_cos();
    [y * cosine + x * sine, x * cosine - y * sine]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_and_its_inverse_cancel() {
        let a = Motion { shift: [1.5, -20.0, 33.0], rotation_rad: 0.004 };
        let b = Motion { shift: [-2.0, 7.0, 5.0], rotation_rad: -0.003 };
        for still in [a.then(a.inverse()), a.to(a), a.then(b).then(b.inverse()).then(a.inverse())] {
            assert!(still.shift.iter().all(|s| s.abs() < 1e-12), "{still:?}");
            assert!(still.rotation_rad.abs() < 1e-15);
        }
    }

    #[test]
    fn content_is_carried_through_both() {
        let a = Motion { shift: [0.0, 4.0, -3.0], rotation_rad: 0.01 };
        let b = Motion { shift: [0.0, -8.0, 30.0], rotation_rad: 0.02 };
        let twice = b.carry(a.carry([10.0, -50.0]));
        let once = a.then(b).carry([10.0, -50.0]);
        assert!((0..2).all(|i| (twice[i] - once[i]).abs() < 1e-12));
    }
}
