//! Lanes in x86-64 vector registers.
//!
//! `unsafe` is here for two reasons only: the intrinsics must run on a processor that has them, and
//! a slice of registers is looked at as a slice of numbers. Values of these types are made and
//! used only in tasks that [`super::Path::run`] has started, after asking the processor; the module is
//! private, so there is no other way to them.

use super::{Lanes, Stream, angle};
use phasewalk_core::{Mask, Scalar};
use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Sixteen `f32` in an AVX-512 register.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct F32x16(__m512);

/// Eight `f32` in an AVX register.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct F32x8(__m256);

/// Sixteen truth values, one bit each.
#[derive(Clone, Copy, Debug)]
pub struct Mask16(__mmask16);

/// Eight truth values, all bits of a lane alike.
#[derive(Clone, Copy, Debug)]
pub struct Mask8(__m256);

impl Mask for Mask16 {
    #[inline(always)]
    fn any(self) -> bool {
        self.0 != 0
    }
}

impl Mask for Mask8 {
    #[inline(always)]
    fn any(self) -> bool {
        // SAFETY: the value exists only where the processor has AVX2.
        unsafe { _mm256_movemask_ps(self.0) != 0 }
    }
}

/// All that was written past the caches is there.
#[inline(always)]
pub fn wait_for_streams() {
    // SAFETY: every x86-64 has the instruction.
    unsafe { _mm_sfence() }
}

/// Bytes of a line of the caches.
const LINE: usize = 64;

/// Ask the caches for so many bytes from `place` on.
#[inline(always)]
pub fn fetch_ahead(place: *const i8, bytes: usize) {
    for offset in (0..bytes).step_by(LINE) {
        // SAFETY: every x86-64 has the instruction, which reads nothing, so that any address will do.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(place.wrapping_add(offset)) }
    }
}

