//! The coherence of the speckle in each part of the image, which linked phases start from.
//!
//! The image is cut into tiles, a tile into square blocks of about sixteen looks, which run along an image that is
//! narrower than that. In a block the phase is nearly the same everywhere, so |C_ij|^2 of the block's mean does not depend
//! on it; for Gaussian speckle of L looks, and means over the tile's blocks and the recordings,
//!
//! S = sum of |C_ij|^2 / sum of P_i P_j = (|gamma|^2 + 1/L) / (1 + |gamma|^2/L),
//!
//! which is solved for |gamma_ij|^2. One model of Gamma is fitted to these in every tile, and what all its pixels share is
//! computed once: precision, inverse information, standard deviations.

use super::memory::STRIP_ROWS;
use super::strip::common_block;
use crate::allocate::{filled, zeros};
use crate::error::Result;
use crate::io::{Series, Shape};
use crate::lanes::{LaneTask, Lanes, Path};
use crate::looks::{Block, SpatialCoherence};
use crate::method::Plan;
use crate::progress::Progress;
use crate::series::Survey;
use num_complex::{Complex, Complex32, Complex64};
use phasewalk_core::bound::{
    information, invert_laplacian, layered_sandwich, reported_variance, sandwich, share_of_layers,
};
use phasewalk_core::closure::{Contrasts, Room};
use phasewalk_core::coherence::{Lag, Mixture};
use phasewalk_core::cross_spectrum::cross_spectrum;
use phasewalk_core::lags::Lags;
use phasewalk_core::linking::is_usable;
use phasewalk_core::model::{Buffers, Model, debias_blocks};
use phasewalk_core::reference::reference_span;
use phasewalk_core::square::Square;
use rayon::prelude::*;
use std::ops::Range;

/// Looks of a block.
const BLOCK_LOOKS: f64 = 16.0;

/// Blocks along the side of a tile: their 36 squared coherences average to 3 % of one.
const BLOCKS: usize = 6;

/// Part of its pixels that a block must have.
const FILLED: f64 = 0.5;

/// Contrasts of the closure that a pixel sums: the slowest two. More would take time in every pair of every pixel.
pub const MODES: usize = 2;

/// What is called short when memory is.
const TILES: &str = "the coherence of the image's tiles";

/// What the pixels of a tile share.
pub struct Tile {
    /// Q, N x N.
    pub precision: Vec<f32>,
    /// (F + 1 1^T / N)^-1, N x N.
    pub inverse: Vec<f32>,
    /// Standard deviation of the reported phase, rad, for the looks of the Gaussian.
    pub sigmas: Vec<f32>,
    /// s_i.
    pub quality: Vec<f64>,
    /// Whether the frame's phase is reported.
    pub usable: Vec<bool>,
    /// h(tau).
    pub mixture: Mixture<f64>,
    /// Was any coherence found?
    pub coherent: bool,
    /// 2 W_k of each pair for the closure (`phasewalk_core::closure`), N x N; empty where it is not asked for.
    pub contrasts: Vec<[f32; MODES]>,
    /// How many of them there are.
    pub modes: usize,
}

/// The image's tiles, row after row.
pub struct Tiles {
    /// First pixel row and column of each, and the image's end.
    edges: [Vec<usize>; 2],
    tiles: Vec<Tile>,
}

/// How tiles are fitted.
pub struct Fit<'a> {
    /// The frames.
    pub series: &'a dyn Series,
    /// Their usable pixels and scale.
    pub survey: &'a Survey,
    /// Depths, times, reference frames.
    pub plan: &'a Plan,
    /// How far a speckle reaches.
    pub coherence: &'a SpatialCoherence,
    /// Looks that the depths of a layer add to each pixel.
    pub looks_of_layers: f64,
    /// How many independent recordings those that there are amount to.
    pub looks_of_recordings: f64,
    /// Looks of the Gaussian that the phases are averaged with.
    pub looks: f64,
    /// Looks of the sub-windows over which each of two layers is averaged before; unused with one.
    pub window_looks: f64,
    /// Will the pixels' closure be tested?
    pub closure: bool,
    /// Vector instructions.
    pub path: Path,
}

