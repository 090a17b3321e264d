//! The nodes of a tracker, oldest first: the compressed anchor, if there is one, and the frames of the window;
//! with the mean cross-spectra between them.

use super::matrices::Hermitian;
use crate::linking::{aligned, residual, turn};
use crate::scalar::{Real, is_number};
use heapless::Vec;
use num_complex::Complex;

/// Powers ⟨|U|²⟩ outside 1 / this ..= this are no light: cross-spectra of the others fit into `f32`.
const LARGEST_POWER: f64 = 1e12;

/// A frame of the window, or the anchor (whose time and quality have no meaning).
#[derive(Clone, Copy, Debug)]
pub(super) struct Node<T> {
    pub(super) time: f64,
    /// u: the time by the clock of the decorrelation, see [`super::clock`].
    pub(super) clock: f64,
    /// phi, rad.
    phase: T,
    /// exp(i phi), kept because it costs much on a processor without `f64`.
    unit: Complex<T>,
    /// As it was judged, 0..=1.
    pub(super) quality: T,
    /// Has the coherence been lost since?
    pub(super) lost: bool,
}

impl<T: Real> Node<T> {
    /// At the phase 0.
    pub(super) fn new(time: f64, quality: T) -> Self {
        let (phase, unit) = (T::zero(), Complex { re: T::one(), im: T::zero() });
        Self { time, clock: time, phase, unit, quality, lost: false }
    }

    pub(super) fn phase(&self) -> T {
        self.phase
    }

    /// exp(i phi).
    pub(super) fn unit(&self) -> Complex<T> {
        self.unit
    }

    pub(super) fn set_phase(&mut self, phase: T) {
        let (im, re) = phase.sin_cos();
        (self.phase, self.unit) = (phase, Complex { re, im });
    }

    /// s: what later frames may have in common with it, 0..=1.
    pub(super) fn weight(&self) -> T {
        if self.lost { T::zero() } else { self.quality }
    }
}

/// What the nodes have in common, aligned with their present phases.
#[derive(Debug)]
pub(super) struct Aligned<'a, T, const N: usize> {
    cross: &'a Hermitian<T, N>,
    /// exp(i phi) / sqrt(power); 0 for dark nodes.
    phasors: [Complex<T>; N],
}

impl<T: Real, const N: usize> Aligned<'_, T, N> {
    fn phasor(&self, i: usize) -> Complex<T> {
        self.phasors.get(i).copied().unwrap_or(zero())
    }

    /// Re(conj(z_i) gamma_ij z_j), z = exp(i phi).
    #[inline]
    pub(super) fn coherence(&self, i: usize, j: usize) -> T {
        aligned(self.phasor(i), self.cross.at(i, j), self.phasor(j))
    }

    /// Im(conj(z_i) gamma_ij z_j): 0 where the phases fit.
    #[inline]
    pub(super) fn residual(&self, i: usize, j: usize) -> T {
        residual(self.phasor(i), self.cross.at(i, j), self.phasor(j))
    }

    /// gamma_ij z_j up to a factor above 0: the phasor that node j suggests for node i.
    #[inline]
    pub(super) fn suggestion(&self, i: usize, j: usize) -> Complex<T> {
        turn(self.cross.at(i, j), self.phasor(j))
    }
}

#[derive(Clone, Debug)]
pub(super) struct Nodes<T, const N: usize> {
    list: Vec<Node<T>, N>,
    /// ⟨U_i conj U_j⟩; the powers on the diagonal.
    cross: Hermitian<T, N>,
    /// Is the first node the anchor?
    anchored: bool,
    /// By how much the clock of the decorrelation is ahead of the time.
    ahead: f64,
}

impl<T: Real, const N: usize> Nodes<T, N> {
    pub(super) fn new() -> Self {
        Self { list: Vec::new(), cross: Hermitian::new(), anchored: false, ahead: 0.0 }
    }

    pub(super) fn all(&self) -> &[Node<T>] {
        &self.list
    }

    pub(super) fn all_mut(&mut self) -> &mut [Node<T>] {
        &mut self.list
    }

    pub(super) fn count(&self) -> usize {
        self.list.len()
    }

    /// Index of the oldest frame of the window.
    pub(super) fn oldest(&self) -> usize {
        usize::from(self.anchored)
    }

    /// The frames of the window, oldest first.
    pub(super) fn window(&self) -> &[Node<T>] {
        self.list.get(self.oldest()..).unwrap_or(&[])
    }

    pub(super) fn is_anchored(&self) -> bool {
        self.anchored
    }

    /// Take the next frame with its cross-spectra ⟨U conj X_j⟩ with all nodes and its power; phase 0, quality 1, or 0
    /// without light. Cross-spectra that no fields can have (NaN, or a coherence far above 1) count as none.
    pub(super) fn push(&mut self, cross: &[Complex<T>], power: T, time: f64) {
        let n = self.count();
        let most = T::from_f64(LARGEST_POWER);
        let lit = power < most && power * most > T::one();
        let power = if lit { power } else { T::zero() };
        for (j, &c) in cross.iter().enumerate().take(n) {
            let limit = T::from_f64(4.0) * power * self.cross.at(j, j).re;
            let square = c.re * c.re + c.im * c.im;
            let sound = is_number(square) && square <= limit;
            self.cross.set(n, j, if sound { c } else { zero() });
        }
        self.cross.set(n, n, Complex { re: power, im: T::zero() });
        let quality = if lit { T::one() } else { T::zero() };
        // Cannot fail: the tracker makes room first.
        let _ = self.list.push(Node { clock: time + self.ahead, ..Node::new(time, quality) });
    }

