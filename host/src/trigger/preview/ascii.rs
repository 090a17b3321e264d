//! An overview for the terminal.

use super::Trace;
use super::windows::{Window, first_burst};
use crate::trigger::summary::channel_name;
use crate::trigger::units::{exact, rounded};
use phasewalk_firmware::channel::Channel;
use std::fmt::Write;

/// Columns of the lanes.
const COLUMNS: i64 = 68;

/// The whole run and its first burst, one line per output: `_` low, `#` high, `|` where it changes
/// within a column.
#[must_use]
pub fn ascii(trace: &Trace) -> String {
    let end = i64::try_from(trace.end()).unwrap_or(i64::MAX);
    let whole = Window { title: "whole run".to_owned(), from: 0, to: end, zero: 0, zero_name: "" };
    let mut text =
        format!("{}, hash {:08x}: {} edges\n", trace.name, trace.hash, trace.edges.len());
    for window in [whole, first_burst(trace)] {
        let _ = writeln!(text, "\n{}", window.title);
        for channel in Channel::ALL {
            let lane = lane(trace, channel, &window);
            let _ = writeln!(text, "  {:<8} {lane}", channel_name(channel));
        }
        let time = |tick: i64| rounded(tick as f64 / f64::from(trace.ticks_per_second));
        let (from, to) = (time(window.from), time(window.to));
        let width = COLUMNS as usize - from.len();
        let _ = writeln!(text, "  {:<8} {from}{to:>width$}", "");
    }
    if trace.plan.frame > 0 {
        let frame = exact(trace.plan.frame.into(), trace.ticks_per_second);
        let _ = writeln!(text, "\nframe clock: one pulse every {frame} while the camera is high");
    }
    text.push_str(
        "\n_ low, # high, | changes; -o NAME.svg draws it to scale, .vcd and .json for viewers",
    );
    text
}

fn lane(trace: &Trace, channel: Channel, window: &Window) -> String {
    let span = i128::from(window.to - window.from).max(1);
    let edge = |column: i64| {
        let offset = span * i128::from(column) / i128::from(COLUMNS);
        window.from + i64::try_from(offset).unwrap_or(i64::MAX)
    };
    (0..COLUMNS).map(|column| sign(trace, channel, edge(column), edge(column + 1))).collect()
}

fn sign(trace: &Trace, channel: Channel, from: i64, to: i64) -> char {
    let signed = |tick: u64| i64::try_from(tick).unwrap_or(i64::MAX);
    match trace.pulses_within(channel, from, to) {
        [] => '_',
        [(rise, fall)] if signed(*rise) <= from && signed(*fall) >= to => '#',
        _ => '|',
    }
}
