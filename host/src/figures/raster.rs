//! A field as an image: every pixel an index into the palette of its colour map.

use std::collections::HashMap;

use ndarray::ArrayView2;

use super::colormap::{COLORS, ColorMap, Rgb, phase_position};
use crate::error::{Error, Result};

/// An image of palette entries.
#[derive(Clone, Debug)]
pub struct Indexed {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
    map: ColorMap,
}

/// A true-colour image, three bytes per pixel, row by row.
#[derive(Clone, Debug)]
pub struct Rgb8 {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green, blue of every pixel.
    pub pixels: Vec<u8>,
}

impl Indexed {
    /// Phase in radians, wrapped into −π..π for display.
    #[must_use]
    pub fn phase(field: ArrayView2<'_, f32>) -> Self {
        Self::map(field, ColorMap::Phase, phase_position)
    }

    /// Speckle amplitude, black at `low` and white at `high` (see [`percentiles`]).
    #[must_use]
    pub fn amplitude(field: ArrayView2<'_, f32>, (low, high): (f32, f32)) -> Self {
        Self::map(field, ColorMap::Grey, |v| position(v, low, high))
    }

    /// Uncertainty in radians, dark at `low` and light at `high`.
    #[must_use]
    pub fn sigma(field: ArrayView2<'_, f32>, (low, high): (f32, f32)) -> Self {
        Self::map(field, ColorMap::Sigma, |v| position(v, low, high))
    }

    fn map(field: ArrayView2<'_, f32>, map: ColorMap, at: impl Fn(f32) -> f32) -> Self {
        let (height, width) = field.dim();
        let pixels = field.iter().map(|&value| map.index(at(value))).collect();
        Self { width, height, pixels, map }
    }

    /// Pixels per row and rows.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The image with at most `width` pixels per row, every kept pixel as it was: averaging
    /// wrapped phases would invent values.
    #[must_use]
    pub fn thinned(&self, width: usize) -> Self {
        let step = self.width.div_ceil(width.max(1)).max(1);
        let (w, h) = (self.width.div_ceil(step), self.height.div_ceil(step));
        self.picked(w, h, |n| n * step)
    }

    /// Every pixel repeated `factor` times along both axes.
    #[must_use]
    pub fn upscaled(&self, factor: usize) -> Self {
        let factor = factor.max(1);
        self.picked(self.width * factor, self.height * factor, |n| n / factor)
    }

    fn picked(&self, width: usize, height: usize, source: impl Fn(usize) -> usize) -> Self {
        let rows = (0..height).map(|y| source(y) * self.width);
        let pixels = rows
            .flat_map(|row| (0..width).map(|x| row + source(x)).collect::<Vec<_>>())
            .map(|n| self.pixels[n])
            .collect();
        Self { width, height, pixels, map: self.map }
    }

    /// The image in no more than `levels` colours: noise then takes fewer bytes.
    #[must_use]
    pub fn with_levels(mut self, levels: usize) -> Self {
        let levels = levels.clamp(1, COLORS);
        for pixel in self.pixels.iter_mut().filter(|pixel| **pixel > 0) {
            let level = (usize::from(*pixel) - 1) * levels / COLORS;
            *pixel = (1 + (2 * level + 1) * COLORS / (2 * levels)) as u8;
        }
        self
    }

    /// The image in true colours.
    #[must_use]
    pub fn to_rgb8(&self) -> Rgb8 {
        let palette = self.map.palette();
        let colors = self.pixels.iter().flat_map(|&p| palette[usize::from(p)]);
        Rgb8 { width: self.width, height: self.height, pixels: colors.collect() }
    }

    /// The image as a PNG file with a palette.
    ///
    /// # Errors
    /// When the image has no pixel.
    pub fn png(&self) -> Result<Vec<u8>> {
        let palette = self.map.palette().as_flattened();
        encode(self.width, self.height, &self.pixels, Some(palette))
    }
}

impl Rgb8 {
    /// The image as a PNG file, with a palette when it has few colours.
    ///
    /// # Errors
    /// When the image has no pixel or `pixels` has the wrong length.
    pub fn png(&self) -> Result<Vec<u8>> {
        match self.counted() {
            Some((indices, palette)) => {
                encode(self.width, self.height, &indices, Some(palette.as_flattened()))
            }
            None => encode(self.width, self.height, &self.pixels, None),
        }
    }

    /// Every pixel as an index into the colours that occur, if these are at most 256.
    fn counted(&self) -> Option<(Vec<u8>, Vec<Rgb>)> {
        let mut known = HashMap::new();
        let mut palette = Vec::new();
        let pixels = self.pixels.as_chunks::<3>().0;
        let indices = pixels.iter().map(|&color| {
            *known.entry(color).or_insert_with(|| {
                palette.push(color);
                palette.len() - 1
            })
        });
        let indices = indices.map(|n| u8::try_from(n).ok()).collect::<Option<_>>()?;
        Some((indices, palette))
    }
}