    /// The two newest frames and all to come are later by `more` on the clock of the decorrelation.
    pub(super) fn put_clock_forward(&mut self, more: f64) {
        self.ahead += more;
        for node in self.list.iter_mut().rev().take(2) {
            node.clock += more;
        }
    }

    /// Delete node k.
    pub(super) fn remove(&mut self, k: usize) {
        if k < self.list.len() {
            self.list.remove(k);
        }
        self.cross.remove(k);
    }

    /// The oldest frame becomes the anchor: multiplied by `factor`, so that its phase is 0.
    pub(super) fn found_anchor(&mut self, factor: Complex<T>) {
        for j in 1..self.count() {
            self.cross.set(0, j, turn(factor, self.cross.at(0, j)));
        }
        self.anchored = true;
        self.level_anchor();
    }

    /// A <- z_A A + z_k U_k for the anchor A, node 0, and the oldest frame U_k, node 1, which is deleted.
    pub(super) fn join_anchor(&mut self, z_anchor: Complex<T>, z_oldest: Complex<T>) {
        for j in 2..self.count() {
            let (a, k) = (turn(z_anchor, self.cross.at(0, j)), turn(z_oldest, self.cross.at(1, j)));
            self.cross.set(0, j, Complex { re: a.re + k.re, im: a.im + k.im });
        }
        let both = aligned(conjugate(z_anchor), self.cross.at(0, 1), conjugate(z_oldest));
        let power = |z: Complex<T>, i: usize| (z.re * z.re + z.im * z.im) * self.cross.at(i, i).re;
        let re = power(z_anchor, 0) + power(z_oldest, 1) + both + both;
        self.cross.set(0, 0, Complex { re, im: T::zero() });
        self.level_anchor();
        self.remove(1);
    }

    fn level_anchor(&mut self) {
        if let Some(anchor) = self.list.first_mut() {
            anchor.set_phase(T::zero());
        }
    }

    /// The cross-spectra as the present phases align them.
    pub(super) fn aligned(&self) -> Aligned<'_, T, N> {
        let mut phasors = [zero(); N];
        for (i, (place, node)) in phasors.iter_mut().zip(&self.list).enumerate() {
            let amplitude = self.amplitude(i);
            *place = Complex { re: node.unit.re * amplitude, im: node.unit.im * amplitude };
        }
        Aligned { cross: &self.cross, phasors }
    }

    /// 1 / sqrt(power of node i); 0 for dark ones.
    fn amplitude(&self, i: usize) -> T {
        let power = self.cross.at(i, i).re;
        if power > T::from_f64(1e-30) { power.inverse_sqrt() } else { T::zero() }
    }

    /// |gamma_ij|^2.
    pub(super) fn coherence_squared(&self, i: usize, j: usize) -> T {
        let c = self.cross.at(i, j);
        let (one, other) = (self.amplitude(i), self.amplitude(j));
        let (re, im) = (c.re * one * other, c.im * one * other);
        re * re + im * im
    }
}

pub(super) fn conjugate<T: Real>(z: Complex<T>) -> Complex<T> {
    Complex { re: z.re, im: -z.im }
}

pub(super) fn zero<T: Real>() -> Complex<T> {
    Complex { re: T::zero(), im: T::zero() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cross-spectra of fields of two pixels, as the anchor takes frames up.
    #[test]
    fn anchor_is_the_sum_of_the_fields() {
        let field = |t: usize| {
            [Complex::from_polar(1.0, 0.3 * t as f64), Complex::from_polar(0.5, 1.1 * t as f64)]
        };
        let mean = |u: &[Complex<f64>; 2], v: &[Complex<f64>; 2]| {
            u.iter().zip(v).map(|(u, v)| u * v.conj()).sum::<Complex<f64>>()
        };
        let mut fields: [_; 4] = core::array::from_fn(field);
        let mut nodes = Nodes::<f64, 4>::new();
        for (i, u) in fields.iter().enumerate() {
            let cross: [_; 4] = core::array::from_fn(|j| mean(u, &fields[j]));
            nodes.push(&cross[..i], mean(u, u).re, i as f64);
        }
        let (first, z, y) =
            (Complex::from_polar(1.0, 0.8), Complex::new(0.6, 0.7), Complex::new(0.2, -0.9));
        nodes.found_anchor(first);
        nodes.join_anchor(z, y);
        fields[1] = core::array::from_fn(|p| z * first * fields[0][p] + y * fields[1][p]);
        assert_eq!((nodes.count(), nodes.oldest()), (3, 1));
        for i in 0..3 {
            for j in 0..3 {
                let expected = mean(&fields[i + 1], &fields[j + 1]);
                assert!((nodes.cross.at(i, j) - expected).norm() < 1e-14, "({i}, {j})");
            }
        }
    }

    #[test]
    fn impossible_cross_spectra_count_as_none() {
        let mut nodes = Nodes::<f32, 3>::new();
        nodes.push(&[], 1.0, 0.0);
        nodes.push(&[Complex::new(3.0, 0.0)], 1.0, 1.0);
        nodes.push(&[Complex::new(f32::NAN, 0.0), Complex::new(0.5, 0.5)], 1.0, 2.0);
        assert_eq!(nodes.coherence_squared(1, 0), 0.0);
        assert_eq!(nodes.coherence_squared(2, 0), 0.0);
        assert!((nodes.coherence_squared(2, 1) - 0.5).abs() < 1e-6);
        let mut dark = Nodes::<f32, 3>::new();
        for power in [f32::NAN, 0.0, f32::INFINITY] {
            dark.push(&[Complex::new(1.0, 0.0); 2], power, 0.0);
        }
        assert!(dark.all().iter().all(|node| node.quality == 0.0));
        assert_eq!(dark.aligned().coherence(1, 0), 0.0);
    }
}
