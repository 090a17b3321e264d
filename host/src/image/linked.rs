//! One thread's way through the strips with linked phases: frame by frame the pairs with all earlier frames are
//! filtered, the frame's phasor is walked from the nearest ones, and the residuals of all enter the score; one step of scoring
//! at the end. No pair is kept beyond its frame. Where the closure is tested, the residuals enter its contrasts
//! (`phasewalk_core::closure`) on the way: they see no change of the phases, so the last step does not matter to them.

pub(super) mod stages;

use super::fields::{self, Fields};
use super::filter::{Pair, Passes, Source};
use super::fir::Sink;
use super::kernel::Kernel;
use super::strip::{Columns, Layout};
use super::tiles::{MODES, Tile, Tiles};
use super::turns::Turns;
use super::unwrapping::Unwrapping;
use super::worker::{STRIPS, blank_unusable, put, unload};
use super::{Doubts, Gaps, Run, StripResult};
use crate::allocate::filled;
use crate::error::Result;
use crate::io::Shape;
use crate::lanes::Lanes;
use crate::planes::Layers;
use crate::series::Survey;
use num_complex::Complex;
use phasewalk_core::closure::{KNOWN, tail};
use phasewalk_core::layers::layer_difference;
use phasewalk_core::linking::{START_FRAMES, residual, start_phasor, turn};
use std::ops::Range;

/// Layouts and kernels of the averages: of two layers each is averaged over sub-windows before they are multiplied.
pub struct Stages {
    /// The average of the product, or of the one layer.
    whole: Kernel,
    /// The sub-window of two layers.
    window: Option<Kernel>,
}

impl Stages {
    /// For one layer the Gaussian as asked for; for two the average of the products has half its variance.
    ///
    /// # Errors
    /// When sigma does not fit the image.
    pub fn new(run: &super::ImageJob<'_>, kernel: &Kernel) -> Result<Self> {
        if !run.plan.depths.has_two_layers() {
            return Ok(Self { whole: kernel.clone(), window: None });
        }
        let half = window_kernel(kernel, run.double)?;
        Ok(Self { whole: half.clone(), window: Some(half) })
    }

    /// Rows of halo that both need.
    pub fn halo(&self) -> usize {
        self.whole.radius() + self.window.as_ref().map_or(0, Kernel::radius)
    }
}

/// The sub-window of two layers: a Gaussian of half the variance.
///
/// # Errors
/// When sigma does not fit the image.
pub fn window_kernel(kernel: &Kernel, double: bool) -> Result<Kernel> {
    Kernel::new(kernel.sigma_px * 0.5_f64.sqrt(), kernel.height, kernel.width, double)
}

/// Bytes of one thread with strips of `rows` rows.
pub fn bytes<L: Lanes>(job: &super::ImageJob<'_>, kernel: &Kernel, rows: usize) -> Result<u64> {
    let stages = Stages::new(job, kernel)?;
    let Shape { frames, width, .. } = job.series.shape();
    let layout = Layout::new(width, L::WIDTH, stages.whole.radius());
    let vector = size_of::<L>() as u64;
    let [places, tall, middle] = [0, 2 * stages.halo(), 2 * stages.whole.radius()]
        .map(|halo| ((rows + halo) * layout.blocks) as u64);
    let (frames, depths) = (frames as u64, job.plan.depths.all().len() as u64);
    let fields = frames * depths * tall * 2 * vector;
    let sums = places * frames * (2 + 2 + 1 + 1) * vector + 6 * middle * vector;
    let modes = if job.tiles.is_some_and(Tiles::test_closure) { MODES as u64 } else { 0 };
    let models = (2 + modes) * frames * frames * vector;
    let contrasts = modes * places * vector;
    let results = (2 * frames + modes.min(1)) * (rows * width * 4) as u64;
    let passes = 2 * Passes::<L>::bytes(&layout, rows + middle as usize / layout.blocks) as u64;
    Ok(fields + sums + models + contrasts + results + passes)
}

/// One thread: strips until there are none left.
#[inline(always)]
pub(super) fn work<L: Lanes>(run: &Run<'_>, tiles: &Tiles, turns: &Turns) -> Result<()> {
    let mut worker = Worker::<L>::new(run, tiles.test_closure())?;
    let mut strip = turns.next(None);
    while let Some(number) = strip {
        let rows = run.rows_of(number);
        worker.load(run, rows.clone())?;
        worker.expand_models(tiles, &rows);
        worker.link(run, rows.len())?;
        worker.report(run, tiles, rows)?;
        strip = turns.next(strip);
    }
    Ok(())
}

