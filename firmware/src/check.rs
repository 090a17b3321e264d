//! What no plan may break. The host asks before it sends, the board before it arms.

use crate::limits::Limits;
use crate::plan::{MAX_SWEEPS, Plan, Stimulus};
use core::fmt;
use serde::{Deserialize, Serialize};

/// A rule that a plan breaks, with the figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Violation {
    /// The rule.
    pub rule: Rule,
    /// What the plan asks for; in ticks where it is a time.
    pub value: u64,
    /// What is allowed: at least or at most, as the rule says.
    pub limit: u64,
}

/// The rules.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Rule {
    /// At least one repeat.
    Repeats,
    /// At least one burst.
    Bursts,
    /// 1 to [`MAX_SWEEPS`] sweeps per burst: none.
    Sweeps,
    /// 1 to [`MAX_SWEEPS`] sweeps per burst: more.
    TooManySweeps,
    /// The laser's pulse is long enough to be made.
    LaserWidth,
    /// The camera's pulse is long enough to be made.
    CameraWidth,
    /// A sweep ends well before the next of its burst starts.
    Spacing,
    /// A burst ends well before the next starts.
    Interval,
    /// A repeat ends well before the next starts.
    RepeatPeriod,
    /// The stimulus is timed at a burst that exists.
    StimulusBurst,
    /// The stimulus is timed at a sweep that exists.
    StimulusSweep,
    /// At least one pulse of light.
    StimulusPulses,
    /// A pulse of light is long enough to be made.
    StimulusOn,
    /// The gap between two pulses of light is long enough to be made.
    StimulusOff,
    /// The laser's pulse stays below the cap.
    LaserPulse,
    /// The laser's time over the run stays below the cap.
    LaserTotal,
    /// The stimulus without a break stays below the cap.
    StimulusPulse,
    /// The stimulus over the run stays below the cap.
    StimulusTotal,
    /// The images fit the camera's memory.
    CameraMemory,
    /// The frame clock is not too fast for the board.
    FrameShort,
    /// The frame clock is not too slow for the board, which may make none.
    FrameLong,
    /// With a frame clock, the camera's pulse holds the images of a sweep: it is as long.
    FramePulse,
    /// A phase limit needs a board that can solve.
    PhaseLimit,
    /// The silence of the solver that ends a run can be told from none, as that of the host.
    PhaseSilence,
    /// The silence of the host that ends a run can be told from none: half of what 32 bits count.
    Heartbeat,
    /// No time, and not the run as a whole, is beyond what the clock counts.
    Length,
}

impl Rule {
    /// Whether value and limit are times in ticks.
    #[must_use]
    pub const fn in_ticks(self) -> bool {
        !matches!(
            self,
            Self::Repeats
                | Self::Bursts
                | Self::Sweeps
                | Self::TooManySweeps
                | Self::StimulusBurst
                | Self::StimulusSweep
                | Self::StimulusPulses
                | Self::CameraMemory
                | Self::PhaseLimit
        )
    }

    /// Whether the limit is the least (rather than the most) that is allowed.
    #[must_use]
    pub const fn is_minimum(self) -> bool {
        matches!(
            self,
            Self::Repeats
                | Self::Bursts
                | Self::Sweeps
                | Self::LaserWidth
                | Self::CameraWidth
                | Self::Spacing
                | Self::Interval
                | Self::RepeatPeriod
                | Self::StimulusPulses
                | Self::StimulusOn
                | Self::StimulusOff
                | Self::FrameShort
        )
    }

