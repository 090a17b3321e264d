//! The coarse surface that all structure follows: tilt, curvature and what is left of each tile.
//!
//! Tiles of the field average the speckle. A second-order surface is searched that makes the mean
//! A-line along it sharpest (largest sum of squares), then every tile is lined up with that mean.

use super::lateral;
use super::volume::Volume;
use crate::reconstruct::quantile::quantile;
use rayon::prelude::*;

/// Tiles across the shorter side, and limits of their size in pixels.
const TILES: usize = 8;
const TILE_PX: (usize, usize) = (4, 16);
/// Tilts tried, in pixels from the centre to the edge, and their step.
const LARGEST_TILT: i32 = 20;
const TILT_STEP: i32 = 2;
/// Steps of the refinement in pixels.
const STEPS: [f64; 5] = [2.0, 1.0, 0.5, 0.25, 0.125];
/// Sweeps over all terms per step at most.
const ROUNDS: usize = 8;
/// Starting points refined.
const STARTS: usize = 4;
/// Largest remaining shift of a tile and its step in pixels.
const TILE_SHIFT: f64 = 4.0;
const TILE_STEP: f64 = 0.5;
/// Tiles over which the remaining shift is smooth.
const TILE_SIGMA: f64 = 1.0;
/// How often the tiles are lined up with their mean.
const TILE_ROUNDS: usize = 3;

/// Terms of the surface over u, v in −1 ..= 1: v, u, v² − 1/3, u² − 1/3, u v.
type Terms = [f64; 5];

/// Mean A-lines of tiles of the field.
pub(super) struct Tiles {
    /// Square root of the intensity above the floor, shape (tile, depth).
    lines: Vec<f32>,
    depths: usize,
    tile_rows: usize,
    tile_columns: usize,
    rows: usize,
    columns: usize,
}

impl Tiles {
    /// Averages `volume` in tiles.
    pub fn new(volume: Volume) -> Self {
        let short = volume.rows.min(volume.columns);
        let side = (short / TILES).clamp(TILE_PX.0, TILE_PX.1);
        let (tile_rows, tile_columns) =
            ((volume.rows / side).max(1), (volume.columns / side).max(1));
        let planes: Vec<Vec<f32>> = (0..volume.depths)
            .into_par_iter()
            .map(|z| tile_means(volume, z, tile_rows, tile_columns))
            .collect();
        let all = planes.iter().flatten().map(|&value| f64::from(value));
        let floor = quantile(all, 0.1) as f32;
        let tiles = tile_rows * tile_columns;
        let lines = (0..tiles)
            .flat_map(|tile| planes.iter().map(move |plane| (plane[tile] - floor).max(0.0).sqrt()))
            .collect();
        let (rows, columns) = (volume.rows, volume.columns);
        Self { lines, depths: volume.depths, tile_rows, tile_columns, rows, columns }
    }

    fn count(&self) -> usize {
        self.tile_rows * self.tile_columns
    }

    fn line(&self, tile: usize) -> &[f32] {
        &self.lines[tile * self.depths..][..self.depths]
    }

    /// Field coordinates u, v of the middle of a tile.
    fn middle(&self, tile: usize) -> (f64, f64) {
        let along = |at: usize, count: usize| (2 * at + 1) as f64 / count as f64 - 1.0;
        (
            along(tile % self.tile_columns, self.tile_columns),
            along(tile / self.tile_columns, self.tile_rows),
        )
    }

    /// Mean of all tiles, each shifted by its own amount (linear interpolation, zero outside).
    fn mean_line(&self, shifts: &[f64]) -> Vec<f32> {
        let mut mean = vec![0.0; self.depths];
        for (tile, &shift) in shifts.iter().enumerate() {
            add_shifted(&mut mean, self.line(tile), shift);
        }
        mean.iter_mut().for_each(|value| *value /= self.count() as f32);
        mean
    }

    fn shifts(&self, terms: &Terms) -> Vec<f64> {
        (0..self.count())
            .map(|tile| {
                let (u, v) = self.middle(tile);
                surface(terms, u, v)
            })
            .collect()
    }

    /// Sum of squares of the mean line along a surface.
    fn sharpness(&self, terms: &Terms) -> f64 {
        let line = self.mean_line(&self.shifts(terms));
        line.iter().map(|&value| f64::from(value).powi(2)).sum()
    }

