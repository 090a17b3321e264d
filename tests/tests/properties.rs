//! Properties of the core that hold whatever the data: one formula against another, one order of
//! work against another, one kind of number against another.

use num_complex::Complex;
use phasewalk::lanes::{LaneTask, Lanes, Path};
use phasewalk_core::batch::solve_series;
use phasewalk_core::cross_spectrum::cross_spectrum;
use phasewalk_core::ensemble::{Ensemble, PairMean};
use phasewalk_core::params::{Difference, RANDOM_PROBABILITY};
use phasewalk_core::regularize::batch_links;
use phasewalk_core::solver::Solver;
use phasewalk_core::storage::{Link, Node};
use phasewalk_core::unwrap::Unwrapper;
use phasewalk_core::variance::phase_variance;
use phasewalk_core::walk::{Estimate, Walk};
use phasewalk_core::weights::{Weighting, Weights, debias, pair_variance};
use phasewalk_core::{Params, Scalar};
use phasewalk_tests::oracle;
use phasewalk_tests::random::Random;
use phasewalk_tests::tolerance::{
    BRIDGE_RAD, BRIDGE_SIGMA_RAD, BRIDGED_DOUBLE_RAD, DOUBLE_RAD, LANE_RAD, SIGMA_RELATIVE,
    SINGLE_RAD,
};
use phasewalk_tests::wide::{self, Wide};

const PIXELS: usize = 64;
const LOOKS: f64 = PIXELS as f64;
const FRAMES: usize = 24;
const SEEDS: [u64; 3] = [1, 20, 300];

type Field = [Complex<f64>; PIXELS];

/// Speckle that keeps 0.97 of itself from frame to frame and turns by 0.2 rad, more or less.
fn fields(frames: usize, seed: u64) -> Vec<Field> {
    let mut random = Random::new(seed);
    let (rho, mut phase) = (0.97_f64, 0.0);
    let mut speckle: Field = std::array::from_fn(|_| random.speckle());
    let mut next = || {
        let turned = speckle.map(|a| a * Complex::from_polar(1.0, phase));
        phase += 0.2 + 0.1 * random.phase();
        speckle = speckle.map(|a| a * rho + random.speckle() * (1.0 - rho * rho).sqrt());
        turned
    };
    (0..frames).map(|_| next()).collect()
}

fn dark() -> Field {
    [Complex::new(0.0, 0.0); PIXELS]
}

fn weights(weighting: Weighting) -> Weights {
    Weights::new(weighting, LOOKS, RANDOM_PROBABILITY)
}

/// The pairs (t, dt) in the order of the solver, with their means.
fn means<T: Scalar>(fields: &[Field], lags: usize) -> Vec<PairMean<T>> {
    let narrow = |u: Complex<f64>| Complex { re: T::from_f64(u.re), im: T::from_f64(u.im) };
    let mean = |u: &Field, v: &Field, power: [T; 2]| {
        let mut ensemble = Ensemble::new();
        for (&u, &v) in u.iter().zip(v) {
            ensemble.add(cross_spectrum(narrow(u), narrow(v)));
        }
        ensemble.mean(power[0], power[1])
    };
    let one = [T::one(); 2];
    let powers: Vec<T> = fields.iter().map(|u| mean(u, u, one).cross.re).collect();
    let pair =
        |(t, dt): (usize, usize)| mean(&fields[t], &fields[t + dt], [powers[t], powers[t + dt]]);
    oracle::pair_list(fields.len(), lags).into_iter().map(pair).collect()
}

/// Everything the batch solution says.
struct Batch {
    /// Against the reference frames.
    phases: Vec<f64>,
    sigmas: Vec<f64>,
    measured: Vec<bool>,
    gauge: usize,
}

impl Batch {
    fn of<T: Scalar + Into<f64>>(fields: &[Field], params: &Params, weights: &Weights) -> Self {
        let times: Vec<f64> = (0..fields.len()).map(|t| t as f64).collect();
        Self::at_times::<T>(fields, &times, params, weights)
    }