    /// What is compared with the limit, for messages.
    #[must_use]
    pub const fn subject(self) -> &'static str {
        match self {
            Self::Repeats => "number of repeats",
            Self::Bursts => "number of bursts",
            Self::Sweeps | Self::TooManySweeps => "number of sweeps per burst",
            Self::LaserWidth => "laser pulse",
            Self::CameraWidth => "camera pulse",
            Self::Spacing => "spacing of the sweeps of a burst",
            Self::Interval => "interval between bursts",
            Self::RepeatPeriod => "period of the repeats",
            Self::StimulusBurst => "burst of the stimulus (counted from 0)",
            Self::StimulusSweep => "sweep of the stimulus (counted from 0)",
            Self::StimulusPulses => "number of pulses of the stimulus",
            Self::StimulusOn => "on-time of the stimulus",
            Self::StimulusOff => "off-time of the flicker",
            Self::LaserPulse => "laser on-time without a break",
            Self::LaserTotal => "laser on-time over the run",
            Self::StimulusPulse => "stimulus on-time without a break",
            Self::StimulusTotal => "stimulus on-time over the run",
            Self::CameraMemory => "number of camera images",
            Self::FrameShort | Self::FrameLong => {
                "period of the frame clock (0: the board has none)"
            }
            Self::FramePulse => "camera pulse less images per sweep times frame period",
            Self::PhaseSilence => "silence of the solver that ends the run",
            Self::PhaseLimit => "number of phase limits (only a board with a solver keeps one)",
            Self::Heartbeat => "silence of the host that ends the run",
            Self::Length => "length of the run, or a time in it,",
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rule, value, limit } = self;
        let most = if rule.is_minimum() { "at least" } else { "at most" };
        let unit = if rule.in_ticks() { " ticks" } else { "" };
        write!(f, "{} is {value}{unit}; {most} {limit}{unit} allowed", rule.subject())
    }
}

/// 101 days at 16 MHz. The clock counts twice as far, and no product or sum of a plan whose times
/// are all below overflows.
const LONGEST: u64 = 1 << 47;

const LONGEST_SILENCE: u64 = 1 << 31;

/// Whether a plan keeps all rules.
///
/// # Errors
/// The first rule that it breaks.
pub fn check(plan: &Plan, limits: &Limits) -> Result<(), Violation> {
    // Sums and products of what the first two let pass do not overflow; of what they do not, they
    // wrap without harm, since the first violation counts.
    let mut rules = Rules(None);
    rules.loops(plan);
    rules.times(plan);
    rules.edges(plan, limits.shortest.into());
    if let Some(stimulus) = &plan.stimulus {
        rules.stimulus(plan, stimulus, limits.shortest.into());
    }
    rules.caps(plan, limits);
    #[cfg(feature = "extended")]
    rules.extended(plan, limits);
    rules.0.map_or(Ok(()), Err)
}

/// The first violation.
struct Rules(Option<Violation>);

impl Rules {
    /// Every loop turns at least once.
    #[inline(never)]
    fn loops(&mut self, plan: &Plan) {
        self.at_least(Rule::Repeats, plan.repeats.into(), 1);
        self.at_least(Rule::Bursts, plan.bursts.into(), 1);
        self.at_least(Rule::Sweeps, plan.sweeps.into(), 1);
        self.at_most(Rule::TooManySweeps, plan.sweeps.into(), MAX_SWEEPS as u64);
        let Some(stimulus) = &plan.stimulus else { return };
        let (bursts, sweeps) = (plan.bursts.wrapping_sub(1), plan.sweeps.wrapping_sub(1));
        self.at_most(Rule::StimulusBurst, stimulus.burst.into(), bursts.into());
        self.at_most(Rule::StimulusSweep, stimulus.sweep.into(), sweeps.into());
        self.at_least(Rule::StimulusPulses, stimulus.pulses.into(), 1);
    }

    /// No time is so long that sums overflow: first each by itself, then the sum.
    #[inline(never)]
    fn times(&mut self, plan: &Plan) {
        self.at_most(Rule::Length, plan.interval, LONGEST);
        self.at_most(Rule::Length, plan.repeat_period, LONGEST);
        if let Some(stimulus) = &plan.stimulus {
            self.at_most(Rule::Length, stimulus.delay, LONGEST);
            self.at_most(Rule::Length, stimulus.on, LONGEST);
            // 32 bits times 32 bits, and what has just been looked at.
            self.at_most(Rule::Length, stimulus.duration(), LONGEST);
        }
        self.at_most(Rule::Length, plan.length(), LONGEST);
    }

