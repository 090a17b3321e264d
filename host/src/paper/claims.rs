//! What the paper says, and what comes out here.
//!
//! A claim is a sentence of the paper, a number that would have to be small or large if it is true,
//! and a limit. The limits are ours; they are chosen from what the sentence says, and shown with the
//! number. A claim on the paper's method is judged by the paper's method; what linked phases give
//! stands beside it.

use super::bound::BoundRow;
use super::measures::{
    frames_within, likeness, spectrum_error, sum_of_steps_beside_direct, visibility,
};
use super::methods::{DIRECT, LINKED, ONE_STEP, PAPER};
use super::scene::Scene;
use super::statistics::Statistics;
use crate::figures::curves::half_lag;
use crate::simulate::START_FRAME;
use crate::study::Estimator;

/// What the number must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// Not more than this.
    AtMost(f64),
    /// Not less than this.
    AtLeast(f64),
}

/// One line of the table.
#[derive(Clone, Debug)]
pub struct Claim {
    /// Lines of the paper's source.
    pub lines: &'static str,
    /// What it says, in short.
    pub text: &'static str,
    /// What is measured, with its unit.
    pub measure: &'static str,
    /// Our number.
    pub value: f64,
    /// What it must be.
    pub limit: Limit,
    /// The same number of linked phases, where they have one.
    pub linked: Option<f64>,
}

/// All that claims are judged by.
pub struct Evidence<'a> {
    /// Run 0 of σ = 0, λ/32 and λ/16.
    pub scenes: &'a [Scene; 3],
    /// All runs of σ = 0, λ/32, λ/24 and λ/16.
    pub statistics: &'a [Statistics; 4],
    /// The estimators against the bound.
    pub bound: &'a [BoundRow],
}

impl Limit {
    /// Whether a number keeps it; what is not a number does not.
    #[must_use]
    pub fn keeps(self, value: f64) -> bool {
        match self {
            Self::AtMost(limit) => value <= limit,
            Self::AtLeast(limit) => value >= limit,
        }
    }
}

impl std::fmt::Display for Limit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::AtMost(limit) => write!(f, "≤ {limit}"),
            Self::AtLeast(limit) => write!(f, "≥ {limit}"),
        }
    }
}

impl Claim {
    fn new(
        lines: &'static str,
        text: &'static str,
        measure: &'static str,
        value: f64,
        limit: Limit,
    ) -> Self {
        Self { lines, text, measure, value, limit, linked: None }
    }

    /// With the number of linked phases beside ours.
    fn beside(self, linked: f64) -> Self {
        Self { linked: Some(linked), ..self }
    }

    /// Whether it holds.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.limit.keeps(self.value)
    }
}

/// Every claim, in the order of the figures.
#[must_use]
pub fn claims(evidence: &Evidence<'_>) -> Vec<Claim> {
    let mut all = of_figure1(&evidence.scenes[2]);
    all.extend(of_images(evidence.scenes));
    all.extend(of_curves(evidence.statistics));
    all.extend(of_correlation(evidence.statistics));
    all.extend(of_outliers(evidence.bound));
    all
}

/// Noise has π/√3 = 1.81 rad.
const NOISE_RAD: Limit = Limit::AtLeast(1.6);

/// Figure 1, c and d, f and g.
fn of_figure1(scene: &Scene) -> Vec<Claim> {
    let truth = &scene.truth_rad;
    let (single, averaged) = (&scene.spectra.single, &scene.spectra.averaged);
    let far = truth.len() / 2..=truth.len() - 1;
    vec![
        Claim::new(
            "155-159",
            "without averaging, summed single steps equal the direct difference",
            "largest difference modulo 2π, one pixel, λ/16, rad",
            sum_of_steps_beside_direct(single),
            Limit::AtMost(1e-3),
        ),
        Claim::new(
            "135-137",
            "Fig. 1 c, f: without averaging the phase is lost beyond the correlation time",
            "rms error of arg C, one pixel, λ/16, Δt ≥ 35, rad",
            spectrum_error(single, truth, far.clone()),
            NOISE_RAD,
        ),
        Claim::new(
            "137-139",
            "Fig. 1 d, g: averaged, direct differences cannot be used",
            "rms error of arg ⟨C⟩, λ/16, Δt ≥ 35, rad",
            spectrum_error(averaged, truth, far),
            NOISE_RAD,
        ),
        Claim::new(
            "139-140",
            "Fig. 1 d, g: averaged, phases for small Δt are valid",
            "rms error of arg ⟨C⟩, λ/16, Δt = 1, rad",
            spectrum_error(averaged, truth, 1..=1),
            Limit::AtMost(0.1),
        ),
    ]
}

