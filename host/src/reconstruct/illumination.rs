//! The light on the camera: how bright each pixel is against the others, and which pixels are dead.
//!
//! The illumination v(y,x) is the mean over images spread over the recording, so that the fringes of
//! the sample average out; v has the mean 1. It is the spatial factor of the source term S(m) v(y,x)
//! that `background` fits to every sweep.

use super::counts::SweepCounts;
use crate::error::{Error, Result};
use rayon::prelude::*;

/// A pixel whose counts hardly change while its neighbours' do is stuck.
const LEAST_CHANGE: f32 = 0.25;
/// A pixel whose mean differs by more than this factor from its neighbours' is not trusted.
const BRIGHTNESS: f32 = 1.5;
/// Neighbours are those at most so many rows and columns away.
const REACH: usize = 2;
/// Live neighbours that stand in for a dead pixel.
const STAND_INS: usize = 4;

/// Brightness of the pixels relative to each other.
#[derive(Clone, Debug, Default)]
pub struct Illumination {
    /// v (y,x), mean 1; a dead pixel has its neighbours' value.
    pub pixels: Vec<f32>,
    /// Dead pixels (y,x).
    pub dead: Vec<bool>,
    repairs: Vec<Repair>,
}

/// A dead pixel and those that stand in for it.
#[derive(Clone, Debug)]
struct Repair {
    pixel: usize,
    stand_ins: Vec<usize>,
}

impl Illumination {
    /// From images spread over the recording, given as one sweep of counts; `saturated` is the
    /// camera's largest count.
    ///
    /// # Errors
    /// When there is no light, or most of the pixels are dead.
    pub fn measure(sample: &SweepCounts, saturated: u16) -> Result<Self> {
        let (height, width) = (sample.height, sample.width);
        let statistics = pixel_statistics(sample);
        let rows: Vec<usize> = (0..height).collect();
        let dead: Vec<bool> = rows
            .par_iter()
            .flat_map_iter(|&y| {
                let statistics = &statistics;
                (0..width).map(move |x| is_dead(statistics, [height, width], [y, x], saturated))
            })
            .collect();
        let lost = dead.iter().filter(|&&dead| dead).count();
        if 2 * lost > dead.len() {
            return Err(Error::failed(format!(
                "{lost} of {} pixels are dark, saturated or stuck: this is no recording of sweeps",
                dead.len()
            )));
        }
        let repairs = repairs(&dead, height, width);
        let mut pixels: Vec<f32> = statistics.iter().map(|s| s.mean).collect();
        for Repair { pixel, stand_ins } in &repairs {
            let sum: f32 = stand_ins.iter().map(|&i| pixels[i]).sum();
            pixels[*pixel] = sum / stand_ins.len() as f32;
        }
        let mean = pixels.iter().map(|&p| f64::from(p)).sum::<f64>() / pixels.len() as f64;
        pixels.iter_mut().for_each(|p| *p /= mean as f32);
        Ok(Self { pixels, dead, repairs })
    }

    /// Put the mean of its neighbours in the place of every dead pixel of one image (y,x).
    pub fn repair(&self, image: &mut [u16]) {
        for Repair { pixel, stand_ins } in &self.repairs {
            let sum: u32 = stand_ins.iter().map(|&i| u32::from(image[i])).sum();
            let count = stand_ins.len() as u32;
            image[*pixel] = ((sum + count / 2) / count) as u16;
        }
    }

    /// Number of dead pixels.
    #[must_use]
    pub fn dead_pixels(&self) -> usize {
        self.repairs.len()
    }
}

/// Mean and standard deviation of one pixel over the images.
#[derive(Clone, Copy, Debug)]
struct PixelStatistics {
    mean: f32,
    deviation: f32,
}

fn pixel_statistics(sample: &SweepCounts) -> Vec<PixelStatistics> {
    let (height, width, pixels) = (sample.height, sample.width, sample.height * sample.width);
    let count = sample.images as f64;
    let row = |y: usize| {
        let (mut sums, mut squares) = (vec![0_u32; width], vec![0_u64; width]);
        for image in sample.counts.chunks_exact(pixels) {
            let line = &image[y * width..][..width];
            for ((sum, square), &value) in sums.iter_mut().zip(&mut squares).zip(line) {
                *sum += u32::from(value);
                *square += u64::from(value) * u64::from(value);
            }
        }
        sums.into_iter().zip(squares).map(move |(sum, square)| {
            let mean = f64::from(sum) / count;
            let deviation = (square as f64 / count - mean * mean).max(0.0).sqrt();
            PixelStatistics { mean: mean as f32, deviation: deviation as f32 }
        })
    };
    (0..height).into_par_iter().flat_map_iter(row).collect()
}

