//! How many bytes a core reads and writes.

use phasewalk::lanes::{LaneTask, Lanes, Stream};
use std::hint::black_box;

/// What is done with them.
#[derive(Clone, Copy)]
pub enum Access {
    /// Read.
    Read,
    /// Written.
    Write,
    /// Written past the caches, as the program does with what is as large as the largest buffer.
    Stream,
}

/// Bytes per second.
pub struct Bytes {
    /// Of the buffer.
    pub bytes: usize,
    /// Read or written?
    pub access: Access,
}

impl LaneTask for Bytes {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> f64 {
        let mut buffer = vec![L::one(); self.bytes / size_of::<L>()];
        // How many places at once a processor fetches ahead of the program best differs.
        let buffer = &mut buffer[..];
        let rates = match self.access {
            Access::Read => {
                [reading::<L, 1>(buffer), reading::<L, 2>(buffer), reading::<L, 4>(buffer)]
            }
            Access::Write => [
                writing::<L, 1, false>(buffer),
                writing::<L, 2, false>(buffer),
                writing::<L, 4, false>(buffer),
            ],
            Access::Stream => [
                writing::<L, 1, true>(buffer),
                writing::<L, 2, true>(buffer),
                writing::<L, 4, true>(buffer),
            ],
        };
        rates.into_iter().fold(0.0, f64::max)
    }
}

/// At least 1 MB a measurement.
fn turns<L>(buffer: &[L]) -> usize {
    ((1 << 20) / size_of_val(buffer)).max(1)
}

#[inline(always)]
fn reading<L: Lanes, const STREAMS: usize>(buffer: &[L]) -> f64 {
    let turns = turns(buffer);
    best_rate!(
        turns * size_of_val(buffer),
        for _ in 0..turns {
            black_box(sum::<L, STREAMS>(black_box(buffer)));
        }
    )
}

#[inline(always)]
fn writing<L: Lanes, const STREAMS: usize, const PAST: bool>(buffer: &mut [L]) -> f64 {
    let (turns, value) = (turns(buffer), black_box(L::one()));
    best_rate!(
        turns * size_of_val(buffer),
        for _ in 0..turns {
            fill::<L, STREAMS, PAST>(buffer, value, &Stream::default());
            black_box(&mut *buffer);
        }
    )
}

/// Vectors that are taken from each of `STREAMS` places in turns, and sums side by side: none waits for
/// another.
const TOGETHER: usize = 8;

#[inline(always)]
fn sum<L: Lanes, const STREAMS: usize>(buffer: &[L]) -> L {
    let mut sums = [L::zero(); TOGETHER];
    let blocks = buffer.as_chunks::<TOGETHER>().0;
    let length = blocks.len() / STREAMS;
    let streams: [&[[L; TOGETHER]]; STREAMS] =
        std::array::from_fn(|stream| &blocks[stream * length..][..length]);
    for at in 0..length {
        for stream in streams {
            for (sum, &vector) in sums.iter_mut().zip(&stream[at]) {
                *sum += vector;
            }
        }
    }
    let mut all = L::zero();
    for sum in sums {
        all += sum;
    }
    all
}

#[inline(always)]
fn fill<L: Lanes, const STREAMS: usize, const PAST: bool>(
    buffer: &mut [L],
    value: L,
    stream_past: &Stream,
) {
    let blocks = buffer.as_chunks_mut::<TOGETHER>().0;
    let length = blocks.len() / STREAMS;
    for at in 0..length {
        for stream in 0..STREAMS {
            for place in &mut blocks[stream * length + at] {
                if PAST {
                    value.stream_to(place, stream_past);
                } else {
                    *place = value;
                }
            }
        }
    }
}