impl<'a> Fit<'a> {
    /// That of a single depth in one recording, averaged with so many looks; the closure is not tested.
    #[must_use]
    pub const fn of_one_plane(
        series: &'a dyn Series,
        survey: &'a Survey,
        plan: &'a Plan,
        coherence: &'a SpatialCoherence,
        looks: f64,
        path: Path,
    ) -> Self {
        Self {
            series,
            survey,
            plan,
            coherence,
            looks_of_layers: 1.0,
            looks_of_recordings: 1.0,
            looks,
            window_looks: looks,
            closure: false,
            path,
        }
    }

    /// Fit all tiles; one step of progress for each row of them.
    ///
    /// # Errors
    /// What the series reports, lack of memory, or the user's interruption.
    pub fn tiles(&self, progress: &Progress) -> Result<Tiles> {
        let block = self.block();
        let edges = self.edges(&block);
        let mut tiles = Vec::new();
        for rows in edges[0].windows(2) {
            let band = Band::read(self, rows[0]..rows[1])?;
            let columns: Vec<_> = edges[1].windows(2).map(|edge| edge[0]..edge[1]).collect();
            let row: Result<Vec<Tile>> =
                columns.into_par_iter().map(|columns| self.tile(&band, &block, columns)).collect();
            tiles.extend(row?);
            progress.advance(1)?;
        }
        Ok(Tiles { edges, tiles })
    }

