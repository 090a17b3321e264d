//! The edges of the rehearsed plan.

use crate::error::{Error, Result};
use crate::trigger::check::Checked;
use crate::trigger::plan_file::Loaded;
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::plan::Plan;
use phasewalk_firmware::rehearsal::rehearse;

/// What a compiled plan makes, edge by edge, in ticks after the start of the run.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Name of the plan.
    pub name: String,
    /// Hash of the compiled plan.
    pub hash: u32,
    /// The plan.
    pub plan: Plan,
    /// Ticks of the board's clock per second.
    pub ticks_per_second: u32,
    /// All edges in the order of time.
    pub edges: Vec<Edge>,
    pulses: [Vec<(u64, u64)>; Channel::ALL.len()],
}

impl Trace {
    /// Rehearse a checked plan.
    ///
    /// # Errors
    /// When the rehearsal ends with a fault.
    pub fn new(loaded: &Loaded, checked: &Checked, board: &Limits) -> Result<Self> {
        let mut edges = Vec::new();
        let mut pulses = [const { Vec::new() }; Channel::ALL.len()];
        let mut rise = [0; Channel::ALL.len()];
        rehearse(board, &checked.compiled, |rehearsed| {
            let edge = rehearsed.edge;
            let channel = edge.channel.index();
            edges.push(edge);
            if edge.high {
                rise[channel] = edge.tick;
            } else {
                pulses[channel].push((rise[channel], edge.tick));
            }
        })
        .map_err(|fault| Error::failed(format!("{}: {fault:?}", loaded.source)))?;
        edges.sort_by_key(|edge| (edge.tick, edge.channel, edge.high));
        Ok(Self {
            name: loaded.name.clone(),
            hash: checked.compiled.hash(),
            plan: checked.plan,
            ticks_per_second: board.ticks_per_second,
            edges,
            pulses,
        })
    }

    /// The tick of the last edge.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.edges.last().map_or(0, |edge| edge.tick)
    }

    /// Rise and fall of all pulses of a channel, in the order of time.
    #[must_use]
    pub fn pulses(&self, channel: Channel) -> &[(u64, u64)] {
        &self.pulses[channel.index()]
    }

    /// The pulses of a channel that reach into a span of time.
    #[must_use]
    pub fn pulses_within(&self, channel: Channel, from: i64, to: i64) -> &[(u64, u64)] {
        let pulses = self.pulses(channel);
        let signed = |tick: u64| i64::try_from(tick).unwrap_or(i64::MAX);
        let first = pulses.partition_point(|&(_, fall)| signed(fall) <= from);
        let last = pulses.partition_point(|&(rise, _)| signed(rise) < to);
        pulses.get(first..last).unwrap_or_default()
    }

    /// The two edges of one channel that follow each other most closely.
    #[must_use]
    pub fn closest(&self) -> Option<(Edge, Edge)> {
        let mut last: [Option<Edge>; Channel::ALL.len()] = [None; Channel::ALL.len()];
        let mut closest: Option<(Edge, Edge)> = None;
        for &edge in &self.edges {
            let Some(before) = last[edge.channel.index()].replace(edge) else { continue };
            let length = edge.tick - before.tick;
            if closest.is_none_or(|(a, b)| length < b.tick - a.tick) {
                closest = Some((before, edge));
            }
        }
        closest
    }
}