    fn at_times<T: Scalar + Into<f64>>(
        fields: &[Field],
        times: &[f64],
        params: &Params,
        weights: &Weights,
    ) -> Self {
        let frames = fields.len();
        let lags = params.max_lag.min(frames - 1).max(1);
        let means = means::<T>(fields, lags);
        let gauge = params.gauge_frame.min(frames - 1);
        let nodes = vec![Node::new(); frames];
        let links = vec![Link::new(); frames * lags];
        let mut solver =
            Solver::with_storage(links, nodes, lags, params.gauge_frame, params.reference_frames);
        let (mut phases, mut measured) = (vec![T::zero(); frames], vec![T::zero(); frames]);
        let mut samples = means.iter().map(|mean| (mean.phase(), weights.weight(mean)));
        let pair = |_, _| samples.next().expect("as many pairs as the solver asks for");
        solve_series(&mut solver, params, times, pair, &mut phases, &mut measured);

        let mut noise = vec![T::zero(); frames * lags];
        for ((t, dt), mean) in oracle::pair_list(frames, lags).into_iter().zip(&means) {
            let variance = pair_variance(debias(mean.coherence_squared(), LOOKS), LOOKS);
            let square = weights.weight(mean) * weights.weight(mean);
            noise[t * lags + dt - 1] = square * square * variance;
        }
        for (t, dt, conductance) in batch_links(params, times) {
            noise[t * lags + dt - 1] += T::from_f64(conductance);
        }
        let references = params.reference_frames;
        let sigma = |frame| {
            let mut scratch = vec![T::zero(); frames];
            phase_variance(&solver, &noise, &measured, references, frame, &mut scratch).sqrt()
        };
        Self {
            sigmas: (0..frames).map(|frame| sigma(frame).into()).collect(),
            phases: phases.into_iter().map(Into::into).collect(),
            measured: measured.into_iter().map(|m| m.into() > 0.0).collect(),
            gauge,
        }
    }
}

#[track_caller]
fn assert_close(got: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((got - expected).abs() <= tolerance, "{what}: {got} instead of {expected}");
}

#[track_caller]
fn assert_all_close(got: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(got.len(), expected.len());
    for (t, (&got, &expected)) in got.iter().zip(expected).enumerate() {
        assert_close(got, expected, tolerance, &format!("frame {t}"));
    }
}

// ---- streaming = batch ---------------------------------------------------------------------

fn stream<const LAGS: usize, const ROWS: usize>(
    fields: &[Field],
    params: Params,
    weighting: Weighting,
) -> (Vec<Estimate<f64>>, Walk<f64, PIXELS, LAGS, ROWS>) {
    let mut walk = Walk::new(params, weights(weighting), LOOKS).unwrap();
    (fields.iter().map(|field| walk.push(field)).collect(), walk)
}

/// After each frame n: newest phase and sigma are those of the batch of frames 0..=n; at the end:
/// the smoothed history, too.
fn streaming_is_batch<const LAGS: usize, const ROWS: usize>(fields: &[Field], params: Params) {
    streaming_is_batch_within::<LAGS, ROWS>(fields, params, DOUBLE_RAD);
}

fn streaming_is_batch_within<const LAGS: usize, const ROWS: usize>(
    fields: &[Field],
    params: Params,
    tolerance: f64,
) {
    for weighting in [Weighting::Paper, Weighting::Fisher] {
        let (estimates, walk) = stream::<LAGS, ROWS>(fields, params, weighting);
        for (n, estimate) in estimates.iter().enumerate() {
            let batch = Batch::of::<f64>(&fields[..=n], &params, &weights(weighting));
            let what = format!("{weighting:?}, lags {LAGS}, rows {ROWS}, frame {n}");
            assert_eq!(estimate.frame, n);
            assert_close(estimate.phase_rad, batch.phases[n], tolerance, &what);
            let sigma = batch.sigmas[n];
            // Infinite in both before the first pair of frames that counts.
            if estimate.sigma_rad != sigma {
                assert_close(estimate.sigma_rad, sigma, SIGMA_RELATIVE * sigma, &what);
            }
        }
        let batch = Batch::of::<f64>(fields, &params, &weights(weighting));
        let first = fields.len().saturating_sub(ROWS);
        assert_eq!(walk.first_kept(), first);
        let mut smoothed = vec![0.0; fields.len() - first];
        walk.smoothed(&mut smoothed);
        let gauge = batch.phases[batch.gauge];
        let expected: Vec<f64> = batch.phases[first..].iter().map(|phase| phase - gauge).collect();
        assert_all_close(&smoothed, &expected, tolerance);
    }
}

