//! Sums of products of two features at neighbouring lags, cell by cell.
//!
//! Every cell has a whole-pixel lag of its own (the guessed motion at its place), and its sum runs
//! over the same pixels of the earlier feature for all lags around it: no window, no bias towards
//! zero.

use super::feature::SCALE;
use super::motion::Motion;
use super::plan::{BORDER, Plan};
use rayon::prelude::*;
use std::ops::Range;

/// Lags on either side of a cell's own.
pub const REACH: usize = 2;
/// Lags along an axis.
pub const SIDE: usize = 2 * REACH + 1;
/// Fewest pixels a cell has along an axis.
const LEAST: usize = 8;
/// Depths that are summed by one task.
const TASK: usize = 8;

/// A value per lag (z, y, x).
pub type Cube = [f64; SIDE * SIDE * SIDE];

/// A feature, or what will become one.
#[derive(Clone, Copy)]
pub struct Side<'a> {
    pub first: usize,
    pub blocks: &'a [Vec<i16>],
    pub energy: &'a [f64],
}

/// Sums of products of one cell.
pub struct Cell {
    /// Σ earlier(x) later(x + lag + l) in units of the features' variance, l = −2 … 2 along every
    /// axis.
    pub cube: Cube,
    /// The cell's whole-pixel lag.
    pub lag: [i64; 3],
    /// Its middle, from the image centre (y, x).
    pub middle: [f64; 2],
    /// Lateral pixels.
    pub area: f64,
    /// Energy of the earlier and of the later side.
    pub energy: [f64; 2],
    /// Σ of the products of both energies.
    pub product: f64,
}

/// Where a cell is summed.
struct Region {
    block: usize,
    lag: [i64; 3],
    /// Later depth index minus earlier depth index.
    deeper: i64,
    depths: Range<usize>,
    /// Every how many depths are summed.
    step: usize,
    rows: Range<usize>,
    columns: Range<usize>,
}

/// Sums of all cells that overlap after `motion`, over every `step`-th depth.
pub fn cells(plan: &Plan, earlier: Side, later: Side, motion: Motion, step: usize) -> Vec<Cell> {
    let deeper = earlier.first as i64 - later.first as i64;
    let regions = regions(plan, deeper, step, motion);
    let tasks: Vec<(usize, Range<usize>)> = regions
        .iter()
        .enumerate()
        .flat_map(|(i, region)| {
            let Range { start, end } = region.depths;
            let task = TASK * region.step;
            (start..end).step_by(task).map(move |z| (i, z..(z + task).min(end)))
        })
        .collect();
    let parts: Vec<(usize, [i64; SIDE * SIDE * SIDE])> = tasks
        .into_par_iter()
        .map(|(i, depths)| (i, sums(plan, &regions[i], depths, earlier, later)))
        .collect();
    let mut totals = vec![[0i64; SIDE * SIDE * SIDE]; regions.len()];
    for (i, part) in parts {
        totals[i].iter_mut().zip(part).for_each(|(total, sum)| *total += sum);
    }
    regions
        .iter()
        .zip(totals)
        .map(|(region, total)| cell(plan, region, total, earlier, later))
        .collect()
}

/// The cells that still have pixels when the later feature is moved back.
fn regions(plan: &Plan, deeper: i64, step: usize, motion: Motion) -> Vec<Region> {
    let dz = motion.shift[0].round() as i64;
    let deeper = deeper + dz;
    let depths = overlap(0..plan.kept, plan.kept, 0, deeper);
    let [across, along] = plan.cells;
    let mut regions = Vec::new();
    for block in 0..plan.blocks.len() {
        for (row, column) in (0..across).flat_map(|r| (0..along).map(move |c| (r, c))) {
            let rows = row * plan.block[0] / across..(row + 1) * plan.block[0] / across;
            let columns = column * plan.block[1] / along..(column + 1) * plan.block[1] / along;
            let middle = middle(plan, block, &rows, &columns);
            let found = motion.carry(middle);
            let [dy, dx] = [0, 1].map(|i| (found[i] - middle[i]).round() as i64);
            let rows = overlap(rows, plan.block[0], BORDER, dy);
            let columns = overlap(columns, plan.block[1], BORDER, dx);
            if rows.len() >= LEAST && columns.len() >= LEAST && depths.len() >= LEAST {
                regions.push(Region {
                    block,
                    lag: [dz, dy, dx],
                    deeper,
                    depths: depths.clone(),
                    step,
                    rows,
                    columns,
                });
            }
        }
    }
    regions
}

