//! How regular a run was: intervals, camera against laser, and what the camera needed.

use super::RunLog;
use crate::trigger::expected::Expected;
use phasewalk_firmware::channel::{Channel, Edge};
use serde::Serialize;
use std::collections::BTreeMap;

/// Times of one kind, in ticks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// How many.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// The least.
    pub min: i64,
    /// The most.
    pub max: i64,
}

impl Spread {
    /// Of some times; `None` if there are none.
    #[must_use]
    pub fn of(times: &[i64]) -> Option<Self> {
        let (min, max) = (*times.iter().min()?, *times.iter().max()?);
        let mean = times.iter().map(|&time| time as f64).sum::<f64>() / times.len() as f64;
        Some(Self { count: times.len(), mean, min, max })
    }

    /// From peak to peak.
    #[must_use]
    pub fn peak_to_peak(&self) -> i64 {
        self.max.saturating_sub(self.min)
    }
}

/// Intervals between volumes for which the plan has the same time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The plan's, in ticks.
    pub planned: u64,
    /// The run's.
    pub made: Spread,
}

/// How regular a run was. Times in ticks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistics {
    /// From the laser's trigger to that of the next volume.
    pub intervals: Vec<Interval>,
    /// From the laser's to the camera's trigger.
    pub camera_minus_laser: Option<Spread>,
    /// From the camera's trigger to its first EXPOSE edge.
    pub exposure_delay: Option<Spread>,
}

impl Statistics {
    /// Those of a run.
    #[must_use]
    pub fn of(log: &RunLog) -> Self {
        let expected = Expected::of(&log.header.plan);
        let laser = rises(log, &expected, Channel::Laser);
        let camera = rises(log, &expected, Channel::Camera);
        let exposed = log.exposures.iter().filter_map(|(tick, volume)| Some(((*volume)?, *tick)));
        Self {
            intervals: intervals(&laser, &expected),
            camera_minus_laser: differences(camera.iter().map(|(v, t)| (*v, *t)), &laser),
            exposure_delay: differences(exposed, &camera),
        }
    }
}

/// Ticks by volume, so that a lost event costs one interval only.
fn rises(log: &RunLog, expected: &Expected, channel: Channel) -> BTreeMap<u32, u64> {
    let start = log.start.unwrap_or(0);
    let edges = log.ticks(channel, true).into_iter();
    let volume = |tick: u64| expected.volume(Edge::rise(channel, tick), start);
    edges.filter_map(|tick| Some((volume(tick)?, tick))).collect()
}

fn intervals(laser: &BTreeMap<u32, u64>, expected: &Expected) -> Vec<Interval> {
    let edges = expected.channel(Channel::Laser).iter().filter(|edge| edge.high);
    let planned: Vec<u64> = edges.map(|edge| edge.tick).collect();
    let mut groups: BTreeMap<u64, Vec<i64>> = BTreeMap::new();
    for (volume, tick) in laser {
        let Some(next) = laser.get(&(volume + 1)) else { continue };
        let at = |volume: u32| planned.get(volume as usize).copied();
        let (Some(from), Some(to)) = (at(*volume), at(volume + 1)) else { continue };
        groups.entry(to - from).or_default().push(difference(*next, *tick));
    }
    let interval =
        |(planned, made): (u64, Vec<i64>)| Some(Interval { planned, made: Spread::of(&made)? });
    groups.into_iter().filter_map(interval).collect()
}

fn differences(
    later: impl Iterator<Item = (u32, u64)>,
    earlier: &BTreeMap<u32, u64>,
) -> Option<Spread> {
    let pairs = later.filter_map(|(volume, tick)| Some(difference(tick, *earlier.get(&volume)?)));
    Spread::of(&pairs.collect::<Vec<_>>())
}

/// Ticks stay below 2^56.
fn difference(later: u64, earlier: u64) -> i64 {
    later.wrapping_sub(earlier).cast_signed()
}
