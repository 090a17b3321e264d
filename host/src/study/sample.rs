//! A random series: U_n = exp(i phi_n) sum over k of R_nk g_k, with Gamma = R R^T and L looks of independent complex normal g.

use crate::allocate::zeros;
use crate::error::Result;
use crate::lanes::{LaneTask, Lanes, Path};
use crate::simulate::philox::{key, philox4x32};
use crate::simulate::vector_math::normal_pair;
use num_complex::{Complex, Complex32, Complex64};
use phasewalk_core::cross_spectrum::cross_spectrum;
use phasewalk_core::ensemble::PairMean;
use phasewalk_core::weights::unit_phasor;

/// What is called short when memory is.
const SERIES: &str = "a random series";

/// Mean cross-spectra of a series.
pub(super) struct Sample {
    n: usize,
    /// ⟨C(t, s - t)⟩, N x N, of t <= s.
    cross: Vec<Complex64>,
    /// ⟨C/|C|⟩.
    phasor: Vec<Complex64>,
}

impl Sample {
    /// Series number `trial` of `seed`.
    pub(super) fn draw(draw: Draw<'_>) -> Result<Self> {
        Path::best()?.run(draw)?
    }

    /// ⟨U_i conj U_j⟩ of all frames.
    pub(super) fn cross(&self) -> Vec<Complex64> {
        let n = self.n;
        let entry = |(i, j): (usize, usize)| {
            if i <= j { self.cross[i * n + j] } else { self.cross[j * n + i].conj() }
        };
        (0..n * n).map(|place| entry((place / n, place % n))).collect()
    }

    pub(super) fn pair_mean(&self, t: usize, s: usize) -> PairMean<f64> {
        let power = |t: usize| self.cross[t * self.n + t].re;
        PairMean {
            cross: self.cross[t * self.n + s],
            phasor: self.phasor[t * self.n + s],
            power: power(t) * power(s),
        }
    }
}

/// What a series is drawn from.
#[derive(Clone, Copy)]
pub(super) struct Draw<'a> {
    /// R, N x N.
    pub root: &'a [f64],
    /// phi, N.
    pub phase: &'a [f64],
    pub looks: usize,
    pub seed: u64,
    pub trial: usize,
}

impl LaneTask for Draw<'_> {
    type Output = Result<Sample>;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> Result<Sample> {
        let n = self.phase.len();
        let fields = self.fields::<L>();
        let vectors = fields.len() / n;
        let frame = |t: usize| &fields[t * vectors..][..vectors];
        let mut cross: Vec<Complex64> = zeros(n * n, SERIES)?;
        let mut phasor: Vec<Complex64> = zeros(n * n, SERIES)?;
        for t in 0..n {
            for s in t..n {
                let [c, p] = means(frame(t), frame(s), self.looks);
                let turn = Complex64::from_polar(1.0, self.phase[t] - self.phase[s]);
                cross[t * n + s] = c * turn;
                phasor[t * n + s] = p * turn;
            }
        }
        Ok(Sample { n, cross, phasor })
    }
}

impl Draw<'_> {
    /// The fields, (frame, look).
    pub(super) fn looks(self) -> Result<Vec<Complex32>> {
        Path::best()?.run(Looks(self))
    }

    /// The fields without their phase, (frame, vector); lanes beyond the looks are dark.
    #[inline(always)]
    fn fields<L: Lanes<Element = f32>>(&self) -> Vec<Complex<L>> {
        let n = self.phase.len();
        let vectors = self.looks.div_ceil(L::WIDTH);
        let zero = Complex { re: L::zero(), im: L::zero() };
        let mut noise = vec![zero; n * vectors];
        for (t, frame) in noise.chunks_exact_mut(vectors).enumerate() {
            for look in 0..self.looks {
                let counter = [look as u32, t as u32, self.trial as u32, 0];
                let words = philox4x32(counter, key(self.seed));
                let [re, im] = normal_pair([words[0], words[1]]);
                let vector = &mut frame[look / L::WIDTH];
                L::flat_mut(std::slice::from_mut(&mut vector.re))[look % L::WIDTH] = re;
                L::flat_mut(std::slice::from_mut(&mut vector.im))[look % L::WIDTH] = im;
            }
        }
        let mut fields = vec![zero; n * vectors];
        for (t, frame) in fields.chunks_exact_mut(vectors).enumerate() {
            for (k, noise) in noise.chunks_exact(vectors).enumerate().take(t + 1) {
                let r = L::from_f64(self.root[t * n + k]);
                for (u, g) in frame.iter_mut().zip(noise) {
                    u.re = r.mul_add(g.re, u.re);
                    u.im = r.mul_add(g.im, u.im);
                }
            }
        }
        fields
    }
}