#[test]
fn streaming_is_batch_at_every_frame() {
    for seed in SEEDS {
        let fields = fields(FRAMES, seed);
        streaming_is_batch::<1, 24>(&fields, Params::paper(1));
        streaming_is_batch::<4, 24>(&fields, Params::paper(4));
        streaming_is_batch::<16, 24>(&fields, Params::paper(16));
        streaming_is_batch::<23, 24>(&fields, Params::paper(23));
    }
}

#[test]
fn streaming_is_batch_after_more_frames_than_rows() {
    for seed in SEEDS {
        let fields = fields(40, seed);
        streaming_is_batch::<1, 2>(&fields, Params::paper(1));
        streaming_is_batch::<4, 5>(&fields, Params::paper(4));
        streaming_is_batch::<4, 9>(&fields, Params::paper(4));
        streaming_is_batch::<16, 17>(&fields, Params::paper(16));
    }
}

#[test]
fn streaming_is_batch_with_second_differences() {
    for seed in SEEDS {
        let second = |lags| Params { difference: Difference::Second, ..Params::paper(lags) };
        streaming_is_batch::<2, 3>(&fields(FRAMES, seed), second(2));
        streaming_is_batch::<4, 24>(&fields(FRAMES, seed), second(4));
    }
}

#[test]
fn streaming_is_batch_over_dark_frames() {
    for gap in [2..3, 4..5, 9..12] {
        let mut fields = fields(FRAMES, SEEDS[0]);
        fields[gap].fill(dark());
        streaming_is_batch_within::<4, 5>(&fields, Params::paper(4), BRIDGED_DOUBLE_RAD);
        streaming_is_batch_within::<16, 24>(&fields, Params::paper(16), BRIDGED_DOUBLE_RAD);
    }
}

// ---- the solver against dense matrices -----------------------------------------------------

/// Random phases beyond wrapping and random weights, some of them zero.
fn random_pairs(count: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut random = Random::new(seed);
    let phases = (0..count).map(|_| 3.0 * random.phase()).collect();
    let weights = (0..count).map(|_| (random.uniform() - 0.2).max(0.0)).collect();
    (phases, weights)
}

/// The core's phases for given unwrapped phases: its own unwrapping is passed by.
fn solve<T: Scalar>(
    params: &Params,
    times: &[f64],
    unwrapped: &[T],
    weights: &[T],
) -> (Vec<T>, Vec<T>) {
    let (frames, lags) = (times.len(), params.max_lag);
    let links = vec![Link::new(); frames * lags];
    let mut solver = Solver::with_storage(
        links,
        vec![Node::new(); frames],
        lags,
        params.gauge_frame,
        params.reference_frames,
    );
    solver.begin_batch(frames);
    let pairs = oracle::pair_list(frames, lags).into_iter();
    for ((t, dt), (&phase, &weight)) in pairs.zip(unwrapped.iter().zip(weights)) {
        solver.add_pair(t, dt, phase, weight);
    }
    phasewalk_core::regularize::add_differences(&mut solver, params, times);
    solver.finish();
    let (mut phases, mut measured) = (vec![T::zero(); frames], vec![T::zero(); frames]);
    solver.phases(&mut phases);
    solver.measured(&mut measured);
    phasewalk_core::reference::subtract_reference(&mut phases, &measured, params.reference_frames);
    (phases, measured)
}

fn even_times(frames: usize) -> Vec<f64> {
    (0..frames).map(|t| t as f64).collect()
}

#[test]
fn elimination_is_the_dense_solution() {
    for seed in SEEDS {
        for lags in [1, 5, FRAMES - 1] {
            let count = oracle::pair_list(FRAMES, lags).len();
            let (c, w) = random_pairs(count, seed);
            let (phases, _) = solve(&Params::paper(lags), &even_times(FRAMES), &c, &w);
            let regularisation = oracle::Regularisation::paper(FRAMES);
            let expected = oracle::solve(FRAMES, lags, &c, &w, &regularisation);
            assert_all_close(&phases, &expected, DOUBLE_RAD);
        }
    }
}

