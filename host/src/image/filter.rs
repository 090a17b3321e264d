//! One pair of frames over a strip: cross-spectrum, unit phasor, and the Gaussian mean of both.

use super::fir::{self, Sink};
use super::strip::{Columns, Layout};
use crate::lanes::{Lanes, fetch_ahead};
use crate::planes::Layers;
use num_complex::Complex;
use phasewalk_core::cross_spectrum::cross_spectrum;
use phasewalk_core::weights::unit_phasor;

/// The fields of two frames over a strip, in (depth, vector, row) order, and how to combine depths and recordings.
#[derive(Clone, Copy)]
pub struct Pair<'a, L> {
    /// How they lie.
    pub columns: Columns,
    /// U(t).
    pub earlier: &'a [Complex<L>],
    /// U(t + dt).
    pub later: &'a [Complex<L>],
    /// Depths of every recording.
    pub recordings: &'a [Layers],
}

impl<'a, L: Lanes> Pair<'a, L> {
    /// Frames t and s of a strip whose frames are `size` places long.
    #[inline(always)]
    pub fn of(
        fields: &'a [Complex<L>],
        size: usize,
        [t, s]: [usize; 2],
        columns: Columns,
        recordings: &'a [Layers],
    ) -> Self {
        let field = |frame: usize| &fields[frame * size..][..size];
        Self { columns, earlier: field(t), later: field(s), recordings }
    }

    /// C or C^{Z1-Z2} of a recording at one place of the strip.
    #[inline(always)]
    fn cross_spectrum(&self, layers: &Layers, place: usize) -> Complex<L> {
        let [first, second] = layers.both();
        layers.combine([self.sum(first, place), self.sum(second, place)])
    }

    /// The mean of [`channels`] over the recordings.
    #[inline(always)]
    fn channels<const CH: usize>(&self, place: usize) -> [L; CH] {
        let [first, others @ ..] = self.recordings else { return [L::zero(); CH] };
        let mut means = channels(self.cross_spectrum(first, place));
        if others.is_empty() {
            return means;
        }
        for layers in others {
            let further: [L; CH] = channels(self.cross_spectrum(layers, place));
            for i in 0..CH {
                means[i] += further[i];
            }
        }
        let share = L::from_f64(1.0 / self.recordings.len() as f64);
        for mean in &mut means {
            *mean = *mean * share;
        }
        means
    }

    /// C summed over some of the depths.
    #[inline(always)]
    pub fn sum(&self, depths: std::ops::Range<usize>, place: usize) -> Complex<L> {
        let plane = self.columns.plane();
        let mut sum = Complex { re: L::zero(), im: L::zero() };
        for z in depths {
            // The same line of the next vector: the passes over this one take as long as it needs to come.
            fetch_ahead(self.later, z * plane + place + self.columns.tall);
            let c = cross_spectrum(self.earlier[z * plane + place], self.later[z * plane + place]);
            sum.re += c.re;
            sum.im += c.im;
        }
        sum
    }
}

/// Buffers of the two filter passes: a column of products and the rows between the passes.
pub struct Passes<L> {
    column: Vec<L>,
    rows: Vec<L>,
    /// Half the Gaussian's taps.
    half: Vec<L>,
}

impl<L: Lanes> Passes<L> {
    /// Buffers for strips of at most `rows` rows.
    pub fn new(layout: &Layout, rows: usize, half: &[f64]) -> Self {
        Self {
            column: vec![L::zero(); CHANNELS * (rows + 2 * layout.halo)],
            rows: vec![L::zero(); CHANNELS * rows * row_places(layout)],
            half: half.iter().map(|&tap| L::from_f64(tap)).collect(),
        }
    }

    /// Bytes that [`Self::new`] takes.
    pub fn bytes(layout: &Layout, rows: usize) -> usize {
        CHANNELS * size_of::<L>() * (rows + 2 * layout.halo + rows * row_places(layout))
    }

