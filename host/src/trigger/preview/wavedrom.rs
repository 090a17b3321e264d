//! WaveJSON, as the WaveDrom editor and its renderers read it: the first bursts, time compressed.

use super::Trace;
use crate::trigger::summary::channel_name;
use crate::trigger::units::exact;
use phasewalk_firmware::channel::{Channel, Edge};
use serde_json::json;

/// Instants that are drawn at most: more do not fit a page.
const INSTANTS: usize = 24;

/// The first bursts as WaveJSON. Each instant at which an output changes is one column; a gap sign
/// stands where more than a burst's length passes.
#[must_use]
pub fn wavedrom(trace: &Trace) -> String {
    let instants: Vec<&[Edge]> =
        trace.edges.chunk_by(|a, b| a.tick == b.tick).take(INSTANTS).collect();
    let mut waves = [const { String::new() }; Channel::ALL.len()];
    waves.iter_mut().for_each(|wave| wave.push('0'));
    let mut times = String::from("x");
    let mut data = Vec::new();
    let mut last = None;
    for edges in &instants {
        let tick = edges.first().map_or(0, |edge| edge.tick);
        if last.is_some_and(|last| tick - last > trace.plan.burst_length()) {
            waves.iter_mut().for_each(|wave| wave.push('|'));
            times.push('|');
        }
        last = Some(tick);
        for (channel, wave) in Channel::ALL.into_iter().zip(&mut waves) {
            let edge = edges.iter().rfind(|edge| edge.channel == channel);
            wave.push(edge.map_or('.', |edge| if edge.high { '1' } else { '0' }));
        }
        times.push('=');
        data.push(exact(tick, trace.ticks_per_second));
    }
    let lanes = Channel::ALL.iter().zip(&waves);
    let mut signal: Vec<_> = lanes
        .map(|(&channel, wave)| json!({ "name": channel_name(channel), "wave": wave }))
        .collect();
    signal.push(json!({ "name": "time", "wave": times, "data": data }));
    let shown = instants.iter().map(|edges| edges.len()).sum::<usize>();
    let picture = json!({
        "signal": signal,
        "config": { "hscale": 2 },
        "head": { "text": format!("{}, hash {:08x}", trace.name, trace.hash) },
        "foot": { "text": format!(
            "Not to scale: one column per instant at which an output changes, a gap where more than \
             the length of a burst passes. The first {shown} of {} edges.", trace.edges.len()) },
    });
    format!("{picture:#}\n")
}
