//! The edges of a run as a table.

use super::RunLog;
use crate::trigger::clock::Fit;
use crate::trigger::expected::Expected;
use crate::trigger::summary::channel_name;
use std::fmt::Write;

/// `channel,level,volume,tick,time_s,fitted_s`, one line per edge in the order of time; `exposed`
/// is a channel, too. Times in seconds after the run's time zero, by the nominal and by the fitted
/// clock; the latter is empty where it is not known well enough.
#[must_use]
pub fn csv(log: &RunLog) -> String {
    let start = log.start.unwrap_or(0);
    let nominal = f64::from(log.header.ticks_per_second);
    let fitted = log.fit().filter(Fit::is_useful);
    let mut table = String::from("channel,level,volume,tick,time_s,fitted_s\n");
    for (tick, channel, level, volume) in rows(log, start) {
        let since = tick.wrapping_sub(start).cast_signed() as f64;
        let volume = volume.map_or(String::new(), |volume| volume.to_string());
        let fitted =
            fitted.map_or(String::new(), |fit| format!("{:.9}", since / fit.ticks_per_second));
        let time = since / nominal;
        // Writing to a string does not fail.
        let _ = writeln!(table, "{channel},{level},{volume},{tick},{time:.9},{fitted}");
    }
    table
}

type Row = (u64, &'static str, u8, Option<u32>);

fn rows(log: &RunLog, start: u64) -> Vec<Row> {
    let expected = Expected::of(&log.header.plan);
    let edges = log.edges.iter().map(|edge| {
        let volume = expected.volume(*edge, start);
        (edge.tick, channel_name(edge.channel), u8::from(edge.high), volume)
    });
    let exposures = log.exposures.iter().map(|(tick, volume)| (*tick, "exposed", 1, *volume));
    let mut rows: Vec<Row> = edges.chain(exposures).collect();
    rows.sort_by_key(|row| row.0);
    rows
}
