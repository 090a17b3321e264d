//! A plane through phases: the law of a rigid rotation, fitted by least squares.

/// phase = `at_origin` + `slope_x` x + `slope_z` z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Radians per unit of x.
    pub slope_x: f64,
    /// Radians per unit of z.
    pub slope_z: f64,
    /// Radians at x = z = 0.
    pub at_origin: f64,
}

/// How well a plane describes the phases it was fitted to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// The plane.
    pub plane: Plane,
    /// Root mean square of what it leaves, radians.
    pub residual: f64,
    /// Share of the phases' variance that it describes, R².
    pub r_squared: f64,
}

/// A place and the phase measured there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Place along x.
    pub x: f64,
    /// Place along z.
    pub z: f64,
    /// Phase, radians.
    pub phase: f64,
}

impl Plane {
    /// The phase at a place, radians.
    #[must_use]
    pub fn at(&self, x: f64, z: f64) -> f64 {
        self.at_origin + self.slope_x * x + self.slope_z * z
    }
}

impl Fit {
    /// Least squares through all points; `None` when they lie on one line, or are none.
    #[must_use]
    pub fn of(points: &[Point]) -> Option<Self> {
        let mean =
            |value: fn(&Point) -> f64| points.iter().map(value).sum::<f64>() / points.len() as f64;
        let (x, z, phase) = (mean(|p| p.x), mean(|p| p.z), mean(|p| p.phase));
        let moment = |value: &dyn Fn(f64, f64, f64) -> f64| -> f64 {
            points.iter().map(|p| value(p.x - x, p.z - z, p.phase - phase)).sum()
        };
        let (xx, xz, zz) =
            (moment(&|x, _, _| x * x), moment(&|x, z, _| x * z), moment(&|_, z, _| z * z));
        let (xp, zp) = (moment(&|x, _, p| x * p), moment(&|_, z, p| z * p));
        let determinant = xx * zz - xz * xz;
        // Of no point at all everything is NaN.
        if determinant.is_nan() || determinant <= f64::EPSILON * xx * zz {
            return None;
        }
        let slope_x = (xp * zz - zp * xz) / determinant;
        let slope_z = (zp * xx - xp * xz) / determinant;
        let plane = Plane { slope_x, slope_z, at_origin: phase - slope_x * x - slope_z * z };
        let left: f64 = points.iter().map(|p| (p.phase - plane.at(p.x, p.z)).powi(2)).sum();
        let total = moment(&|_, _, p| p * p);
        let residual = (left / points.len() as f64).sqrt();
        Some(Self { plane, residual, r_squared: 1.0 - left / total })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(noise: f64) -> Vec<Point> {
        let place = |n: u32| (f64::from(n % 7), f64::from(n / 7) * 0.5);
        let sign = |n: u32| if n.is_multiple_of(2) { noise } else { -noise };
        let point = |n| {
            let (x, z) = place(n);
            Point { x, z, phase: 1.5 - 8.0 * x + 0.25 * z + sign(n) }
        };
        (0..70).map(point).collect()
    }

    #[test]
    fn a_plane_is_found() {
        let fit = Fit::of(&points(0.0)).unwrap();
        assert!((fit.plane.slope_x + 8.0).abs() < 1e-12);
        assert!((fit.plane.slope_z - 0.25).abs() < 1e-12);
        assert!((fit.plane.at(0.0, 0.0) - 1.5).abs() < 1e-12);
        assert!(fit.residual < 1e-12 && fit.r_squared > 1.0 - 1e-12);
        let noisy = Fit::of(&points(0.3)).unwrap();
        assert!((noisy.residual - 0.3).abs() < 0.01);
    }

    #[test]
    fn a_line_or_nothing_has_no_plane() {
        let line: Vec<Point> =
            (0..5).map(f64::from).map(|x| Point { x, z: 2.0 * x, phase: x }).collect();
        assert_eq!(Fit::of(&line), None);
        assert_eq!(Fit::of(&[]), None);
    }
}
