//! What is on the wires: chip, pull resistors, the outside world, faults.

use super::CYCLES_PER_TICK;
use super::pin::{Pin, PinEdge};

/// Who drives a wire; the first that does so, in this order, decides.
#[derive(Clone, Copy, Default)]
struct Wire {
    stuck: Option<bool>,
    chip: Option<bool>,
    outside: Option<bool>,
    pull: Option<bool>,
    level: bool,
}

impl Wire {
    fn settled(&self) -> bool {
        self.stuck.or(self.chip).or(self.outside).or(self.pull).unwrap_or(false)
    }
}

/// All wires, and the edges on them.
pub struct Wires {
    wires: [Wire; Pin::COUNT],
    /// (from, to): the wire of `to` follows the wire of `from`.
    jumpers: Vec<(Pin, Pin)>,
    /// Edges since power-on, or since they were forgotten.
    pub edges: Vec<PinEdge>,
    /// Edges that the chip's inputs have not seen yet, with their cycles.
    unseen: Vec<(Pin, bool, u64)>,
}

impl Default for Wires {
    fn default() -> Self {
        Self {
            wires: [Wire::default(); Pin::COUNT],
            jumpers: Vec::new(),
            edges: Vec::new(),
            unseen: Vec::new(),
        }
    }
}

impl Wires {
    pub fn level(&self, pin: Pin) -> bool {
        self.wires[pin.index()].level
    }

    pub fn is_driven(&self, pin: Pin) -> bool {
        self.wires[pin.index()].chip.is_some()
    }

    /// What the chip does to the pin from this cycle on.
    pub fn chip(&mut self, pin: Pin, drive: Option<bool>, pull: Option<bool>, cycle: u64) {
        let wire = &mut self.wires[pin.index()];
        (wire.chip, wire.pull) = (drive, pull);
        self.settle(pin, cycle);
    }

    pub fn outside(&mut self, pin: Pin, drive: Option<bool>, cycle: u64) {
        self.wires[pin.index()].outside = drive;
        self.settle(pin, cycle);
    }

    pub fn stick(&mut self, pin: Pin, level: Option<bool>, cycle: u64) {
        self.wires[pin.index()].stuck = level;
        self.settle(pin, cycle);
    }

    /// A jumper to `to`, or none.
    pub fn connect(&mut self, from: Option<Pin>, to: Pin, cycle: u64) {
        self.jumpers.retain(|&(_, other)| other != to);
        self.jumpers.extend(from.map(|from| (from, to)));
        self.outside(to, from.map(|from| self.level(from)), cycle);
    }

    /// An edge that the chip's inputs have not seen yet.
    pub fn take_unseen(&mut self) -> Option<(Pin, bool, u64)> {
        (!self.unseen.is_empty()).then(|| self.unseen.remove(0))
    }

    fn settle(&mut self, pin: Pin, cycle: u64) {
        let wire = &mut self.wires[pin.index()];
        let high = wire.settled();
        if wire.level == high {
            return;
        }
        wire.level = high;
        self.edges.push(PinEdge { tick: cycle / CYCLES_PER_TICK, pin, high });
        self.unseen.push((pin, high, cycle));
        for at in 0..self.jumpers.len() {
            let (from, to) = self.jumpers[at];
            if from == pin {
                self.outside(to, Some(high), cycle);
            }
        }
    }
}