/// Buffers of one thread, allocated once.
struct Worker<L> {
    stages: Stages,
    /// Of the average: its halo on each side of a row.
    layout: Layout,
    /// Of the sub-windows.
    window: Layout,
    depths: Vec<usize>,
    recordings: Vec<Layers>,
    fields: Fields<L>,
    averager: Averager<L>,
    /// (frame, row, vector): 1 / sqrt of the mean power.
    inverse_root: Vec<L>,
    /// (frame j, row, vector): gamma_ij of the frame i under way.
    gamma: Vec<Complex<L>>,
    /// (frame, row, vector).
    phasors: Vec<Complex<L>>,
    /// (frame, row, vector).
    score: Vec<L>,
    /// Q and (F + 1 1^T / N)^-1 of each lane's tile, (frame, frame).
    precision: Vec<L>,
    inverse: Vec<L>,
    /// 2 W_k of each lane's tile, (frame, frame), and x_k, (row, vector); empty where the closure is not tested.
    weights: Vec<[L; MODES]>,
    contrasts: Vec<[L; MODES]>,
    /// q, then p, (row, x).
    closure: Vec<f32>,
    /// (time, row, x).
    phases: Vec<f32>,
    sigmas: Vec<f32>,
}

impl<L: Lanes> Worker<L> {
    fn new(run: &Run<'_>, closure: bool) -> Result<Self> {
        let job = run.job;
        let Shape { frames, width, .. } = job.series.shape();
        let stages = Stages::new(job, run.kernel)?;
        let layout = Layout::new(width, L::WIDTH, stages.whole.radius());
        let radius = stages.window.as_ref().map_or(0, Kernel::radius);
        let window = Layout::new(width, L::WIDTH, radius);
        let depths = job.plan.depths.all();
        let places = run.rows * layout.blocks;
        let loading = layout.with_rows_of_halo(stages.halo());
        let zero = Complex { re: L::zero(), im: L::zero() };
        let numbers = |count: usize| filled(L::zero(), count, STRIPS);
        let modes =
            |count: usize| filled([L::zero(); MODES], if closure { count } else { 0 }, STRIPS);
        Ok(Self {
            fields: Fields::new(frames * depths.len(), &loading, run.rows)?,
            averager: Averager::new(&stages, &layout, &window, run.rows),
            inverse_root: numbers(frames * places)?,
            gamma: filled(zero, frames * places, STRIPS)?,
            phasors: filled(zero, frames * places, STRIPS)?,
            score: numbers(frames * places)?,
            precision: numbers(frames * frames)?,
            inverse: numbers(frames * frames)?,
            weights: modes(frames * frames)?,
            contrasts: modes(places)?,
            closure: vec![0.0; if closure { run.rows * width } else { 0 }],
            phases: vec![0.0; frames * run.rows * width],
            sigmas: vec![0.0; if job.sigma { frames * run.rows * width } else { 0 }],
            recordings: job.plan.depths.layers(),
            stages,
            layout,
            window,
            depths,
        })
    }

    #[inline(always)]
    fn load(&mut self, run: &Run<'_>, rows: Range<usize>) -> Result<()> {
        let Survey { valid, scale, .. } = run.job.survey;
        let (series, depths) = (run.job.series, &self.depths);
        let source = fields::Source { series, depths, valid, scale: *scale };
        self.fields.load(&source, &self.layout.with_rows_of_halo(self.stages.halo()), rows)
    }

