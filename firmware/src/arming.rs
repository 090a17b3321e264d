//! Arming a compare register that knows only the low bits of the time.
//!
//! A compare output sets or clears its pin when the counter equals the register: at the edge's tick
//! and, harmlessly, at every wrap after it. So the register must be written less than a wrap before
//! the edge, and early enough to be done in time. [`NearEdges`] decides, from the counter alone:
//! its edges all lie less than a wrap ahead, or are late.

/// Edges of an output that can be near at once, made ones that were not collected among them: a
/// power of two.
pub const DEPTH: u8 = 8;

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
    Wait,
    /// Too late.
    Late,
}

/// The near edges of one output, in one ring:
///
/// ```text
/// collected … made, not collected … armed … waiting … free
///             ▲ made                ▲ next (after the armed one)   ▲ end
/// ```
///
/// Made for interrupts: each step is a few dozen instructions, and nothing is copied.
#[derive(Debug)]
pub struct NearEdges {
    ring: [NearEdge; DEPTH as usize],
    made: u8,
    next: u8,
    end: u8,
    /// The edge before `next` is armed and was not made.
    armed: bool,
    /// What the output became last.
    level: bool,
}

impl Default for NearEdges {
    fn default() -> Self {
        Self::new()
    }
}

impl NearEdges {
    /// None, and the output is low.
    #[must_use]
    pub const fn new() -> Self {
        let none = NearEdge { tick: 0, high: false };
        Self { ring: [none; DEPTH as usize], made: 0, next: 0, end: 0, armed: false, level: false }
    }

    /// Put an edge behind the others; false when there is no room.
    #[inline(always)]
    pub fn push(&mut self, edge: NearEdge) -> bool {
        let room = self.end.wrapping_sub(self.made) < DEPTH;
        if room {
            self.ring[place(self.end)] = edge;
            self.end = self.end.wrapping_add(1);
        }
        room
    }

    /// What the output became last.
    #[must_use]
    #[inline(always)]
    pub fn level(&self) -> bool {
        self.level
    }

    /// Whether the counter, now at `now`, has passed the armed edge.
    #[must_use]
    #[inline(always)]
    pub fn has_passed(&self, now: u16) -> bool {
        // An interrupt that was pending from an earlier wrap finds the edge still ahead.
        self.armed && now.wrapping_sub(self.before_next().tick) < 0x8000
    }

    /// The armed edge, if the counter, now at `now`, has passed it: it was made.
    #[inline(always)]
    pub fn matched(&mut self, now: u16) -> Option<NearEdge> {
        if !self.has_passed(now) {
            return None;
        }
        self.armed = false;
        let edge = self.before_next();
        self.level = edge.high;
        Some(edge)
    }

    /// The edge to be armed next.
    #[must_use]
    #[inline(always)]
    pub fn next(&self) -> Option<NearEdge> {
        if self.next == self.end { None } else { Some(self.ring[place(self.next)]) }
    }

    /// What to do with the next edge, the counter being at `now`.
    #[inline(always)]
    pub fn arm(&mut self, now: u16, window: Window) -> Arming {
        if self.armed || self.next == self.end {
            return Arming::Nothing;
        }
        let next = self.ring[place(self.next)];
        let left = next.tick.wrapping_sub(now);
        if left < window.least || left > window.reach {
            return Arming::Late;
        }
        if left > window.most {
            return Arming::Wait;
        }
        self.next = self.next.wrapping_add(1);
        self.armed = true;
        Arming::Set(next)
    }

    /// An edge that was made, each once.
    #[inline(always)]
    pub fn collect(&mut self) -> Option<NearEdge> {
        if self.made == self.next.wrapping_sub(self.armed as u8) {
            return None;
        }
        let edge = self.ring[place(self.made)];
        self.made = self.made.wrapping_add(1);
        Some(edge)
    }

    /// Forget what was not made; the output is low.
    #[inline(always)]
    pub fn stop(&mut self) {
        self.next = self.next.wrapping_sub(self.armed as u8);
        self.end = self.next;
        self.armed = false;
        self.level = false;
    }

    #[inline(always)]
    fn before_next(&self) -> NearEdge {
        self.ring[place(self.next.wrapping_sub(1))]
    }
}

#[inline(always)]
const fn place(index: u8) -> usize {
    (index % DEPTH) as usize
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
                let expected = match left {
                    0..60 => Arming::Late,
                    60..=245 => Arming::Set(edge(now.wrapping_add(left))),
                    246..=63_488 => Arming::Wait,
                    _ => Arming::Late,
                };
                assert_eq!(edges.arm(now, CLOSE), expected, "{now} {left}");
            }
        }
    }

    #[test]
    fn one_after_the_other() {
        let mut edges = NearEdges::new();
        assert_eq!(edges.arm(1_100, FAR), Arming::Nothing);
        for tick in [65_000, 300, 1_200] {
            assert!(edges.push(edge(tick)));
        }
        assert_eq!(edges.arm(60_000, FAR), Arming::Set(edge(65_000)));
        assert_eq!(edges.arm(60_010, FAR), Arming::Nothing);
        // A match of an earlier wrap.
        assert_eq!((edges.matched(60_020), edges.collect(), edges.level()), (None, None, false));
        assert_eq!((edges.matched(65_007), edges.level()), (Some(edge(65_000)), true));
        assert_eq!(edges.matched(65_008), None);
        assert_eq!(edges.arm(65_010, FAR), Arming::Set(edge(300)));
        assert_eq!(edges.matched(301), Some(edge(300)));
        assert_eq!((edges.collect(), edges.collect()), (Some(edge(65_000)), Some(edge(300))));
        assert_eq!(edges.collect(), None);
        assert_eq!(edges.arm(1_100, FAR), Arming::Late);
        edges.stop();
        assert_eq!(
            (edges.arm(1_100, FAR), edges.next(), edges.level()),
            (Arming::Nothing, None, false)
        );
    }

    #[test]
    fn the_ring_is_full_until_made_edges_are_collected() {
        let mut edges = NearEdges::new();
        let mut tick = 1_000_u16;
        while edges.push(edge(tick)) {
            tick += 1_000;
        }
        assert_eq!(tick, 1_000 * (u16::from(DEPTH) + 1));
        for round in 0..1_000_u16 {
            let due = 1_000_u16.wrapping_add(round.wrapping_mul(1_000));
            assert_eq!(edges.arm(due.wrapping_sub(500), FAR), Arming::Set(edge(due)));
            assert_eq!(edges.matched(due.wrapping_add(9)), Some(edge(due)));
            assert!(!edges.push(edge(tick)));
            assert_eq!(edges.collect(), Some(edge(due)));
            assert!(edges.push(edge(tick)));
            tick = tick.wrapping_add(1_000);
        }
    }

    #[test]
    fn a_stop_keeps_what_was_made() {
        let mut edges = NearEdges::new();
        for tick in [1_000, 2_000, 3_000] {
            assert!(edges.push(edge(tick)));
        }
        edges.arm(500, FAR);
        edges.matched(1_001);
        edges.arm(1_002, FAR);
        edges.stop();
        assert_eq!((edges.collect(), edges.collect()), (Some(edge(1_000)), None));
    }
}