    /// Filter the pair: ⟨C⟩ in the first two channels and, with four, ⟨C/|C|⟩ in the others.
    #[inline(always)]
    pub fn run<const CH: usize>(
        &mut self,
        layout: &Layout,
        rows: usize,
        pair: Pair<'_, L>,
        sink: &mut impl Sink<L, CH>,
    ) {
        self.filter(layout, rows, &pair, sink);
    }

    /// Filter what `source` has in each vector of `rows` lines and R lines of halo above and below; results go to
    /// row * vectors of a row + vector.
    #[inline(always)]
    pub fn filter<const CH: usize>(
        &mut self,
        layout: &Layout,
        rows: usize,
        source: &impl Source<L, CH>,
        sink: &mut impl Sink<L, CH>,
    ) {
        for vector in 0..layout.blocks {
            self.gather(layout, rows, source, vector);
            self.down::<CH>(layout, rows, vector);
        }
        self.across(layout, rows, sink);
    }

    /// The first step for one vector of the rows: what `source` has there in all lines.
    #[inline(always)]
    pub(super) fn gather<const CH: usize>(
        &mut self,
        layout: &Layout,
        rows: usize,
        source: &impl Source<L, CH>,
        vector: usize,
    ) {
        let column = &mut self.column.as_chunks_mut::<CH>().0[..rows + 2 * layout.halo];
        for (line, place) in column.iter_mut().enumerate() {
            *place = source.at(line, vector);
        }
    }

    /// The second: filter that along y.
    #[inline(always)]
    pub(super) fn down<const CH: usize>(&mut self, layout: &Layout, rows: usize, vector: usize) {
        let long = row_places(layout);
        let column = &self.column.as_chunks::<CH>().0[..rows + 2 * layout.halo];
        let mut between = Rows(&mut self.rows.as_chunks_mut::<CH>().0[..rows * long]);
        fir::filter(column, &self.half, [layout.halo + vector, long], &mut between);
    }

    /// The last: filter along x what all vectors have left.
    #[inline(always)]
    pub(super) fn across<const CH: usize>(
        &mut self,
        layout: &Layout,
        rows: usize,
        sink: &mut impl Sink<L, CH>,
    ) {
        let (long, used) = (row_places(layout), layout.blocks + 2 * layout.halo);
        let between = &mut self.rows.as_chunks_mut::<CH>().0[..rows * long];
        for (row, line) in between.chunks_exact_mut(long).enumerate() {
            let line = &mut line[..used];
            layout.fill_halo(line);
            fir::filter(line, &self.half, [row * layout.blocks, 1], sink);
        }
    }
}

/// Places of a row between the passes with its halo, and one more where they are even: the rows of a vector, which are
/// written one after the other, then lie in different sets of the cache.
fn row_places(layout: &Layout) -> usize {
    (layout.blocks + 2 * layout.halo) | 1
}

/// What is filtered. (Not a closure, as [`Sink`].)
pub trait Source<L, const CH: usize> {
    /// The numbers in a vector of a line of the strip with its halo.
    fn at(&self, line: usize, vector: usize) -> [L; CH];
}

impl<L: Lanes, const CH: usize> Source<L, CH> for Pair<'_, L> {
    #[inline(always)]
    fn at(&self, line: usize, vector: usize) -> [L; CH] {
        self.channels(self.columns.place(line, vector))
    }
}

/// The rows between the passes.
struct Rows<'a, L, const CH: usize>(&'a mut [[L; CH]]);

impl<L: Lanes, const CH: usize> Sink<L, CH> for Rows<'_, L, CH> {
    #[inline(always)]
    fn take(&mut self, place: usize, means: [L; CH]) {
        self.0[place] = means;
    }
}

/// The most channels a pass carries: real and imaginary part of C and of C/|C|.
const CHANNELS: usize = 4;

#[inline(always)]
fn channels<L: Lanes, const CH: usize>(c: Complex<L>) -> [L; CH] {
    let mut channels = [L::zero(); CH];
    if CH == CHANNELS {
        let phasor = unit_phasor(c);
        channels[CH - 2] = phasor.re;
        channels[CH - 1] = phasor.im;
    }
    channels[0] = c.re;
    channels[1] = c.im;
    channels
}
