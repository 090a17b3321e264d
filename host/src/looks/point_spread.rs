//! Where the light of a pixel comes from: k(d), the share that comes from the place at a distance d.
//!
//! Behind an aperture of even transmission the point spread |h(d)|^2 is proportional to |mu(d)|^2: both h and mu are the
//! Fourier transform of the pupil, which is 0 or 1 and so its own square (theorem of van Cittert and Zernike). What
//! only blurs the image, as defocus does, mu does not show: then k is too narrow. Noise of pixels makes it narrower too.

use super::SpatialCoherence;
use std::f64::consts::{SQRT_2, TAU};

/// An aperture with a sharp edge scatters light further than |mu|^2 can be measured: its mean falls with the cube of the
/// distance. So many rings, each wider by the root of two, hold it.
const RINGS: i32 = 16;
/// Places on each ring.
const PLACES: i32 = 16;
/// Least distance, pixels, to which |mu|^2 must be known along both axes to tell how it goes on. A line scan has no
/// neighbours across.
const LEAST_REACH: isize = 3;

/// A share of the light of a pixel, and how far from it that comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    dy: isize,
    dx: isize,
    /// Of 1.
    pub share: f64,
}

impl Share {
    /// The number of the place in an image of this height and width, where it is inside.
    #[inline]
    #[must_use]
    pub fn place(&self, pixel: usize, height: usize, width: usize) -> Option<usize> {
        let (y, x) = ((pixel / width) as isize + self.dy, (pixel % width) as isize + self.dx);
        let inside = (0..height as isize).contains(&y) && (0..width as isize).contains(&x);
        inside.then(|| y as usize * width + x as usize)
    }

    fn distance(&self) -> f64 {
        (self.dy as f64).hypot(self.dx as f64)
    }
}

/// k(d).
#[derive(Clone, Debug)]
pub struct PointSpread {
    /// As far as |mu|^2 is known.
    near: Vec<Share>,
    /// Beyond, a few places for all.
    far: Vec<Share>,
}

impl PointSpread {
    /// k = |mu|^2 over its sum.
    #[must_use]
    pub fn of(coherence: &SpatialCoherence) -> Self {
        let (measured, reach) = coherence.of_aperture();
        let radius = reach as f64;
        let measured = measured.into_iter().map(|(dy, dx, share)| Share { dy, dx, share });
        if reach < LEAST_REACH {
            let near: Vec<Share> = measured.collect();
            let sum = near.iter().map(|place| place.share).sum();
            return Self { near, far: Vec::new() }.normalised(sum);
        }
        let near: Vec<Share> = measured.filter(|place| place.distance() <= radius).collect();
        let outer = near.iter().filter(|place| place.distance() > radius / 2.0);
        let (light, cubes) = outer.fold((0.0, 0.0), |(light, cubes), place| {
            (light + place.share, cubes + place.distance().powi(-3))
        });
        // Beyond r there is the integral of 2 pi r C / r^3.
        let beyond = TAU * f64::max(light, 0.0) / cubes;
        let far = (0..RINGS).flat_map(|ring| places_of(ring, radius, beyond)).collect();
        let sum = near.iter().map(|place| place.share).sum::<f64>() + beyond / radius;
        Self { near, far }.normalised(sum)
    }

    /// The sum is 1 at least, that of d = 0; of few speckles chance may make it less.
    fn normalised(mut self, sum: f64) -> Self {
        for place in self.near.iter_mut().chain(&mut self.far) {
            place.share /= sum.max(1.0);
        }
        self
    }

    /// The shares from places as near as |mu|^2 is known.
    #[must_use]
    pub fn near(&self) -> &[Share] {
        &self.near
    }

    /// Share of the light of `pixel` that comes from the mask (y, x). Beyond the edges of the image it goes on as within.
    #[must_use]
    pub fn light_of(&self, mask: &[bool], width: usize, pixel: usize) -> f64 {
        let height = mask.len() / width;
        let (mut of_mask, mut of_image) = (0.0, 0.0);
        for from in self.near.iter().chain(&self.far) {
            if let Some(place) = from.place(pixel, height, width) {
                of_image += from.share;
                of_mask += if mask[place] { from.share } else { 0.0 };
            }
        }
        of_mask / of_image
    }
}