/// mu_1 fixes the gauge and nothing else: the dense solution with Gamma_1 in it, however strong, is
/// the one whose gauge frame is set to zero exactly.
#[test]
fn the_strength_of_the_gauge_changes_nothing() {
    let (c, w) = random_pairs(oracle::pair_list(FRAMES, 9).len(), SEEDS[1]);
    let (exact, _) = solve(&Params::paper(9), &even_times(FRAMES), &c, &w);
    for mu_1 in [phasewalk_core::params::GAUGE_STRENGTH, 1e-4, 1.0, 1e3] {
        let regularisation =
            oracle::Regularisation { mu_1, ..oracle::Regularisation::paper(FRAMES) };
        let dense = oracle::solve(FRAMES, 9, &c, &w, &regularisation);
        assert_all_close(&exact, &dense, DOUBLE_RAD);
    }
}

#[test]
fn the_choice_of_the_gauge_frame_changes_nothing() {
    let (c, w) = random_pairs(oracle::pair_list(FRAMES, 9).len(), SEEDS[2]);
    let with_gauge = |gauge_frame| {
        let params = Params { gauge_frame, ..Params::paper(9) };
        solve(&params, &even_times(FRAMES), &c, &w).0
    };
    let expected = with_gauge(4);
    for gauge in [0, 1, 11, FRAMES - 1, FRAMES + 7] {
        assert_all_close(&with_gauge(gauge), &expected, DOUBLE_RAD);
    }
}

/// The second divided differences as rows of a matrix, of the paper's scale at even times.
fn second_differences(times: &[f64], mu: f64) -> Vec<Vec<f64>> {
    let interval = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let row = |i: usize| {
        let [a, b, c] = [times[i], times[i + 1], times[i + 2]];
        let scale = 2.0 * mu * interval * interval;
        let mut row = vec![0.0; times.len()];
        row[i] = scale / ((b - a) * (c - a));
        row[i + 1] = -scale / ((b - a) * (c - b));
        row[i + 2] = scale / ((c - b) * (c - a));
        row
    };
    (0..times.len() - 2).map(row).collect()
}

/// (S^T W^2 S + Gamma_2^T Gamma_2 + e_0 e_0^T) phi = S^T W^2 c in double-double, minus phi_0.
fn dense(lags: usize, c: &[f64], w: &[f64], gamma_2: &[Vec<f64>]) -> Vec<f64> {
    let frames = gamma_2[0].len();
    let mut normal = vec![vec![Wide::ZERO; frames]; frames];
    let mut right = vec![vec![Wide::ZERO]; frames];
    normal[0][0] = Wide::from(1.0);
    let weighted = |row: Vec<f64>, w: f64| row.into_iter().map(move |x| x * w).collect();
    let s = oracle::difference_matrix(frames, lags).into_iter().zip(w);
    let rows: Vec<Vec<f64>> = s.map(|(row, &w)| weighted(row, w)).collect();
    let values = c.iter().zip(w).map(|(c, w)| c * w).chain(std::iter::repeat(0.0));
    for (row, value) in rows.iter().chain(gamma_2).zip(values) {
        for (i, &x) in row.iter().enumerate() {
            right[i][0] = right[i][0] + Wide::product(x, value);
            for (j, &y) in row.iter().enumerate() {
                normal[i][j] = normal[i][j] + Wide::product(x, y);
            }
        }
    }
    let solution = wide::solve(normal, right).expect("Gamma_2 and the gauge make it regular");
    solution.iter().map(|row| (row[0] - solution[0][0]).to_f64()).collect()
}

#[test]
fn second_differences_are_the_dense_solution_at_any_times() {
    let mut random = Random::new(SEEDS[0]);
    let uneven = (0..FRAMES).scan(0.0, |time, _| {
        *time += 0.1 + 3.0 * random.uniform();
        Some(*time)
    });
    for times in [even_times(FRAMES), uneven.collect()] {
        let (c, mut w) = random_pairs(oracle::pair_list(FRAMES, 6).len(), SEEDS[1]);
        for ((t, dt), w) in oracle::pair_list(FRAMES, 6).into_iter().zip(&mut w) {
            if (11..14).contains(&t) || (11..14).contains(&(t + dt)) {
                *w = 0.0;
            }
        }
        let params = Params { difference: Difference::Second, ..Params::paper(6) };
        let (phases, _) = solve(&params, &times, &c, &w);
        let relative: Vec<f64> = phases.iter().map(|phase| phase - phases[0]).collect();
        let gamma_2 = second_differences(&times, params.difference_strength);
        assert_all_close(&relative, &dense(6, &c, &w, &gamma_2), DOUBLE_RAD);
    }
}

