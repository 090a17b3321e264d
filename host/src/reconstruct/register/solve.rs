//! Motions of all sweeps from the motions between pairs of them (paper lines 707-709).

use super::banded::Banded;
use super::judge::{judge, usable};
use super::motion::{Motion, rotate};
use super::pair::PairMotion;

/// Rounds of linearisation and reweighting.
const ROUNDS: usize = 12;
/// Squared residual, in units of the usual one, at which a pair counts half.
const OUTLYING: f64 = 6.0;

type Pair = (usize, usize, PairMotion);

/// Motions of all sweeps relative to the first good one; `None` for sweeps without a usable pair.
///
/// Weighted least squares with Cauchy's weights, exact for rotations: sweep j seen from sweep i has
/// moved by Mⱼ ∘ Mᵢ⁻¹.
#[must_use]
pub fn solve(sweeps: usize, pairs: &[Pair]) -> Vec<Option<Motion>> {
    let good = judge(sweeps, pairs);
    let pairs: Vec<Pair> = usable(pairs).into_iter().filter(|p| good[p.0] && good[p.1]).collect();
    let Some(first) = good.iter().position(|&g| g) else {
        return vec![None; sweeps];
    };
    let mut motions = chained(sweeps, first, &pairs);
    let unknown = numbered(&good, first);
    for _ in 0..ROUNDS {
        improve(&mut motions, &unknown, &pairs);
    }
    motions
}

/// Every sweep reached from the first by the best pairs.
fn chained(sweeps: usize, first: usize, pairs: &[Pair]) -> Vec<Option<Motion>> {
    let mut motions = vec![None; sweeps];
    motions[first] = Some(Motion::default());
    loop {
        let open = pairs.iter().filter(|p| motions[p.0].is_some() != motions[p.1].is_some());
        let Some(&(i, j, pair)) = open.max_by(|a, b| a.2.quality.total_cmp(&b.2.quality)) else {
            return motions;
        };
        match (motions[i], motions[j]) {
            (Some(known), _) => motions[j] = Some(known.then(pair.motion)),
            (_, Some(known)) => motions[i] = Some(known.then(pair.motion.inverse())),
            _ => {}
        }
    }
}

/// Index of the first unknown of every good sweep but the first, which stays at rest.
fn numbered(good: &[bool], first: usize) -> Vec<Option<usize>> {
    let mut next = 0;
    let number = |(sweep, &good): (usize, &bool)| {
        (good && sweep != first).then(|| {
            next += 4;
            next - 4
        })
    };
    good.iter().enumerate().map(number).collect()
}

/// A pair's equation: residual, and its derivatives with respect to both sweeps' (dz, dy, dx,
/// angle).
struct Equation {
    residual: [f64; 4],
    sides: [[[f64; 4]; 4]; 2],
}

fn equation(earlier: Motion, later: Motion, pair: Motion) -> Equation {
    let seen = earlier.to(later);
    let shift: [f64; 3] = std::array::from_fn(|i| seen.shift[i] - pair.shift[i]);
    let residual = [shift[0], shift[1], shift[2], seen.rotation_rad - pair.rotation_rad];
    let (sine, cosine) = seen.rotation_rad.sin_cos();
    let [y, x] = rotate(seen.rotation_rad, [earlier.shift[1], earlier.shift[2]]);
    // The earlier shift is turned along: seen = later − R(angle) earlier, and dR/dangle (y, x) =
    // (x, −y).
    let of_earlier = [
        [-1.0, 0.0, 0.0, 0.0],
        [0.0, -cosine, -sine, x],
        [0.0, sine, -cosine, -y],
        [0.0, 0.0, 0.0, -1.0],
    ];
    let of_later =
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, -x], [0.0, 0.0, 1.0, y], [0.0, 0.0, 0.0, 1.0]];
    Equation { residual, sides: [of_earlier, of_later] }
}

