//! The averaged volume: intensities of the matched sweeps in the coordinates of the first, from which
//! the surfaces are found (paper lines 707-711).
//!
//! Sweeps are moved by whole pixels. That blurs by less than the axial resolution; what the rounding
//! leaves on average in depth is known and taken off the surfaces.

use super::register::Motion;
use super::resample::places;
use crate::allocate::zeros;
use crate::error::Result;
use rayon::prelude::*;

/// Sum of |U|^2 over the sweeps, (z, y, x).
#[derive(Clone, serde::Serialize, serde::Deserialize)]
pub struct MeanVolume {
    size: [usize; 3],
    sum: Vec<f32>,
    /// Sweeps that show the pixel (y, x).
    seen: Vec<u16>,
    sweeps: usize,
    /// Sum of what the rounding left in depth.
    rest: f64,
}

impl MeanVolume {
    /// An empty sum of a size (z, y, x).
    ///
    /// # Errors
    /// When the memory is not there.
    pub fn new(size: [usize; 3]) -> Result<Self> {
        let pixels = size[1] * size[2];
        let sum = zeros(size[0] * pixels, "the averaged volume")?;
        Ok(Self { size, sum, seen: vec![0; pixels], sweeps: 0, rest: 0.0 })
    }

    /// Forget all sweeps.
    pub fn clear(&mut self) {
        self.sum.fill(0.0);
        self.seen.fill(0);
        (self.sweeps, self.rest) = (0, 0.0);
    }

    /// Add a sweep's |U| (z, y, x), which has moved.
    pub fn add(&mut self, amplitude: &[f32], motion: &Motion) {
        let [depth, height, width] = self.size;
        let pixels = height * width;
        let runs = runs(motion, [height, width]);
        for run in &runs {
            self.seen[run.to..run.to + run.length].iter_mut().for_each(|seen| *seen += 1);
        }
        let down = motion.shift[0].round();
        self.sum.par_chunks_exact_mut(pixels).enumerate().for_each(|(z, plane)| {
            let from = z as isize + down as isize;
            let Some(from) = usize::try_from(from).ok().filter(|&from| from < depth) else {
                return;
            };
            let amplitude = &amplitude[from * pixels..][..pixels];
            for &Run { to, from, length } in &runs {
                let sums = plane[to..to + length].iter_mut();
                sums.zip(&amplitude[from..from + length]).for_each(|(sum, u)| *sum += u * u);
            }
        });
        self.sweeps += 1;
        self.rest += motion.shift[0] - down;
    }

    /// Number of sweeps in it.
    #[must_use]
    pub fn sweeps(&self) -> usize {
        self.sweeps
    }

    /// Mean intensity (z, y, x); zero where no sweep looked.
    #[must_use]
    pub fn intensity(&self) -> Vec<f32> {
        let pixels = self.size[1] * self.size[2];
        let mut mean = self.sum.clone();
        mean.par_chunks_exact_mut(pixels).for_each(|plane| {
            for (value, &seen) in plane.iter_mut().zip(&self.seen) {
                *value /= f32::from(seen.max(1));
            }
        });
        mean
    }

    /// By how much all is too deep in it, in depth pixels, for the rounding.
    #[must_use]
    pub fn depth_bias(&self) -> f64 {
        self.rest / self.sweeps.max(1) as f64
    }
}

/// Neighbouring pixels of a row whose sources are neighbours, too.
struct Run {
    to: usize,
    from: usize,
    length: usize,
}

/// Where the pixels that a moved sweep shows lie in it, to the nearest pixel.
fn runs(motion: &Motion, [height, width]: [usize; 2]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (to, place) in places(motion, [height, width]).enumerate() {
        let [y, x] = place.map(f64::round);
        let inside = y >= 0.0 && x >= 0.0 && y < height as f64 && x < width as f64;
        if !inside {
            continue;
        }
        let from = y as usize * width + x as usize;
        match runs.last_mut() {
            Some(run) if (run.to + run.length, run.from + run.length) == (to, from) => {
                run.length += 1;
            }
            _ => runs.push(Run { to, from, length: 1 }),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moved_sweeps_add_up_in_place() {
        let size = [6, 5, 7];
        let at = |z: usize, y: usize, x: usize| (z * 5 + y) * 7 + x;
        let mut mean = MeanVolume::new(size).unwrap();
        for (dz, dy, dx) in [(0, 0, 0), (1, -1, 2), (2, 1, -1)] {
            let mut amplitude = vec![0.0; 6 * 5 * 7];
            amplitude[at((2 + dz) as usize, (2 + dy) as usize, (3 + dx) as usize)] = 3.0;
            let shift = [f64::from(dz) + 0.25, f64::from(dy), f64::from(dx)];
            mean.add(&amplitude, &Motion { shift, rotation_rad: 0.0 });
        }
        let intensity = mean.intensity();
        assert_eq!(intensity[at(2, 2, 3)], 9.0);
        assert!((intensity.iter().sum::<f32>() - 9.0).abs() < 1e-6);
        assert!((mean.depth_bias() - 0.25).abs() < 1e-12);
        assert_eq!(mean.sweeps(), 3);
        mean.clear();
        assert_eq!(mean.sweeps(), 0);
    }
}
