//! The safety rules: what is watched in every pass, independently of the sequencer.

use crate::board::Board;
use crate::channel::{Channel, Edge};
use crate::fault::Fault;
use crate::limits::Limits;
use crate::plan::{Caps, Inputs, Interlock, Plan};

/// Test pulses of the safety loop come every so many passes' worth of ticks.
const LOOP_TEST_PASSES: u32 = 100;

/// The clock's interrupt must come within so many passes' worth of ticks.
const INTERRUPT_PASSES: u32 = 8;

/// Passes in a row in which the clock may stand still: no pass is shorter than a tick.
const STILL_PASSES: u8 = 100;

/// The dynamic enable changes twice per pass's worth of ticks, at most.
const ENABLE_SHARE: u32 = 2;

/// What is watched while the board is armed or runs.
#[derive(Debug, Clone, Default)]
pub struct Guard {
    /// Since when each output has been high.
    high_since: [Option<u64>; Channel::ALL.len()],
    /// How long each output has been high before that.
    total: [u64; Channel::ALL.len()],
    // Of these times the low bits do: they are looked at in every pass.
    heard: u32,
    loop_tested: u32,
}

impl Guard {
    /// Watch from the tick `now` on.
    pub fn begin(&mut self, now: u64) {
        let now = now as u32;
        *self = Self { heard: now, loop_tested: now, ..Self::default() };
    }

    /// Whether a run may begin.
    ///
    /// # Errors
    /// What is not as it must be.
    #[inline(never)]
    pub fn preflight<B: Board>(inputs: &Inputs, board: &mut B) -> Result<(), Fault> {
        hardware(board)?;
        interlock(inputs.interlock, board)?;
        if inputs.interlock == Interlock::Pulsed && !board.interlock_passes_pulse() {
            return Err(Fault::InterlockStuck);
        }
        if inputs.ready && !board.camera_ready() {
            return Err(Fault::NotReady);
        }
        Ok(())
    }

    /// The host has spoken.
    pub fn heard(&mut self, now: u64) {
        self.heard = now as u32;
    }

    /// An output has changed.
    #[inline(never)]
    pub fn made(&mut self, edge: Edge) {
        let index = edge.channel.index();
        let (Some(since), Some(total)) =
            (self.high_since.get_mut(index), self.total.get_mut(index))
        else {
            return;
        };
        if edge.high {
            *since = Some(edge.tick);
        } else if let Some(since) = since.take() {
            *total = total.wrapping_add(edge.tick.saturating_sub(since));
        }
    }

    /// An output is high, as far as its edges were collected.
    pub fn is_high(&self, channel: Channel) -> bool {
        self.high_since.get(channel.index()).is_some_and(Option::is_some)
    }

    /// One pass.
    ///
    /// # Errors
    /// The rule that is broken; all outputs must go low.
    #[inline(never)]
    pub fn pass<B: Board>(&mut self, board: &mut B, plan: &Plan, now: u64) -> Result<(), Fault> {
        if let Some(fault) = board.latched() {
            return Err(fault);
        }
        interlock(plan.inputs.interlock, board)?;
        hardware(board)?;
        self.caps(&plan.caps, &B::LIMITS, now)?;
        self.heartbeat(plan.caps.heartbeat, now as u32)?;
        if plan.inputs.interlock == Interlock::Pulsed {
            self.test_loop(board, now as u32)?;
        }
        Ok(())
    }

    /// What the laboratory allows, and the board.
    fn caps(&self, caps: &Caps, limits: &Limits, now: u64) -> Result<(), Fault> {
        let laser = caps.laser_pulse.min(limits.laser_pulse);
        let laser_total = caps.laser_total.min(limits.laser_total);
        if !self.within(Channel::Laser, now, laser.into(), laser_total) {
            return Err(Fault::LaserCap);
        }
        let stimulus_total = caps.stimulus_total.min(limits.stimulus_total);
        if self.within(Channel::Stimulus, now, caps.stimulus_pulse, stimulus_total) {
            Ok(())
        } else {
            Err(Fault::StimulusCap)
        }
    }