    /// Steps of progress that [`Self::tiles`] makes.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.edges(&self.block())[0].len() as u64 - 1
    }

    fn block(&self) -> Block {
        self.coherence.block_of_looks(BLOCK_LOOKS, self.looks_of_layers, self.series.shape())
    }

    /// Tiles of about six blocks' side, made of whole strips and whole lane blocks of every path.
    fn edges(&self, block: &Block) -> [Vec<usize>; 2] {
        let Shape { height, width, .. } = self.series.shape();
        let [rows, columns] = block.sides.map(|side| side * BLOCKS);
        [edges(height, STRIP_ROWS, rows), edges(width, common_block(width), columns)]
    }

    fn tile(&self, band: &Band, block: &Block, columns: Range<usize>) -> Result<Tile> {
        let task = TileTask { fit: self, band, block, columns };
        let squares = self.path.run(task)??;
        self.solve(squares)
    }

    /// The model of a tile and what follows from it.
    fn solve(&self, mut squares: Squares) -> Result<Tile> {
        let n = self.plan.frames();
        let mut reals = zeros(Buffers::<f64>::reals(n), TILES)?;
        let mut lags = filled(Lag { tau: 0.0, mean: 0.0, pairs: 0.0 }, n * n / 2 + 1, TILES)?;
        let mut indices = zeros(Lags::indices(n), TILES)?;
        let mut matrices: [Vec<f64>; 3] = [0; 3].map(|_| vec![0.0; n * n]);
        let [mut root, mut precision, mut inverse] =
            matrices.each_mut().map(|data| Square::new(data, n));
        let buffers = Buffers { reals: &mut reals, lags: &mut lags, indices: &mut indices };
        // The spread of a mean squared coherence is 1 / (L sqrt(blocks)).
        let blocks = squares.blocks.max(1) as f64 * self.looks_of_recordings;
        let mut model = Model::new(&self.plan.times_s, squares.looks * blocks.sqrt(), buffers);
        model.fit_blind(&Square::new(&mut squares.product, n), &mut root);
        precision.copy_from(&model.gamma);
        precision.invert();
        information(&model.gamma, &precision, &mut inverse);
        invert_laplacian(&mut inverse);
        let usable: Vec<bool> =
            (0..n).map(|i| is_usable(&model, &precision, self.looks, i)).collect();
        let counted: Vec<f64> = usable.iter().map(|&usable| f64::from(usable)).collect();
        let (contrasts, modes) = self.contrasts(&model.gamma, &counted)?;
        let single = |matrix: &Square<'_, f64>| -> Vec<f32> {
            (0..n).flat_map(|i| matrix.row(i).iter().map(|&x| x as f32)).collect()
        };
        let variances = match squares.neighbours {
            None => self.variances([&precision, &inverse, &root], &counted)?,
            Some(neighbours) => {
                self.layer_variances(&precision, &model.gamma, neighbours, &counted)?
            }
        };
        let sigma = |(&usable, &variance): (&bool, &f64)| {
            if usable { variance.sqrt() as f32 } else { f32::INFINITY }
        };
        Ok(Tile {
            sigmas: usable.iter().zip(&variances).map(sigma).collect(),
            precision: single(&precision),
            inverse: single(&inverse),
            quality: model.quality.to_vec(),
            usable,
            mixture: model.mixture,
            coherent: model.is_coherent(),
            contrasts,
            modes,
        })
    }

    /// Of one layer: the larger of the model's and the sandwich's.
    fn variances(
        &self,
        [precision, inverse, root]: [&Square<'_, f64>; 3],
        usable: &[f64],
    ) -> Result<Vec<f64>> {
        let n = self.plan.frames();
        let mut matrices = zeros(3 * n * n, TILES)?;
        let mut rest = matrices.chunks_exact_mut(n * n);
        let [mut honest, mut a, mut b] =
            [0; 3].map(|_| Square::new(rest.next().unwrap_or_default(), n));
        sandwich(precision, root, self.looks, &mut honest, &mut a, &mut b);
        let variance = |frame: usize| {
            let of = |covariance| self.reported(covariance, usable, frame);
            (of(inverse) * 0.5 / self.looks).max(of(&honest))
        };
        Ok((0..n).map(variance).collect())
    }

    /// Of the difference of two layers: both layers' noise.
    fn layer_variances(
        &self,
        precision: &Square<'_, f64>,
        gamma: &Square<'_, f64>,
        neighbours: [f64; 2],
        usable: &[f64],
    ) -> Result<Vec<f64>> {
        let n = self.plan.frames();
        let mut matrices = zeros(5 * n * n, TILES)?;
        let mut rest = matrices.chunks_exact_mut(n * n);
        let [mut out, mut a, mut b, mut seen, mut own] =
            [0; 5].map(|_| Square::new(rest.next().unwrap_or_default(), n));
        let (share, looks) = (share_of_layers(neighbours), [self.looks, self.window_looks]);
        let scratch = [&mut a, &mut b, &mut seen, &mut own];
        layered_sandwich(precision, gamma, share, looks, &mut out, scratch);
        Ok((0..n).map(|frame| self.reported(&out, usable, frame)).collect())
    }

    fn reported(&self, covariance: &Square<'_, f64>, usable: &[f64], frame: usize) -> f64 {
        let references = reference_span(usable, self.plan.params.reference_frames);
        reported_variance(covariance, usable, references, frame)
    }

    /// 2 W_k, as each pair is met once, and how many there are.
    fn contrasts(
        &self,
        gamma: &Square<'_, f64>,
        usable: &[f64],
    ) -> Result<(Vec<[f32; MODES]>, usize)> {
        if !self.closure {
            return Ok((Vec::new(), 0));
        }
        let n = self.plan.frames();
        let mut matrices = zeros(5 * n * n, TILES)?;
        let mut rest = matrices.chunks_exact_mut(n * n);
        let squares = [0; 5].map(|_| Square::new(rest.next().unwrap_or_default(), n));
        let mut reals = zeros(Room::<f64>::reals(n), TILES)?;
        let room = Room { squares, reals: &mut reals };
        let mut contrasts = Contrasts::new(gamma, usable, self.looks, room);
        let mut all = filled([0.0; MODES], n * n, TILES)?;
        let modes = contrasts.modes().min(MODES);
        for k in 0..modes {
            let weights = contrasts.weights(k);
            for (i, row) in all.chunks_exact_mut(n).enumerate() {
                for (place, &w) in row.iter_mut().zip(weights.row(i)) {
                    place[k] = 2.0 * w as f32;
                }
            }
        }
        Ok((all, modes))
    }
}

