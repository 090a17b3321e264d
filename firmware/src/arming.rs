//! Arming a compare register that knows only the low bits of the time.
//!
//! A compare output sets or clears its pin when the counter equals the register: at the edge's tick
//! and, harmlessly, at every wrap after it. So the register must be written less than a wrap before
//! the edge, and early enough to be done in time. [`Output`] decides, from the counter alone: its
//! edges all lie less than a wrap ahead, or are late.

/// Edges of an output that can be near at once: the armed one, and the one that its interrupt arms.
pub const DEPTH: usize = 2;

/// The counter of a timer, with its compare register.
pub trait Counter: Copy + PartialOrd + core::fmt::Debug {
    /// Zero.
    const ZERO: Self;

    /// Edges are at most this far ahead; so a counter that is less than the rest of the wrap past an
    /// edge's tick has passed it.
    const REACH: Self;

    /// An edge is found out to have been made within so many ticks: the rest of the wrap.
    const PASSED: Self;

    /// Ticks from `earlier` to this, at most a wrap.
    fn since(self, earlier: Self) -> Self;
}

impl Counter for u16 {
    const ZERO: Self = 0;
    const REACH: Self = Self::MAX - Self::PASSED + 1;
    const PASSED: Self = 2_048;

    #[inline(always)]
    fn since(self, earlier: Self) -> Self {
        self.wrapping_sub(earlier)
    }
}

impl Counter for u32 {
    const ZERO: Self = 0;
    const REACH: Self = Self::MAX - Self::PASSED + 1;
    const PASSED: Self = 1 << 31;

    #[inline(always)]
    fn since(self, earlier: Self) -> Self {
        self.wrapping_sub(earlier)
    }
}

/// Reach of a 16-bit counter.
pub const REACH: u16 = u16::REACH;

/// When a register may be written: so many ticks before its edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window<C = u16> {
    /// At least.
    pub least: C,
    /// At most.
    pub most: C,
}

/// An edge less than a wrap ahead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NearEdge<C = u16> {
    /// The low bits of its tick.
    pub tick: C,
    /// What the output becomes.
    pub high: bool,
}

/// What to do now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arming<C = u16> {
    /// Nothing waits, or an edge is armed already.
    Nothing,
    /// Write this one into the register.
    Set(NearEdge<C>),
    /// Too early for this one.
    Wait,
    /// Too late.
    Late,
}

/// The near edges of one output.
///
/// Made for interrupts: each step is a few dozen instructions.
#[derive(Debug)]
pub struct Output<C = u16> {
    armed: NearEdge<C>,
    is_armed: bool,
    ready: NearEdge<C>,
    is_ready: bool,
    /// What the output became last.
    level: bool,
    /// Edges made, wrapping.
    made: u8,
}

impl<C: Counter> Default for Output<C> {
    fn default() -> Self {
        Self::new()
    }
}

impl<C: Counter> Output<C> {
    /// No edges, and the output is low.
    #[must_use]
    pub const fn new() -> Self {
        let none = NearEdge { tick: C::ZERO, high: false };
        Self { armed: none, is_armed: false, ready: none, is_ready: false, level: false, made: 0 }
    }

    /// Have an edge ready to be armed; false when one is ready already.
    #[inline(always)]
    pub fn put(&mut self, edge: NearEdge<C>) -> bool {
        let room = !self.is_ready;
        if room {
            self.ready = edge;
            self.is_ready = true;
        }
        room
    }

    /// The edge that is ready to be armed.
    #[must_use]
    #[inline(always)]
    pub fn ready(&self) -> Option<NearEdge<C>> {
        if self.is_ready { Some(self.ready) } else { None }
    }

    /// Whether an edge is armed that was not made.
    #[must_use]
    #[inline(always)]
    pub fn is_armed(&self) -> bool {
        self.is_armed
    }

    /// What the output became last.
    #[must_use]
    #[inline(always)]
    pub fn level(&self) -> bool {
        self.level
    }

    /// Edges made since the board started, wrapping.
    #[must_use]
    #[inline(always)]
    pub fn made(&self) -> u8 {
        self.made
    }

    /// Whether the counter, now at `now`, has passed the armed edge.
    #[must_use]
    #[inline(always)]
    pub fn has_passed(&self, now: C) -> bool {
        // An interrupt that was pending from an earlier wrap finds the edge still ahead.
        self.is_armed && now.since(self.armed.tick) < C::PASSED
    }

