//! Light that the aperture brings into a region from outside of it, and how it is taken off.
//!
//! The cross-spectrum that is seen at a pixel x is that of the places around it, blurred by the point spread k. Where the
//! region moves as one (S_in) and its surroundings do (S_out), and K(x) is the share of the light at x that comes from the
//! mask, it is
//!
//! ```text
//! C(x) = K(x) S_in + (1 - K(x)) S_out
//! ```
//! inside of the mask and outside, and the average over the pixels x of the region less that over pixels x' outside,
//!
//! ```text
//! sum over x of C(x) - sum over x' of w(x') C(x'),   w(x') = beta sum over y of k(x' - y),
//! beta = sum over x of (1 - K(x)) / sum over x' of (1 - K(x')) sum over y of k(x' - y),
//! ```
//! holds nothing of S_out; y are the mask's pixels there, also those of a rim that is left out. Each sub-window has its
//! own, so only its neighbourhood need move as one. Beta is 8 at most: what reaches a sub-window from further than |mu|^2
//! is known is hardly seen at its own rim. Beyond the image's edge mask and surroundings go on.
//!
//! Without it the phase of a region whose surroundings rest is too small: between neighbouring frames by the share of light
//! from outside, less where the phases are further apart. Where both sides of the mask's edge have one phase, only light
//! is lost.

use crate::looks::PointSpread;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The largest beta.
const MOST: f64 = 8.0;

/// A pixel outside of the mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outside {
    /// Its number in the image.
    pub place: usize,
    /// w.
    pub weight: f64,
}

/// What is around the pixels of a sub-window.
pub(super) struct Around {
    pub pixels: Vec<Outside>,
    /// Sum over its own pixels of the share of light from outside of the mask, as far as it is taken off.
    pub light: f64,
}

/// A mask, and how light spreads around it.
pub(super) struct Surroundings<'a> {
    /// k.
    pub spread: &'a PointSpread,
    /// What moves as one, (y, x): also pixels that are not used themselves.
    pub mask: &'a [bool],
    /// Pixels that can be used, (y, x).
    pub valid: &'a [bool],
    /// Pixels of a row.
    pub width: usize,
}

impl Surroundings<'_> {
    /// The pixels outside of the mask that take the light from there off the sum over `pixels`; `drawn` are the mask's
    /// pixels there.
    pub(super) fn around(&self, pixels: &[usize], drawn: &[usize]) -> Around {
        let light = self.light_from_outside(pixels).iter().sum::<f64>().max(0.0);
        let mut weights = self.spread_of(drawn);
        // Of what |mu|^2 is by chance.
        weights.retain(|_, w| *w > 0.0);
        let places: Vec<usize> = weights.keys().copied().collect();
        let own = self.light_from_outside(&places);
        let taken: f64 = weights.values().zip(&own).map(|(w, own)| w * own).sum();
        let beta = if taken > 0.0 { (light / taken).min(MOST) } else { 0.0 };
        if beta == 0.0 {
            return Around { pixels: Vec::new(), light: 0.0 };
        }
        let outside = weights.into_iter().map(|(place, w)| Outside { place, weight: beta * w });
        Around { pixels: outside.collect(), light: beta * taken }
    }

    /// 1 - K of these pixels.
    fn light_from_outside(&self, pixels: &[usize]) -> Vec<f64> {
        let of = |&pixel: &usize| 1.0 - self.spread.light_of(self.mask, self.width, pixel);
        pixels.par_iter().map(of).collect()
    }

    /// Sum over `pixels` y of k(x' - y) at every usable pixel x' outside of the mask.
    fn spread_of(&self, pixels: &[usize]) -> BTreeMap<usize, f64> {
        let height = self.mask.len() / self.width;
        let mut light = BTreeMap::new();
        for &pixel in pixels {
            for share in self.spread.near() {
                let place = share.place(pixel, height, self.width);
                if let Some(place) = place.filter(|&at| !self.mask[at] && self.valid[at]) {
                    *light.entry(place).or_insert(0.0) += share.share;
                }
            }
        }
        light
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::without_rim;
    use crate::looks::SpatialCoherence;
    use num_complex::Complex64;

    const HEIGHT: usize = 40;
    const WIDTH: usize = 50;

    /// A cross near the edge of the image, where the two rightmost columns cannot be used.
    fn masks() -> [Vec<bool>; 2] {
        let mask = |i: usize| {
            let (y, x) = (i / WIDTH, i % WIDTH);
            (10..16).contains(&y) && x > 20 || (28..36).contains(&x) && y < 30
        };
        let usable = |i: usize| i % WIDTH < WIDTH - 2;
        [&mask as &dyn Fn(usize) -> bool, &usable].map(|of| (0..HEIGHT * WIDTH).map(of).collect())
    }

    /// C = K exp(i phi) + 1 - K has the argument phi again, in every part of the region, whatever pixels it uses.
    #[test]
    fn light_of_still_surroundings_is_taken_off() {
        let [mask, valid] = masks();
        let coherence = SpatialCoherence::from_function(6, |dy, dx| {
            (-((dy * dy + dx * dx) as f64) / 4.0).exp()
        });
        let spread = PointSpread::of(&coherence);
        let surroundings =
            Surroundings { spread: &spread, mask: &mask, valid: &valid, width: WIDTH };
        let phi = Complex64::cis(2.5);
        let seen = |pixel: usize| {
            let k = surroundings.spread.light_of(&mask, WIDTH, pixel);
            phi * k + (1.0 - k)
        };
        let all: Vec<usize> = (0..mask.len()).filter(|&i| mask[i] && valid[i]).collect();
        let corner: Vec<usize> =
            all.iter().copied().filter(|i| i / WIDTH < 5 && i % WIDTH < 30).collect();
        let inner: Vec<usize> = without_rim(&mask, WIDTH, 2)
            .iter()
            .enumerate()
            .filter(|&(i, &inner)| inner && valid[i])
            .map(|(i, _)| i)
            .collect();
        for (pixels, drawn) in [(&all, &all), (&corner, &corner), (&inner, &all)] {
            let inside: Complex64 = pixels.iter().map(|&pixel| seen(pixel)).sum();
            let around = surroundings.around(pixels, drawn);
            assert!(around.pixels.iter().all(|of| !mask[of.place] && valid[of.place]));
            let outside: Complex64 =
                around.pixels.iter().map(|of| seen(of.place) * of.weight).sum();
            let [raw, corrected] =
                [inside, inside - outside].map(|sum| (sum * phi.conj()).arg().abs());
            assert!(raw > 0.001 && corrected < 1e-12, "{raw}, {corrected}");
            assert!(around.light > 0.001 * pixels.len() as f64, "{}", around.light);
        }
    }

    #[test]
    fn without_surroundings_nothing_is_taken_off() {
        let [mask, _] = masks();
        let coherence =
            SpatialCoherence::from_function(6, |dy, dx| (-((dy * dy + dx * dx) as f64)).exp());
        let of = |mask: &[bool], valid: &[bool]| {
            let spread = PointSpread::of(&coherence);
            let pixels: Vec<usize> = (0..mask.len()).filter(|&i| mask[i]).collect();
            Surroundings { spread: &spread, mask, valid, width: WIDTH }.around(&pixels, &pixels)
        };
        let whole = of(&vec![true; mask.len()], &vec![true; mask.len()]);
        assert!(whole.pixels.is_empty() && whole.light == 0.0);
        // Nothing around the mask can be used.
        assert!(of(&mask, &mask).pixels.is_empty());
    }
}