    /// The tile of a lane; its block of columns and the strip lie in one (`tiles`).
    fn tile<'a>(&self, tiles: &'a Tiles, rows: &Range<usize>, lane: usize) -> &'a Tile {
        let Layout { blocks, width, .. } = self.layout;
        tiles.at(rows.start, (lane * blocks).min(width - 1))
    }

    fn expand_models(&mut self, tiles: &Tiles, rows: &Range<usize>) {
        for lane in 0..L::WIDTH {
            let tile = self.tile(tiles, rows, lane);
            let parts = [
                (&mut self.precision[..], &tile.precision[..]),
                (&mut self.inverse, &tile.inverse),
                (self.weights.as_flattened_mut(), tile.contrasts.as_flattened()),
            ];
            for (lanes, numbers) in parts {
                let own = L::flat_mut(lanes).iter_mut().skip(lane).step_by(L::WIDTH);
                for (place, &number) in own.zip(numbers) {
                    *place = L::Element::from(number);
                }
            }
        }
    }

    #[inline(always)]
    fn link(&mut self, run: &Run<'_>, rows: usize) -> Result<()> {
        let frames = run.job.plan.frames();
        self.score.fill(L::zero());
        self.contrasts.fill([L::zero(); MODES]);
        for i in 0..frames {
            self.filter_power(rows, i);
            for j in 0..i {
                self.filter_pair(rows, i, j);
            }
            self.walk(rows, i);
            self.add_frame(rows, i);
            run.progress.advance(1)?;
        }
        self.finish(run, rows);
        Ok(())
    }

    /// 1 / sqrt⟨|U_i|^2⟩, 0 in the dark.
    #[inline(always)]
    fn filter_power(&mut self, rows: usize, i: usize) {
        let Self { stages, layout, window, fields, averager, inverse_root, .. } = self;
        let places = rows * layout.blocks;
        let columns = Columns::new(&layout.with_rows_of_halo(stages.halo()), rows);
        let size = self.depths.len() * columns.plane();
        let pair = Pair::of(&fields.numbers, size, [i, i], columns, &self.recordings);
        let mut roots = Roots(&mut inverse_root[i * places..][..places]);
        averager.run([layout, window], rows, pair, &mut roots);
    }

    /// gamma_ij.
    #[inline(always)]
    fn filter_pair(&mut self, rows: usize, i: usize, j: usize) {
        let Self { stages, layout, window, fields, averager, inverse_root, gamma, .. } = self;
        let places = rows * layout.blocks;
        let columns = Columns::new(&layout.with_rows_of_halo(stages.halo()), rows);
        let size = self.depths.len() * columns.plane();
        let pair = Pair::of(&fields.numbers, size, [i, j], columns, &self.recordings);
        let root = |frame: usize| &inverse_root[frame * places..][..places];
        let roots = [root(i), root(j)];
        let mut normalised = Normalised { roots, gamma: &mut gamma[j * places..][..places] };
        averager.run([layout, window], rows, pair, &mut normalised);
    }

    /// z_i from the nearest predecessors.
    #[inline(always)]
    fn walk(&mut self, rows: usize, i: usize) {
        let places = rows * self.layout.blocks;
        let n = self.frames();
        let (known, rest) = self.phasors.split_at_mut(i * places);
        let Some(new) = rest.get_mut(..places) else { return };
        new.fill(Complex { re: L::zero(), im: L::zero() });
        for j in i.saturating_sub(START_FRAMES)..i {
            let weight = (-self.precision[i * n + j]).max(L::zero());
            let pairs = self.gamma[j * places..].iter().zip(&known[j * places..]);
            for (sum, (&gamma, &z)) in new.iter_mut().zip(pairs) {
                let c = turn(gamma, z);
                sum.re = weight.mul_add(c.re, sum.re);
                sum.im = weight.mul_add(c.im, sum.im);
            }
        }
        let one = Complex { re: L::one(), im: L::zero() };
        let before = known.len().checked_sub(places).map(|start| &known[start..]);
        for (place, z) in new.iter_mut().enumerate() {
            *z = start_phasor(*z, before.map_or(one, |before| before[place]));
        }
    }

    /// The frame's residuals, with contrasts or without.
    #[inline(always)]
    fn add_frame(&mut self, rows: usize, i: usize) {
        if self.contrasts.is_empty() {
            let n = self.frames();
            let places = rows * self.layout.blocks;
            return self.add_residuals::<0>(rows, i, &vec![[]; n * n], &mut vec![[]; places]);
        }
        let weights = std::mem::take(&mut self.weights);
        let mut contrasts = std::mem::take(&mut self.contrasts);
        self.add_residuals(rows, i, &weights, &mut contrasts);
        (self.weights, self.contrasts) = (weights, contrasts);
    }

    /// Residuals of all pairs (i, j < i) into the scores of both and into the contrasts, M of each place.
    #[inline(always)]
    fn add_residuals<const M: usize>(
        &mut self,
        rows: usize,
        i: usize,
        weights: &[[L; M]],
        contrasts: &mut [[L; M]],
    ) {
        let places = rows * self.layout.blocks;
        let n = self.frames();
        let own = &self.phasors[i * places..][..places];
        let (earlier, rest) = self.score.split_at_mut(i * places);
        for j in 0..i {
            let (q, weights) = (self.precision[i * n + j], weights[i * n + j]);
            let pairs = self.gamma[j * places..].iter().zip(&self.phasors[j * places..]);
            let scores = rest.iter_mut().zip(&mut earlier[j * places..]);
            let all = scores.zip(pairs.zip(own)).zip(contrasts.iter_mut());
            for (((score_i, score_j), ((&gamma, &z_j), &z_i)), contrasts) in all {
                let residual = residual(z_i, gamma, z_j);
                for (x, w) in contrasts.iter_mut().zip(weights) {
                    *x = w.mul_add(residual, *x);
                }
                let pull = q * residual;
                *score_i = *score_i - pull;
                *score_j += pull;
            }
        }
    }

    fn frames(&self) -> usize {
        self.precision.len().isqrt()
    }

    /// phi = arg z + F^-1 g of all places.
    #[inline(always)]
    fn finish(&mut self, run: &Run<'_>, rows: usize) {
        let blocks = self.layout.blocks;
        let (places, n) = (rows * blocks, run.job.plan.frames());
        let (mut row, mut closures) = (vec![L::zero(); n * blocks], vec![L::zero(); blocks]);
        let mut phases = vec![L::zero(); n];
        let mut score = vec![L::zero(); n];
        for place in 0..places {
            for (frame, score) in score.iter_mut().enumerate() {
                *score = self.score[frame * places + place];
            }
            for (frame, phase) in phases.iter_mut().enumerate() {
                let z = self.phasors[frame * places + place];
                let row = &self.inverse[frame * n..][..n];
                let mut sum = z.im.atan2(z.re);
                for (&f, &g) in row.iter().zip(&score) {
                    sum = f.mul_add(g, sum);
                }
                *phase = sum;
            }
            put(&mut row, &phases, place % blocks, blocks);
            if let Some(contrasts) = self.contrasts.get(place) {
                let q = contrasts.iter().fold(L::zero(), |q, &x| x.mul_add(x, q));
                closures[place % blocks] = q;
            }
            if (place + 1) % blocks == 0 {
                unload(&self.layout, &row, [place / blocks, rows], &mut self.phases);
                unload(&self.layout, &closures, [place / blocks, rows], &mut self.closure);
            }
        }
    }

    /// Unwrap each pixel in time and hand the strip over, NaN where there is no phase.
    #[inline(always)]
    fn report(&mut self, run: &Run<'_>, tiles: &Tiles, rows: Range<usize>) -> Result<()> {
        let Shape { frames, width, .. } = run.job.series.shape();
        let valid = &run.job.survey.valid[rows.start * width..rows.end * width];
        let (mut unmeasured, mut over_gaps) = (0, Gaps::default());
        for columns in tiles.columns() {
            let tile = tiles.at(rows.start, columns.start);
            let mut unwrapping = Unwrapping::<L>::new(run.job.plan, tile, valid);
            for row in 0..rows.len() {
                let pixels = row * width + columns.start..row * width + columns.end;
                unwrapping.unwrap(&mut self.phases, pixels.clone());
                if !tile.usable.contains(&true) {
                    unmeasured += valid[pixels.clone()].iter().filter(|&&valid| valid).count();
                }
                if let Some(closure) = self.closure.get_mut(pixels.clone()) {
                    for p in closure {
                        *p = tail(f64::from(*p), tile.modes, KNOWN) as f32;
                    }
                }
                for (image, &sigma) in self.sigmas.chunks_exact_mut(valid.len()).zip(&tile.sigmas) {
                    image[pixels.clone()].fill(sigma);
                }
            }
            over_gaps.add(unwrapping.gaps);
        }
        let size = frames * valid.len();
        blank_unusable(&mut self.phases, valid, frames);
        blank_unusable(&mut self.sigmas, valid, frames);
        blank_unusable(&mut self.closure, valid, 1);
        run.doubts.add(Doubts { unmeasured, over_gaps });
        let sigmas = run.job.sigma.then(|| &self.sigmas[..size]);
        let phases = &self.phases[..size];
        let closure = self.closure.get(..valid.len());
        (run.each)(StripResult { first_row: rows.start, phases, sigmas, closure, valid })
    }
}

