//! What each stage must do at the least, for one vector of pixels and one pair of frames: operations of the
//! formulas as the code has them, and registers that come from beyond the first cache.
//!
//! Absolute values, changes of sign and addresses are not counted, nor is what the filter reads again from the
//! first cache. What happens once for a frame is shared out among its pairs.

use phasewalk::image::stages::{Stage, Timed};
use phasewalk::method::Method;
use phasewalk_core::linking::START_FRAMES;
use phasewalk_core::params::UNWRAP_NEIGHBOURS;
use std::ops::{Add, Mul};

/// Vector operations.
#[derive(Clone, Copy, Default)]
pub struct Operations {
    /// Additions, subtractions, comparisons, selections, minima and maxima: one issue slot each.
    pub adds: f64,
    /// Multiplications, and first estimates of a reciprocal root.
    pub multiplies: f64,
    /// Multiply-adds.
    pub multiply_adds: f64,
    /// Divisions.
    pub divisions: f64,
    /// Square roots.
    pub roots: f64,
    /// Reciprocal square roots: an estimate and a Newton step (3 multiplications, 2 of them with an addition,
    /// and a halving), or in plain Rust a root and a division.
    pub inverse_roots: f64,
}

impl Add for Operations {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            adds: self.adds + other.adds,
            multiplies: self.multiplies + other.multiplies,
            multiply_adds: self.multiply_adds + other.multiply_adds,
            divisions: self.divisions + other.divisions,
            roots: self.roots + other.roots,
            inverse_roots: self.inverse_roots + other.inverse_roots,
        }
    }
}

impl Mul<f64> for Operations {
    type Output = Self;

    fn mul(self, times: f64) -> Self {
        Self {
            adds: self.adds * times,
            multiplies: self.multiplies * times,
            multiply_adds: self.multiply_adds * times,
            divisions: self.divisions * times,
            roots: self.roots * times,
            inverse_roots: self.inverse_roots * times,
        }
    }
}

const fn operations(adds: f64, multiplies: f64, multiply_adds: f64) -> Operations {
    Operations { adds, multiplies, multiply_adds, divisions: 0.0, roots: 0.0, inverse_roots: 0.0 }
}

/// U(t) conj U(s), `cross_spectrum`, and every other product of complex numbers.
const PRODUCT: Operations = operations(0.0, 2.0, 2.0);

/// C/|C|, `unit_phasor`: |C|^2, is it dark and the two choices, 1/|C|, two products.
const UNIT_PHASOR: Operations = Operations { inverse_roots: 1.0, ..operations(3.0, 3.0, 1.0) };

/// `lanes::angle`: the ratio of the shorter to the longer side; its square, eight steps of the polynomial, the
/// product; three choices of the octant, each a comparison, a difference and a selection.
const ANGLE: Operations = Operations { divisions: 1.0, ..operations(13.0, 2.0, 8.0) };

/// `Weights::paper`: the modulus, less the threshold, not below 0.
const WEIGHT: Operations = Operations { roots: 1.0, ..operations(2.0, 1.0, 1.0) };

/// `Unwrapper`: is it a number, and if not, the one before.
const TAKEN: Operations = operations(2.0, 0.0, 0.0);

/// Sum of the distances to the neighbours, against its limit.
const DISTANCES: Operations = operations(2.0 * UNWRAP_NEIGHBOURS as f64 + 1.0, 0.0, 0.0);

/// `Solver::set_pair`: is phase and weight a number above 0; w^2 and w^2 c, or 0; their sums; both frames are
/// measured.
const LINK: Operations = operations(9.0, 2.0, 0.0);

/// `solver::join`: conductance and flux of one new link.
const JOIN: Operations = operations(0.0, 0.0, 3.0);

/// What else the elimination does with each link: its sums at the node, its shares, ground and reference of its
/// other end; and the back-substitution.
const LINK_ELIMINATED: Operations = operations(3.0, 2.0, 5.0);

/// Frames that the solver eliminates together: what lies behind them is then read and written once.
const PANEL: f64 = 4.0;

/// gamma: the product of two roots, times both parts.
const NORMALISE: Operations = operations(0.0, 3.0, 0.0);

/// A neighbour's phasor turned by gamma, with its weight.
const STEP: Operations = operations(0.0, 2.0, 4.0);

/// r_ij, and its pull on both frames' scores.
const RESIDUAL: Operations = operations(2.0, 4.0, 3.0);

/// The buffers of `machine::BUFFERS` that a stage's registers come from or go to.
#[derive(Clone, Copy)]
pub enum Level {
    /// The second cache: lines between the filter's passes, links of the solver, a frame of the strip.
    Second = 1,
    /// What holds all frames of a strip: the third cache, if there is one.
    Frames = 2,
    /// What holds the samples of all pairs of a strip: memory.
    Samples = 3,
}

/// Registers read and written.
pub struct Traffic {
    /// Where.
    pub level: Level,
    /// Read.
    pub reads: f64,
    /// Written.
    pub writes: f64,
}

/// Where a stage stands.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A step of the filter, which should come to half of its roof.
    Filter,
    /// What is done with each mean while it is in registers: in the program it takes turns with the filter.
    Means,
    /// All else.
    Rest,
}

