//! Lanes in plain Rust: an array, one loop per operation.

use super::{Lanes, angle};
use phasewalk_core::{Mask, Scalar};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// `W` numbers side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct Array<E, const W: usize>([E; W]);

/// `W` truth values.
#[derive(Clone, Copy, Debug)]
pub struct ArrayMask<const W: usize>([bool; W]);

impl<const W: usize> Mask for ArrayMask<W> {
    #[inline(always)]
    fn any(self) -> bool {
        let mut any = false;
        for lane in self.0 {
            any |= lane;
        }
        any
    }
}

/// An array whose lane `i` is the expression. A loop: of `array::from_fn` and `map` the compiler keeps some as calls.
macro_rules! lanes {
    ($start:expr, |$i:ident| $lane:expr) => {{
        let mut lanes = [$start; W];
        for $i in 0..W {
            lanes[$i] = $lane;
        }
        lanes
    }};
}

macro_rules! operator {
    ($element:ty, $trait:ident, $method:ident) => {
        impl<const W: usize> $trait for Array<$element, W> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(lanes!(0.0, |i| self.0[i].$method(other.0[i])))
            }
        }
    };
}

macro_rules! array_lanes {
    ($element:ty, $atan2:expr, $whole:expr) => {
        operator!($element, Add, add);
        operator!($element, Sub, sub);
        operator!($element, Mul, mul);
        operator!($element, Div, div);

        impl<const W: usize> Neg for Array<$element, W> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(lanes!(0.0, |i| -self.0[i]))
            }
        }

        impl<const W: usize> AddAssign for Array<$element, W> {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }

        impl<const W: usize> Scalar for Array<$element, W> {
            type Mask = ArrayMask<W>;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                Self([value as $element; W])
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(lanes!(0.0, |i| self.0[i].sqrt()))
            }

            #[inline(always)]
            fn atan2(self, x: Self) -> Self {
                $atan2(self, x)
            }

            #[inline(always)]
            fn abs(self) -> Self {
                Self(lanes!(0.0, |i| self.0[i].abs()))
            }

            #[inline(always)]
            fn round(self) -> Self {
                // So large a number has no digits behind the point.
                Self(lanes!(0.0, |i| (self.0[i] + $whole) - $whole))
            }

            #[inline(always)]
            fn lt(self, other: Self) -> Self::Mask {
                ArrayMask(lanes!(false, |i| self.0[i] < other.0[i]))
            }

            #[inline(always)]
            fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
                Self(lanes!(0.0, |i| if mask.0[i] { yes.0[i] } else { no.0[i] }))
            }

            // Without hardware support a fused multiply-add is a slow library call.
            #[inline(always)]
            fn mul_add(self, factor: Self, term: Self) -> Self {
                self * factor + term
            }
        }

        impl<const W: usize> Lanes for Array<$element, W> {
            type Element = $element;
            const WIDTH: usize = W;
            // Of a machine with 16 registers of 4 `f32` at least.
            const REGISTERS: usize = 16 * 16 / (W * size_of::<$element>());

            #[inline(always)]
            fn rotate_up(self) -> Self {
                Self(lanes!(0.0, |i| self.0[(i + W - 1) % W]))
            }

            #[inline(always)]
            fn rotate_down(self) -> Self {
                Self(lanes!(0.0, |i| self.0[(i + 1) % W]))
            }

            #[inline(always)]
            fn flat(vectors: &[Self]) -> &[$element] {
                array_slices::flat(vectors)
            }

            #[inline(always)]
            fn flat_mut(vectors: &mut [Self]) -> &mut [$element] {
                array_slices::flat_mut(vectors)
            }
        }
    };
}

array_lanes!(f32, angle::atan2, 12_582_912.0);
array_lanes!(
    f64,
    |y: Self, x: Self| Self(lanes!(0.0, |i| libm::atan2(y.0[i], x.0[i]))),
    6_755_399_441_055_744.0
);

/// Vectors seen as numbers.
mod array_slices {
    use super::Array;

    pub(super) fn flat<E, const W: usize>(vectors: &[Array<E, W>]) -> &[E] {
        // SAFETY: Array is repr(transparent) over [E; W], so the slice is one of [E; W].
        unsafe { std::slice::from_raw_parts(vectors.as_ptr().cast(), vectors.len() * W) }
    }

    pub(super) fn flat_mut<E, const W: usize>(vectors: &mut [Array<E, W>]) -> &mut [E] {
        // SAFETY: as above, and the borrow is exclusive.
        unsafe { std::slice::from_raw_parts_mut(vectors.as_mut_ptr().cast(), vectors.len() * W) }
    }
}
