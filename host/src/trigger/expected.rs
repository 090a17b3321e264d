//! What a plan asks for, edge by edge, and whether a run did that.

use super::summary::channel_name;
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::plan::Plan;
use phasewalk_firmware::schedule::{Light, Sweeps};
use serde::{Deserialize, Serialize};

/// The edges of a plan, made by the board's own code; ticks count from the run's time zero.
#[derive(Debug, Clone)]
pub struct Expected {
    /// How many the plan has.
    planned: u64,
    /// Of each channel in the order of time; a sweep has two of the laser and two of the camera.
    edges: [Vec<Edge>; Channel::ALL.len()],
}

/// The edges of a run beside those of its plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Comparison {
    /// Edges made.
    pub made: u64,
    /// Edges of the plan.
    pub planned: u64,
    /// The first deviation in words; none if there is none.
    pub deviation: Option<String>,
}

impl Expected {
    /// The edges of `plan`.
    #[must_use]
    pub fn of(plan: &Plan) -> Self {
        let mut edges: [Vec<Edge>; Channel::ALL.len()] = Default::default();
        let mut keep = |edge: Edge| {
            if let Some(channel) = edges.get_mut(edge.channel.index()) {
                channel.push(edge);
            }
        };
        let (mut sweeps, mut light) = (Sweeps::default(), Light::default());
        while let Some(sweep) = sweeps.next(plan) {
            sweep.edges(plan, 0).into_iter().for_each(&mut keep);
        }
        std::iter::from_fn(|| light.next(plan, 0)).for_each(keep);
        let planned = edges.iter().map(|edges| edges.len() as u64).sum();
        Self { planned, edges }
    }

    /// The light ends at this tick and does not come back.
    pub fn end_light(&mut self, tick: u64) {
        let Some(light) = self.edges.get_mut(Channel::Stimulus.index()) else { return };
        light.retain(|edge| edge.tick < tick);
        if light.last().is_some_and(|last| last.high) {
            light.push(Edge::fall(Channel::Stimulus, tick));
        }
    }

    /// The edges of one channel.
    #[must_use]
    pub fn channel(&self, channel: Channel) -> &[Edge] {
        self.edges.get(channel.index()).map_or(&[], Vec::as_slice)
    }

    /// All of them in the order of time.
    #[must_use]
    pub fn in_order(&self) -> Vec<Edge> {
        let mut all: Vec<Edge> = self.edges.iter().flatten().copied().collect();
        all.sort_by_key(|edge| edge.tick);
        all
    }

    /// The volume, from 0, at whose sweep an edge belongs; `start` is the tick of time zero. None
    /// for the stimulus.
    #[must_use]
    pub fn volume(&self, edge: Edge, start: u64) -> Option<u32> {
        if edge.channel == Channel::Stimulus {
            return None;
        }
        let tick = edge.tick.saturating_sub(start);
        let edges = self.channel(edge.channel);
        // Every other edge is one of the same kind.
        let of_kind = |volume: usize| edges.get(2 * volume + usize::from(!edge.high));
        let mut after = edges.partition_point(|other| other.tick < tick) / 2;
        after = after.min((edges.len() / 2).saturating_sub(1));
        let candidates = after.saturating_sub(1)..=after + 1;
        let distance =
            |volume: &usize| of_kind(*volume).map_or(u64::MAX, |e| e.tick.abs_diff(tick));
        u32::try_from(candidates.min_by_key(distance)?).ok()
    }

    /// The volume, from 0, whose camera trigger was the last before an EXPOSE edge.
    #[must_use]
    pub fn exposed_volume(&self, tick: u64, start: u64) -> Option<u32> {
        let tick = tick.checked_sub(start)?;
        let before = self.channel(Channel::Camera).partition_point(|edge| edge.tick <= tick);
        // A trigger is a rising and a falling edge.
        u32::try_from(before.div_ceil(2).checked_sub(1)?).ok()
    }