/// One stage.
pub struct Cost {
    /// Which.
    pub stage: Stage,
    /// For people.
    pub name: &'static str,
    /// What it belongs to.
    pub part: Part,
    /// Arithmetic.
    pub operations: Operations,
    /// Bytes.
    pub traffic: Vec<Traffic>,
}

/// All stages of a method, for a series of so many frames.
pub fn costs(method: Method, timed: &Timed, frames: usize) -> Vec<Cost> {
    let pairs = Pairs::of(frames);
    match method {
        Method::Linked => [filter(timed, 2), linking(&pairs)].into_iter().flatten().collect(),
        _ => [filter(timed, 4), solution(&pairs)].into_iter().flatten().collect(),
    }
}

/// Numbers of a series, per pair.
struct Pairs {
    /// Frames.
    frames: f64,
    /// New links of the elimination: r (r - 1) / 2 for each frame with r behind it.
    joins: f64,
    /// Pairs with enough neighbours to be unwrapped.
    unwrapped: f64,
    /// Pairs that the start of linked phases looks at.
    start: f64,
}

impl Pairs {
    fn of(frames: usize) -> Self {
        let pairs = (frames * (frames - 1) / 2) as f64;
        let behind = |lag: usize| (0..frames).map(move |t| (frames - 1 - t).saturating_sub(lag));
        let sum = |numbers: &mut dyn Iterator<Item = usize>| numbers.sum::<usize>() as f64 / pairs;
        Self {
            frames: frames as f64 / pairs,
            joins: sum(&mut behind(0).map(|r| r * r.saturating_sub(1) / 2)),
            unwrapped: sum(&mut behind(UNWRAP_NEIGHBOURS - 1)),
            start: sum(&mut (0..frames).map(|i| i.min(START_FRAMES))),
        }
    }
}

/// Products and both passes: for every row those of its share of the halo; for every result a multiplication
/// and, for each of R taps, an addition and a multiply-add in each channel.
fn filter(timed: &Timed, channels: usize) -> Vec<Cost> {
    let Timed { rows, halo, .. } = *timed;
    let tall = (rows + 2 * halo) as f64 / rows as f64;
    let product = if channels == 4 { PRODUCT + UNIT_PHASOR } else { PRODUCT };
    let channels = channels as f64;
    let taps = operations(halo as f64, 1.0, halo as f64) * channels;
    let both = [Level::Frames, Level::Second];
    let fields = both.map(|level| Traffic { level, reads: 2.0 * tall, writes: 0.0 });
    let between = |reads, writes| vec![Traffic { level: Level::Second, reads, writes }];
    let part = Part::Filter;
    let cost = |stage, name, operations, traffic| Cost { stage, name, part, operations, traffic };
    vec![
        cost(Stage::Products, "products", product * tall, fields.into()),
        cost(Stage::Vertical, "vertical filter", taps, between(0.0, channels)),
        cost(Stage::Horizontal, "halo, horizontal filter", taps, between(channels, 0.0)),
    ]
}

/// The least squares behind the filter.
fn solution(pairs: &Pairs) -> Vec<Cost> {
    let links = 2.0 * pairs.joins / PANEL;
    let cost =
        |stage, part, name, operations, traffic| Cost { stage, name, part, operations, traffic };
    let at = |level, reads, writes| Traffic { level, reads, writes };
    let quotients = Operations { divisions: 2.0 * pairs.frames, ..Operations::default() };
    vec![
        cost(
            Stage::Samples,
            Part::Means,
            "arg, weight, store",
            ANGLE + WEIGHT,
            vec![at(Level::Samples, 0.0, 2.0)],
        ),
        cost(
            Stage::Assemble,
            Part::Rest,
            "unwrap, assemble",
            TAKEN + DISTANCES * pairs.unwrapped + LINK,
            vec![at(Level::Samples, 2.0, 0.0), at(Level::Second, 0.0, 2.0)],
        ),
        cost(
            Stage::Solve,
            Part::Rest,
            "factor, solve",
            JOIN * pairs.joins + LINK_ELIMINATED + quotients,
            vec![at(Level::Second, links + 2.0, links)],
        ),
    ]
}

/// Linked phases behind the filter.
fn linking(pairs: &Pairs) -> Vec<Cost> {
    let cost = |stage, part, name, operations, reads, writes| Cost {
        stage,
        name,
        part,
        operations,
        traffic: vec![Traffic { level: Level::Frames, reads, writes }],
    };
    let walk = STEP * pairs.start + UNIT_PHASOR * pairs.frames;
    // F^-1 g, with a row of numbers for each frame.
    let row = operations(0.0, 0.0, 2.0) + operations(0.0, 0.0, pairs.frames);
    let score = row + ANGLE * pairs.frames;
    vec![
        cost(Stage::Normalise, Part::Means, "normalise", NORMALISE, 1.0, 2.0),
        cost(Stage::Walk, Part::Rest, "start", walk, 4.0 * pairs.start, 0.0),
        cost(Stage::Residuals, Part::Rest, "residuals", RESIDUAL, 5.0, 1.0),
        cost(Stage::Score, Part::Rest, "step of scoring", score, 3.0 * pairs.frames, 0.0),
    ]
}
