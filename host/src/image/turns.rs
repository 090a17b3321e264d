//! Which thread computes which strip.
//!
//! A thread goes on beside the strip that it had before, whose rows it holds (`fields`). Where that is taken it begins anew in
//! the longest stretch that is left: at the image's edge, so that two threads meet in the middle, or halfway between two
//! others.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// The strips that are left.
pub(super) struct Turns {
    free: Mutex<Vec<bool>>,
}

impl Turns {
    /// So many strips.
    pub fn new(strips: usize) -> Self {
        Self { free: Mutex::new(vec![true; strips]) }
    }

    /// A strip for the thread that had the one `before`; none when all are taken.
    pub fn next(&self, before: Option<usize>) -> Option<usize> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let is_free = |&strip: &usize| free.get(strip) == Some(&true);
        let beside = before.and_then(|strip| {
            [Some(strip + 1), strip.checked_sub(1)].into_iter().flatten().find(is_free)
        });
        let strip = beside.or_else(|| begin(&free))?;
        free[strip] = false;
        Some(strip)
    }

    /// Leave no strips to anybody.
    pub fn stop(&self) {
        self.free.lock().unwrap_or_else(PoisonError::into_inner).fill(false);
    }
}

/// Where in the longest stretch of free strips to begin.
fn begin(free: &[bool]) -> Option<usize> {
    let mut longest = 0..0;
    let mut start = 0;
    for stretch in free.chunk_by(|a, b| a == b) {
        let here: Range<usize> = start..start + stretch.len();
        start = here.end;
        if stretch[0] && here.len() > longest.len() {
            longest = here;
        }
    }
    let Range { start, end } = longest;
    match (start == 0, end == free.len()) {
        _ if longest.is_empty() => None,
        (true, _) => Some(start),
        (_, true) => Some(end - 1),
        _ => Some(start + (end - start) / 2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_threads_meet_in_the_middle() {
        let turns = Turns::new(7);
        let (mut up, mut down) = (None, None);
        for (low, high) in [(0, 6), (1, 5), (2, 4)] {
            up = turns.next(up);
            down = turns.next(down);
            assert_eq!((up, down), (Some(low), Some(high)));
        }
        assert_eq!(turns.next(down), Some(3));
        assert_eq!((turns.next(up), turns.next(Some(3))), (None, None));
    }

    #[test]
    fn whoever_ends_first_begins_anew_in_the_longest_stretch() {
        let turns = Turns::new(12);
        assert_eq!([turns.next(None), turns.next(None)], [Some(0), Some(11)]);
        assert_eq!(turns.next(None), Some(6), "a third thread between them");
        assert_eq!([turns.next(Some(0)), turns.next(Some(6))], [Some(1), Some(7)]);
        assert_eq!(turns.next(None), Some(4), "a fourth between 1 and 6");
        assert_eq!(turns.next(Some(4)), Some(5));
        assert_eq!(turns.next(Some(5)), Some(9), "both neighbours are taken: between 7 and 11");
    }

    #[test]
    fn every_strip_is_computed_once() {
        for (strips, threads) in [(1, 1), (1, 4), (2, 3), (23, 2), (40, 5)] {
            let turns = Turns::new(strips);
            let mut held = vec![None; threads];
            let mut done = Vec::new();
            for thread in (0..).map(|i| (i * i) % threads) {
                held[thread] = turns.next(held[thread]);
                match held[thread] {
                    Some(strip) => done.push(strip),
                    None => break,
                }
            }
            done.sort_unstable();
            assert!(done.iter().copied().eq(0..strips), "{done:?}");
        }
    }

    #[test]
    fn nothing_is_left_after_a_stop() {
        let turns = Turns::new(3);
        turns.stop();
        assert_eq!(turns.next(None), None);
        assert_eq!(Turns::new(0).next(None), None);
    }
}
