//! A band of rows of the images as they come: the last frames, their phases, and what becomes of the next one.

use super::fields::{circular, scale_usable, scatter};
use super::filter::{Pair, Passes};
use super::fir::Sink;
use super::memory::STRIP_ROWS;
use super::newest::{Incoming, NewestSettings, Outgoing};
use super::strip::{Columns, Layout};
use super::worker::unload;
use crate::allocate::filled;
use crate::error::Result;
use crate::lanes::Lanes;
use crate::planes::Layers;
use num_complex::{Complex, Complex32};
use phasewalk_core::held::{HeldPair, newest_phase};
use phasewalk_core::params::REFERENCE_FRAMES;
use phasewalk_core::reference::reference_mean;
use phasewalk_core::weights::Weights;
use std::ops::Range;

/// What the buffers are called when memory is short.
const BANDS: &str = "the last frames (see --max-lag)";

/// State of one thread.
pub(super) struct Band<L> {
    rows: Range<usize>,
    height: usize,
    scale: f32,
    lags: usize,
    weights: Weights,
    layout: Layout,
    /// Rows of a strip.
    strip: usize,
    /// Frames so far.
    frames: usize,
    /// The last L + 1 fields in a ring, (frame, line, vector), with R lines of halo above and below.
    fields: Vec<Complex<L>>,
    /// Their phases, (frame, row, vector), radians against the first frame.
    phases: Vec<L>,
    /// Sum of the reference frames' phases, and how many they are, (row, vector).
    references: Vec<[L; 2]>,
    passes: Passes<L>,
    /// (row, vector, lag) of a strip.
    pairs: Vec<HeldPair<L>>,
}

impl<L: Lanes> Band<L> {
    /// Before the first frame.
    pub fn new(settings: &NewestSettings, rows: Range<usize>) -> Result<Self> {
        let sizes = Sizes::of::<L>(settings, &rows);
        let zero = L::zero();
        let Sizes { layout, strip, lines, places, slots } = sizes;
        let nothing = HeldPair { wanted: zero, weight: zero };
        Ok(Self {
            fields: filled(Complex { re: zero, im: zero }, slots * lines * layout.blocks, BANDS)?,
            phases: filled(zero, slots * places, BANDS)?,
            references: filled([zero; 2], places, BANDS)?,
            passes: Passes::new(&layout, strip, &settings.kernel.half),
            pairs: filled(nothing, strip * layout.blocks * settings.max_lag, BANDS)?,
            height: settings.kernel.height,
            scale: settings.scale,
            lags: settings.max_lag,
            weights: settings.weights,
            frames: 0,
            rows,
            layout,
            strip,
        })
    }

    /// Bytes that [`Self::new`] takes.
    pub fn bytes(settings: &NewestSettings, rows: &Range<usize>) -> u64 {
        let Sizes { layout, strip, lines, places, slots } = Sizes::of::<L>(settings, rows);
        let vector = size_of::<L>();
        let fields = slots * lines * layout.blocks * 2 * vector;
        let phases = (slots + 2) * places * vector;
        let pairs = strip * layout.blocks * settings.max_lag * size_of::<HeldPair<L>>();
        (fields + phases + pairs + Passes::<L>::bytes(&layout, strip)) as u64
    }

    /// Where the frame that came `age` frames before the newest lies in the rings.
    #[inline(always)]
    fn slot(&self, age: usize) -> usize {
        (self.frames - age) % (self.lags + 1)
    }

    /// Put the frame into its slot.
    #[inline(always)]
    fn load(&mut self, frame: &Incoming) {
        let Layout { width, halo, .. } = self.layout;
        let columns = Columns::new(&self.layout, self.rows.len());
        let start = self.slot(0) * columns.plane();
        let slot = &mut self.fields[start..start + columns.plane()];
        let mut line = vec![Complex32::default(); width];
        for i in 0..columns.tall {
            let y = circular(self.rows.start, i, halo, self.height);
            line.copy_from_slice(&frame.field[y * width..][..width]);
            scale_usable(&mut line, &frame.finite[y * width..], self.scale);
            scatter(&line, &self.layout, columns.line(slot, i));
        }
    }

