//! Sweep after sweep: each is compared with the last members, and joins them if it matches as they do.

use super::feature::Feature;
use super::motion::Motion;
use super::pair::PairMotion;
use super::{MATCHED, Registration};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Sweeps that a new one is compared with.
pub const NEIGHBOURS: usize = 6;
/// Share of the usual quality of a match below which a sweep is taken for smeared.
const LEAST_SHARE: f64 = 0.3;

/// What is known of the sweeps so far.
#[derive(Clone, Default, Serialize, Deserialize)]
pub struct Matches {
    /// Motions between sweeps: (earlier, later, motion).
    pub pairs: Vec<(usize, usize, PairMotion)>,
    /// Best quality of each sweep's pairs; 0 for one that was not compared.
    pub quality: Vec<f64>,
    /// Motion against the first member, for the members so far.
    pub members: Vec<(usize, Motion)>,
}

/// What a sweep became.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// It does not show the retina, or shows it smeared.
    Apart,
    /// The first member; what came before was no picture of the retina.
    First,
    /// A member that has moved.
    Member(Motion),
}

/// Compares, with the features of the last members.
pub struct Sequence {
    registration: Registration,
    features: VecDeque<(usize, Feature)>,
}

impl Sequence {
    /// Without features.
    #[must_use]
    pub fn new(registration: Registration) -> Self {
        Self { registration, features: VecDeque::new() }
    }

    /// Give the next sweep its place; `amplitude` is its |U| (z, y, x).
    pub fn push(&mut self, amplitude: &[f32], matches: &mut Matches) -> Place {
        let sweep = matches.quality.len();
        let feature = self.registration.feature(amplitude);
        let found = self.compare(&feature, matches);
        let best = found.iter().map(|(_, pair)| pair.quality).fold(0.0, f64::max);
        let matched = best >= matches.enough();
        matches.quality.push(best);
        if !matched && matches.members.len() > 1 {
            return Place::Apart;
        }
        let place = match matched {
            true => Place::Member(matches.join(sweep, found)),
            false => {
                self.features.clear();
                matches.members = vec![(sweep, Motion::default())];
                Place::First
            }
        };
        self.remember(sweep, feature);
        place
    }

    /// Bring back the feature of a member that the next sweep is compared with, oldest first.
    pub fn hold(&mut self, sweep: usize, amplitude: &[f32]) {
        self.remember(sweep, self.registration.feature(amplitude));
    }

    fn remember(&mut self, sweep: usize, feature: Feature) {
        self.features.push_back((sweep, feature));
        if self.features.len() > NEIGHBOURS {
            self.features.pop_front();
        }
    }

    /// Motion against each of the last members, the latest first. Once one has matched, the motions
    /// against the others are known nearly; where that leads nowhere, all shifts are searched.
    fn compare(&self, feature: &Feature, matches: &Matches) -> Vec<(usize, PairMotion)> {
        let enough = matches.enough();
        let any = |other: &Feature| self.registration.pair(other, feature, None);
        let mut others = self.features.iter().rev();
        let mut found = Vec::new();
        let mut guess = None;
        for (earlier, other) in others.by_ref() {
            let Some(known) = matches.motion_of(*earlier) else { continue };
            let pair = any(other);
            found.push((*earlier, pair));
            if pair.quality >= enough {
                guess = Some(known.then(pair.motion));
                break;
            }
        }
        let Some(whole) = guess else { return found };
        let near = |(earlier, other): &(usize, Feature)| {
            let near = matches.motion_of(*earlier)?.to(whole);
            let pair = self.registration.pair(other, feature, Some(near));
            let lost = pair.quality < MATCHED;
            Some((*earlier, if lost { any(other) } else { pair }))
        };
        let others: Vec<&(usize, Feature)> = others.collect();
        found.extend(others.into_par_iter().filter_map(near).collect::<Vec<_>>());
        found
    }
}

impl Matches {
    /// A sweep that is not compared, for a fault.
    pub fn skip(&mut self) {
        self.quality.push(0.0);
    }

    /// The members that the next sweep is compared with, oldest first.
    #[must_use]
    pub fn last_members(&self) -> Vec<usize> {
        let first = self.members.len().saturating_sub(NEIGHBOURS);
        self.members[first..].iter().map(|member| member.0).collect()
    }

    /// Quality of a match: above chance, and not far below what is usual here. A sweep that is
    /// smeared by a saccade matches a little.
    fn enough(&self) -> f64 {
        let of = |&(sweep, _): &(usize, Motion)| self.quality[sweep];
        let mut usual: Vec<f64> = self.members.iter().skip(1).map(of).collect();
        usual.sort_by(f64::total_cmp);
        usual.get(usual.len() / 2).map_or(MATCHED, |usual| MATCHED.max(LEAST_SHARE * usual))
    }

    fn motion_of(&self, sweep: usize) -> Option<Motion> {
        self.members.iter().find(|(member, _)| *member == sweep).map(|(_, motion)| *motion)
    }

    /// A new member with its motions against earlier ones; its own is their mean.
    fn join(&mut self, sweep: usize, found: Vec<(usize, PairMotion)>) -> Motion {
        let matched = found.into_iter().filter(|(_, pair)| pair.quality >= MATCHED);
        let matched: Vec<(usize, PairMotion)> = matched.collect();
        let whole = |(earlier, pair): &(usize, PairMotion)| {
            Some((self.motion_of(*earlier)?.then(pair.motion), pair.quality))
        };
        let motion = average(&matched.iter().filter_map(whole).collect::<Vec<_>>());
        self.pairs.extend(matched.into_iter().map(|(earlier, pair)| (earlier, sweep, pair)));
        self.members.push((sweep, motion));
        motion
    }
}

/// Mean of motions that say the same, weighted by their quality squared.
fn average(motions: &[(Motion, f64)]) -> Motion {
    let total: f64 = motions.iter().map(|(_, quality)| quality * quality).sum();
    let mut mean = Motion::default();
    for (motion, quality) in motions {
        let share = quality * quality / total;
        mean.rotation_rad += share * motion.rotation_rad;
        mean.shift.iter_mut().zip(motion.shift).for_each(|(mean, shift)| *mean += share * shift);
    }
    mean
}
