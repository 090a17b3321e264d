//! The board measures its own edges: the laser's output at the capture input, by a jumper.
//!
//! ```text
//! camera  ──┐▔▔▔▔└──────────────────    opens the capture
//! laser   ──────┐▔▔▔▔▔▔▔▔▔▔▔▔▔└─────    D9 ─jumper─ D8: its rise is captured
//!               └ made     └ captured, a few ticks of the input's synchroniser later
//! ```
//!
//! The edge is stamped by the output's compare register when it is made and by the input's capture
//! register when it is seen: two pieces of hardware that share only the counter. Their difference
//! must be the same for every sweep.

use super::log::RunLog;
use super::log::statistics::Spread;
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::plan::{Caps, Inputs, Interlock, Plan, Pulse, Start};
use serde::Serialize;
use std::collections::BTreeMap;

/// The input's synchroniser takes this many ticks at most, with its noise filter.
const LONGEST_DELAY: i64 = 8;

/// The plan of the test: `sweeps` sweeps, 25 ms apart (so that all edges can be told), the laser 100 µs after the
/// camera.
#[must_use]
pub fn plan(sweeps: u16, ticks_per_second: u32) -> Plan {
    let microsecond = ticks_per_second / 1_000_000;
    let laser = Pulse { delay: 100 * microsecond, width: 1_000 * microsecond };
    Plan {
        inputs: Inputs { interlock: Interlock::Off, ready: false, start: Start::Command },
        repeats: 1,
        repeat_period: 0,
        bursts: sweeps,
        interval: u64::from(25_000 * microsecond),
        sweeps: 1,
        spacing: [0; 2],
        laser,
        camera: Pulse { delay: 0, width: 300 * microsecond },
        frame: 0,
        phase_limit: None,
        stimulus: None,
        caps: Caps {
            laser_pulse: 2 * laser.width,
            laser_total: u64::from(laser.width) * (u64::from(sweeps) + 2),
            stimulus_pulse: 0,
            stimulus_total: 0,
            images_per_sweep: 0,
            camera_images: 0,
            heartbeat: 2 * ticks_per_second,
        },
    }
}

/// What the test has found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// Edges made.
    pub made: usize,
    /// Edges captured.
    pub captured: usize,
    /// Captured minus made: ticks and how often.
    pub histogram: BTreeMap<i64, usize>,
    /// Peak to peak, in ticks; none if nothing was captured.
    pub peak_to_peak: Option<i64>,
    /// What is wrong; none if all is as it should be.
    pub defect: Option<String>,
}

impl Verdict {
    /// Of a run of [`plan`].
    #[must_use]
    pub fn of(log: &RunLog) -> Self {
        let made = log.ticks(Channel::Laser, true);
        let volume = |volume: u32| made.get(volume as usize).copied();
        let captured = log.exposures.iter();
        let delays: Vec<i64> = captured
            .filter_map(|(tick, number)| Some(tick.wrapping_sub(volume((*number)?)?).cast_signed()))
            .collect();
        let mut histogram = BTreeMap::new();
        for delay in &delays {
            *histogram.entry(*delay).or_default() += 1;
        }
        let spread = Spread::of(&delays);
        Self {
            made: made.len(),
            captured: delays.len(),
            histogram,
            peak_to_peak: spread.map(|spread| spread.peak_to_peak()),
            defect: defect(made.len(), spread.as_ref()),
        }
    }
}

fn defect(made: usize, spread: Option<&Spread>) -> Option<String> {
    let Some(spread) = spread else {
        return Some("no edge was captured: is the jumper there?".to_owned());
    };
    if spread.count != made {
        let count = spread.count;
        return Some(format!("{count} of {made} edges were captured: check the jumper"));
    }
    if spread.min < 0 || spread.max > LONGEST_DELAY {
        return Some(format!(
            "captured {} to {} ticks after the edge, expected 0 to {LONGEST_DELAY}: something \
             else drives the input",
            spread.min, spread.max
        ));
    }
    let jitter = spread.peak_to_peak();
    (jitter > 0).then(|| format!("the edges jitter by {jitter} ticks, expected none"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasewalk_firmware::check::check;
    use phasewalk_firmware::compiled::Compiled;
    use phasewalk_firmware::limits::Limits;
    use phasewalk_firmware::rehearsal::rehearse;

    #[test]
    fn its_plan_is_allowed_and_can_be_made_in_time() {
        for sweeps in [1, 200, 1000] {
            let plan = plan(sweeps, Limits::UNO.ticks_per_second);
            assert_eq!(check(&plan, &Limits::UNO), Ok(()));
            assert_eq!(rehearse(&Limits::UNO, &Compiled::new(&plan).unwrap(), |_| ()), Ok(()));
        }
    }

    #[test]
    fn defects_are_named() {
        let spread = |times: &[i64]| Spread::of(times);
        assert_eq!(defect(3, spread(&[3, 3, 3]).as_ref()), None);
        for (times, words) in [
            (&[][..], "jumper"),
            (&[3, 3][..], "2 of 3"),
            (&[3, 4, 3][..], "jitter by 1 ticks"),
            (&[3, 900, 3][..], "something else"),
        ] {
            let found = defect(3, spread(times).as_ref()).unwrap();
            assert!(found.contains(words), "{found}");
        }
    }
}
