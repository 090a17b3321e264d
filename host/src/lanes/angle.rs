//! The arc tangent for f32 lanes.

use phasewalk_core::Scalar;
use std::f64::consts::{FRAC_PI_2, PI};

/// atan(a) / a as a polynomial in a^2 on 0..=1, highest power first: near-minimax, error 2e-8, below
/// the rounding of f32 (1e-7 rad in all).
const ARC_TANGENT: [f64; 9] = [
    0.002766283501762026,
    -0.01573124912218365,
    0.04213762358919304,
    -0.07456854826004547,
    0.10618370636953849,
    -0.14197797794085124,
    0.19991872029109073,
    -0.33333036709286273,
    0.9999999817886557,
];

/// Angle of the point (x, y) in -pi..=pi, 0 at the origin; error below 3e-7 rad in f32.
#[inline(always)]
pub(super) fn atan2<T: Scalar>(y: T, x: T) -> T {
    let (rise, run) = (y.abs(), x.abs());
    let longer = rise.max(run);
    let lit = T::zero().lt(longer);
    let ratio = rise.min(run) / T::select(lit, longer, T::one());
    let square = ratio * ratio;
    let [first, rest @ ..] = ARC_TANGENT;
    let mut series = T::from_f64(first);
    for coefficient in rest {
        series = series.mul_add(square, T::from_f64(coefficient));
    }
    let octant = series * ratio;
    let quadrant = T::select(run.lt(rise), T::from_f64(FRAC_PI_2) - octant, octant);
    let half = T::select(x.lt(T::zero()), T::from_f64(PI) - quadrant, quadrant);
    T::select(y.lt(T::zero()), -half, half)
}
