//! The timing certificate: the compiled bytes, run through the board's own sequencer with every
//! pass of its main loop as long as it may be, and what was left of the time for each edge.

use super::units::{microseconds, rounded, seconds};
use crate::error::{Error, Result};
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::rehearsal::{Rehearsed, rehearse, rehearsed};
use std::collections::VecDeque;

/// What a rehearsal of every edge has shown. Times are in ticks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Certificate {
    /// In the order of [`Channel::ALL`].
    pub channels: [Rehearsals; Channel::ALL.len()],
    /// Longest time that the laser's trigger is high within any window of the asked length.
    pub laser_in_window: u64,
    /// The bounds on which it rests: pass, interrupt, lead.
    pub assumed: Limits,
}

/// What a rehearsal has shown of one channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rehearsals {
    /// Edges made.
    pub edges: u64,
    /// The edge with the least time left.
    pub least: Option<Least>,
    /// Time high.
    pub high: u64,
    /// Longest time high without a break.
    pub longest_high: u64,
    /// Shortest time between two edges.
    pub shortest: Option<u64>,
    last: Option<Edge>,
}

/// The edge that has the least time left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Least {
    /// What is left in the worst case.
    pub slack: u64,
    /// The edge.
    pub edge: Edge,
    /// Its number among the channel's edges, from 0.
    pub number: u64,
}

impl Rehearsals {
    fn take(&mut self, Rehearsed { edge, slack }: Rehearsed) {
        if self.least.is_none_or(|least| slack < least.slack) {
            self.least = Some(Least { slack, edge, number: self.edges });
        }
        if let Some(last) = self.last.replace(edge) {
            let length = edge.tick.saturating_sub(last.tick);
            self.shortest = Some(self.shortest.map_or(length, |shortest| shortest.min(length)));
            if last.high {
                self.high += length;
                self.longest_high = self.longest_high.max(length);
            }
        }
        self.edges += 1;
    }
}

/// Rehearse a compiled plan as on `board`; `window` (ticks) is what the laser's duty is taken over.
///
/// # Errors
/// When an edge would be late in the worst case, or the bytes do not make the plan's edges.
pub fn certify(compiled: &Compiled, window: u64, board: &Limits) -> Result<Certificate> {
    let mut channels = [Rehearsals::default(); Channel::ALL.len()];
    let mut duty = Window { length: window, ..Window::default() };
    let outcome = rehearse(board, compiled, |rehearsed| {
        channels[rehearsed.edge.channel.index()].take(rehearsed);
        if rehearsed.edge.channel == Channel::Laser {
            duty.take(rehearsed.edge);
        }
    });
    let certificate =
        Certificate { channels, laser_in_window: duty.most, assumed: rehearsed(board) };
    outcome.map_err(|fault| certificate.refusal(fault))?;
    certificate.agrees(compiled)?;
    Ok(certificate)
}

impl Certificate {
    /// Edges rehearsed, of all channels.
    #[must_use]
    pub fn edges(&self) -> u64 {
        self.channels.iter().map(|channel| channel.edges).sum()
    }

    /// What was seen of a channel.
    #[must_use]
    pub fn of(&self, channel: Channel) -> &Rehearsals {
        &self.channels[channel.index()]
    }

    /// Whether a board may take longer for nothing that the certificate rests on.
    #[must_use]
    pub fn covers(&self, board: &Limits) -> bool {
        let assumed = &self.assumed;
        board.ticks_per_second == assumed.ticks_per_second
            && board.pass <= assumed.pass
            && board.interrupt <= assumed.interrupt
            && board.lead <= assumed.lead
            && board.reach >= assumed.reach
    }

    /// Why the rehearsal ended before the run did.
    fn refusal(&self, fault: Fault) -> Error {
        if fault != Fault::Late {
            return Error::failed(format!(
                "the rehearsal of the compiled plan ends with {fault:?}"
            ));
        }
        let last = self.channels.iter().filter_map(|channel| channel.last).map(|edge| edge.tick);
        let per_second = self.assumed.ticks_per_second;
        Error::failed(format!(
            "too dense for the board: after {} edges, about {} after the start, an edge would be late \
             when passes of the main loop take as long as they may, {} us",
            self.edges(),
            rounded(seconds(last.max().unwrap_or(0), per_second)),
            microseconds(self.assumed.pass.into(), per_second)
        ))
    }