macro_rules! register_lanes {
    ($lanes:ident, $width:literal, $registers:literal, $mask:ident, $add:ident, $sub:ident, $mul:ident, $div:ident,
     $set:ident, $sqrt:ident, $estimate:ident, $fma:ident, $max:ident, $min:ident, |$x:ident| $abs:expr, |$a:ident, $b:ident| $lt:expr,
     |$chosen:ident, $yes:ident, $no:ident| $select:expr, $stream:ident, |$up:ident| $rotate_up:expr,
     |$down:ident| $rotate_down:expr) => {
        // What looks like closures are expressions that the macro pastes in: a real closure would not inherit the
        // instructions of its surroundings, and every intrinsic in it could become a call.
        // SAFETY (all blocks of this macro): values of the type exist only on paths that are entered
        // after the processor was asked for the features (see the module's text).
        impl Add for $lanes {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                // SAFETY: as above.
                Self(unsafe { $add(self.0, other.0) })
            }
        }

        impl Sub for $lanes {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                // SAFETY: as above.
                Self(unsafe { $sub(self.0, other.0) })
            }
        }

        impl Mul for $lanes {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                // SAFETY: as above.
                Self(unsafe { $mul(self.0, other.0) })
            }
        }

        impl Div for $lanes {
            type Output = Self;
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                // SAFETY: as above.
                Self(unsafe { $div(self.0, other.0) })
            }
        }

        impl Neg for $lanes {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self::zero() - self
            }
        }

        impl AddAssign for $lanes {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }

        impl Scalar for $lanes {
            type Mask = $mask;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                // SAFETY: as above.
                Self(unsafe { $set(value as f32) })
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: as above.
                Self(unsafe { $sqrt(self.0) })
            }

            #[inline(always)]
            fn inverse_sqrt(self) -> Self {
                // SAFETY: as above.
                let estimate = Self(unsafe { $estimate(self.0) });
                // One Newton step: y (3 - x y^2) / 2, from 12-14 bits to the last bit or so.
                let residual = (self * estimate).mul_add(-estimate, Self::one());
                (estimate * Self::from_f64(0.5)).mul_add(residual, estimate)
            }

            #[inline(always)]
            fn atan2(self, x: Self) -> Self {
                angle::atan2(self, x)
            }

            #[inline(always)]
            fn abs(self) -> Self {
                let $x = self.0;
                // SAFETY: as above.
                Self(unsafe { $abs })
            }

            #[inline(always)]
            fn round(self) -> Self {
                // 1.5 * 2^23: so large a number has no digits behind the point.
                let whole = Self::from_f64(12_582_912.0);
                (self + whole) - whole
            }

            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                let ($a, $b) = (self.0, other.0);
                // SAFETY: as above.
                $mask(unsafe { $lt })
            }

            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                let ($chosen, $yes, $no) = (mask.0, yes.0, no.0);
                // SAFETY: as above.
                Self(unsafe { $select })
            }

            #[inline(always)]
            fn mul_add(self, factor: Self, term: Self) -> Self {
                // SAFETY: as above.
                Self(unsafe { $fma(self.0, factor.0, term.0) })
            }

            // Of the two the instructions give the second where they are equal, or one is no number: `self`, as it should be.
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // SAFETY: as above.
                Self(unsafe { $max(other.0, self.0) })
            }

            #[inline(always)]
            fn min(self, other: Self) -> Self {
                // SAFETY: as above.
                Self(unsafe { $min(other.0, self.0) })
            }
        }

        impl Lanes for $lanes {
            type Element = f32;
            const WIDTH: usize = $width;
            const REGISTERS: usize = $registers;

            #[inline(always)]
            fn stream_to(self, place: &mut Self, _: &Stream) {
                // SAFETY: as above; a value of the register's type is aligned as the instruction wants it.
                unsafe { $stream((&raw mut place.0).cast(), self.0) }
            }

            #[inline(always)]
            fn rotate_up(self) -> Self {
                let $up = self.0;
                // SAFETY: as above.
                Self(unsafe { $rotate_up })
            }

            #[inline(always)]
            fn rotate_down(self) -> Self {
                let $down = self.0;
                // SAFETY: as above.
                Self(unsafe { $rotate_down })
            }

            #[inline(always)]
            fn flat(vectors: &[Self]) -> &[f32] {
                // SAFETY: a register is its lanes side by side, without padding.
                unsafe {
                    std::slice::from_raw_parts(vectors.as_ptr().cast(), vectors.len() * $width)
                }
            }

            #[inline(always)]
            fn flat_mut(vectors: &mut [Self]) -> &mut [f32] {
                let count = vectors.len() * $width;
                // SAFETY: as above, and the borrow is exclusive.
                unsafe { std::slice::from_raw_parts_mut(vectors.as_mut_ptr().cast(), count) }
            }
        }
    };
}

register_lanes!(
    F32x16,
    16,
    32,
    Mask16,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_div_ps,
    _mm512_set1_ps,
    _mm512_sqrt_ps,
    _mm512_rsqrt14_ps,
    _mm512_fmadd_ps,
    _mm512_max_ps,
    _mm512_min_ps,
    |a| _mm512_abs_ps(a),
    |a, b| _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b),
    |mask, yes, no| _mm512_mask_blend_ps(mask, no, yes),
    _mm512_stream_ps,
    |a| _mm512_castsi512_ps(_mm512_alignr_epi32::<15>(
        _mm512_castps_si512(a),
        _mm512_castps_si512(a)
    )),
    |a| _mm512_castsi512_ps(_mm512_alignr_epi32::<1>(
        _mm512_castps_si512(a),
        _mm512_castps_si512(a)
    ))
);

register_lanes!(
    F32x8,
    8,
    16,
    Mask8,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_set1_ps,
    _mm256_sqrt_ps,
    _mm256_rsqrt_ps,
    _mm256_fmadd_ps,
    _mm256_max_ps,
    _mm256_min_ps,
    |a| _mm256_andnot_ps(_mm256_set1_ps(-0.0), a),
    |a, b| _mm256_cmp_ps::<_CMP_LT_OQ>(a, b),
    |mask, yes, no| _mm256_blendv_ps(no, yes, mask),
    _mm256_stream_ps,
    |a| _mm256_permutevar8x32_ps(a, _mm256_setr_epi32(7, 0, 1, 2, 3, 4, 5, 6)),
    |a| _mm256_permutevar8x32_ps(a, _mm256_setr_epi32(1, 2, 3, 4, 5, 6, 7, 0))
);
