//! A symmetric filter along one axis:
//!
//! ```text
//! y_o = h_0 x_(o+R) + sum over d = 1 ... R of h_d (x_(o+R-d) + x_(o+R+d))
//! ```
//! What a tap adds to one result it adds, but for one number on each side, to its neighbour with the next tap. Where
//! there are registers enough, blocks of neighbouring results keep these numbers: a tap then reads two of each channel
//! for the whole block. Where half as many are, neighbours are summed side by side, so that no sum waits for itself.

use crate::lanes::Lanes;

/// Where the results of a filter go. (Not a closure: those do not inherit the vector instructions of the function they
/// are written in, and then every operation on a register becomes a call.)
pub trait Sink<L, const CH: usize> {
    /// The result that belongs at `place`; it may be told twice.
    fn take(&mut self, place: usize, means: [L; CH]);
}

/// Results of a block, and channels that are filtered together: 8 sums, 8 numbers on each side and a tap are 25 registers.
const BLOCK: usize = 4;
const TOGETHER: usize = 2;
/// Registers that a block needs, and that so many sums of neighbouring results do with what they are made of.
const FOR_BLOCKS: usize = 32;
const FOR_NEIGHBOURS: usize = 16;
const SUMS: usize = 8;

/// Filter a line of n + 2R numbers of each channel, `half` being h; result o goes to place `first + o stride`.
#[inline(always)]
pub fn filter<L: Lanes, const CH: usize>(
    line: &[[L; CH]],
    half: &[L],
    [first, stride]: [usize; 2],
    sink: &mut impl Sink<L, CH>,
) {
    let count = (line.len() + 2).saturating_sub(2 * half.len());
    let mut o = 0;
    while o < count {
        let left = count - o;
        if L::REGISTERS >= FOR_BLOCKS && left < BLOCK && count >= BLOCK {
            // What is left takes less in a block with results that are known already.
            o = count - BLOCK;
        }
        let (line, place) = (&line[o..], first + o * stride);
        let taken = if L::REGISTERS >= FOR_BLOCKS && count >= BLOCK {
            give(in_block(line, half), [place, stride], sink)
        } else if L::REGISTERS >= FOR_NEIGHBOURS && CH * 4 <= SUMS && left >= 4 {
            give(neighbours::<L, CH, 4>(line, half), [place, stride], sink)
        } else if L::REGISTERS >= FOR_NEIGHBOURS && CH * 2 <= SUMS && left >= 2 {
            give(neighbours::<L, CH, 2>(line, half), [place, stride], sink)
        } else {
            give(neighbours::<L, CH, 1>(line, half), [place, stride], sink)
        };
        o += taken;
    }
}

/// Hand neighbouring results over; gives their number.
#[inline(always)]
fn give<L: Copy, const CH: usize, const N: usize>(
    results: [[L; CH]; N],
    [first, stride]: [usize; 2],
    sink: &mut impl Sink<L, CH>,
) -> usize {
    for (i, &result) in results.iter().enumerate() {
        sink.take(first + i * stride, result);
    }
    N
}

/// The results at the beginning of a line.
#[inline(always)]
fn in_block<L: Lanes, const CH: usize>(line: &[[L; CH]], half: &[L]) -> [[L; CH]; BLOCK] {
    let mut results = [[L::zero(); CH]; BLOCK];
    for channel in (0..CH).step_by(TOGETHER) {
        let sums = in_registers(line, half, channel);
        for (result, sum) in results.iter_mut().zip(sums) {
            result[channel..channel + TOGETHER].copy_from_slice(&sum);
        }
    }
    results
}