impl Tiles {
    /// The tile that a pixel lies in.
    #[must_use]
    pub fn at(&self, y: usize, x: usize) -> &Tile {
        let [rows, columns] = &self.edges;
        let within = |edges: &[usize], place: usize| {
            edges.partition_point(|&edge| edge <= place).clamp(1, edges.len() - 1) - 1
        };
        &self.tiles[within(rows, y) * (columns.len() - 1) + within(columns, x)]
    }

    /// The columns of each tile of a row of them.
    pub fn columns(&self) -> impl Iterator<Item = Range<usize>> {
        self.edges[1].windows(2).map(|ends| ends[0]..ends[1])
    }

    /// An image, (y, x), in which each pixel has the value of its tile.
    #[must_use]
    pub fn image(&self, value: impl Fn(&Tile) -> f32) -> Vec<f32> {
        let [rows, columns] = &self.edges;
        let lengths = |edges: &[usize]| -> Vec<usize> {
            edges.windows(2).map(|ends| ends[1] - ends[0]).collect()
        };
        let (heights, widths) = (lengths(rows), lengths(columns));
        let mut image = Vec::new();
        for (height, tiles) in heights.into_iter().zip(self.tiles.chunks(widths.len().max(1))) {
            let values = tiles.iter().map(&value).zip(&widths);
            let line: Vec<f32> =
                values.flat_map(|(v, &width)| std::iter::repeat_n(v, width)).collect();
            image.extend(std::iter::repeat_n(line, height).flatten());
        }
        image
    }

    /// Has a frame a phase in any tile?
    #[must_use]
    pub fn is_usable(&self, frame: usize) -> bool {
        self.tiles.iter().any(|tile| tile.usable.get(frame) == Some(&true))
    }

    /// Bytes of all tiles.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let of = |tile: &Tile| 8 * tile.precision.len() + size_of_val(&tile.contrasts[..]);
        self.tiles.iter().map(|tile| of(tile) as u64).sum()
    }

    /// Is the closure of the pixels tested?
    #[must_use]
    pub fn test_closure(&self) -> bool {
        self.tiles.iter().any(|tile| !tile.contrasts.is_empty())
    }

    /// First pixel rows and first columns of the tiles.
    #[must_use]
    pub fn origins(&self) -> [&[usize]; 2] {
        self.edges.each_ref().map(|edges| edges.split_last().map_or(&[][..], |(_, first)| first))
    }

    /// s_i of every tile, (time, row of tiles, column of tiles).
    #[must_use]
    pub fn quality(&self) -> Vec<f32> {
        let frames = self.tiles.first().map_or(0, |tile| tile.quality.len());
        let image = |frame: usize| self.tiles.iter().map(move |tile| tile.quality[frame] as f32);
        (0..frames).flat_map(image).collect()
    }
}

/// 0, then multiples of `unit` about `wanted` apart, then `length`; what is left over at the end joins the last one
/// if it is less than half of it.
fn edges(length: usize, unit: usize, wanted: usize) -> Vec<usize> {
    let step = unit * ((wanted as f64 / unit as f64).round() as usize).max(1);
    let mut edges: Vec<usize> = (0..length).step_by(step).collect();
    if edges.len() > 1 && length - edges[edges.len() - 1] < step / 2 {
        edges.pop();
    }
    edges.push(length);
    edges
}

/// The rows of one row of tiles: all frames and depths.
struct Band {
    /// (frame, depth, row, x).
    fields: Vec<Complex32>,
    /// First row.
    rows: Range<usize>,
}

impl Band {
    fn read(fit: &Fit<'_>, rows: Range<usize>) -> Result<Self> {
        let Shape { frames, width, .. } = fit.series.shape();
        let depths = fit.plan.depths.all();
        let plane = rows.len() * width;
        let mut fields = zeros(frames * depths.len() * plane, TILES)?;
        let mut planes = fields.chunks_exact_mut(plane);
        for frame in 0..frames {
            for (&depth, plane) in depths.iter().zip(&mut planes) {
                fit.series.read_rows(frame, depth, rows.clone(), plane)?;
            }
        }
        Ok(Self { fields, rows })
    }
}

