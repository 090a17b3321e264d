//! Arming a compare register that knows only the low bits of the time.
//!
//! A compare output sets or clears its pin when the counter equals the register: at the edge's tick
//! and, harmlessly, at every wrap after it. So the register must be written less than a wrap before
//! the edge, and early enough to be done in time. [`NearEdges`] decides, from the counter alone:
//! its edges all lie less than a wrap ahead, or are late.

use heapless::Deque;

/// Edges that can wait behind the armed one.
pub const DEPTH: usize = 4;

/// When a register may be written: so many ticks before its edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// At least.
    pub least: u16,
    /// At most.
    pub most: u16,
    /// Beyond this it is not early but late: the time has passed.
    pub reach: u16,
}

/// An edge less than a wrap ahead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NearEdge {
    /// The low bits of its tick.
    pub tick: u16,
    /// What the output becomes.
    pub high: bool,
}

/// What to do now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arming {
    /// Nothing waits, or an edge is armed already.
    Nothing,
    /// Write this one into the register.
    Set(NearEdge),
    /// Too early for this one.
    Wait(NearEdge),
    /// Too late.
    Late,
}

/// The near edges of one output: the armed one and those behind it.
#[derive(Debug, Default)]
pub struct NearEdges {
    waiting: Deque<NearEdge, DEPTH>,
    armed: Option<NearEdge>,
}

impl NearEdges {
    /// None.
    #[must_use]
    pub const fn new() -> Self {
        Self { waiting: Deque::new(), armed: None }
    }

    /// Put an edge behind the others; false when there is no room.
    #[inline]
    pub fn push(&mut self, edge: NearEdge) -> bool {
        self.waiting.push_back(edge).is_ok()
    }

    /// Whether another edge has room.
    #[must_use]
    #[inline]
    pub fn has_room(&self) -> bool {
        !self.waiting.is_full()
    }

    /// The armed edge, if the counter, now at `now`, has passed it: it was made.
    #[inline]
    pub fn matched(&mut self, now: u16) -> Option<NearEdge> {
        if self.has_passed(now) { self.armed.take() } else { None }
    }

    /// Whether the counter, now at `now`, has passed the armed edge.
    #[must_use]
    #[inline]
    pub fn has_passed(&self, now: u16) -> bool {
        // An interrupt that was pending from an earlier wrap finds the edge still ahead.
        self.armed.is_some_and(|edge| now.wrapping_sub(edge.tick) < 0x8000)
    }

    /// The edge behind the armed one.
    #[must_use]
    #[inline]
    pub fn next(&self) -> Option<NearEdge> {
        self.waiting.front().copied()
    }

    /// What to do with the next edge, the counter being at `now`.
    #[inline]
    pub fn arm(&mut self, now: u16, window: Window) -> Arming {
        if self.armed.is_some() {
            return Arming::Nothing;
        }
        let Some(&next) = self.waiting.front() else { return Arming::Nothing };
        let left = next.tick.wrapping_sub(now);
        if left < window.least || left > window.reach {
            return Arming::Late;
        }
        if left > window.most {
            return Arming::Wait(next);
        }
        let _ = self.waiting.pop_front();
        self.armed = Some(next);
        Arming::Set(next)
    }

    /// Forget all.
    #[inline]
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.armed = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAR: Window = Window { least: 160, most: 63_488, reach: 63_488 };
    const CLOSE: Window = Window { least: 60, most: 245, reach: 63_488 };

    fn edge(tick: u16) -> NearEdge {
        NearEdge { tick, high: true }
    }

    #[test]
    fn armed_within_the_window_only_whatever_the_counter() {
        for now in [0_u16, 1, 1000, 40_000, 65_535] {
            for left in 0..=u16::MAX {
                let mut edges = NearEdges::new();
                assert!(edges.push(edge(now.wrapping_add(left))));
                let next = edge(now.wrapping_add(left));
                let expected = match left {
                    0..60 => Arming::Late,
                    60..=245 => Arming::Set(next),
                    246..=63_488 => Arming::Wait(next),
                    _ => Arming::Late,
                };
                assert_eq!(edges.arm(now, CLOSE), expected, "{now} {left}");
            }
        }
    }

    #[test]
    fn one_after_the_other() {
        let mut edges = NearEdges::new();
        for tick in [65_000, 300, 1_200, 2_000] {
            assert!(edges.has_room() && edges.push(edge(tick)));
        }
        assert!(!edges.has_room() && !edges.push(edge(3_000)));
        assert_eq!(edges.arm(60_000, FAR), Arming::Set(edge(65_000)));
        assert_eq!(edges.arm(60_010, FAR), Arming::Nothing);
        // A match of an earlier wrap.
        assert_eq!(edges.matched(60_020), None);
        assert_eq!(edges.matched(65_007), Some(edge(65_000)));
        assert_eq!(edges.matched(65_008), None);
        assert_eq!(edges.arm(65_010, FAR), Arming::Set(edge(300)));
        assert_eq!(edges.matched(301), Some(edge(300)));
        assert_eq!(edges.arm(1_100, FAR), Arming::Late);
        edges.clear();
        assert_eq!(edges.arm(1_100, FAR), Arming::Nothing);
    }
}
