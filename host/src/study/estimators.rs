//! The estimators that are compared.

use super::peers::Peer;
use super::sample::Sample;
use super::scenario::Scenario;
use super::tracked::track;
use crate::curve::{link, phases_of_means};
use crate::error::Result;
use crate::method::{Depths, Method, Plan};
use phasewalk_core::weights::Weighting;

/// Frames whose mean is the reference: the first alone, so that the end phase is phi_{N-1} - phi_0.
const REFERENCE_FRAMES: usize = 1;

/// An estimator of a series' phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimator {
    /// A method of `phasewalk phase`.
    Own(Method),
    /// Linked frame by frame, in fixed memory.
    Tracker,
    /// What others do with the same averages; it has no standard deviation.
    Peer(Peer),
}

impl Estimator {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Own(Method::OneStep),
        Self::Own(Method::Paper(Weighting::Paper)),
        Self::Own(Method::Paper(Weighting::Fisher)),
        Self::Own(Method::Linked),
        Self::Tracker,
        Self::Peer(Peer::Evd),
        Self::Peer(Peer::Emi),
        Self::Peer(Peer::TaperedEmi),
        Self::Peer(Peer::Cofi),
    ];

    /// What it is called in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Own(Method::Direct) => "direct",
            Self::Own(Method::OneStep) => "one-step",
            Self::Own(Method::Paper(Weighting::Fisher)) => "paper, fisher weights",
            Self::Own(Method::Paper(Weighting::Paper)) => "paper",
            Self::Own(Method::Linked) => "linked",
            Self::Tracker => "tracker",
            Self::Peer(Peer::Evd) => "EVD",
            Self::Peer(Peer::Emi) => "EMI",
            Self::Peer(Peer::TaperedEmi) => "EMI, tapered",
            Self::Peer(Peer::Cofi) => "COFI, banded",
        }
    }

    /// Phases against the first frame and standard deviations of one series; NaN where the estimator tells none.
    pub(super) fn estimate(
        self,
        scenario: &Scenario,
        sample: &Sample,
        looks: f64,
    ) -> Result<(Vec<f64>, Vec<f64>)> {
        match self {
            Self::Own(method) => own(&plan(&scenario.times, method)?, sample, looks),
            Self::Tracker => track(&sample.cross(), &scenario.times, looks),
            Self::Peer(peer) => {
                let phases = peer.phases(&sample.cross(), &scenario.times);
                let unknown = vec![f64::NAN; phases.len()];
                Ok((phases, unknown))
            }
        }
    }
}

/// `method` for frames at these times.
pub(super) fn plan(times: &[f64], method: Method) -> Result<Plan> {
    let mut plan = Plan::new(method, times.len(), None, None, Depths::single())?;
    plan.params.reference_frames = REFERENCE_FRAMES;
    plan.times_s = times.to_vec();
    Ok(plan)
}

fn own(plan: &Plan, sample: &Sample, looks: f64) -> Result<(Vec<f64>, Vec<f64>)> {
    if plan.method == Method::Linked {
        let rows = link(&mut sample.cross(), plan, looks)?.rows;
        return Ok(rows.iter().map(|row| (row.phase_rad, row.sigma_rad)).unzip());
    }
    let pairs = plan.pairs();
    let means: Vec<_> = pairs.iter().map(|&(t, s)| sample.pair_mean(t, s)).collect();
    Ok(phases_of_means(plan, &pairs, &means, looks, looks))
}