    /// Whether an output has been high for at most so long, without a break and in total.
    #[inline(never)]
    fn within(&self, channel: Channel, now: u64, pulse: u64, total: u64) -> bool {
        let index = channel.index();
        let before = self.total.get(index).copied().unwrap_or(0);
        let since = self.high_since.get(index).copied().flatten();
        let on = since.map_or(0, |since| now.saturating_sub(since));
        on <= pulse && before.wrapping_add(on) <= total
    }

    fn heartbeat(&self, limit: u32, now: u32) -> Result<(), Fault> {
        let silence = now.wrapping_sub(self.heard);
        if limit > 0 && silence > limit { Err(Fault::Heartbeat) } else { Ok(()) }
    }

    fn test_loop<B: Board>(&mut self, board: &mut B, now: u32) -> Result<(), Fault> {
        let due = now.wrapping_sub(self.loop_tested) >= B::LIMITS.pass * LOOP_TEST_PASSES;
        if !due {
            return Ok(());
        }
        self.loop_tested = now;
        if board.interlock_passes_pulse() { Ok(()) } else { Err(Fault::InterlockStuck) }
    }
}

fn interlock<B: Board>(interlock: Interlock, board: &mut B) -> Result<(), Fault> {
    if interlock == Interlock::Off || board.interlock_closed() {
        Ok(())
    } else {
        Err(Fault::Interlock)
    }
}

fn hardware<B: Board>(board: &mut B) -> Result<(), Fault> {
    if !board.stack_intact() {
        return Err(Fault::Stack);
    }
    if board.read_back() { Ok(()) } else { Err(Fault::ReadBack) }
}

/// Watchdog and dynamic enable: given only while the clock and its interrupt advance.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pulse {
    // Low bits of times: they are looked at in every pass.
    now: u32,
    interrupted: u32,
    toggled: u32,
    interrupts: u16,
    still: u8,
}

impl Pulse {
    /// One pass; `enable` while light may be made.
    ///
    /// # Errors
    /// [`Fault::Clock`]: then neither is given.
    #[inline(never)]
    pub fn pass<B: Board>(&mut self, board: &mut B, now: u64, enable: bool) -> Result<(), Fault> {
        let (now, pass) = (now as u32, B::LIMITS.pass);
        let went_on = now.wrapping_sub(self.now);
        self.still = if went_on == 0 { self.still.saturating_add(1) } else { 0 };
        self.now = now;
        let interrupts = board.interrupts();
        let interrupted = interrupts != self.interrupts;
        if interrupted {
            self.interrupts = interrupts;
            self.interrupted = now;
        }
        let overdue = now.wrapping_sub(self.interrupted) > pass * INTERRUPT_PASSES;
        // Backwards is a long way forwards.
        if overdue || went_on > pass * INTERRUPT_PASSES || self.still > STILL_PASSES {
            board.rest_enable();
            return Err(Fault::Clock);
        }
        if interrupted {
            // Only an interrupt earns the next period.
            board.feed_watchdog();
        }
        if !enable {
            board.rest_enable();
        } else if now.wrapping_sub(self.toggled) >= pass / ENABLE_SHARE {
            self.toggled = now;
            board.toggle_enable();
        }
        Ok(())
    }
}

/// The longest pass of the main loop, the figure that the host's certificate rests on.
#[derive(Debug, Clone, Copy, Default)]
pub struct Longest {
    last: Option<u32>,
    longest: u32,
}

impl Longest {
    /// A pass begins; passes count while `running`.
    #[inline(never)]
    pub fn pass(&mut self, now: u64, running: bool) {
        let now = now as u32;
        if let Some(last) = self.last {
            self.longest = self.longest.max(now.wrapping_sub(last));
        }
        self.last = running.then_some(now);
    }

    /// In ticks.
    #[must_use]
    pub fn ticks(&self) -> u32 {
        self.longest
    }
}