    /// The second-order surface with the sharpest mean line.
    pub fn second_order(&self) -> Terms {
        let tilts: Vec<i32> = (-LARGEST_TILT..=LARGEST_TILT).step_by(TILT_STEP as usize).collect();
        let mut grid: Vec<(f64, Terms)> = tilts
            .par_iter()
            .flat_map_iter(|&v| tilts.iter().map(move |&u| [f64::from(v), f64::from(u)]))
            .map(|[v, u]| {
                let terms = [v, u, 0.0, 0.0, 0.0];
                (self.sharpness(&terms), terms)
            })
            .collect();
        grid.sort_by(|a, b| b.0.total_cmp(&a.0));
        let refined: Vec<(f64, Terms)> =
            grid.par_iter().take(STARTS).map(|&(value, terms)| self.climb(value, terms)).collect();
        let best = refined.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or([0.0; 5], |(_, terms)| terms)
    }

    /// Improves one term after the other with ever smaller steps.
    fn climb(&self, mut value: f64, mut terms: Terms) -> (f64, Terms) {
        for step in STEPS {
            for _ in 0..ROUNDS {
                let before = value;
                for term in 0..terms.len() {
                    for sign in [-step, step] {
                        let mut trial = terms;
                        trial[term] += sign;
                        let sharpness = self.sharpness(&trial);
                        if sharpness > value {
                            (value, terms) = (sharpness, trial);
                        }
                    }
                }
                if value <= before {
                    break;
                }
            }
        }
        (value, terms)
    }

    /// What is left of each tile's shift after `terms`, smooth over the tiles.
    pub fn remainders(&self, terms: &Terms) -> Vec<f32> {
        let base = self.shifts(terms);
        let mut rest = vec![0.0_f32; self.count()];
        let steps = (2.0 * TILE_SHIFT / TILE_STEP) as usize + 1;
        for _ in 0..TILE_ROUNDS {
            let shifts: Vec<f64> =
                base.iter().zip(&rest).map(|(base, rest)| base + f64::from(*rest)).collect();
            let mean = self.mean_line(&shifts);
            let middle = mean.iter().sum::<f32>() / mean.len().max(1) as f32;
            let pattern: Vec<f32> = mean.iter().map(|value| value - middle).collect();
            let mut match_at: Vec<f32> = (0..self.count())
                .into_par_iter()
                .flat_map_iter(|tile| {
                    let (line, base, pattern) = (self.line(tile), base[tile], &pattern);
                    (0..steps).map(move |step| {
                        let shift = base + step as f64 * TILE_STEP - TILE_SHIFT;
                        correlation(line, pattern, shift)
                    })
                })
                .collect();
            lateral::smooth(&mut match_at, self.tile_rows, self.tile_columns, TILE_SIGMA);
            for (rest, curve) in rest.iter_mut().zip(match_at.chunks_exact(steps)) {
                *rest = (highest(curve) * TILE_STEP - TILE_SHIFT) as f32;
            }
            lateral::smooth(&mut rest, self.tile_rows, self.tile_columns, TILE_SIGMA);
        }
        rest
    }

    /// The surface for every A-line, shape (y, x): 0 on the mean; without `remainders` a smooth one.
    pub fn surface(&self, terms: &Terms, remainders: &[f32]) -> Vec<f32> {
        (0..self.rows * self.columns)
            .into_par_iter()
            .map(|at| {
                let (y, x) = ((at / self.columns) as f64, (at % self.columns) as f64);
                let along = |at: f64, count: usize| (2.0 * at + 1.0) / count as f64 - 1.0;
                let (u, v) = (along(x, self.columns), along(y, self.rows));
                (surface(terms, u, v) + self.between(remainders, u, v)) as f32
            })
            .collect()
    }

    /// Bilinear interpolation between the middles of the tiles.
    fn between(&self, map: &[f32], u: f64, v: f64) -> f64 {
        if map.is_empty() {
            return 0.0;
        }
        let place = |along: f64, count: usize| {
            let at = (0.5 * (along + 1.0) * count as f64 - 0.5).clamp(0.0, count as f64 - 1.0);
            let low = (at as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), at - low as f64)
        };
        let (x0, x1, x) = place(u, self.tile_columns);
        let (y0, y1, y) = place(v, self.tile_rows);
        let value = |y: usize, x: usize| f64::from(map[y * self.tile_columns + x]);
        (1.0 - y) * ((1.0 - x) * value(y0, x0) + x * value(y0, x1))
            + y * ((1.0 - x) * value(y1, x0) + x * value(y1, x1))
    }
}