    /// Compare with the edges of a run. A run that ended early may lack edges at its end.
    #[must_use]
    pub fn compare(&self, made: &[Edge], start: u64, whole: bool) -> Comparison {
        let first = Channel::ALL.into_iter().filter_map(|channel| {
            let of_channel: Vec<Edge> =
                made.iter().copied().filter(|edge| edge.channel == channel).collect();
            self.first_deviation(channel, &of_channel, start, whole)
        });
        let first = first.min_by_key(|(tick, _)| *tick);
        Comparison {
            made: made.len() as u64,
            planned: self.planned,
            deviation: first.map(|(_, words)| words),
        }
    }

    /// Its tick and what it is.
    fn first_deviation(
        &self,
        channel: Channel,
        made: &[Edge],
        start: u64,
        whole: bool,
    ) -> Option<(u64, String)> {
        let planned = self.channel(channel);
        let name = channel_name(channel);
        for (index, edge) in made.iter().enumerate() {
            let Some(plan) = planned.get(index) else {
                let number = index + 1;
                return Some((edge.tick, format!("{name}: edge {number} is not in the plan")));
            };
            let due = start.saturating_add(plan.tick);
            if edge.high != plan.high || edge.tick != due {
                return Some((due, deviation(name, index, plan, edge, due)));
            }
        }
        let missing = planned.get(made.len()).filter(|_| whole)?;
        let due = start.saturating_add(missing.tick);
        let (number, of) = (made.len() + 1, planned.len());
        let words = format!("{name}: edge {number} of {of}, due at tick {due}, is missing");
        Some((due, words))
    }
}

fn deviation(name: &str, index: usize, plan: &Edge, edge: &Edge, due: u64) -> String {
    let number = index + 1;
    let level = |high: bool| if high { "rises" } else { "falls" };
    if edge.high != plan.high {
        return format!(
            "{name}: edge {number} {} at tick {} where the plan {} at tick {due}",
            level(edge.high),
            edge.tick,
            level(plan.high),
        );
    }
    let (by, side) = (edge.tick.abs_diff(due), if edge.tick > due { "late" } else { "early" });
    format!("{name}: edge {number} {} {by} ticks {side}, at tick {}", level(edge.high), edge.tick)
}

