//! The numbers the mathematics is written in: one trait, so that each formula is written once.
//!
//! `f32` runs on the microcontroller, `f64` in the oracle and for curves; the host adds *lane
//! types* that hold one number for each of W neighbouring pixels in a vector register. A
//! comparison therefore gives a [`Mask`] (`bool` for one number, W bits for lanes), and branches
//! on data are written with [`Scalar::select`].
//!
//! Square root and arc tangent come from `libm`, whose `f32` results are the same bits on every
//! machine. The feature `micromath` replaces both for `f32` by faster approximations
//! (relative error of the root below 2e-6 after two Newton steps, error of the arc tangent below
//! 3e-3 rad): for boards whose time is scarcer than their signal is clean.

use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Outcome of a comparison, lane by lane.
pub trait Mask: Copy {
    /// True in at least one lane.
    fn any(self) -> bool;
}

impl Mask for bool {
    #[inline(always)]
    fn any(self) -> bool {
        self
    }
}

/// A real number, or one real number per lane.
pub trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// What a comparison gives.
    type Mask: Mask;

    /// The same number in every lane, rounded to this type.
    fn from_f64(value: f64) -> Self;

    /// Square root; NaN for negative numbers.
    fn sqrt(self) -> Self;

    /// Angle of the point (`x`, `self`) in -pi..=pi; 0 at the origin.
    fn atan2(self, x: Self) -> Self;

    /// Absolute value.
    fn abs(self) -> Self;

    /// The nearest whole number, of numbers below 2^22 in size.
    fn round(self) -> Self;

    /// `self < other`, false for NaN.
    fn lt(self, other: Self) -> Self::Mask;

    /// `yes` where `mask` is true, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// `self * factor + term`; lanes fuse the two roundings where the machine can.
    fn mul_add(self, factor: Self, term: Self) -> Self;

    /// 1 / sqrt(self), for normal numbers above 0; lanes may be one unit in the last place less exact.
    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        Self::one() / self.sqrt()
    }

    /// Zero.
    #[inline(always)]
    fn zero() -> Self {
        Self::from_f64(0.0)
    }

    /// One.
    #[inline(always)]
    fn one() -> Self {
        Self::from_f64(1.0)
    }

    /// The larger of the two; `self` when `other` is NaN.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(self.lt(other), other, self)
    }

    /// The smaller of the two; `self` when `other` is NaN.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(other.lt(self), other, self)
    }
}

/// One real number, whose comparisons are plain: what models are fitted with, once for many pixels.
pub trait Real: Scalar<Mask = bool> + PartialOrd {
    /// e to the power of `self`.
    fn exp(self) -> Self;

    /// Natural logarithm; NaN for negative numbers.
    fn ln(self) -> Self;

    /// (sine, cosine) of `self` in radians.
    fn sin_cos(self) -> (Self, Self);

    /// The same number as `f64`.
    fn to_f64(self) -> f64;
}

/// Is it finite? (Below 1e30, which no phase and no field that can be squared in `f32` reaches.)
#[inline(always)]
pub(crate) fn is_number<T: Scalar>(x: T) -> T::Mask {
    x.abs().lt(T::from_f64(1e30))
}

/// What `f32` and `f64` share, but for the two transcendental functions.
macro_rules! plain_scalar {
    ($type:ty, $sqrt:path, $atan2:path, $round:path) => {
        impl Scalar for $type {
            type Mask = bool;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }

            #[inline(always)]
            fn atan2(self, x: Self) -> Self {
                $atan2(self, x)
            }

            #[inline(always)]
            fn abs(self) -> Self {
                <$type>::abs(self)
            }

            #[inline(always)]
            fn round(self) -> Self {
                $round(self)
            }

            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }

            #[inline(always)]
            fn select(mask: bool, yes: Self, no: Self) -> Self {
                if mask { yes } else { no }
            }

            // Two roundings on every machine: the board and the desktop must agree in every bit.
            #[inline(always)]
            fn mul_add(self, factor: Self, term: Self) -> Self {
                self * factor + term
            }
        }
    };
}

plain_scalar!(f64, libm::sqrt, libm::atan2, libm::rint);
#[cfg(not(feature = "micromath"))]
plain_scalar!(f32, libm::sqrtf, libm::atan2f, libm::rintf);
#[cfg(feature = "micromath")]
plain_scalar!(f32, fast::sqrt, fast::atan2, libm::rintf);

macro_rules! real {
    ($type:ty, $exp:path, $ln:path, $sin_cos:path) => {
        impl Real for $type {
            #[inline]
            fn exp(self) -> Self {
                $exp(self)
            }

            #[inline]
            fn ln(self) -> Self {
                $ln(self)
            }

            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                $sin_cos(self)
            }

            #[inline]
            fn to_f64(self) -> f64 {
                self.into()
            }
        }
    };
}

real!(f64, libm::exp, libm::log, libm::sincos);
real!(f32, libm::expf, libm::logf, libm::sincosf);

#[cfg(feature = "micromath")]
mod fast {
    use micromath::F32Ext;

    /// micromath's root is good to 6e-2 only; each Newton step squares that and halves it.
    pub(super) fn sqrt(x: f32) -> f32 {
        if x > 0.0 {
            let root = F32Ext::sqrt(x);
            let root = 0.5 * (root + x / root);
            0.5 * (root + x / root)
        } else {
            libm::sqrtf(x)
        }
    }

    pub(super) fn atan2(y: f32, x: f32) -> f32 {
        if x == 0.0 && y == 0.0 { 0.0 } else { F32Ext::atan2(y, x) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<T: Scalar + Into<f64>>(root_error: f64, angle_error: f64) {
        for i in 0..2000 {
            let a = f64::from(i) * 0.003_139 - 3.139;
            let (sine, cosine) = libm::sincos(a);
            let angle: f64 = T::from_f64(sine).atan2(T::from_f64(cosine)).into();
            assert!(libm::fabs(angle - a) < angle_error, "angle {a} came back as {angle}");
            let x = libm::exp(f64::from(i) * 0.02 - 20.0);
            let root: f64 = T::from_f64(x).sqrt().into();
            assert!(libm::fabs(root / libm::sqrt(x) - 1.0) < root_error, "root of {x}");
        }
        let nothing: f64 = T::zero().atan2(T::zero()).into();
        assert_eq!(nothing, 0.0);
    }

    #[test]
    fn roots_and_angles() {
        check::<f64>(1e-15, 1e-12);
        if cfg!(feature = "micromath") {
            check::<f32>(2e-6, 3e-3)
        } else {
            check::<f32>(1e-7, 1e-6)
        }
    }

    #[test]
    fn comparisons_with_nan_choose_the_number() {
        assert_eq!(Scalar::max(1.0_f32, f32::NAN), 1.0);
        assert_eq!(Scalar::min(1.0_f64, f64::NAN), 1.0);
        assert_eq!(Scalar::max(-1.0_f32, 2.0), 2.0);
        assert_eq!(Scalar::min(-1.0_f32, 2.0), -1.0);
    }
}