    /// Average the pairs of the newest frame over a strip of so many rows from row `first` of the band on.
    #[inline(always)]
    fn filter(&mut self, first: usize, rows: usize) {
        let lags = self.lags;
        let (newest, known) = (self.slot(0), lags.min(self.frames));
        let slots: Vec<usize> = (1..=known).map(|age| self.slot(age)).collect();
        let Self { layout, fields, phases, passes, pairs, weights, .. } = self;
        let (blocks, places) = (layout.blocks, self.rows.len() * layout.blocks);
        let columns = Columns::new(layout, self.rows.len());
        let strip = |slot: usize| &fields[slot * columns.plane()..][first..columns.plane()];
        let one = [Layers { first: 0..1, second: 1..1 }];
        for (lag, &slot) in slots.iter().enumerate() {
            let held = &phases[slot * places + first * blocks..][..rows * blocks];
            let pair =
                Pair { columns, earlier: strip(slot), later: strip(newest), recordings: &one };
            let mut sink = HeldPairs { weights: *weights, held, lags, lag, pairs };
            passes.run(layout, rows, pair, &mut sink);
        }
    }

    /// Put the newest phases of the strip where its pairs want them.
    #[inline(always)]
    fn solve(&mut self, first: usize, rows: usize, result: &mut Outgoing) {
        let known = self.lags.min(self.frames);
        let (newest, before) = (self.slot(0), self.slot(known.min(1)));
        let (blocks, all) = (self.layout.blocks, self.rows.len());
        let [mut phases, mut seen] = [vec![L::zero(); blocks], vec![L::zero(); blocks]];
        for place in 0..rows * blocks {
            let at = first * blocks + place;
            let expected =
                if known > 0 { self.phases[before * all * blocks + at] } else { L::zero() };
            let found = newest_phase(&self.pairs[place * self.lags..][..known], expected);
            self.phases[newest * all * blocks + at] = found.phase_rad;
            let weighs = L::select(L::zero().lt(found.weight), L::one(), L::zero());
            let counts = if self.frames > 0 { weighs } else { L::one() };
            let [sum, count] = &mut self.references[at];
            if self.frames < REFERENCE_FRAMES {
                *sum = counts.mul_add(found.phase_rad, *sum);
                *count += counts;
            }
            phases[place % blocks] = found.phase_rad - reference_mean(*sum, *count);
            seen[place % blocks] = counts;
            if (place + 1) % blocks == 0 {
                let row = [first + place / blocks, all];
                unload(&self.layout, &phases, row, &mut result.phases);
                unload(&self.layout, &seen, row, &mut result.seen);
            }
        }
    }
}

/// What the pair with the frame `lag` + 1 before, whose phases are held, says of the newest one.
struct HeldPairs<'a, L> {
    weights: Weights,
    held: &'a [L],
    lags: usize,
    lag: usize,
    pairs: &'a mut [HeldPair<L>],
}

impl<L: Lanes> Sink<L, 4> for HeldPairs<'_, L> {
    #[inline(always)]
    fn take(&mut self, place: usize, [re, im, u, v]: [L; 4]) {
        self.pairs[place * self.lags + self.lag] = HeldPair {
            wanted: self.held[place] - im.atan2(re),
            weight: self.weights.paper(Complex { re: u, im: v }),
        };
    }
}

/// Take the next frame.
#[inline(always)]
pub(super) fn push<L: Lanes>(band: &mut Band<L>, frame: &Incoming) -> Outgoing {
    let (rows, strip) = (band.rows.len(), band.strip);
    let pixels = rows * band.layout.width;
    let mut result = Outgoing { phases: vec![0.0; pixels], seen: vec![0.0; pixels] };
    band.load(frame);
    for first in (0..rows).step_by(strip) {
        let rows = strip.min(rows - first);
        band.filter(first, rows);
        band.solve(first, rows, &mut result);
    }
    band.frames += 1;
    result
}

/// Lengths of the buffers.
struct Sizes {
    layout: Layout,
    /// Rows of a strip.
    strip: usize,
    /// Lines of a band with its halo.
    lines: usize,
    /// Vectors of a band without it.
    places: usize,
    /// Frames held.
    slots: usize,
}

impl Sizes {
    fn of<L: Lanes>(settings: &NewestSettings, rows: &Range<usize>) -> Self {
        let layout = Layout::new(settings.kernel.width, L::WIDTH, settings.kernel.radius());
        Self {
            strip: STRIP_ROWS.min(rows.len()),
            lines: rows.len() + 2 * layout.halo,
            places: rows.len() * layout.blocks,
            slots: settings.max_lag + 1,
            layout,
        }
    }
}