/// Mean squared coherences of a tile.
struct Squares {
    /// Of one layer, or the product of those of two, N x N.
    product: Vec<f64>,
    /// Of each of two layers, in neighbouring frames.
    neighbours: Option<[f64; 2]>,
    /// Over how many blocks.
    blocks: usize,
    /// Looks of a block.
    looks: f64,
}

/// How full a tile's blocks are: at its ends and where pixels are missing they have fewer looks.
#[derive(Default)]
struct Filling {
    blocks: usize,
    /// Sum of n, the pixels of a block, and of n^2.
    pixels: f64,
    squares: f64,
}

impl Filling {
    fn add(&mut self, pixels: usize) {
        self.blocks += 1;
        self.pixels += pixels as f64;
        self.squares += (pixels as f64).powi(2);
    }

    /// 1 / (mean of 1/L) with the weights n^2 that blocks have in the sums, L being proportional to n.
    fn looks(&self, block: &Block) -> f64 {
        let filled = self.squares / (self.pixels * block.pixels() as f64);
        block.looks * if filled > 0.0 { filled } else { 1.0 }
    }
}

/// Finds the mean squared coherences of a tile.
struct TileTask<'a> {
    fit: &'a Fit<'a>,
    band: &'a Band,
    block: &'a Block,
    columns: Range<usize>,
}

impl LaneTask for TileTask<'_> {
    type Output = Result<Squares>;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> Result<Squares> {
        let n = self.fit.plan.frames();
        let planes = &self.fit.plan.depths;
        let recordings = planes.layers();
        let mut sums = vec![Sums::new(n)?; if planes.has_two_layers() { 2 } else { 1 }];
        let mut filling = Filling::default();
        let [tall, wide] = self.block.sides;
        for y in self.band.rows.clone().step_by(tall) {
            for x in self.columns.clone().step_by(wide) {
                let pixels = self.pixels(y, x);
                if (pixels.len() as f64) < FILLED * self.block.pixels() as f64 {
                    continue;
                }
                filling.add(pixels.len());
                // Further recordings are further blocks: the bulk of each may move in its own way.
                for layers in &recordings {
                    for (sums, layer) in sums.iter_mut().zip(layers.both()) {
                        sums.add(&self.gather::<L>(&pixels, layer), n);
                    }
                }
            }
        }
        let looks = filling.looks(self.block);
        let layers: Vec<Vec<f64>> = sums.iter().map(|sums| sums.squares(looks, n)).collect();
        let neighbours = |layer: &Vec<f64>| {
            let of = |t: usize| layer[t * n + t + 1];
            (0..n - 1).map(of).sum::<f64>() / (n - 1) as f64
        };
        let product = |place: usize| layers.iter().map(|layer| layer[place]).product();
        Ok(Squares {
            product: (0..n * n).map(product).collect(),
            neighbours: match &layers[..] {
                [first, second] => Some([neighbours(first), neighbours(second)]),
                _ => None,
            },
            blocks: filling.blocks,
            looks,
        })
    }
}

impl TileTask<'_> {
    /// Places in the band's planes of the usable pixels of the block at (y, x).
    fn pixels(&self, y: usize, x: usize) -> Vec<usize> {
        let Shape { width, .. } = self.fit.series.shape();
        let valid = &self.fit.survey.valid;
        let [tall, wide] = self.block.sides;
        let rows = y..(y + tall).min(self.band.rows.end);
        let columns = x..(x + wide).min(self.columns.end);
        let all = rows.flat_map(|y| columns.clone().map(move |x| (y, x)));
        all.filter(|&(y, x)| valid[y * width + x])
            .map(|(y, x)| (y - self.band.rows.start) * width + x)
            .collect()
    }

    /// The block's fields, (frame, vector), its pixels and depths side by side in lanes.
    #[inline(always)]
    fn gather<L: Lanes<Element = f32>>(
        &self,
        pixels: &[usize],
        layer: Range<usize>,
    ) -> Vec<Complex<L>> {
        let Shape { width, .. } = self.fit.series.shape();
        let depths = self.fit.plan.depths.all().len();
        let plane = self.band.rows.len() * width;
        let vectors = (pixels.len() * layer.len()).div_ceil(L::WIDTH);
        let zero = Complex { re: L::zero(), im: L::zero() };
        let mut fields = vec![zero; self.fit.plan.frames() * vectors];
        let scale = self.fit.survey.scale;
        for (frame, target) in fields.chunks_exact_mut(vectors).enumerate() {
            let places = layer.clone().flat_map(|z| pixels.iter().map(move |&pixel| (z, pixel)));
            for (i, (z, pixel)) in places.enumerate() {
                let u = self.band.fields[(frame * depths + z) * plane + pixel] * scale;
                let vector = &mut target[i / L::WIDTH];
                L::flat_mut(std::slice::from_mut(&mut vector.re))[i % L::WIDTH] = u.re;
                L::flat_mut(std::slice::from_mut(&mut vector.im))[i % L::WIDTH] = u.im;
            }
        }
        fields
    }
}

