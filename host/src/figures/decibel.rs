//! Amplitudes in decibels above the noise, and the range a picture of them should have.

use ndarray::{Array2, ArrayView2};

use super::raster::percentiles;

/// A grey scale shared by several images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decibels {
    /// Amplitude at 0 dB, black.
    pub floor: f32,
    /// Decibels at white.
    pub top: f32,
}

/// Share of all pixels taken as noise: they are black.
pub const NOISE: f32 = 0.25;
/// Share of all pixels that are not yet white.
const WHITE: f32 = 0.998;
/// Least and largest range.
const RANGE: (f32, f32) = (10.0, 80.0);

impl Decibels {
    /// The scale on which a quarter of all pixels are black and the brightest are just white.
    #[must_use]
    pub fn of(amplitudes: &[ArrayView2<'_, f32>]) -> Self {
        let (floor, white) = percentiles(amplitudes, NOISE, WHITE);
        // Where a quarter of the pixels is 0, the brightest sets the scale.
        let floor = floor.max(white * level(-RANGE.1)).max(f32::MIN_POSITIVE);
        let wanted = (decibels(white / floor) / 5.0).ceil() * 5.0;
        Self { floor, top: wanted.clamp(RANGE.0, RANGE.1) }
    }

    /// Decibels above the floor; no amplitude at all lies far below it.
    #[must_use]
    pub fn convert(&self, amplitude: ArrayView2<'_, f32>) -> Array2<f32> {
        amplitude.mapv(|a| match a.is_finite() {
            true => decibels(a.max(0.0) / self.floor).max(-1000.0),
            false => f32::NAN,
        })
    }

    /// Labels of an evenly marked bar, from 0 to the top.
    #[must_use]
    pub fn labels(&self) -> Vec<String> {
        let step = if self.top > 40.0 && self.top % 10.0 == 0.0 { 10.0 } else { 5.0 };
        let count = (self.top / step).round() as usize;
        (0..=count).map(|n| format!("{}", step * n as f32)).collect()
    }
}

/// 20 log10 of a ratio of amplitudes.
fn decibels(ratio: f32) -> f32 {
    20.0 * ratio.log10()
}

/// The ratio of amplitudes at a level in decibels.
fn level(decibels: f32) -> f32 {
    10_f32.powf(decibels / 20.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn ten_times_the_floor_is_twenty_decibels() {
        let image = array![[1.0, 1.0, 1.0, 10.0]];
        let scale = Decibels::of(&[image.view()]);
        assert_eq!(scale, Decibels { floor: 1.0, top: 20.0 });
        assert_eq!(scale.convert(image.view())[[0, 3]], 20.0);
        assert_eq!(scale.labels(), ["0", "5", "10", "15", "20"]);
    }

    #[test]
    fn odd_amplitudes_have_a_scale() {
        for value in [0.0, -1.0, f32::NAN, f32::INFINITY, f32::MAX] {
            let image = array![[value, value], [0.0, value]];
            let scale = Decibels::of(&[image.view()]);
            assert!(scale.floor > 0.0 && (RANGE.0..=RANGE.1).contains(&scale.top), "{scale:?}");
            assert!(scale.convert(image.view()).iter().all(|v| *v >= -1000.0 || v.is_nan()));
        }
    }
}
