//! One pair of frames over a strip: cross-spectrum, unit phasor, and the Gaussian mean of both.

use super::strip::Layout;
use crate::lanes::Lanes;
use crate::planes::Layers;
use num_complex::Complex;
use phasewalk_core::cross_spectrum::cross_spectrum;
use phasewalk_core::weights::unit_phasor;

/// The fields of two frames over a strip, in (depth, row, vector) order, and how to combine depths and recordings.
#[derive(Clone, Copy)]
pub struct Pair<'a, L> {
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
        recordings: &'a [Layers],
    ) -> Self {
        let field = |frame: usize| &fields[frame * size..][..size];
        Self { earlier: field(t), later: field(s), recordings }
    }

    /// C or C^{Z1-Z2} of a recording at one place of the strip; `plane` places make one depth.
    #[inline(always)]
    fn cross_spectrum(&self, layers: &Layers, place: usize, plane: usize) -> Complex<L> {
        let [first, second] = layers.both();
        layers.combine([self.sum(first, place, plane), self.sum(second, place, plane)])
    }

    /// The mean of [`channels`] over the recordings.
    #[inline(always)]
    fn channels<const CH: usize>(&self, place: usize, plane: usize) -> [L; CH] {
        let [first, others @ ..] = self.recordings else { return [L::zero(); CH] };
        let mut means = channels(self.cross_spectrum(first, place, plane));
        if others.is_empty() {
            return means;
        }
        for layers in others {
            let further: [L; CH] = channels(self.cross_spectrum(layers, place, plane));
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
    pub fn sum(&self, depths: std::ops::Range<usize>, place: usize, plane: usize) -> Complex<L> {
        let mut sum = Complex { re: L::zero(), im: L::zero() };
        for z in depths {
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
            rows: vec![L::zero(); CHANNELS * rows * (layout.blocks + 2 * layout.halo)],
            half: half.iter().map(|&tap| L::from_f64(tap)).collect(),
        }
    }

    /// Bytes that [`Self::new`] takes.
    pub fn bytes(layout: &Layout, rows: usize) -> usize {
        let row = layout.blocks + 2 * layout.halo;
        CHANNELS * size_of::<L>() * (rows + 2 * layout.halo + rows * row)
    }

    /// Filter the pair and give `each(row, vector, means)`: ⟨C⟩ in the first two channels and, with
    /// four, ⟨C/|C|⟩ in the others.
    #[inline(always)]
    pub fn run<const CH: usize>(
        &mut self,
        layout: &Layout,
        rows: usize,
        pair: Pair<'_, L>,
        each: impl FnMut(usize, usize, [L; CH]),
    ) {
        let plane = (rows + 2 * layout.halo) * layout.blocks;
        self.filter(layout, rows, |place| pair.channels(place, plane), each);
    }

    /// Filter what `source` has at each place (line * vectors of a row + vector) of `rows` lines and R
    /// lines of halo above and below.
    #[inline(always)]
    pub fn filter<const CH: usize>(
        &mut self,
        layout: &Layout,
        rows: usize,
        source: impl Fn(usize) -> [L; CH],
        mut each: impl FnMut(usize, usize, [L; CH]),
    ) {
        let tall = rows + 2 * layout.halo;
        let long = layout.blocks + 2 * layout.halo;
        let window = self.half.len() * 2 - 1;
        let column = &mut self.column.as_chunks_mut::<CH>().0[..tall];
        let between = &mut self.rows.as_chunks_mut::<CH>().0[..rows * long];
        for vector in 0..layout.blocks {
            for (line, place) in column.iter_mut().enumerate() {
                *place = source(line * layout.blocks + vector);
            }
            for (row, window) in column.windows(window).enumerate() {
                between[row * long + layout.halo + vector] = weighted_sum(window, &self.half);
            }
        }
        for (row, line) in between.chunks_exact_mut(long).enumerate() {
            layout.fill_halo(line);
            for (vector, window) in line.windows(window).enumerate() {
                each(row, vector, weighted_sum(window, &self.half));
            }
        }
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

/// Symmetric filter: the window's middle times half[0], plus (left + right) times half[d].
#[inline(always)]
fn weighted_sum<L: Lanes, const CH: usize>(window: &[[L; CH]], half: &[L]) -> [L; CH] {
    let radius = half.len() - 1;
    let (left, middle_right) = window.split_at(radius);
    let mut sum = middle_right[0];
    for channel in &mut sum {
        *channel = *channel * half[0];
    }
    let sides = left.iter().rev().zip(&middle_right[1..]);
    for ((before, after), &tap) in sides.zip(&half[1..]) {
        for i in 0..CH {
            sum[i] = (before[i] + after[i]).mul_add(tap, sum[i]);
        }
    }
    sum
}