/// The fields with their phase, look by look.
struct Looks<'a>(Draw<'a>);

impl LaneTask for Looks<'_> {
    type Output = Vec<Complex32>;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> Vec<Complex32> {
        let Self(draw) = self;
        let fields = draw.fields::<L>();
        let frames = fields.chunks_exact(fields.len() / draw.phase.len()).zip(draw.phase);
        let mut looks = Vec::with_capacity(draw.phase.len() * draw.looks);
        for (frame, &phase) in frames {
            let turn = Complex64::from_polar(1.0, phase);
            let turn = Complex32::new(turn.re as f32, turn.im as f32);
            let lanes = frame.iter().flat_map(|u| {
                let re = L::flat(std::slice::from_ref(&u.re)).iter();
                re.zip(L::flat(std::slice::from_ref(&u.im)))
            });
            looks.extend(lanes.take(draw.looks).map(|(&re, &im)| Complex32::new(re, im) * turn));
        }
        looks
    }
}

/// ⟨C⟩ and ⟨C/|C|⟩ over the looks.
#[inline(always)]
fn means<L: Lanes<Element = f32>>(
    u: &[Complex<L>],
    v: &[Complex<L>],
    looks: usize,
) -> [Complex64; 2] {
    let mut sums = [L::zero(); 4];
    for (&u, &v) in u.iter().zip(v) {
        let c = cross_spectrum(u, v);
        let phasor = unit_phasor(c);
        for (sum, part) in sums.iter_mut().zip([c.re, c.im, phasor.re, phasor.im]) {
            *sum += part;
        }
    }
    let mean =
        |part: L| L::flat(&[part]).iter().map(|&lane| f64::from(lane)).sum::<f64>() / looks as f64;
    let [a, b, c, d] = sums.map(mean);
    [Complex64::new(a, b), Complex64::new(c, d)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::scenarios;

    /// The mean over many looks is Gamma with the phase, and trials differ.
    #[test]
    fn samples_have_the_scenarios_coherence() {
        let scenario = &scenarios()[0];
        let n = scenario.times.len();
        let root = scenario.root();
        let from =
            |trial| Draw { root: &root, phase: &scenario.phase, looks: 20_000, seed: 1, trial };
        let draw = |trial| Sample::draw(from(trial)).unwrap();
        let sample = draw(0);
        let looks = from(0).looks().unwrap();
        let cross = sample.cross();
        let power = cross[0].re;
        for (t, s) in [(0, 1), (10, 13), (40, 60), (69, 20)] {
            let turn = Complex64::from_polar(1.0, scenario.phase[t] - scenario.phase[s]);
            let expected = turn * scenario.gamma[t * n + s];
            // The spread is 1/sqrt(20,000) = 0.007.
            assert!((cross[t * n + s] / power - expected).norm() < 0.03, "{t} {s}");
            let of = |t: usize| &looks[t * 20_000..][..20_000];
            let mean = of(t).iter().zip(of(s)).map(|(u, v)| u * v.conj()).sum::<Complex32>();
            let mean = Complex64::new(f64::from(mean.re), f64::from(mean.im)) / 20_000.0;
            assert!((mean - cross[t * n + s]).norm() < 1e-3 * power, "{t} {s}");
        }
        assert!((draw(1).cross()[5] - cross[5]).norm() > 1e-6);
    }
}