/// Of [`visibility`]: well visible, visible, and nothing but noise.
const WELL_VISIBLE: Limit = Limit::AtLeast(0.5);
const VISIBLE: Limit = Limit::AtLeast(0.2);
const ONLY_NOISE: Limit = Limit::AtMost(0.1);

/// Figure 2.
fn of_images([_, slow, fast]: &[Scene; 3]) -> Vec<Claim> {
    let mut all = of_slow_images(slow).to_vec();
    all.extend(of_fast_images(slow, fast));
    all
}

/// Visibility of the x in one of a scene's images.
fn seen(scene: &Scene, frame: usize, method: usize) -> f64 {
    let image = scene.snapshot(frame).phases[method].view();
    visibility(image, &scene.mask, scene.truth_rad[frame])
}

const SEEN_LATE: &str = "visibility of the x, frame 60";
const SEEN_LAST: &str = "visibility of the x, frame 69";

fn of_slow_images(slow: &Scene) -> [Claim; 3] {
    let phases = &slow.snapshot(10).phases;
    let alike = |method: usize| likeness(&phases[DIRECT], &phases[method]);
    [
        Claim::new(
            "460-463",
            "λ/32, first 10 steps: direct and extended images almost indistinguishable",
            "mean cosine of their difference, frame 10",
            alike(PAPER),
            Limit::AtLeast(0.9),
        )
        .beside(alike(LINKED)),
        Claim::new(
            "463-464",
            "λ/32, 60 steps: the direct difference yields only noise",
            SEEN_LATE,
            seen(slow, 60, DIRECT),
            ONLY_NOISE,
        ),
        Claim::new(
            "464-466",
            "λ/32, 60 steps: the x is well visible by the extended method",
            SEEN_LATE,
            seen(slow, 60, PAPER),
            WELL_VISIBLE,
        )
        .beside(seen(slow, 60, LINKED)),
    ]
}

fn of_fast_images(slow: &Scene, fast: &Scene) -> [Claim; 3] {
    let share = |method| seen(fast, 69, method) / seen(slow, 69, method);
    [
        Claim::new(
            "468-469",
            "λ/16, 69 steps: the x begins to deteriorate",
            "visibility over that at λ/32, frame 69",
            share(PAPER),
            Limit::AtMost(0.9),
        )
        .beside(share(LINKED)),
        Claim::new(
            "470",
            "λ/16, 69 steps: the x remains visible by the extended method",
            SEEN_LAST,
            seen(fast, 69, PAPER),
            VISIBLE,
        )
        .beside(seen(fast, 69, LINKED)),
        Claim::new(
            "471",
            "λ/16, 69 steps: the direct difference yields only noise",
            SEEN_LAST,
            seen(fast, 69, DIRECT),
            ONLY_NOISE,
        ),
    ]
}

/// Error that still counts as recovering the phase, as part of the phase put in.
const RECOVERED: Limit = Limit::AtMost(0.1);
/// A phase whose error is as large as itself is lost.
const LOST: Limit = Limit::AtLeast(1.0);

const END_ERROR: &str = "rms error in frame 69 over the phase put in";

/// Figure 3, a-h.
fn of_curves(statistics: &[Statistics; 4]) -> Vec<Claim> {
    let [still, slow, medium, fast] = statistics;
    let end = |of: &Statistics, method: usize| of.last_errors()[method] / of.last_truth();
    let direct =
        |lines, text, of, limit| Claim::new(lines, text, END_ERROR, end(of, DIRECT), limit);
    let walk = |lines, text, of, method| {
        Claim::new(lines, text, END_ERROR, end(of, method), RECOVERED).beside(end(of, LINKED))
    };
    vec![
        direct("485-488", "σ = 0: the direct difference yields the curve put in", still, RECOVERED),
        direct(
            "488-491",
            "λ/32: the direct difference accumulates huge errors",
            slow,
            Limit::AtLeast(0.5),
        ),
        direct("493-494", "λ/24: devastating effects on the direct difference", medium, LOST),
        direct("493-494", "λ/16: devastating effects on the direct difference", fast, LOST),
        walk("495-497", "σ = 0: the extended method yields the directed motion", still, PAPER),
        walk("495-497", "λ/32: the extended method yields the directed motion", slow, PAPER),
        walk("495-497", "λ/24: the extended method yields the directed motion", medium, PAPER),
        walk("495-497", "λ/16: the extended method yields the directed motion", fast, PAPER),
        walk("425-427", "λ/16: single steps yield valid results for large t", fast, ONE_STEP),
    ]
}