/// The light between two radii, in equal parts round the ring.
fn places_of(ring: i32, radius: f64, beyond: f64) -> impl Iterator<Item = Share> {
    let [inner, outer] = [ring, ring + 1].map(|k| radius * SQRT_2.powi(k));
    let share = beyond * (inner.recip() - outer.recip()) / f64::from(PLACES);
    let between = (inner * outer).sqrt();
    (0..PLACES).map(move |place| {
        // Neighbouring rings are turned against each other.
        let angle = TAU * (f64::from(place) + f64::from(ring % 2) / 2.0) / f64::from(PLACES);
        let (sine, cosine) = angle.sin_cos();
        let [dy, dx] = [sine, cosine].map(|part| (between * part).round() as isize);
        Share { dy, dx, share }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// |mu|^2 of a round aperture, whose cut-off is `cutoff` cycles per pixel: (2 J1(v) / v)^2, v = 2 pi cutoff d.
    fn airy(cutoff: f64, reach: isize) -> SpatialCoherence {
        SpatialCoherence::from_function(reach, |dy, dx| {
            let v = TAU * cutoff * (dy as f64).hypot(dx as f64);
            if v == 0.0 { 1.0 } else { (2.0 * libm::j1(v) / v).powi(2) }
        })
    }

    /// Beyond the angle v a round aperture scatters J0(v)^2 + J1(v)^2 of the light (Rayleigh).
    #[test]
    fn light_far_from_its_place_is_that_of_a_round_aperture() {
        const SIDE: usize = 401;
        // The outer half of the reach holds one or two of the Airy pattern's rings, more of their peaks or of their zeros.
        let narrow = [0.4, 0.34, 0.3, 0.24, 0.2, 0.16, 0.12].map(|cutoff| (cutoff, 0.78..1.25));
        // The first zero of the Airy pattern is where |mu|^2 is last known.
        let wide = [(0.1, 1.3..1.5)];
        for (cutoff, around) in narrow.into_iter().chain(wide) {
            let spread = PointSpread::of(&airy(cutoff, 6));
            // Where a ring of the tail ends.
            for radius in [6.0, 12.0, 24.0, 48.0] {
                let disc: Vec<bool> = (0..SIDE * SIDE)
                    .map(|i| {
                        let from_middle = |at: usize| at as f64 - (SIDE / 2) as f64;
                        from_middle(i / SIDE).hypot(from_middle(i % SIDE)) <= radius
                    })
                    .collect();
                let found = 1.0 - spread.light_of(&disc, SIDE, SIDE * SIDE / 2);
                let v = TAU * cutoff * radius;
                let beyond = libm::j0(v).powi(2) + libm::j1(v).powi(2);
                // In its mean 2 / (pi v); beyond a square, that of the circle in it times 4 / (pi sqrt 2).
                let beyond_image = SQRT_2 / PI * 4.0 / (PI * TAU * cutoff * (SIDE / 2) as f64);
                let expected = (beyond - beyond_image) / (1.0 - beyond_image);
                let share = found / expected;
                assert!(around.contains(&share), "{cutoff}, {radius}: {found}, {expected}");
            }
        }
    }

    /// Behind a pupil without a sharp edge nothing is scattered far; the less is claimed, the better |mu|^2 is known.
    #[test]
    fn a_soft_pupil_has_less_of_a_tail_the_narrower_the_speckle_is() {
        for (square, most) in [(1.0, 1e-3), (2.0, 0.012), (4.0, 0.1), (9.0, 0.27)] {
            let soft = SpatialCoherence::from_function(6, |dy, dx| {
                (-((dy * dy + dx * dx) as f64) / square).exp()
            });
            let beyond: f64 = PointSpread::of(&soft).far.iter().map(|from| from.share).sum();
            assert!(beyond < most, "{square}: {beyond}");
        }
    }

    /// A region that reaches to the edge of the image goes on behind it, and so does what is around it.
    #[test]
    fn the_edge_of_the_image_is_none_of_the_masks() {
        const WIDTH: usize = 60;
        let mask: Vec<bool> = (0..WIDTH * 80).map(|i| i % WIDTH < 20).collect();
        // Along y and x the light falls independently, and no further than two pixels: rows that the edge cuts off are
        // like those that it leaves.
        let near = SpatialCoherence::from_function(LEAST_REACH - 1, |dy, dx| {
            (-((dy * dy + dx * dx) as f64)).exp()
        });
        let spread = PointSpread::of(&near);
        for x in [0, 10, 18, 19, 20, 21, 40, WIDTH - 1] {
            let [edge, middle] = [x, 40 * WIDTH + x].map(|at| spread.light_of(&mask, WIDTH, at));
            assert!((edge - middle).abs() < 1e-12, "{x}: {edge} {middle}");
        }
        assert_eq!(spread.light_of(&mask, WIDTH, 0), 1.0);
        // That from further away is cut off by the image's other edges too.
        let spread = PointSpread::of(&airy(0.24, 6));
        assert!(spread.light_of(&mask, WIDTH, 0) > 0.98);
    }

    #[test]
    fn shares_sum_to_one_and_a_line_has_no_tail() {
        let spread = PointSpread::of(&airy(0.24, 6));
        let everywhere = spread.light_of(&[true; 400], 20, 19);
        assert_eq!(everywhere, 1.0);
        let all: f64 = spread.near.iter().chain(&spread.far).map(|from| from.share).sum();
        // What the last ring does not reach: its radius is 256 times that of |mu|^2.
        assert!((0.999..1.000_001).contains(&all), "{all}");

        let line = SpatialCoherence::from_function(0, |_, _| 1.0);
        let spread = PointSpread::of(&line);
        assert_eq!(spread.light_of(&[true, false], 2, 0), 1.0);
        assert!(spread.far.is_empty());
    }
}