    /// The armed edge, if the counter, now at `now`, has passed it: it was made.
    #[inline(always)]
    pub fn matched(&mut self, now: C) -> Option<NearEdge<C>> {
        if !self.has_passed(now) {
            return None;
        }
        self.is_armed = false;
        self.level = self.armed.high;
        self.made = self.made.wrapping_add(1);
        Some(self.armed)
    }

    /// What to do with the ready edge, the counter being at `now`.
    #[inline(always)]
    pub fn arm(&mut self, now: C, window: Window<C>) -> Arming<C> {
        if self.is_armed || !self.is_ready {
            return Arming::Nothing;
        }
        let left = self.ready.tick.since(now);
        if left < window.least || left > C::REACH {
            return Arming::Late;
        }
        if left > window.most {
            return Arming::Wait;
        }
        self.set();
        Arming::Set(self.armed)
    }

    /// The ready edge is in the register now.
    #[inline(always)]
    pub fn set(&mut self) {
        self.armed = self.ready;
        self.is_armed = true;
        self.is_ready = false;
    }

    /// Forget what was not made; the output is low.
    pub fn stop(&mut self) {
        self.is_ready = false;
        self.is_armed = false;
        self.level = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAR: Window = Window { least: 160, most: REACH };
    const CLOSE: Window = Window { least: 60, most: 245 };

    #[test]
    fn a_counter_of_32_bits_tells_edges_ahead_from_passed_ones() {
        let window = Window { least: 420, most: u32::REACH };
        let mut output = Output::<u32>::new();
        let edge = NearEdge { tick: 50, high: true };
        assert!(output.put(edge));
        assert_eq!(output.arm(u32::MAX - 1_000_000, window), Arming::Set(edge));
        assert_eq!(output.matched(u32::MAX), None);
        assert_eq!(output.matched(40_000_000), Some(edge));
        assert!(output.put(NearEdge { tick: 40_000_400, high: false }));
        assert_eq!(output.arm(40_000_000, window), Arming::Late);
    }

    fn edge(tick: u16) -> NearEdge {
        NearEdge { tick, high: true }
    }

    #[test]
    fn armed_within_the_window_only_whatever_the_counter() {
        for now in [0_u16, 1, 1000, 40_000, 65_535] {
            for left in 0..=u16::MAX {
                let mut output = Output::new();
                assert!(output.put(edge(now.wrapping_add(left))));
                let expected = match left {
                    0..60 => Arming::Late,
                    60..=245 => Arming::Set(edge(now.wrapping_add(left))),
                    246..=63_488 => Arming::Wait,
                    _ => Arming::Late,
                };
                assert_eq!(output.arm(now, CLOSE), expected, "{now} {left}");
            }
        }
    }

    #[test]
    fn one_after_the_other() {
        let mut output = Output::new();
        assert_eq!(output.arm(1_100, FAR), Arming::Nothing);
        assert!(output.put(edge(65_000)));
        assert!(!output.put(edge(300)), "one is ready");
        assert_eq!(output.arm(60_000, FAR), Arming::Set(edge(65_000)));
        assert!(output.put(edge(300)), "one is armed, one ready");
        assert_eq!(output.arm(60_010, FAR), Arming::Nothing);
        // A match of an earlier wrap, whatever is left until the edge.
        for left in 1..=REACH {
            assert_eq!(output.matched(65_000_u16.wrapping_sub(left)), None, "{left}");
        }
        assert_eq!((output.matched(60_020), output.made(), output.level()), (None, 0, false));
        assert_eq!(output.matched(65_007), Some(edge(65_000)));
        assert_eq!((output.made(), output.level(), output.is_armed()), (1, true, false));
        assert_eq!(output.matched(65_008), None);
        assert_eq!(output.arm(65_010, FAR), Arming::Set(edge(300)));
        assert!(output.put(edge(1_200)));
        assert_eq!(output.matched(301), Some(edge(300)));
        assert_eq!(output.arm(1_100, FAR), Arming::Late);
        output.stop();
        assert_eq!((output.arm(1_100, FAR), output.ready()), (Arming::Nothing, None));
        assert_eq!((output.made(), output.level()), (2, false));
    }
}