/// One step of Gauss and Newton.
fn improve(motions: &mut [Option<Motion>], unknown: &[Option<usize>], pairs: &[Pair]) {
    let equations: Vec<(&Pair, Equation)> = pairs
        .iter()
        .filter_map(|p| Some((p, equation(motions[p.0]?, motions[p.1]?, p.2.motion))))
        .collect();
    let weights = weights(&equations);
    let size = unknown.iter().flatten().count() * 4;
    let distance = |p: &Pair| unknown[p.0].zip(unknown[p.1]).map_or(0, |(i, j)| i.abs_diff(j));
    let band = pairs.iter().map(distance).max().unwrap_or(0) + 3;
    let mut matrix = Banded::new(size, band);
    let mut right = vec![0.0; size];
    for ((pair, equation), weight) in equations.iter().zip(weights) {
        accumulate(
            &mut matrix,
            &mut right,
            [unknown[pair.0], unknown[pair.1]],
            pair,
            equation,
            weight,
        );
    }
    let Some(steps) = matrix.solve(&right) else { return };
    for (motion, at) in motions.iter_mut().zip(unknown) {
        if let (Some(motion), Some(at)) = (motion, at) {
            (0..3).for_each(|i| motion.shift[i] += steps[at + i]);
            motion.rotation_rad += steps[at + 3];
        }
    }
}

/// Cauchy's weights: residuals far above the usual count little.
fn weights(equations: &[(&Pair, Equation)]) -> Vec<f64> {
    let squares: Vec<f64> =
        equations.iter().map(|(p, e)| form(&p.2.information, e.residual, e.residual)).collect();
    let mut sorted = squares.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0).max(1e-12);
    squares.iter().map(|s| 1.0 / (1.0 + s / (OUTLYING * usual))).collect()
}

/// a · M b.
fn form(matrix: &[[f64; 4]; 4], a: [f64; 4], b: [f64; 4]) -> f64 {
    (0..4).map(|i| a[i] * (0..4).map(|j| matrix[i][j] * b[j]).sum::<f64>()).sum()
}

/// Adds a pair to the normal equations.
fn accumulate(
    matrix: &mut Banded,
    right: &mut [f64],
    unknown: [Option<usize>; 2],
    pair: &Pair,
    equation: &Equation,
    weight: f64,
) {
    let column =
        |side: usize, p: usize| -> [f64; 4] { std::array::from_fn(|i| equation.sides[side][i][p]) };
    let entries = [0, 1].into_iter().filter_map(|side| unknown[side].map(|at| (side, at)));
    for (side, at) in entries.clone() {
        for p in 0..4 {
            right[at + p] -= weight * form(&pair.2.information, column(side, p), equation.residual);
            for (other, there) in entries.clone() {
                for q in (0..4).filter(|q| there + q <= at + p) {
                    let product = form(&pair.2.information, column(side, p), column(other, q));
                    matrix.add(at + p, there + q, weight * product);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(sweep: usize) -> Motion {
        let t = sweep as f64;
        Motion {
            shift: [t.sin(), 40.0 * (0.7 * t).sin(), 25.0 * t.cos()],
            rotation_rad: 0.005 * (1.7 * t).sin(),
        }
    }

    fn pair(i: usize, j: usize, motion: Motion) -> Pair {
        let information =
            std::array::from_fn(|p| std::array::from_fn(|q| f64::from(u8::from(p == q)) * 1e3));
        (i, j, PairMotion { motion, quality: 50.0, correlation: 0.5, information })
    }

    fn pairs(sweeps: usize) -> Vec<Pair> {
        let lags = |j: usize| (j.saturating_sub(4)..j).map(move |i| (i, j));
        (1..sweeps).flat_map(lags).map(|(i, j)| pair(i, j, truth(i).to(truth(j)))).collect()
    }

    fn check(found: &[Option<Motion>], but: &[usize], tolerance: f64) {
        for (sweep, found) in found.iter().enumerate() {
            assert_eq!(found.is_none(), but.contains(&sweep), "sweep {sweep}");
            let Some(found) = found else { continue };
            let wrong = truth(0).to(truth(sweep)).to(*found);
            assert!(wrong.shift.iter().all(|s| s.abs() < tolerance), "sweep {sweep}: {wrong:?}");
        }
    }

    #[test]
    fn rotations_and_large_shifts_compose_exactly() {
        check(&solve(12, &pairs(12)), &[], 1e-9);
    }

    #[test]
    fn a_wrong_pair_counts_little() {
        let mut pairs = pairs(12);
        pairs[9].2.motion.shift[1] += 5.0;
        check(&solve(12, &pairs), &[], 0.01);
    }

    #[test]
    fn a_sweep_without_a_match_has_no_motion() {
        let mut pairs = pairs(8);
        pairs.iter_mut().filter(|p| p.0 == 5 || p.1 == 5).for_each(|p| p.2.quality = 3.0);
        check(&solve(8, &pairs), &[5], 1e-9);
        assert_eq!(solve(2, &[]), [None, None]);
    }
}