/// Sums over blocks: |C_ij|^2 and P_i P_j of pairs j <= i.
#[derive(Clone)]
struct Sums {
    squares: Vec<f64>,
    powers: Vec<f64>,
}

impl Sums {
    fn new(n: usize) -> Result<Self> {
        Ok(Self { squares: zeros(n * n, TILES)?, powers: zeros(n * n, TILES)? })
    }

    /// A block's fields, (frame, vector).
    #[inline(always)]
    fn add<L: Lanes<Element = f32>>(&mut self, fields: &[Complex<L>], n: usize) {
        let vectors = fields.len() / n.max(1);
        let frame = |i: usize| &fields[i * vectors..][..vectors];
        let powers: Vec<f64> = (0..n).map(|i| total(frame(i), frame(i)).re).collect();
        for i in 0..n {
            for j in 0..i {
                self.squares[i * n + j] += total(frame(i), frame(j)).norm_sqr();
                self.powers[i * n + j] += powers[i] * powers[j];
            }
        }
    }

    /// |gamma_ij|^2, N x N, 1 on the diagonal.
    fn squares(&self, looks: f64, n: usize) -> Vec<f64> {
        let square = |i: usize, j: usize| {
            let (i, j) = (i.max(j), i.min(j));
            let power = self.powers[i * n + j];
            if i == j {
                1.0
            } else if power > 0.0 {
                debias_blocks(self.squares[i * n + j] / power, looks)
            } else {
                0.0
            }
        };
        (0..n * n).map(|place| square(place / n, place % n)).collect()
    }
}

/// Sum of u conj v over all lanes.
#[inline(always)]
fn total<L: Lanes<Element = f32>>(u: &[Complex<L>], v: &[Complex<L>]) -> Complex64 {
    let (mut re, mut im) = (L::zero(), L::zero());
    for (&u, &v) in u.iter().zip(v) {
        let c = cross_spectrum(u, v);
        re += c.re;
        im += c.im;
    }
    let sum = |x: L| L::flat(&[x]).iter().map(|&lane| f64::from(lane)).sum();
    Complex64 { re: sum(re), im: sum(im) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_block_has_half_the_looks() {
        let block = Block { sides: [4, 5], looks: 16.0 };
        let looks = |pixels: &[usize]| {
            let mut filling = Filling::default();
            pixels.iter().for_each(|&n| filling.add(n));
            filling.looks(&block)
        };
        assert_eq!(looks(&[]), 16.0);
        assert_eq!(looks(&[20, 20]), 16.0);
        assert_eq!(looks(&[10, 10, 10]), 8.0);
        // 1/L = (4/16 + 1/8) / (4 + 1) of blocks that weigh 4 and 1.
        assert!((looks(&[20, 10]) - 40.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn tiles_are_whole_strips_and_blocks() {
        assert_eq!(edges(368, 16, 54), [0, 48, 96, 144, 192, 240, 288, 336, 368]);
        assert_eq!(edges(640, common_block(640), 54)[..3], [0, 80, 160]);
        assert_eq!(edges(13, 16, 54), [0, 13]);
        assert_eq!(edges(53, common_block(53), 18), [0, 16, 32, 53]);
    }
}