// ---- frames without weights, short series --------------------------------------------------

#[test]
fn a_dark_frame_is_bridged_and_says_so() {
    let mut fields = fields(FRAMES, SEEDS[0]);
    fields[12] = dark();
    for weighting in [Weighting::Paper, Weighting::Fisher] {
        let batch = Batch::of::<f64>(&fields, &Params::paper(9), &weights(weighting));
        let midway = 0.5 * (batch.phases[11] + batch.phases[13]);
        assert_close(batch.phases[12], midway, BRIDGE_RAD, "between its neighbours");
        let alone = 1e3 / f64::sqrt(2.0);
        assert_close(batch.sigmas[12], alone, BRIDGE_SIGMA_RAD, "held by Gamma_2 alone");
        for t in (0..FRAMES).filter(|&t| t != 12) {
            assert!(batch.measured[t] && batch.sigmas[t] < 1.0, "frame {t}: {}", batch.sigmas[t]);
        }
        assert!(!batch.measured[12]);
    }
}

#[test]
fn only_measured_frames_are_references() {
    for dark_frames in [0..1, 2..3, 1..4, 0..4] {
        let mut fields = fields(FRAMES, SEEDS[1]);
        fields[dark_frames.clone()].fill(dark());
        let batch = Batch::of::<f64>(&fields, &Params::paper(9), &weights(Weighting::Fisher));
        let references: Vec<usize> = (0..5).filter(|t| !dark_frames.contains(t)).collect();
        let sum: f64 = references.iter().map(|&t| batch.phases[t]).sum();
        assert_close(sum / references.len() as f64, 0.0, DOUBLE_RAD, "mean of the references");
    }
}

#[test]
fn short_series_are_their_own_reference() {
    for frames in [2, 3, 4] {
        for seed in SEEDS {
            let fields = fields(frames, seed);
            let batch =
                Batch::of::<f64>(&fields, &Params::paper(frames - 1), &weights(Weighting::Fisher));
            let pairs = means::<f64>(&fields, frames - 1);
            let c: Vec<f64> = pairs.iter().map(PairMean::phase).collect();
            let w: Vec<f64> =
                pairs.iter().map(|mean| weights(Weighting::Fisher).weight(mean)).collect();
            let regularisation = oracle::Regularisation::paper(frames);
            let expected = oracle::solve(frames, frames - 1, &c, &w, &regularisation);
            assert_all_close(&batch.phases, &expected, DOUBLE_RAD);
            let sum: f64 = batch.phases.iter().sum();
            assert_close(sum, 0.0, DOUBLE_RAD, "mean of all frames");
        }
        let fields = fields(frames, SEEDS[0]);
        streaming_is_batch::<1, 2>(&fields, Params::paper(1));
        streaming_is_batch::<4, 5>(&fields, Params::paper(4));
    }
}

// ---- one kind of number against another ----------------------------------------------------

#[test]
fn single_precision_is_enough() {
    for seed in SEEDS {
        for lags in [1, 5, FRAMES - 1] {
            for weighting in [Weighting::Paper, Weighting::Fisher] {
                let fields = fields(FRAMES, seed);
                let (params, weights) = (Params::paper(lags), weights(weighting));
                let single = Batch::of::<f32>(&fields, &params, &weights);
                let double = Batch::of::<f64>(&fields, &params, &weights);
                assert_all_close(&single.phases, &double.phases, SINGLE_RAD);
            }
        }
    }
}

/// A weak pair beside a strong one: two frames of three hang together by a weight of 0.01. What `f32`
/// loses in the strong pair's current of 3 must not show behind the weak one's conductance of 1e-4.
#[test]
fn single_precision_keeps_the_digits_of_weak_pairs() {
    let (c, w) = ([3.1, 0.7], [1.0, 0.01]);
    let (double, _) = solve(&Params::paper(1), &even_times(3), &c, &w);
    let narrow = |values: [f64; 2]| values.map(|x| x as f32);
    let (single, _) = solve(&Params::paper(1), &even_times(3), &narrow(c), &narrow(w));
    let single: Vec<f64> = single.into_iter().map(f64::from).collect();
    assert_all_close(&single, &double, SINGLE_RAD);
}