    /// Pulses can be made, and each sweep ends before the next starts.
    #[inline(never)]
    fn edges(&mut self, plan: &Plan, shortest: u64) {
        self.at_least(Rule::LaserWidth, plan.laser.width.into(), shortest);
        self.at_least(Rule::CameraWidth, plan.camera.width.into(), shortest);
        let sweep = plan.sweep_length().wrapping_add(shortest);
        for &spacing in plan.spacing.iter().take(usize::from(plan.sweeps.wrapping_sub(1))) {
            self.at_least(Rule::Spacing, spacing.into(), sweep);
        }
        if plan.bursts > 1 {
            let burst = plan.burst_length().wrapping_add(shortest);
            self.at_least(Rule::Interval, plan.interval, burst);
        }
        if plan.repeats > 1 {
            let repeat = plan.repeat_length().wrapping_add(shortest);
            self.at_least(Rule::RepeatPeriod, plan.repeat_period, repeat);
        }
    }

    /// The stimulus can be made, and no pulse of it is longer than allowed.
    #[inline(never)]
    fn stimulus(&mut self, plan: &Plan, stimulus: &Stimulus, shortest: u64) {
        self.at_least(Rule::StimulusOn, stimulus.on, shortest);
        if stimulus.pulses > 1 {
            let off = u64::from(stimulus.period).saturating_sub(stimulus.on);
            self.at_least(Rule::StimulusOff, off, shortest);
        }
        if !stimulus.sham {
            self.at_most(Rule::StimulusPulse, stimulus.on, plan.caps.stimulus_pulse);
        }
    }

    /// On-times and images stay below what laboratory and board allow.
    #[inline(never)]
    fn caps(&mut self, plan: &Plan, limits: &Limits) {
        let caps = &plan.caps;
        let laser_pulse = caps.laser_pulse.min(limits.laser_pulse);
        self.at_most(Rule::LaserPulse, plan.laser.width.into(), laser_pulse.into());
        let laser_total = caps.laser_total.min(limits.laser_total);
        self.at_most(Rule::LaserTotal, plan.laser_on(), laser_total);
        let stimulus_total = caps.stimulus_total.min(limits.stimulus_total);
        self.at_most(Rule::StimulusTotal, plan.stimulus_on(), stimulus_total);
        self.at_most(Rule::Heartbeat, caps.heartbeat.into(), LONGEST_SILENCE);
        self.at_most(Rule::CameraMemory, plan.images(), caps.camera_images.into());
    }

    /// What only larger boards have. Others find no plan in bytes that ask for it.
    #[cfg(feature = "extended")]
    fn extended(&mut self, plan: &Plan, limits: &Limits) {
        if plan.frame > 0 {
            self.at_most(Rule::FrameLong, plan.frame.into(), limits.frame_longest.into());
            self.at_least(Rule::FrameShort, plan.frame.into(), limits.shortest.into());
            let images = u64::from(plan.frame).wrapping_mul(plan.caps.images_per_sweep.into());
            self.at_most(Rule::FramePulse, images.abs_diff(plan.camera.width.into()), 0);
        }
        if let Some(limit) = &plan.phase_limit {
            self.at_most(Rule::PhaseLimit, 1, limits.speckles.min(1).into());
            self.at_most(Rule::PhaseSilence, limit.silence.into(), LONGEST_SILENCE - 1);
        }
    }

    #[inline(never)]
    fn at_least(&mut self, rule: Rule, value: u64, limit: u64) {
        if value < limit && self.0.is_none() {
            self.0 = Some(Violation { rule, value, limit });
        }
    }