/// The part of `range` from which every lag around `lag` stays within `border` and `size` −
/// `border`.
fn overlap(range: Range<usize>, size: usize, border: usize, lag: i64) -> Range<usize> {
    let (border, reach, size) = (border as i64, REACH as i64, size as i64);
    let start = (range.start as i64).max(border).max(border + reach - lag);
    let end = (range.end as i64).min(size - border).min(size - border - reach - lag);
    start as usize..end.max(start) as usize
}

/// Middle of a part of a block, from the image centre.
fn middle(plan: &Plan, block: usize, rows: &Range<usize>, columns: &Range<usize>) -> [f64; 2] {
    let [cy, cx] = plan.centre();
    let corner = plan.blocks[block];
    let mean = |r: &Range<usize>| (r.start + r.end) as f64 / 2.0 - 0.5;
    [corner[0] as f64 + mean(rows) - cy, corner[1] as f64 + mean(columns) - cx]
}

/// Sums over some depths of a region.
fn sums(
    plan: &Plan,
    region: &Region,
    depths: Range<usize>,
    earlier: Side,
    later: Side,
) -> [i64; SIDE * SIDE * SIDE] {
    let [rows, columns] = plan.block;
    let (a, b) = (&earlier.blocks[region.block], &later.blocks[region.block]);
    let moved = |at: usize, by: i64, l: usize| (at as i64 + by + l as i64) as usize - REACH;
    let mut total = [0i64; SIDE * SIDE * SIDE];
    for z in depths.step_by(region.step) {
        for y in region.rows.clone() {
            let ours = &a[(z * rows + y) * columns..][region.columns.clone()];
            for (l, total) in total.chunks_mut(SIDE).enumerate() {
                let z = moved(z, region.deeper, l / SIDE);
                let y = moved(y, region.lag[1], l % SIDE);
                let x = moved(region.columns.start, region.lag[2], 0);
                let theirs = &b[(z * rows + y) * columns + x..][..ours.len() + 2 * REACH];
                for (x, total) in total.iter_mut().enumerate() {
                    *total += i64::from(dot(ours, &theirs[x..]));
                }
            }
        }
    }
    total
}

/// Σ a b; the features' limit keeps a row within 32 bits.
fn dot(a: &[i16], b: &[i16]) -> i32 {
    a.iter().zip(b).map(|(&a, &b)| i32::from(a) * i32::from(b)).sum()
}

fn cell(
    plan: &Plan,
    region: &Region,
    total: [i64; SIDE * SIDE * SIDE],
    earlier: Side,
    later: Side,
) -> Cell {
    let area = (region.rows.len() * region.columns.len()) as f64;
    let pairs = region
        .depths
        .clone()
        .map(|z| (earlier.energy[z], later.energy[(z as i64 + region.deeper) as usize]));
    let (mut energy, mut product) = ([0.0; 2], 0.0);
    for (e, l) in pairs {
        energy[0] += area * e;
        energy[1] += area * l;
        product += area * e * l;
    }
    let unit = 1.0 / f64::from(SCALE * SCALE);
    Cell {
        cube: total.map(|t| t as f64 * unit),
        lag: region.lag,
        middle: middle(plan, region.block, &region.rows, &region.columns),
        area,
        energy,
        product,
    }
}