/// Values below which the fractions `low` and `high` of all finite values lie, over all fields, so
/// that a series of images shares one scale. `(0, 1)` when no value is finite.
#[must_use]
pub fn percentiles(fields: &[ArrayView2<'_, f32>], low: f32, high: f32) -> (f32, f32) {
    /// Values looked at: enough for a percentile, few enough to sort.
    const SAMPLES: usize = 1 << 18;
    let total: usize = fields.iter().map(ArrayView2::len).sum();
    let mut values: Vec<f32> = fields
        .iter()
        .flat_map(|field| field.iter())
        .step_by((total / SAMPLES).max(1))
        .copied()
        .filter(|value| value.is_finite())
        .collect();
    values.sort_by(f32::total_cmp);
    let at = |fraction: f32| {
        let last = values.len().saturating_sub(1);
        values.get((fraction.clamp(0.0, 1.0) * last as f32).round() as usize)
    };
    match (at(low), at(high)) {
        (Some(&low), Some(&high)) => (low, high),
        _ => (0.0, 1.0),
    }
}

/// Where a value lies between two ends; the middle when the ends coincide.
fn position(value: f32, low: f32, high: f32) -> f32 {
    if value.is_finite() && high <= low {
        return 0.5;
    }
    (value - low) / (high - low)
}

fn encode(width: usize, height: usize, data: &[u8], palette: Option<&[u8]>) -> Result<Vec<u8>> {
    let failed = |what: png::EncodingError| {
        Error::failed(format!("PNG image of {width} x {height} pixels: {what}"))
    };
    let side = |n: usize| u32::try_from(n).unwrap_or(0);
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side(width), side(height));
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_filter(png::Filter::NoFilter);
    match palette {
        Some(palette) => {
            encoder.set_color(png::ColorType::Indexed);
            encoder.set_palette(palette);
        }
        None => encoder.set_color(png::ColorType::Rgb),
    }
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(data).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::figures::colormap::NO_VALUE;
    use ndarray::{Array2, array};

    /// Width, height and true colours of a PNG file.
    pub(crate) fn decoded(bytes: &[u8]) -> (u32, u32, Vec<u8>) {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        pixels.truncate(info.buffer_size());
        (info.width, info.height, pixels)
    }

    #[test]
    fn a_phase_image_decodes_to_its_colours() {
        let field = array![[0.0, std::f32::consts::PI, f32::NAN], [1.0, 7.5, -20.0]];
        let image = Indexed::phase(field.view());
        let (width, height, pixels) = decoded(&image.png().unwrap());
        assert_eq!((width, height), (3, 2));
        assert_eq!(pixels, image.to_rgb8().pixels);
        assert_eq!(pixels[6..9], NO_VALUE);
        let wide = decoded(&image.upscaled(3).to_rgb8().png().unwrap());
        assert_eq!((wide.0, wide.1), (9, 6));
        assert_eq!(wide.2[..9], pixels[..3].repeat(3));
    }

    #[test]
    fn odd_fields_are_drawn() {
        for value in [f32::NAN, f32::INFINITY, 0.0, -3.0] {
            let field = Array2::from_elem((4, 5), value);
            let range = percentiles(&[field.view()], 0.01, 0.99);
            let image = Indexed::amplitude(field.view(), range).to_rgb8();
            assert_eq!(image.pixels.chunks(3).all(|c| c == NO_VALUE), !value.is_finite());
        }
        assert!(Indexed::phase(Array2::zeros((0, 0)).view()).png().is_err());
    }

    #[test]
    fn percentiles_span_all_fields() {
        let fields = [array![[0.0, 1.0, 2.0]], array![[3.0, 4.0, f32::NAN]]];
        let views: Vec<_> = fields.iter().map(|field| field.view()).collect();
        assert_eq!(percentiles(&views, 0.25, 0.75), (1.0, 3.0));
        assert_eq!(percentiles(&[], 0.25, 0.75), (0.0, 1.0));
    }

    #[test]
    fn thinning_and_levels_keep_size_and_missing_values() {
        let field = Array2::from_shape_fn((9, 20), |(y, x)| (x * y) as f32 * 0.1);
        let image = Indexed::phase(field.view()).thinned(10);
        assert_eq!(image.size(), (10, 5));
        let mut levels = image.with_levels(16).pixels;
        levels.sort_unstable();
        levels.dedup();
        assert!(levels.len() <= 16 && levels[0] > 0);
        let missing = Indexed::phase(Array2::from_elem((1, 1), f32::NAN).view());
        assert_eq!(missing.with_levels(4).pixels, [0]);
    }
}