    #[inline(never)]
    fn at_most(&mut self, rule: Rule, value: u64, limit: u64) {
        if value > limit && self.0.is_none() {
            self.0 = Some(Violation { rule, value, limit });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::presets::paper;

    fn broken(change: impl FnOnce(&mut Plan)) -> Violation {
        let mut plan = paper();
        change(&mut plan);
        check(&plan, &Limits::UNO).unwrap_err()
    }

    #[test]
    fn the_papers_sequence_is_allowed() {
        assert_eq!(check(&paper(), &Limits::UNO), Ok(()));
    }

    #[test]
    fn each_rule_is_kept_with_its_figures() {
        let second = 16_000_000_u64;
        let cases = [
            (broken(|p| p.repeats = 0), Rule::Repeats, 0, 1),
            (broken(|p| p.bursts = 0), Rule::Bursts, 0, 1),
            (broken(|p| p.sweeps = 0), Rule::Sweeps, 0, 1),
            (broken(|p| p.sweeps = 4), Rule::TooManySweeps, 4, 3),
            (broken(|p| p.laser.width = 799), Rule::LaserWidth, 799, 800),
            (broken(|p| p.camera.width = 0), Rule::CameraWidth, 0, 800),
            (broken(|p| (p.sweeps, p.spacing[0]) = (2, 9)), Rule::Spacing, 9, 137_333),
            (broken(|p| p.interval = 137_332), Rule::Interval, 137_332, 137_333),
            (broken(|p| p.repeats = 2), Rule::RepeatPeriod, 0, 248_537_333),
            (broken(|p| stimulus(p).burst = 70), Rule::StimulusBurst, 70, 69),
            (broken(|p| stimulus(p).sweep = 1), Rule::StimulusSweep, 1, 0),
            (broken(|p| stimulus(p).pulses = 0), Rule::StimulusPulses, 0, 1),
            (broken(|p| flicker(p, 4000, 10)), Rule::StimulusOn, 10, 800),
            (broken(|p| flicker(p, 4000, 3300)), Rule::StimulusOff, 700, 800),
            (broken(|p| stimulus(p).delay = LONGEST + 1), Rule::Length, LONGEST + 1, LONGEST),
            (broken(|p| p.laser.width = 1_000_000), Rule::LaserPulse, 1_000_000, 160_000),
            (broken(|p| p.caps.laser_total = second / 2), Rule::LaserTotal, 9_557_310, second / 2),
            (broken(|p| p.caps.stimulus_pulse = second), Rule::StimulusPulse, 230_536_533, second),
            (broken(|p| p.caps.stimulus_total = second), Rule::StimulusTotal, 230_536_533, second),
            (broken(|p| p.caps.heartbeat = u32::MAX), Rule::Heartbeat, u32::MAX.into(), 1 << 31),
            (broken(|p| p.caps.camera_images = 35_839), Rule::CameraMemory, 35_840, 35_839),
            (broken(|p| p.interval = u64::MAX), Rule::Length, u64::MAX, LONGEST),
        ];
        for (violation, rule, value, limit) in cases {
            assert_eq!(violation, Violation { rule, value, limit });
        }
    }

    #[test]
    fn a_sham_stimulus_needs_no_allowance() {
        let mut plan = paper();
        stimulus(&mut plan).sham = true;
        (plan.caps.stimulus_pulse, plan.caps.stimulus_total) = (0, 0);
        assert_eq!(check(&plan, &Limits::UNO), Ok(()));
    }

    fn stimulus(plan: &mut Plan) -> &mut Stimulus {
        plan.stimulus.as_mut().expect("the paper's sequence has one")
    }

    fn flicker(plan: &mut Plan, period: u32, on: u64) {
        let stimulus = stimulus(plan);
        (stimulus.period, stimulus.on, stimulus.pulses) = (period, on, 100);
    }
}
