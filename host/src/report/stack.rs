//! A series of images, one per frame, small enough to be carried inside a page.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use ndarray::{ArrayView2, ArrayView3};

use crate::error::Result;
use crate::figures::raster::{Indexed, percentiles};

/// Most pixels across an image in a page.
pub const WIDTH: usize = 320;
/// Colours of an image in a page: pure noise then takes six bits per pixel, not eight, and a step
/// of phase is still only a tenth of a radian.
const LEVELS: usize = 64;

/// Images of all frames of a scene, in one way of looking at it.
#[derive(Clone, Debug)]
pub struct Stack {
    label: String,
    cyclic: bool,
    images: Vec<Vec<u8>>,
}

impl Stack {
    /// Speckle amplitudes, axes (time, y, x), on one grey scale for all frames.
    ///
    /// # Errors
    /// When a frame has no pixel.
    pub fn speckle(label: &str, frames: ArrayView3<'_, f32>) -> Result<Self> {
        let views: Vec<_> = frames.outer_iter().collect();
        let (_, high) = percentiles(&views, 0.0, 0.995);
        Self::encoded(label, false, frames, |frame| Indexed::amplitude(frame, (0.0, high)))
    }

    /// Phases in radians, axes (time, y, x).
    ///
    /// # Errors
    /// When a frame has no pixel.
    pub fn phase(label: &str, frames: ArrayView3<'_, f32>) -> Result<Self> {
        Self::encoded(label, true, frames, Indexed::phase)
    }

    /// PNG files made elsewhere; `cyclic` when their colours are the phase map's.
    #[must_use]
    pub fn from_png(label: &str, cyclic: bool, images: Vec<Vec<u8>>) -> Self {
        Self { label: label.to_owned(), cyclic, images }
    }

    fn encoded<'a>(
        label: &str,
        cyclic: bool,
        frames: ArrayView3<'a, f32>,
        image: impl Fn(ArrayView2<'_, f32>) -> Indexed,
    ) -> Result<Self> {
        let png = |frame| image(frame).thinned(WIDTH).with_levels(LEVELS).png();
        let images = frames.outer_iter().map(png).collect::<Result<_>>()?;
        Ok(Self::from_png(label, cyclic, images))
    }

    /// What the images show.
    #[must_use]
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Whether the colours mean a phase.
    #[must_use]
    pub fn is_cyclic(&self) -> bool {
        self.cyclic
    }

    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// Whether there is no frame.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    /// Every image as the address of itself.
    pub(super) fn addresses(&self) -> impl Iterator<Item = String> {
        self.images.iter().map(|image| png_address(image))
    }
}

/// A PNG file as a `data:` address.
pub(super) fn png_address(image: &[u8]) -> String {
    format!("data:image/png;base64,{}", BASE64.encode(image))
}