/// Where nothing but Gamma_2 joins two parts of a series, the level between them is what mu_2 says
/// also in `f32`.
#[test]
fn single_precision_bridges_gaps() {
    single_precision_is_double_over(&[(12..13, 9), (12..13, 1), (10..14, 3)]);
}

/// The same where the gauge frame itself is held by Gamma_2 alone.
#[test]
fn single_precision_bridges_a_dark_gauge_frame() {
    single_precision_is_double_over(&[(4..5, 9), (4..5, 1)]);
}

fn single_precision_is_double_over(gaps: &[(std::ops::Range<usize>, usize)]) {
    let mut faults = Vec::new();
    for (gap, lags) in gaps {
        for seed in SEEDS {
            let mut fields = fields(FRAMES, seed);
            fields[gap.clone()].fill(dark());
            let (params, weights) = (Params::paper(*lags), weights(Weighting::Fisher));
            let single = Batch::of::<f32>(&fields, &params, &weights).phases;
            let double = Batch::of::<f64>(&fields, &params, &weights).phases;
            let errors = single.iter().zip(double).map(|(a, b)| (a - b).abs());
            let worst = errors.fold(0.0, f64::max);
            if worst > SINGLE_RAD {
                faults.push(format!("frames {gap:?} dark, lags {lags}, seed {seed}: {worst} rad"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// One solution of as many random problems as there are lanes, and each of them by itself.
fn lanes_solve_as_scalars_do<L: Lanes<Element = f32>>(seed: u64) {
    let params = Params::paper(9);
    let times = even_times(FRAMES);
    let count = oracle::pair_list(FRAMES, 9).len();
    let problems: Vec<_> =
        (0..L::WIDTH).map(|lane| random_pairs(count, seed + lane as u64)).collect();
    let gather = |number: &dyn Fn(usize, usize) -> f64| {
        let mut vectors = vec![L::zero(); count];
        for (i, place) in L::flat_mut(&mut vectors).iter_mut().enumerate() {
            *place = number(i % L::WIDTH, i / L::WIDTH) as f32;
        }
        vectors
    };
    let (c, w) = (gather(&|lane, i| problems[lane].0[i]), gather(&|lane, i| problems[lane].1[i]));
    let (phases, measured) = solve(&params, &times, &c, &w);
    for (lane, (c, w)) in problems.iter().enumerate() {
        let narrow = |values: &[f64]| values.iter().map(|&x| x as f32).collect::<Vec<f32>>();
        let (expected, expected_measured) = solve(&params, &times, &narrow(c), &narrow(w));
        let of_lane = |values: &[L]| {
            let numbers = L::flat(values).iter().skip(lane).step_by(L::WIDTH);
            numbers.map(|&x| f64::from(x)).collect::<Vec<f64>>()
        };
        let widen = |values: &[f32]| values.iter().map(|&x| f64::from(x)).collect::<Vec<f64>>();
        assert_all_close(&of_lane(&phases), &widen(&expected), LANE_RAD);
        assert_eq!(of_lane(&measured), widen(&expected_measured));
    }
}

/// Rows of random phases, each lane its own: the same bits as one by one.
fn lanes_unwrap_as_scalars_do<L: Lanes<Element = f32>>(seed: u64) {
    let mut random = Random::new(seed);
    let mut lanes = Unwrapper::<L>::new();
    let mut scalars = vec![Unwrapper::<f32>::new(); L::WIDTH];
    for _ in 0..70 {
        let mut wrapped = [L::zero()];
        L::flat_mut(&mut wrapped).fill_with(|| random.phase() as f32);
        let unwrapped = [lanes.push(wrapped[0])];
        let inputs = L::flat(&wrapped).iter().zip(L::flat(&unwrapped));
        for (scalar, (&wrapped, &unwrapped)) in scalars.iter_mut().zip(inputs) {
            assert_eq!(scalar.push(wrapped).to_bits(), unwrapped.to_bits());
        }
    }
}

struct DoAsScalarsDo;

impl LaneTask for DoAsScalarsDo {
    type Output = ();

    fn run<L: Lanes<Element = f32>>(self) {
        for seed in SEEDS {
            lanes_solve_as_scalars_do::<L>(seed);
            lanes_unwrap_as_scalars_do::<L>(seed);
        }
    }
}

#[test]
fn lanes_do_as_scalars_do() {
    for path in Path::available() {
        path.run(DoAsScalarsDo).unwrap();
    }
}
