//! The sequencer: hands the plan's edges to the hardware, each in time.
//!
//! ```text
//! idle ─ start ─► waiting for the next sweep ─ near ─► plan verified, camera ready ─► edges
//!                        ▲                                                              │
//!                        └────────────────── all handed over ◄──────────────────────────┘
//! ```
//!
//! It never makes an edge itself. A pass verifies the plan or takes up a sweep, not both, and hands
//! over what the hardware takes, so that its length has a bound.

use crate::board::{Board, Offer};
use crate::channel::{Channel, Edge};
use crate::compiled::Compiled;
use crate::fault::Fault;
use crate::plan::Plan;
use crate::schedule::{Light, Sweep, Sweeps};

/// From the start of a run to its time zero, in passes of [`Limits::pass`](crate::limits::Limits):
/// enough to hand over the first edges.
pub const START_PASSES: u32 = 5;

/// Where a run is.
#[derive(Debug, Clone)]
pub struct Sequencer {
    plan: Plan,
    start: u64,
    sweeps: Sweeps,
    next_sweep: Option<Sweep>,
    /// The memory has been verified for the next sweep.
    verified: bool,
    laboured: bool,
    /// Of the current sweep, what has not been handed over.
    pending: [Option<Edge>; 4],
    light: Light,
    next_light: Option<Edge>,
    /// Sweeps whose edges have been handed over or are pending.
    begun: u32,
    /// Edges handed over that have not been made.
    outstanding: u16,
}

/// What remains to be done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Remaining {
    /// Edges.
    Edges,
    /// Nothing: every edge was made.
    Nothing,
}

impl Default for Sequencer {
    fn default() -> Self {
        Self {
            plan: Plan::EMPTY,
            start: 0,
            sweeps: Sweeps::default(),
            next_sweep: None,
            verified: false,
            laboured: false,
            pending: [None; 4],
            light: Light::default(),
            next_light: None,
            begun: 0,
            outstanding: 0,
        }
    }
}

impl Sequencer {
    /// Take the plan out of its memory, to be looked at or run; false when it is none, or no longer
    /// what was stored. Not during a run.
    #[must_use]
    pub fn load(&mut self, memory: &Compiled) -> bool {
        memory.is_intact() && memory.read(&mut self.plan)
    }

    /// Begin to run the loaded plan; its time zero is the tick `start`.
    #[inline(never)]
    pub fn begin(&mut self, start: u64) {
        self.start = start;
        self.sweeps = Sweeps::default();
        self.next_sweep = self.sweeps.next(&self.plan);
        self.verified = false;
        self.pending = [None; 4];
        self.light = Light::default();
        self.next_light = self.light.next(&self.plan, start);
        self.begun = 0;
        self.outstanding = 0;
    }

    /// The loaded plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Sweeps whose edges have been handed over or are just being.
    #[must_use]
    pub fn begun(&self) -> u32 {
        self.begun
    }

    /// An edge was made.
    pub fn made(&mut self) {
        self.outstanding = self.outstanding.saturating_sub(1);
    }

    /// One pass: hand over what is due, `memory` being where the plan is held.
    ///
    /// # Errors
    /// [`Fault::PlanMemory`], [`Fault::NotReady`], [`Fault::Late`].
    #[inline(never)]
    pub fn pass<B: Board>(
        &mut self,
        board: &mut B,
        memory: &Compiled,
        now: u64,
    ) -> Result<Remaining, Fault> {
        self.laboured = false;
        if self.pending == [None; 4] && self.verified {
            self.begin_sweep(board, memory)?;
        }
        self.offer_sweep(board)?;
        self.verify::<B>(memory, now)?;
        self.offer_light(board)?;
        let handed_over =
            self.next_sweep.is_none() && self.pending == [None; 4] && self.next_light.is_none();
        let nothing = handed_over && self.outstanding == 0;
        Ok(if nothing { Remaining::Nothing } else { Remaining::Edges })
    }

    /// Whether the last pass did something that takes long.
    #[must_use]
    pub fn laboured(&self) -> bool {
        self.laboured
    }

    /// Once for each sweep, when it is near: its plan must be what was sent.
    #[inline(never)]
    fn verify<B: Board>(&mut self, memory: &Compiled, now: u64) -> Result<(), Fault> {
        let Some(sweep) = self.next_sweep else { return Ok(()) };
        let near = u64::from(B::LIMITS.reach + 3 * B::LIMITS.pass);
        let far = self.start.wrapping_add(sweep.start).saturating_sub(now) > near;
        if far || self.verified || self.laboured {
            return Ok(());
        }
        (self.verified, self.laboured) = (memory.is_intact(), true);
        if self.verified { Ok(()) } else { Err(Fault::PlanMemory) }
    }

    /// Take up the next sweep, for which the plan was verified: ask the camera.
    #[inline(never)]
    fn begin_sweep<B: Board>(&mut self, board: &mut B, memory: &Compiled) -> Result<(), Fault> {
        let Some(sweep) = self.next_sweep else { return Ok(()) };
        (self.verified, self.laboured) = (false, true);
        if !memory.read(&mut self.plan) {
            return Err(Fault::PlanMemory);
        }
        if self.plan.inputs.ready && !board.camera_ready() {
            return Err(Fault::NotReady);
        }
        self.pending = sweep.edges(&self.plan, self.start).map(Some);
        self.next_sweep = self.sweeps.next(&self.plan);
        self.begun = self.begun.wrapping_add(1);
        Ok(())
    }

    /// Of each channel the pending edges, until one must wait.
    #[inline(never)]
    fn offer_sweep<B: Board>(&mut self, board: &mut B) -> Result<(), Fault> {
        let mut waits = [false; Channel::ALL.len()];
        for slot in &mut self.pending {
            let Some(edge) = *slot else { continue };
            let Some(waits) = waits.get_mut(edge.channel.index()) else { continue };
            if *waits {
                continue;
            }
            if hand_over(board, edge)? {
                self.outstanding = self.outstanding.saturating_add(1);
                *slot = None;
            } else {
                *waits = true;
            }
        }
        Ok(())
    }

    #[inline(never)]
    fn offer_light<B: Board>(&mut self, board: &mut B) -> Result<(), Fault> {
        // A pulse may be shorter than a pass: its two edges go together.
        for _ in 0..2 {
            let Some(edge) = self.next_light else { break };
            if !hand_over(board, edge)? {
                break;
            }
            self.outstanding = self.outstanding.saturating_add(1);
            self.next_light = self.light.next(&self.plan, self.start);
        }
        Ok(())
    }
}

/// Whether the hardware has taken the edge.
fn hand_over<B: Board>(board: &mut B, edge: Edge) -> Result<bool, Fault> {
    match board.offer(edge) {
        Offer::Taken => Ok(true),
        Offer::Later => Ok(false),
        Offer::Late => Err(Fault::Late),
    }
}
