//! Shift and rotation in one fit to the correlations of all cells.
//!
//! J(p) = Σ_cells Σ_lags C(lag) K(lag − u(p)) is maximised over p = (dz, dy, dx, angle), where u is
//! the cell's displacement by p. No cell needs a peak of its own, so that weak pairs do as well as
//! they can.

use super::banded::Banded;
use super::kernel::weights;
use super::lags::{Cell, Cube, REACH, SIDE};
use super::motion::{Motion, rotate};

/// Steps of the maximisation; it converges quadratically.
const STEPS: usize = 20;
/// The maximum is found when a step moves no pixel by more, px.
const CLOSE: f64 = 1e-5;
/// Pixels that an angle is worth in the damping.
const ARM: f64 = 50.0;

/// Value, gradient and curvature of J.
pub struct Peak {
    pub value: f64,
    gradient: [f64; 4],
    curvature: [[f64; 4]; 4],
}

/// Displacement of a cell by `motion` beyond its own lag.
pub fn beyond(cell: &Cell, motion: Motion) -> [f64; 3] {
    let found = motion.carry(cell.middle);
    [
        motion.shift[0] - cell.lag[0] as f64,
        found[0] - cell.middle[0] - cell.lag[1] as f64,
        found[1] - cell.middle[1] - cell.lag[2] as f64,
    ]
}

/// Derivatives of a cell's displacement (z, y, x) with respect to (dz, dy, dx, angle).
pub fn slopes(cell: &Cell, motion: Motion) -> [[f64; 4]; 3] {
    let [y, x] = rotate(motion.rotation_rad, cell.middle);
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, x], [0.0, 0.0, 1.0, -y]]
}

/// The motion at the maximum next to `start` and J there.
pub fn maximise(cells: &[Cell], start: Motion) -> (Motion, Peak) {
    let cells: Vec<(&Cell, Cube)> = cells.iter().map(|c| (c, without_pedestal(&c.cube))).collect();
    let mut motion = coarse(&cells, start);
    let mut peak = evaluate(&cells, motion);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let Some(step) = step(&peak, damping) else {
            damping *= 10.0;
            continue;
        };
        let next = moved(motion, step);
        let there = evaluate(&cells, next);
        if there.value >= peak.value {
            (motion, peak) = (next, there);
            damping *= 0.1;
            if step.iter().zip([1.0, 1.0, 1.0, ARM]).all(|(s, arm)| (s * arm).abs() < CLOSE) {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
    (motion, peak)
}

fn moved(motion: Motion, step: [f64; 4]) -> Motion {
    Motion {
        shift: std::array::from_fn(|i| motion.shift[i] + step[i]),
        rotation_rad: motion.rotation_rad + step[3],
    }
}

/// The cube without its mean.
fn without_pedestal(cube: &Cube) -> Cube {
    let mean = cube.iter().sum::<f64>() / cube.len() as f64;
    cube.map(|c| c - mean)
}

/// `start` moved to the whole-pixel lag where the sum over the cells is largest.
fn coarse(cells: &[(&Cell, Cube)], start: Motion) -> Motion {
    let shifted = |l: usize| {
        let step = [l / (SIDE * SIDE), l / SIDE % SIDE, l % SIDE].map(|i| i as f64 - REACH as f64);
        moved(start, [step[0], step[1], step[2], 0.0])
    };
    (0..SIDE * SIDE * SIDE)
        .map(shifted)
        .max_by(|&a, &b| evaluate(cells, a).value.total_cmp(&evaluate(cells, b).value))
        .unwrap_or(start)
}

fn evaluate(cells: &[(&Cell, Cube)], motion: Motion) -> Peak {
    let mut sum = Peak { value: 0.0, gradient: [0.0; 4], curvature: [[0.0; 4]; 4] };
    for (cell, cube) in cells {
        let (value, gradient, curvature) = local(cube, beyond(cell, motion));
        let slopes = slopes(cell, motion);
        sum.value += value;
        for p in 0..4 {
            sum.gradient[p] += (0..3).map(|i| slopes[i][p] * gradient[i]).sum::<f64>();
            for q in 0..4 {
                for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
                    sum.curvature[p][q] += slopes[i][p] * curvature[i][j] * slopes[j][q];
                }
            }
        }
    }
    sum
}

/// J of one cell with its derivatives with respect to the displacement `u`.
fn local(cube: &Cube, u: [f64; 3]) -> (f64, [f64; 3], [[f64; 3]; 3]) {
    let k: [_; 3] = std::array::from_fn(|axis| weights(axis, u[axis]));
    // Contracted along x, then y, then z; orders of derivatives add up to two.
    let mut value = [[[0.0; 3]; 3]; 3];
    for z in 0..SIDE {
        let mut plane = [[0.0; 3]; 3];
        for y in 0..SIDE {
            let row = &cube[(z * SIDE + y) * SIDE..][..SIDE];
            for dx in 0..3 {
                let sum: f64 = row.iter().zip(&k[2]).map(|(c, k)| c * k[dx]).sum();
                (0..3).for_each(|dy| plane[dy][dx] += sum * k[1][y][dy]);
            }
        }
        for (dz, dy, dx) in orders() {
            value[dz][dy][dx] += plane[dy][dx] * k[0][z][dz];
        }
    }
    let [zz, yy, xx] = [value[2][0][0], value[0][2][0], value[0][0][2]];
    let [zy, zx, yx] = [value[1][1][0], value[1][0][1], value[0][1][1]];
    let gradient = [value[1][0][0], value[0][1][0], value[0][0][1]];
    (value[0][0][0], gradient, [[zz, zy, zx], [zy, yy, yx], [zx, yx, xx]])
}

/// Orders of derivatives (z, y, x) up to two in all.
fn orders() -> impl Iterator<Item = (usize, usize, usize)> {
    (0..27).map(|i| (i / 9, i / 3 % 3, i % 3)).filter(|(z, y, x)| z + y + x <= 2)
}

/// Newton's step, damped; none when J is not concave enough.
fn step(peak: &Peak, damping: f64) -> Option<[f64; 4]> {
    let mut matrix = Banded::new(4, 3);
    for p in 0..4 {
        for q in 0..=p {
            matrix.add(p, q, -peak.curvature[p][q]);
        }
        let arm = if p == 3 { ARM * ARM } else { 1.0 };
        matrix.add(p, p, damping * arm * peak.value.abs());
    }
    let solution = matrix.solve(&peak.gradient)?;
    solution.try_into().ok()
}