fn surface(terms: &Terms, u: f64, v: f64) -> f64 {
    let third = 1.0 / 3.0;
    terms[0] * v
        + terms[1] * u
        + terms[2] * (v * v - third)
        + terms[3] * (u * u - third)
        + terms[4] * u * v
}

fn tile_means(volume: Volume, z: usize, tile_rows: usize, tile_columns: usize) -> Vec<f32> {
    let mut sums = vec![0.0_f32; tile_rows * tile_columns];
    let mut counts = vec![0.0_f32; tile_rows * tile_columns];
    for y in 0..volume.rows {
        let row = volume.row(z, y);
        let from = (y * tile_rows / volume.rows) * tile_columns;
        for tile in 0..tile_columns {
            // The pixels x with x·tiles / columns = tile.
            let edge = |tile: usize| (tile * volume.columns).div_ceil(tile_columns);
            let part = &row[edge(tile)..edge(tile + 1)];
            sums[from + tile] += part.iter().sum::<f32>();
            counts[from + tile] += part.len() as f32;
        }
    }
    sums.iter().zip(counts).map(|(sum, count)| sum / count.max(1.0)).collect()
}

/// The places z for which z + shift lies inside, the place that the first of them comes from, and the
/// fractional part of the shift; none for a shift beyond the line.
fn overlap(shift: f64, depths: usize) -> Option<(std::ops::Range<usize>, usize, f32)> {
    let (whole, depths) = (shift.floor() as i64, depths as i64);
    if whole.abs() >= depths {
        return None;
    }
    let low = (-whole).max(0);
    let high = (depths - 1 - whole).clamp(low, depths);
    let inside = low as usize..high as usize;
    Some((inside, (low + whole) as usize, (shift - shift.floor()) as f32))
}

/// sum(z) += line(z + shift).
fn add_shifted(sum: &mut [f32], line: &[f32], shift: f64) {
    let Some((inside, from, part)) = overlap(shift, line.len()) else { return };
    let sum = &mut sum[inside];
    let (low, high) = (&line[from..], &line[(from + 1).min(line.len())..]);
    for ((sum, low), high) in sum.iter_mut().zip(low).zip(high) {
        *sum += low + part * (high - low);
    }
}

/// Sum over z of line(z + shift) pattern(z).
fn correlation(line: &[f32], pattern: &[f32], shift: f64) -> f32 {
    let Some((inside, from, part)) = overlap(shift, line.len()) else { return 0.0 };
    let (low, high) = (&line[from..], &line[(from + 1).min(line.len())..]);
    let pairs = low.iter().zip(high).map(|(low, high)| low + part * (high - low));
    pattern[inside].iter().zip(pairs).map(|(pattern, value)| pattern * value).sum()
}

/// Sub-sample place of the highest value.
pub(super) fn highest(curve: &[f32]) -> f64 {
    let best = (0..curve.len()).max_by(|&a, &b| curve[a].total_cmp(&curve[b])).unwrap_or(0);
    best as f64 + vertex(curve, best)
}

/// Where the parabola through three values around `at` is highest, −0.5 ..= 0.5; 0 at the ends.
pub(super) fn vertex(curve: &[f32], at: usize) -> f64 {
    if at == 0 || at + 1 >= curve.len() {
        return 0.0;
    }
    let [a, b, c] = [curve[at - 1], curve[at], curve[at + 1]].map(f64::from);
    let bend = a - 2.0 * b + c;
    if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_beyond_the_line_take_nothing() {
        let line: Vec<f32> = (0..32_u8).map(f32::from).collect();
        for shift in [-1e3, -33.0, -32.0, 32.0, 32.5, 35.0, 1e3] {
            let mut sum = vec![0.0; 32];
            add_shifted(&mut sum, &line, shift);
            assert!(sum.iter().all(|&s| s == 0.0), "{shift}");
            assert_eq!(correlation(&line, &line, shift), 0.0);
        }
        let mut sum = vec![0.0; 32];
        add_shifted(&mut sum, &line, 2.5);
        assert_eq!((sum[0], sum[28], sum[29]), (2.5, 30.5, 0.0));
        let mut sum = vec![0.0; 32];
        add_shifted(&mut sum, &line, -31.0);
        assert_eq!((sum[30], sum[31]), (0.0, 0.0));
    }
}
