//! The clock, and how many operations on vectors a core does.

use phasewalk::lanes::{LaneTask, Lanes, Path};
use std::hint::black_box;

/// Cycles per second, from a chain of operations on whole numbers of which each needs the one before: one cycle
/// each, and the compiler cannot shorten it. Beside it vectors are multiplied, which many processors clock down
/// for: one in eight cycles, so that no chain waits for a port.
pub struct Clock;

impl LaneTask for Clock {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> f64 {
        const STEPS: u64 = 100_000;
        let (a, b) = (black_box(0x9E37_79B9_7F4A_7C15_u64), black_box(0xD1B5_4A32_D192_ED03_u64));
        let (one, other) = (black_box(L::one()), black_box(L::from_f64(1.37)));
        best_rate!(16 * STEPS, {
            let (mut x, mut sums) = (1_u64, black_box([L::one(); 2]));
            for _ in 0..STEPS {
                for sum in &mut sums {
                    x = (x ^ a).wrapping_add(b);
                    x = (x ^ a).wrapping_add(b);
                    x = (x ^ a).wrapping_add(b);
                    x = (x ^ a).wrapping_add(b);
                    *sum = sum.mul_add(one, other);
                }
            }
            black_box((x, sums));
        })
    }
}

/// Which operation is repeated.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Add,
    Multiply,
    Both,
    MultiplyAdd,
    Divide,
    Root,
}

/// Operations per second in so many independent chains that none waits for the other.
pub struct Arithmetic {
    /// Says how many registers there are.
    pub path: Path,
    /// Which.
    pub kind: Kind,
}

impl LaneTask for Arithmetic {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> f64 {
        // As many as there are registers, but for two (a portable vector takes two).
        match self.path {
            Path::Avx512 => rate::<L, 24>(self.kind),
            Path::Avx2 => rate::<L, 12>(self.kind),
            Path::Portable => rate::<L, 6>(self.kind),
        }
    }
}

#[inline(always)]
fn rate<L: Lanes, const CHAINS: usize>(kind: Kind) -> f64 {
    match kind {
        Kind::Add => chains::<L, CHAINS, 0>(),
        Kind::Multiply => chains::<L, CHAINS, 1>(),
        Kind::Both => chains::<L, CHAINS, 2>(),
        Kind::MultiplyAdd => chains::<L, CHAINS, 3>(),
        Kind::Divide => chains::<L, CHAINS, 4>(),
        Kind::Root => chains::<L, CHAINS, 5>(),
    }
}

/// The loop, `KIND` being the operation.
#[inline(always)]
fn chains<L: Lanes, const CHAINS: usize, const KIND: usize>() -> f64 {
    const STEPS: usize = 20_000;
    // Numbers that stay as they are, or nearly: none must become subnormal, which is slow.
    let (one, other) = (black_box(L::one()), black_box(L::from_f64(1.37)));
    best_rate!(CHAINS * STEPS, {
        let mut sums = black_box([L::one(); CHAINS]);
        for _ in 0..STEPS {
            for (i, sum) in sums.iter_mut().enumerate() {
                *sum = match KIND {
                    0 => *sum + one,
                    1 => *sum * one,
                    2 if i % 2 == 0 => *sum + one,
                    2 => *sum * one,
                    3 => sum.mul_add(one, other),
                    4 => other / *sum,
                    // The addition is made while the root waits.
                    _ => (*sum + other).sqrt(),
                };
            }
        }
        black_box(sums);
    })
}