/// Events that would find no room in the board's memory, since a plan makes edges faster than the
/// board can tell them over a line of `baud` bits per second: about, for its passes are usually
/// half as long as they may be.
#[must_use]
pub fn untold(expected: &Expected, board: &Limits, baud: u32) -> u64 {
    // An event's frame has up to 20 bytes of 10 bits; every other pass says one; 8 events can wait.
    const FRAME_BITS: f64 = 200.0;
    const PASSES: f64 = 2.0;
    const WAITING: f64 = 8.0;
    let by_line = FRAME_BITS / f64::from(baud) * f64::from(board.ticks_per_second);
    let by_passes = PASSES * f64::from(board.pass) / 2.0;
    let ticks_per_event = by_line.max(by_passes);
    let (mut waiting, mut last, mut lost) = (0.0_f64, 0, 0);
    for edge in expected.in_order() {
        waiting = (waiting - (edge.tick - last) as f64 / ticks_per_event).max(0.0);
        last = edge.tick;
        // A camera that is wired answers each trigger by an EXPOSE edge.
        let events = if edge.channel == Channel::Camera && edge.high { 2 } else { 1 };
        for _ in 0..events {
            if waiting + 1.0 > WAITING {
                lost += 1;
            } else {
                waiting += 1.0;
            }
        }
    }
    lost
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasewalk_firmware::compiled::Compiled;
    use phasewalk_firmware::plan::{Caps, Inputs, Interlock, Pulse, Start, Stimulus};
    use phasewalk_firmware::rehearsal::rehearse;

    fn plan() -> Plan {
        Plan {
            inputs: Inputs { interlock: Interlock::Off, ready: false, start: Start::Command },
            repeats: 2,
            repeat_period: 16_000_000,
            bursts: 3,
            interval: 1_600_000,
            sweeps: 2,
            spacing: [400_000, 0],
            laser: Pulse { delay: 1_600, width: 16_000 },
            camera: Pulse { delay: 0, width: 1_600 },
            frame: 0,
            phase_limit: None,
            stimulus: Some(Stimulus {
                burst: 0,
                sweep: 1,
                delay: 7,
                on: 100_000,
                pulses: 5,
                period: 200_000,
                sham: false,
            }),
            caps: Caps {
                laser_pulse: 20_000,
                laser_total: 1_000_000,
                stimulus_pulse: 20_000,
                stimulus_total: 1_000_000,
                images_per_sweep: 0,
                camera_images: 0,
                heartbeat: 0,
            },
        }
    }

    #[test]
    fn they_are_the_edges_of_a_rehearsal() {
        let compiled = Compiled::new(&plan()).unwrap();
        let mut edges: [Vec<Edge>; 3] = Default::default();
        rehearse(&Limits::UNO, &compiled, |made| edges[made.edge.channel.index()].push(made.edge))
            .unwrap();
        assert_eq!(Expected::of(&plan()).edges, edges);
    }

    #[test]
    fn a_run_on_plan_has_no_deviation_and_others_are_named() {
        let expected = Expected::of(&plan());
        let made = |start: u64| {
            let edges = expected.in_order().into_iter();
            edges.map(|edge| Edge { tick: edge.tick + start, ..edge }).collect::<Vec<_>>()
        };
        let good = made(1000);
        let count = good.len() as u64;
        let on_plan = Comparison { made: count, planned: count, deviation: None };
        assert_eq!(expected.compare(&good, 1000, true), on_plan);
        let mut late = good.clone();
        late[5].tick += 3;
        let words = expected.compare(&late, 1000, true).deviation.unwrap();
        assert!(words.contains("3 ticks late"), "{words}");
        let fewer = &good[..good.len() - 1];
        assert!(expected.compare(fewer, 1000, true).deviation.unwrap().contains("missing"));
        assert_eq!(expected.compare(fewer, 1000, false).deviation, None);
        let mut more = good.clone();
        more.push(Edge::rise(Channel::Laser, 1 << 40));
        assert!(expected.compare(&more, 1000, true).deviation.unwrap().contains("not in the plan"));
    }

    #[test]
    fn light_that_was_ended_is_not_missed() {
        // Pulses of 100,000 every 200,000 from 400,007 on, in both repeats.
        for (tick, edges) in [(400_000, 0), (450_000, 2), (500_007, 2), (650_000, 4), (1 << 40, 20)]
        {
            let mut expected = Expected::of(&plan());
            expected.end_light(tick);
            let light = expected.channel(Channel::Stimulus);
            assert_eq!(light.len(), edges, "{tick}");
            assert!(light.last().is_none_or(|last| !last.high && last.tick <= tick));
        }
    }

    #[test]
    fn edges_find_their_volume() {
        let expected = Expected::of(&plan());
        let volumes = |channel: Channel| -> Vec<u32> {
            let edges = expected.channel(channel).iter();
            edges
                .map(|edge| expected.volume(Edge { tick: edge.tick + 12, ..*edge }, 10).unwrap())
                .collect()
        };
        let each = |volume: u32| [volume, volume];
        let twice: Vec<u32> = (0..12).flat_map(each).collect();
        assert_eq!(volumes(Channel::Laser), twice);
        assert_eq!(volumes(Channel::Camera), twice);
        assert_eq!(expected.exposed_volume(9, 10), None);
        assert_eq!(expected.exposed_volume(10, 10), Some(0));
        assert_eq!(expected.exposed_volume(400_009, 10), Some(0));
        assert_eq!(expected.exposed_volume(1 << 40, 10), Some(11));
    }

    #[test]
    fn a_plan_too_dense_for_the_line_is_found() {
        let mut plan = plan();
        assert_eq!(untold(&Expected::of(&plan), &Limits::UNO, 250_000), 0);
        let stimulus = plan.stimulus.as_mut().unwrap();
        (stimulus.on, stimulus.period, stimulus.pulses) = (800, 1_600, 100);
        assert!(untold(&Expected::of(&plan), &Limits::UNO, 250_000) > 50);
    }
}