/// Dark, full, stuck, or of another brightness than its neighbours.
fn is_dead(
    statistics: &[PixelStatistics],
    [height, width]: [usize; 2],
    [y, x]: [usize; 2],
    saturated: u16,
) -> bool {
    let own = statistics[y * width + x];
    let rows = y.saturating_sub(REACH)..(y + REACH + 1).min(height);
    let around = rows.flat_map(|row| {
        let columns = x.saturating_sub(REACH)..(x + REACH + 1).min(width);
        columns.map(move |column| statistics[row * width + column])
    });
    let (mut means, mut deviations): (Vec<f32>, Vec<f32>) =
        around.map(|s| (s.mean, s.deviation)).unzip();
    let (mean, deviation) = (median(&mut means), median(&mut deviations));
    own.mean >= 0.98 * f32::from(saturated)
        || own.deviation <= LEAST_CHANGE * deviation
        || own.mean * BRIGHTNESS <= mean
        || own.mean >= BRIGHTNESS * mean
}

fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// The nearest live pixels of each dead one.
fn repairs(dead: &[bool], height: usize, width: usize) -> Vec<Repair> {
    let of = |pixel: usize| {
        let (y, x) = (pixel / width, pixel % width);
        for reach in 1..height.max(width) {
            let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
            let live = rows.flat_map(|row| {
                let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
                columns.map(move |column| row * width + column).filter(|&i| !dead[i])
            });
            let mut live: Vec<usize> = live.collect();
            let distance =
                |&i: &usize| (i / width).abs_diff(y).pow(2) + (i % width).abs_diff(x).pow(2);
            live.sort_by_key(distance);
            live.truncate(STAND_INS);
            if live.len() == STAND_INS {
                return live;
            }
        }
        (0..dead.len()).find(|&i| !dead[i]).into_iter().collect()
    };
    let all = (0..dead.len()).filter(|&pixel| dead[pixel]);
    all.map(|pixel| Repair { pixel, stand_ins: of(pixel) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vignetted field with a hump of a source, a little noise, and four bad pixels.
    fn sample() -> SweepCounts {
        let (images, height, width) = (32, 12, 16);
        let mut sample = SweepCounts::new(images, height, width).unwrap();
        for (i, count) in sample.counts.iter_mut().enumerate() {
            let (m, pixel) = (i / (height * width), i % (height * width));
            let noise = (i * 7919 % 41) as f64 - 20.0;
            let light = 1500.0 + 10.0 * m as f64 - 1.5 * (pixel % width) as f64;
            *count = (light + noise) as u16;
            match pixel {
                37 => *count = 0,
                90 => *count = 4095,
                91 => *count = 1600,
                150 => *count /= 4,
                _ => {}
            }
        }
        sample
    }

    #[test]
    fn dead_pixels_are_found_and_replaced() {
        let mut sample = sample();
        let light = Illumination::measure(&sample, 4095).unwrap();
        let found: Vec<usize> = (0..light.dead.len()).filter(|&i| light.dead[i]).collect();
        assert_eq!(found, [37, 90, 91, 150]);
        assert_eq!(light.dead_pixels(), 4);
        let pixels = 12 * 16;
        light.repair(&mut sample.counts[..pixels]);
        for i in found {
            assert!((1400..1560).contains(&sample.counts[i]), "{}", sample.counts[i]);
        }
    }

    #[test]
    fn the_illumination_is_relative() {
        let light = Illumination::measure(&sample(), 4095).unwrap();
        let mean = light.pixels.iter().sum::<f32>() / light.pixels.len() as f32;
        assert!((mean - 1.0).abs() < 1e-5);
        let slope = (light.pixels[15] - light.pixels[0]) / 15.0;
        assert!((slope + 1.5 / 1644.0).abs() < 2e-4, "{slope}");
    }

    #[test]
    fn darkness_is_no_recording() {
        let dark = SweepCounts::new(8, 6, 6).unwrap();
        assert!(Illumination::measure(&dark, 4095).is_err());
    }
}
