//! The edges of a plan, one after the other: the nested loops unrolled as they are needed.
//!
//! [`Sweeps`] walks the sweeps and [`Light`] the edges of the stimulus; both keep their place only
//! and take the plan at each step, so that the plan can be held (and checked) in one place.

use crate::channel::{Channel, Edge};
use crate::plan::{Plan, Stimulus};

/// One sweep of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sweep {
    /// When it starts, in ticks after the start of the run.
    pub start: u64,
}

impl Sweep {
    /// Its edges: of each channel in the order of time, `start` being the tick of the run's start.
    #[must_use]
    pub fn edges(self, plan: &Plan, start: u64) -> [Edge; 4] {
        let begin = start.wrapping_add(self.start);
        let at = |delay: u64| begin.wrapping_add(delay);
        [
            Edge::rise(Channel::Laser, at(u64::from(plan.laser.delay))),
            Edge::rise(Channel::Camera, at(u64::from(plan.camera.delay))),
            Edge::fall(Channel::Laser, at(plan.laser.end())),
            Edge::fall(Channel::Camera, at(plan.camera.end())),
        ]
    }
}

/// The sweeps of a run in the order of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sweeps {
    repeat: u16,
    burst: u16,
    sweep: u8,
    repeat_start: u64,
    burst_start: u64,
}

impl Sweeps {
    /// The next sweep; `None` after the last.
    #[inline(never)]
    pub fn next(&mut self, plan: &Plan) -> Option<Sweep> {
        if self.repeat >= plan.repeats {
            return None;
        }
        let start = self.burst_start.wrapping_add(plan.sweep_offset(self.sweep));
        self.advance(plan);
        Some(Sweep { start })
    }

    fn advance(&mut self, plan: &Plan) {
        self.sweep = self.sweep.saturating_add(1);
        if self.sweep < plan.sweeps {
            return;
        }
        self.sweep = 0;
        self.burst = self.burst.saturating_add(1);
        self.burst_start = self.burst_start.wrapping_add(plan.interval);
        if self.burst < plan.bursts {
            return;
        }
        self.burst = 0;
        self.repeat = self.repeat.saturating_add(1);
        self.repeat_start = self.repeat_start.wrapping_add(plan.repeat_period);
        self.burst_start = self.repeat_start;
    }
}

/// The edges of the stimulus in the order of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Light {
    repeat: u16,
    pulse: u32,
    high: bool,
    /// From the start of the run to the start of the repeat, in ticks.
    repeat_start: u64,
    /// From the first rising edge of the repeat to that of the pulse, in ticks.
    pulse_start: u64,
}

impl Light {
    /// The next edge, `start` being the tick of the run's start; `None` after the last and without
    /// a stimulus or with a sham.
    #[inline(never)]
    pub fn next(&mut self, plan: &Plan, start: u64) -> Option<Edge> {
        let stimulus = plan.stimulus.as_ref().filter(|stimulus| !stimulus.sham)?;
        if self.repeat >= plan.repeats {
            return None;
        }
        let mut tick = start.wrapping_add(self.repeat_start).wrapping_add(self.pulse_start);
        tick = tick.wrapping_add(plan.stimulus_start(stimulus));
        self.high = !self.high;
        if self.high {
            return Some(Edge::rise(Channel::Stimulus, tick));
        }
        self.advance(plan, stimulus);
        Some(Edge::fall(Channel::Stimulus, tick.wrapping_add(stimulus.on)))
    }

    fn advance(&mut self, plan: &Plan, stimulus: &Stimulus) {
        self.pulse = self.pulse.wrapping_add(1);
        self.pulse_start = self.pulse_start.wrapping_add(stimulus.period.into());
        if self.pulse >= stimulus.pulses {
            (self.pulse, self.pulse_start) = (0, 0);
            self.repeat = self.repeat.wrapping_add(1);
            self.repeat_start = self.repeat_start.wrapping_add(plan.repeat_period);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::presets::paper;
    use std::vec::Vec;

    fn sweeps(plan: &Plan) -> Vec<u64> {
        let mut sweeps = Sweeps::default();
        core::iter::from_fn(|| sweeps.next(plan)).map(|sweep| sweep.start).collect()
    }

    fn light(plan: &Plan, start: u64) -> Vec<(bool, u64)> {
        let mut light = Light::default();
        core::iter::from_fn(|| light.next(plan, start)).map(|e| (e.high, e.tick)).collect()
    }

    #[test]
    fn the_papers_seventy_sweeps() {
        let expected: Vec<u64> = (0..70).map(|volume| volume * 3_600_000).collect();
        assert_eq!(sweeps(&paper()), expected);
    }

    #[test]
    fn loops_nest() {
        let mut plan = paper();
        (plan.repeats, plan.repeat_period, plan.bursts, plan.sweeps) = (2, 1_000_000, 2, 3);
        (plan.interval, plan.spacing) = (100_000, [1_000, 20_000]);
        let first = [0, 1_000, 21_000, 100_000, 101_000, 121_000];
        let expected: Vec<u64> =
            first.into_iter().chain(first.map(|start| start + 1_000_000)).collect();
        assert_eq!(sweeps(&plan), expected);
        assert_eq!(plan.burst_offset(1) + plan.sweep_offset(2), first[5]);
    }

    #[test]
    fn light_comes_on_with_the_sixth_volume_and_stays() {
        let plan = paper();
        let on = 1000 + 5 * 3_600_000;
        let off = 1000 + 69 * 3_600_000 + 136_533;
        assert_eq!(light(&plan, 1000), [(true, on), (false, off)]);
    }

    #[test]
    fn flicker_is_pulses() {
        let mut plan = paper();
        (plan.repeats, plan.repeat_period) = (2, 500_000_000);
        let stimulus = plan.stimulus.as_mut().unwrap();
        (stimulus.burst, stimulus.on, stimulus.pulses, stimulus.period) = (0, 4_000, 3, 5_000);
        let once = [(true, 0), (false, 4_000), (true, 5_000), (false, 9_000), (true, 10_000)];
        let once: Vec<_> = once.into_iter().chain([(false, 14_000)]).collect();
        let again = once.iter().map(|&(high, tick)| (high, tick + 500_000_000));
        let expected: Vec<_> = once.iter().copied().chain(again).collect();
        assert_eq!(light(&plan, 0), expected);
        assert_eq!(plan.stimulus_on(), 2 * 12_000);
    }

    #[test]
    fn a_sham_makes_no_light() {
        let mut plan = paper();
        plan.stimulus.as_mut().unwrap().sham = true;
        assert!(light(&plan, 0).is_empty());
        plan.stimulus = None;
        assert!(light(&plan, 0).is_empty());
    }
}