    /// What the sequencer made is what the loops of the plan add up to.
    fn agrees(&self, compiled: &Compiled) -> Result<()> {
        let plan = compiled.plan().ok_or_else(|| self.refusal(Fault::PlanMemory))?;
        let sweeps = 2 * plan.total_sweeps();
        let camera = plan.total_sweeps() * u64::from(plan.camera.width);
        let light = plan.stimulus.filter(|stimulus| !stimulus.sham);
        let light = light.map_or(0, |light| 2 * u64::from(light.pulses) * u64::from(plan.repeats));
        let expected = [(sweeps, plan.laser_on()), (sweeps, camera), (light, plan.stimulus_on())];
        let made = self.channels.map(|channel| (channel.edges, channel.high));
        if made == expected {
            return Ok(());
        }
        Err(Error::failed(format!(
            "the compiled plan does not make the plan's edges (number, ticks high): {made:?} instead \
             of {expected:?}"
        )))
    }
}

/// The longest time high within a window that slides over the pulses.
///
/// The most is always reached by a window that ends with a pulse.
#[derive(Debug, Default)]
struct Window {
    length: u64,
    rise: u64,
    pulses: VecDeque<(u64, u64)>,
    sum: u64,
    most: u64,
}

impl Window {
    fn take(&mut self, edge: Edge) {
        if edge.high {
            self.rise = edge.tick;
            return;
        }
        self.pulses.push_back((self.rise, edge.tick));
        self.sum += edge.tick - self.rise;
        let begin = edge.tick.saturating_sub(self.length);
        while let Some(&(rise, fall)) = self.pulses.front().filter(|(_, fall)| *fall <= begin) {
            self.sum -= fall - rise;
            let _ = self.pulses.pop_front();
        }
        let outside = self.pulses.front().map_or(0, |(rise, _)| begin.saturating_sub(*rise));
        self.most = self.most.max(self.sum - outside);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trigger::plan_file::load;

    fn certificate(plan: &str, settings: &[&str]) -> Certificate {
        let settings: Vec<String> = settings.iter().map(|&text| text.to_owned()).collect();
        let plan = load(plan, &settings, &Limits::UNO).unwrap().plan;
        certify(&Compiled::new(&plan).unwrap(), 16_000_000, &Limits::UNO).unwrap()
    }

    #[test]
    fn the_papers_edges() {
        let certificate = certificate("paper", &[]);
        assert_eq!(certificate.channels.map(|channel| channel.edges), [140, 140, 2]);
        let laser = certificate.of(Channel::Laser);
        assert_eq!((laser.high, laser.longest_high), (70 * 136_533, 136_533));
        assert_eq!(certificate.of(Channel::Camera).shortest, Some(1600));
        // Four pulses and what is left of 1 s after 4 x 225 ms.
        assert_eq!(certificate.laser_in_window, 5 * 136_533);
        assert!(certificate.covers(&Limits::UNO));
        assert!(!certificate.covers(&Limits { pass: Limits::UNO.pass + 1, ..Limits::UNO }));
    }

    #[test]
    fn the_least_slack_is_the_least_of_all_edges() {
        let plan = load("triples", &[], &Limits::UNO).unwrap().plan;
        let compiled = Compiled::new(&plan).unwrap();
        let mut slacks = Vec::new();
        rehearse(&Limits::UNO, &compiled, |edge| slacks.push(edge.slack)).unwrap();
        let certificate = certify(&compiled, 1, &Limits::UNO).unwrap();
        let least = certificate.channels.iter().filter_map(|c| c.least).map(|least| least.slack);
        assert_eq!(least.min(), slacks.iter().copied().min());
        assert_eq!(certificate.edges(), slacks.len() as u64);
        assert_eq!(certificate.laser_in_window, 1);
    }

    #[test]
    fn the_shortest_pulse_that_is_allowed_can_be_made() {
        let certificate = certificate("paper", &["camera.pulse=50us", "laser.pulse=50us"]);
        let least = certificate.of(Channel::Camera).least.unwrap();
        // 800 ticks less the interrupt's 480 and the lead of 160.
        assert_eq!((least.slack, least.edge.high), (160, false));
    }

    #[test]
    fn a_plan_that_is_too_dense_is_refused_with_figures() {
        let settings = ["stimulus.flicker.period=120us", "stimulus.flicker.on=60us"];
        let plan = load("paper", &settings.map(str::to_owned), &Limits::UNO).unwrap().plan;
        let message =
            certify(&Compiled::new(&plan).unwrap(), 1, &Limits::UNO).unwrap_err().to_string();
        assert!(message.contains("1.12") && message.contains("1250 us"), "{message}");
    }

    #[test]
    fn a_window_counts_parts_of_pulses() {
        let mut window = Window { length: 100, ..Window::default() };
        for (rise, fall) in [(0, 10), (50, 60), (95, 105), (300, 301)] {
            window.take(Edge::rise(Channel::Laser, rise));
            window.take(Edge::fall(Channel::Laser, fall));
        }
        assert_eq!(window.most, 25);
    }
}