/// Those of two channels.
#[inline(always)]
fn in_registers<L: Lanes, const CH: usize>(
    line: &[[L; CH]],
    half: &[L],
    channel: usize,
) -> [[L; TOGETHER]; BLOCK] {
    let zero = [[L::zero(); TOGETHER]; BLOCK];
    let [middle, taps @ ..] = half else { return zero };
    let radius = taps.len();
    let two = |x: &[L; CH]| [x[channel], x[channel + 1]];
    let (mut left, mut sums) = (zero, zero);
    for (o, x) in line[radius..radius + BLOCK].iter().enumerate() {
        left[o] = two(x);
        sums[o] = [left[o][0] * *middle, left[o][1] * *middle];
    }
    let mut right = left;
    let (before, after) = (line[..radius].iter().rev(), line[radius + BLOCK..].iter());
    for ((before, after), &tap) in before.zip(after).zip(taps) {
        for o in (1..BLOCK).rev() {
            left[o] = left[o - 1];
        }
        left[0] = two(before);
        for o in 1..BLOCK {
            right[o - 1] = right[o];
        }
        right[BLOCK - 1] = two(after);
        for o in 0..BLOCK {
            for c in 0..TOGETHER {
                sums[o][c] = (left[o][c] + right[o][c]).mul_add(tap, sums[o][c]);
            }
        }
    }
    sums
}

/// The first results of a line.
#[inline(always)]
fn neighbours<L: Lanes, const CH: usize, const N: usize>(
    line: &[[L; CH]],
    half: &[L],
) -> [[L; CH]; N] {
    let mut sums = [[L::zero(); CH]; N];
    let [middle, taps @ ..] = half else { return sums };
    let radius = taps.len();
    for o in 0..N {
        for c in 0..CH {
            sums[o][c] = line[radius + o][c] * *middle;
        }
    }
    let before = line[..radius + N - 1].windows(N).rev();
    let after = line[radius + 1..].windows(N);
    for ((before, after), &tap) in before.zip(after).zip(taps) {
        for o in 0..N {
            for c in 0..CH {
                sums[o][c] = (before[o][c] + after[o][c]).mul_add(tap, sums[o][c]);
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{LaneTask, Path};

    struct Kept<const CH: usize>(Vec<Option<[f64; CH]>>);

    impl<L: Lanes, const CH: usize> Sink<L, CH> for Kept<CH> {
        fn take(&mut self, place: usize, means: [L; CH]) {
            let first = |x: L| L::flat(&[x])[0].into();
            let means = means.map(first);
            let before = self.0[place].replace(means);
            assert!(before.is_none_or(|before| before == means), "{place} twice");
        }
    }

    /// Lines of every length, short and long filters, all paths: the sum as it is written.
    struct EqualSum;

    impl LaneTask for EqualSum {
        type Output = ();
        fn run<L: Lanes<Element = f32>>(self) {
            for radius in [0, 1, 2, 5, 14] {
                for count in 1..=9 {
                    check::<L, 2>(radius, count);
                    check::<L, 4>(radius, count);
                }
            }
        }
    }

    fn check<L: Lanes<Element = f32>, const CH: usize>(radius: usize, count: usize) {
        let number = |place: usize, channel: usize| ((7 * place + 3 * channel) % 11) as f64 - 5.0;
        let tap = |d: usize| 1.0 / (d as f64 + 2.0);
        let line: Vec<[L; CH]> = (0..count + 2 * radius)
            .map(|place| std::array::from_fn(|channel| L::from_f64(number(place, channel))))
            .collect();
        let half: Vec<L> = (0..=radius).map(|d| L::from_f64(tap(d))).collect();
        let mut kept = Kept::<CH>(vec![None; 3 * count + 1]);
        filter(&line, &half, [1, 3], &mut kept);
        for o in 0..count {
            let result = kept.0[1 + 3 * o].expect("every place has a result");
            for (channel, &got) in result.iter().enumerate() {
                let term = |d: usize| tap(d.abs_diff(radius)) * number(o + d, channel);
                let expected: f64 = (0..=2 * radius).map(term).sum();
                assert!((got - expected).abs() < 2e-5, "{radius} {count} {o}: {got} {expected}");
            }
        }
        assert_eq!(kept.0.iter().flatten().count(), count);
    }

    #[test]
    fn results_are_the_sums_on_every_path() {
        for path in Path::available() {
            path.run(EqualSum).unwrap();
        }
    }
}