/// What still counts as within the correlation time, in times to one half: at three of them an exponential has an
/// eighth of its amplitude left.
const WITHIN_CORRELATION: Limit = Limit::AtMost(3.0);

/// Figure 3, i-k, and how long the methods last beside it.
fn of_correlation(statistics: &[Statistics; 4]) -> Vec<Claim> {
    let [_, slow, _, fast] = statistics;
    let mean = |of: &Statistics, lag: usize| of.autocorrelation.mean[lag];
    let half = |of: &Statistics| half_lag(&of.autocorrelation.mean).unwrap_or(f64::INFINITY);
    let within = |of: &Statistics, method: usize| {
        let limit = 0.1 * of.last_truth();
        frames_within(&of.errors[method], START_FRAME, limit) as f64 / half(of)
    };
    let times = "frames with an rms error ≤ 10 % of the end phase, over those to one half, λ/16";
    vec![
        Claim::new(
            "466-467",
            "λ/32: speckle patterns appear correlated after 10 steps",
            "autocorrelation at lag 10",
            mean(slow, 10),
            Limit::AtLeast(0.3),
        ),
        Claim::new(
            "467",
            "λ/32: speckle patterns are completely changed after 69 steps",
            "autocorrelation at lag 69",
            mean(slow, 69),
            Limit::AtMost(0.1),
        ),
        Claim::new(
            "491-493",
            "λ/32: the autocorrelation drops to one half in less than ten frames",
            "frames to one half",
            half(slow),
            Limit::AtMost(10.0),
        ),
        Claim::new(
            "497-498",
            "λ/16: the autocorrelation halves after few frames",
            "frames to one half",
            half(fast),
            Limit::AtMost(4.0),
        ),
        Claim::new(
            "413",
            "the direct difference only yields phases within the correlation time",
            times,
            within(fast, DIRECT),
            WITHIN_CORRELATION,
        ),
        Claim::new(
            "548-550",
            "averaged steps allow more than ten times the decorrelation time",
            times,
            within(fast, PAPER),
            Limit::AtLeast(10.0),
        )
        .beside(within(fast, LINKED)),
    ]
}

/// What three frames without any signal do, λ/32, 1000 looks.
fn of_outliers(bound: &[BoundRow]) -> Vec<Claim> {
    let row = bound.iter().find(|row| row.scenario == "3 outliers" && row.looks == 1000);
    let over = |name: &str| {
        let place = Estimator::ALL.iter().position(|known| known.name() == name);
        let score = row.zip(place).and_then(|(row, place)| row.scores.get(place));
        score.map_or(f64::NAN, |score| score.over_bound)
    };
    let measure = "rms error over the bound, 3 outlier frames, λ/32, 1000 looks";
    vec![
        Claim::new(
            "428-429",
            "in single steps one outlier ruins all that follows",
            measure,
            over("one-step"),
            Limit::AtLeast(5.0),
        ),
        Claim::new(
            "554-555",
            "the extended method removes the sensitivity to outliers",
            measure,
            over("paper"),
            Limit::AtMost(2.0),
        )
        .beside(over("linked")),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_kept_or_not() {
        assert!(Limit::AtMost(1.0).keeps(1.0) && !Limit::AtMost(1.0).keeps(1.1));
        assert!(Limit::AtLeast(1.0).keeps(1.0) && !Limit::AtLeast(1.0).keeps(0.9));
        assert!(!Limit::AtMost(1.0).keeps(f64::NAN) && !Limit::AtLeast(1.0).keeps(f64::NAN));
        assert_eq!(Limit::AtLeast(0.5).to_string(), "≥ 0.5");
    }

    #[test]
    fn the_outliers_are_found_in_the_study() {
        let names: Vec<&str> = crate::study::scenarios().iter().map(|s| s.name).collect();
        assert!(names.contains(&"3 outliers"));
        let known = Estimator::ALL.map(Estimator::name);
        assert!(["one-step", "paper", "linked"].iter().all(|name| known.contains(name)));
    }
}
