//! Lane types: W neighbouring pixels in one vector register, for the core's generic code.
//!
//! | type | lanes | machine |
//! |---|---|---|
//! | `F32x16` | 16 | x86-64 with AVX-512 |
//! | `F32x8` | 8 | x86-64 with AVX2 and FMA |
//! | [`Array`] of f32 | 8 | any |
//! | [`Array`] of f64 | 8 | any, for `--precision f64` |
//!
//! The machine is asked at run time ([`Path::best`]) and work enters through [`Path::run`], so the
//! ordinary build is portable and fast.
//! `PHASEWALK_SIMD=avx512|avx2|portable` chooses a path by hand.

mod angle;
mod array;
mod path;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use array::Array;
pub use path::{LaneTask, Path};

use phasewalk_core::Scalar;

/// A [`Scalar`] that holds one number for each of `WIDTH` pixels.
pub trait Lanes: Scalar + Send + Sync + 'static {
    /// The number in a lane.
    type Element: Copy + Send + Sync + PartialOrd + From<f32> + Into<f64> + 'static;

    /// How many lanes.
    const WIDTH: usize;

    /// How many vectors the machine's registers hold, as far as is known when it is compiled.
    const REGISTERS: usize;

    /// Each lane gets the number of the lane before it, the first that of the last.
    #[must_use]
    fn rotate_up(self) -> Self;

    /// Each lane gets the number of the lane behind it, the last that of the first.
    #[must_use]
    fn rotate_down(self) -> Self;

    /// Write past the caches, where the path can: what is not read again soon then need not be fetched from memory
    /// first. Others may read it when the `stream` has ended.
    #[inline(always)]
    fn stream_to(self, place: &mut Self, stream: &Stream) {
        let _ = stream;
        *place = self;
    }

    /// The numbers of all vectors in order, `WIDTH` each.
    fn flat(vectors: &[Self]) -> &[Self::Element];

    /// The same, to be written.
    fn flat_mut(vectors: &mut [Self]) -> &mut [Self::Element];
}

/// As long as it lives, what [`Lanes::stream_to`] has written may be under way.
#[derive(Debug, Default)]
pub struct Stream(());

impl Drop for Stream {
    #[inline(always)]
    fn drop(&mut self) {
        #[cfg(target_arch = "x86_64")]
        x86::wait_for_streams();
    }
}

/// Ask for `slice[at]`, which will be read soon (it may be beyond the end, to no effect): memory then fetches it while
/// other work is done. The machine itself looks ahead in a line of reads, but not beyond a page of 4 KiB.
#[inline(always)]
pub fn fetch_ahead<T>(slice: &[T], at: usize) {
    #[cfg(target_arch = "x86_64")]
    x86::fetch_ahead(slice.as_ptr().wrapping_add(at).cast(), size_of::<T>());
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (slice, at);
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasewalk_core::Mask;

    /// Every operation of the lane type equals the scalar one in each lane.
    fn lanes_equal_scalar<L: Lanes>(tolerance: f64) {
        let numbers: Vec<f64> =
            (0..97).map(|i| f64::from((f64::from(i) * 0.173 - 8.3).powi(3) as f32)).collect();
        let load = |offset: usize| {
            let mut vector = [L::zero()];
            for (i, lane) in L::flat_mut(&mut vector).iter_mut().enumerate() {
                *lane = L::Element::from(numbers[(offset + 5 * i) % numbers.len()] as f32);
            }
            vector[0]
        };
        let compare = |name: &str, got: L, expected: &dyn Fn(usize) -> f64| {
            for (i, &lane) in L::flat(&[got]).iter().enumerate() {
                let (got, expected): (f64, f64) = (lane.into(), expected(i));
                let same = got == expected || (got.is_nan() && expected.is_nan());
                let close = (got - expected).abs() <= tolerance * expected.abs().max(1e-30);
                assert!(same || close, "{name} in lane {i}: {got} for {expected}");
            }
        };
        for a in 0..numbers.len() {
            let b = 3 * a + 1;
            let x = |i: usize| numbers[(a + 5 * i) % numbers.len()];
            let y = |i: usize| numbers[(b + 5 * i) % numbers.len()];
            let (u, v) = (load(a), load(b));
            let mut streamed = L::zero();
            u.stream_to(&mut streamed, &Stream::default());
            compare("stream", streamed, &x);
            compare("add", u + v, &|i| x(i) + y(i));
            compare("sub", u - v, &|i| x(i) - y(i));
            compare("mul", u * v, &|i| x(i) * y(i));
            compare("div", u / v, &|i| x(i) / y(i));
            compare("neg", -u, &|i| -x(i));
            compare("abs", u.abs(), &|i| x(i).abs());
            compare("max", u.max(v), &|i| x(i).max(y(i)));
            compare("min", u.min(v), &|i| x(i).min(y(i)));
            compare("sqrt", u.abs().sqrt(), &|i| x(i).abs().sqrt());
            compare("inverse_sqrt", u.abs().inverse_sqrt(), &|i| 1.0 / x(i).abs().sqrt());
            compare("round", u.round(), &|i| x(i).round_ties_even());
            compare("atan2", u.atan2(v), &|i| libm::atan2(x(i), y(i)));
            compare("select", L::select(u.lt(v), u, -v), &|i| {
                if x(i) < y(i) { x(i) } else { -y(i) }
            });
            compare("rotate_up", u.rotate_up(), &|i| x((i + L::WIDTH - 1) % L::WIDTH));
            compare("rotate_down", u.rotate_down(), &|i| x((i + 1) % L::WIDTH));
            let any = (0..L::WIDTH).any(|i| x(i) < y(i));
            assert_eq!(u.lt(v).any(), any, "any");
            let mut sum = u;
            sum += v;
            compare("add_assign", sum, &|i| x(i) + y(i));
            let (a, b) = (u.abs(), v.abs());
            compare("mul_add", a.mul_add(b, b), &|i| x(i).abs().mul_add(y(i).abs(), y(i).abs()));
        }
        let nan = L::from_f64(f64::NAN);
        for (name, got, expected) in [
            ("max(1, nan)", L::one().max(nan), 1.0),
            ("max(nan, 1)", nan.max(L::one()), f64::NAN),
            ("min(1, nan)", L::one().min(nan), 1.0),
            ("min(nan, 1)", nan.min(L::one()), f64::NAN),
        ] {
            compare(name, got, &|_| expected);
        }
        compare("atan2(0,0)", L::zero().atan2(L::zero()), &|_| 0.0);
        compare("atan2(0,-1)", L::zero().atan2(-L::one()), &|_| std::f64::consts::PI);
        compare(
            "nan < 1",
            L::select(L::from_f64(f64::NAN).lt(L::one()), L::one(), L::zero()),
            &|_| 0.0,
        );
    }

    // f32: a few units in the last place; cancellation in add, sub and mul_add is relative to the
    // rounded inputs, which are the same on both sides (mul_add on two roundings: no cancellation).
    const SINGLE: f64 = 4e-7;

    #[test]
    fn double_lanes() {
        lanes_equal_scalar::<Array<f64, 4>>(1e-15);
    }

    struct EqualScalar;

    impl LaneTask for EqualScalar {
        type Output = ();
        fn run<L: Lanes<Element = f32>>(self) {
            lanes_equal_scalar::<L>(SINGLE);
        }
    }

    #[test]
    fn single_lanes_on_every_path() {
        for path in Path::available() {
            path.run(EqualScalar).unwrap();
        }
    }

    #[test]
    fn the_portable_path_is_always_there() {
        assert_eq!(Path::available().last(), Some(&Path::Portable));
    }
}
