//! Arming a compare register that knows only the low bits of the time.
//!
//! A compare output sets or clears its pin when the counter equals the register: at the edge's tick
//! and, harmlessly, at every wrap after it. So the register must be written less than a wrap before
//! the edge, and early enough to be done in time. [`Output`] decides, from the counter alone: its
//! edges all lie less than a wrap ahead, or are late.

/// Edges of an output that can be near at once: the armed one, and the one that its interrupt arms.
pub const DEPTH: usize = 2;

/// Edges are at most this far ahead; so a counter that is less than the rest of the wrap past an
/// edge's tick has passed it.
pub const REACH: u16 = 65_535 - PASSED + 1;

/// An edge is found out to have been made within so many ticks.
const PASSED: u16 = 2_048;

/// When a register may be written: so many ticks before its edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// At least.
    pub least: u16,
    /// At most.
    pub most: u16,
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
    Wait,
    /// Too late.
    Late,
}

/// The near edges of one output.
///
/// Made for interrupts: each step is a few dozen instructions.
#[derive(Debug)]
pub struct Output {
    armed: NearEdge,
    is_armed: bool,
    ready: NearEdge,
    is_ready: bool,
    /// What the output became last.
    level: bool,
    /// Edges made, wrapping.
    made: u8,
}

impl Default for Output {
    fn default() -> Self {
        Self::new()
    }
}

impl Output {
    /// No edges, and the output is low.
    #[must_use]
    pub const fn new() -> Self {
        let none = NearEdge { tick: 0, high: false };
        Self { armed: none, is_armed: false, ready: none, is_ready: false, level: false, made: 0 }
    }

    /// Have an edge ready to be armed; false when one is ready already.
    #[inline(always)]
    pub fn put(&mut self, edge: NearEdge) -> bool {
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
    pub fn ready(&self) -> Option<NearEdge> {
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
    pub fn has_passed(&self, now: u16) -> bool {
        // An interrupt that was pending from an earlier wrap finds the edge still ahead.
        self.is_armed && now.wrapping_sub(self.armed.tick) < PASSED
    }

    /// The armed edge, if the counter, now at `now`, has passed it: it was made.
    #[inline(always)]
    pub fn matched(&mut self, now: u16) -> Option<NearEdge> {
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
    pub fn arm(&mut self, now: u16, window: Window) -> Arming {
        if self.is_armed || !self.is_ready {
            return Arming::Nothing;
        }
        let left = self.ready.tick.wrapping_sub(now);
        if left < window.least || left > REACH {
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