/// The average of a pair over the Gaussian and the recordings, of two layers by way of sub-windows.
struct Averager<L> {
    whole: Passes<L>,
    window: Option<Passes<L>>,
    /// Each layer's average over sub-windows in one recording, (row, vector).
    layers: [Vec<Complex<L>>; 2],
    /// The sum over the recordings of their product.
    products: Vec<Complex<L>>,
}

impl<L: Lanes> Averager<L> {
    fn new(stages: &Stages, layout: &Layout, window: &Layout, rows: usize) -> Self {
        let middle = rows + 2 * layout.halo;
        let zero = Complex { re: L::zero(), im: L::zero() };
        let half = stages.window.as_ref().map(|kernel| &kernel.half);
        let places = if half.is_some() { middle * layout.blocks } else { 0 };
        Self {
            whole: Passes::new(layout, rows, &stages.whole.half),
            window: half.map(|half| Passes::new(window, middle, half)),
            layers: [vec![zero; places], vec![zero; places]],
            products: vec![zero; places],
        }
    }

    /// The mean of every place of the strip.
    #[inline(always)]
    fn run(
        &mut self,
        [layout, window]: [&Layout; 2],
        rows: usize,
        pair: Pair<'_, L>,
        sink: &mut impl Sink<L, 2>,
    ) {
        let blocks = layout.blocks;
        let Some(passes) = &mut self.window else {
            self.whole.run(layout, rows, pair, sink);
            return;
        };
        let middle = rows + 2 * layout.halo;
        self.products.fill(Complex { re: L::zero(), im: L::zero() });
        for recording in pair.recordings {
            for (average, depths) in self.layers.iter_mut().zip(recording.both()) {
                let layer = Layer { pair, depths };
                passes.filter(window, middle, &layer, &mut Averages(average));
            }
            let [first, second] = &self.layers;
            for (sum, (&first, &second)) in self.products.iter_mut().zip(first.iter().zip(second)) {
                let c = layer_difference(first, second);
                sum.re += c.re;
                sum.im += c.im;
            }
        }
        self.whole.filter(layout, rows, &Products { sums: &self.products, blocks }, sink);
    }
}

