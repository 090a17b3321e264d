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

/// An edge that was not made so many passes after it was due has been lost.
const OVERDUE_PASSES: u32 = 2;

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
    /// Of each channel, edges handed over that have not been made, and when the last of them is due.
    outstanding: [u8; Channel::ALL.len()],
    due: [u64; Channel::ALL.len()],
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
            outstanding: [0; 3],
            due: [0; 3],
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
        self.outstanding = [0; 3];
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
    pub fn made(&mut self, channel: Channel) {
        if let Some(outstanding) = self.outstanding.get_mut(channel.index()) {
            *outstanding = outstanding.saturating_sub(1);
        }
    }

    /// No more light from here on, and what the hardware has of it is forgotten.
    pub fn end_light(&mut self) {
        self.next_light = None;
        if let Some(outstanding) = self.outstanding.get_mut(Channel::Stimulus.index()) {
            *outstanding = 0;
        }
    }

    /// Whether an edge should have been made long ago: the hardware has lost it.
    #[inline(never)]
    fn is_overdue(&self, now: u64, patience: u32) -> bool {
        let latest = now.saturating_sub(patience.into());
        let mut channels = self.outstanding.iter().zip(&self.due);
        channels.any(|(&outstanding, &due)| outstanding > 0 && due < latest)
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
        if !self.laboured && self.is_overdue(now, OVERDUE_PASSES * B::LIMITS.pass) {
            return Err(Fault::Late);
        }
        let nothing = handed_over && self.outstanding == [0; 3];
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
                *slot = None;
                taken(&mut self.outstanding, &mut self.due, edge);
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
            taken(&mut self.outstanding, &mut self.due, edge);
            self.next_light = self.light.next(&self.plan, self.start);
        }
        Ok(())
    }
}

/// An edge was handed over.
fn taken(outstanding: &mut [u8; 3], due: &mut [u64; 3], edge: Edge) {
    let index = edge.channel.index();
    if let (Some(outstanding), Some(due)) = (outstanding.get_mut(index), due.get_mut(index)) {
        *outstanding = outstanding.saturating_add(1);
        *due = edge.tick;
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
