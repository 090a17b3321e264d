//! The parts of a run that are worth a closer look.

use super::Trace;
use crate::trigger::summary::channel_name;
use phasewalk_firmware::channel::Edge;

/// A burst and the one before are shown together while a burst is not too thin to be seen then.
const THINNEST: u64 = 60;

/// A span of time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Window {
    /// What is seen.
    pub title: String,
    /// Its first tick after the start of the run.
    pub from: i64,
    /// Its last.
    pub to: i64,
    /// The tick from which its axis counts.
    pub zero: i64,
    /// What happens there.
    pub zero_name: &'static str,
}

/// The first burst.
#[must_use]
pub fn first_burst(trace: &Trace) -> Window {
    let length = signed(trace.plan.burst_length());
    let title = if trace.plan.sweeps > 1 { "first burst" } else { "first sweep" };
    Window {
        title: title.to_owned(),
        from: -length / 12,
        to: length + length / 6,
        zero: 0,
        zero_name: "after the start of the run",
    }
}

/// The burst with which the stimulus comes on, and the one before where both can be seen.
#[must_use]
pub fn stimulus(trace: &Trace) -> Option<Window> {
    let plan = &trace.plan;
    let stimulus = plan.stimulus.filter(|stimulus| !stimulus.sham)?;
    let burst = signed(plan.burst_offset(stimulus.burst));
    let light = signed(plan.stimulus_start(&stimulus));
    let length = signed(plan.burst_length());
    let with_the_one_before =
        stimulus.burst > 0 && plan.interval <= plan.burst_length().saturating_mul(THINNEST);
    let from = if with_the_one_before { burst - signed(plan.interval) } else { burst };
    let shown = signed(stimulus.on).min(length);
    let to = (burst + length).max(light + shown);
    let pad = (to - from) / 16;
    let volume = u32::from(stimulus.burst) * u32::from(plan.sweeps) + u32::from(stimulus.sweep);
    Some(Window {
        title: format!("the stimulus comes on with volume {volume} (counted from 0)"),
        from: from - pad,
        to: to + pad,
        zero: burst,
        zero_name: "after the start of its burst",
    })
}

/// The two edges of one channel that are closest together.
#[must_use]
pub fn closest(trace: &Trace) -> Option<(Window, Edge, Edge)> {
    let (first, second) = trace.closest()?;
    let (from, to) = (signed(first.tick), signed(second.tick));
    let pad = (to - from) * 3 / 2;
    let state = if first.high { "high" } else { "low" };
    let channel = channel_name(first.channel);
    let window = Window {
        title: format!("shortest time between two edges of an output: {channel} {state}"),
        from: from - pad,
        to: to + pad,
        zero: from,
        zero_name: "after the first of the two edges",
    };
    Some((window, first, second))
}

/// Ticks that may be counted backwards from.
pub fn signed(tick: u64) -> i64 {
    i64::try_from(tick).unwrap_or(i64::MAX)
}