/// 1 / sqrt of the mean power, 0 in the dark.
struct Roots<'a, L>(&'a mut [L]);

impl<L: Lanes> Sink<L, 2> for Roots<'_, L> {
    #[inline(always)]
    fn take(&mut self, place: usize, [power, _]: [L; 2]) {
        let lit = L::from_f64(f64::from(f32::MIN_POSITIVE)).lt(power);
        let root = L::select(lit, power, L::one()).inverse_sqrt();
        self.0[place] = L::select(lit, root, L::zero());
    }
}

/// gamma_ij.
struct Normalised<'a, L> {
    roots: [&'a [L]; 2],
    gamma: &'a mut [Complex<L>],
}

impl<L: Lanes> Sink<L, 2> for Normalised<'_, L> {
    #[inline(always)]
    fn take(&mut self, place: usize, [re, im]: [L; 2]) {
        let share = self.roots[0][place] * self.roots[1][place];
        self.gamma[place] = Complex { re: re * share, im: im * share };
    }
}

/// One layer's cross-spectrum.
struct Layer<'a, L> {
    pair: Pair<'a, L>,
    depths: Range<usize>,
}

impl<L: Lanes> Source<L, 2> for Layer<'_, L> {
    #[inline(always)]
    fn at(&self, line: usize, vector: usize) -> [L; 2] {
        let c = self.pair.sum(self.depths.clone(), self.pair.columns.place(line, vector));
        [c.re, c.im]
    }
}

/// Its average over sub-windows.
struct Averages<'a, L>(&'a mut [Complex<L>]);

impl<L: Lanes> Sink<L, 2> for Averages<'_, L> {
    #[inline(always)]
    fn take(&mut self, place: usize, [re, im]: [L; 2]) {
        self.0[place] = Complex { re, im };
    }
}

/// The products of both, row after row.
struct Products<'a, L> {
    sums: &'a [Complex<L>],
    blocks: usize,
}

impl<L: Lanes> Source<L, 2> for Products<'_, L> {
    #[inline(always)]
    fn at(&self, line: usize, vector: usize) -> [L; 2] {
        let c = self.sums[line * self.blocks + vector];
        [c.re, c.im]
    }
}
