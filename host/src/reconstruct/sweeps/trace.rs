//! What is kept of every image to find the sweeps: the mean of a few groups of pixels.

use crate::error::{Error, Result};

/// Group means of all images of a recording, in order.
///
/// The source's spectrum and the fixed fringes repeat in every sweep; the sample's fringes do not.
/// A group should average them out: some ten speckles or more, from rows with light.
#[derive(Clone, Debug)]
pub struct Trace {
    /// P, groups per image.
    channels: usize,
    /// Largest count of the camera.
    full_scale: u16,
    /// Group means in counts (DN), shape (image, P).
    means: Vec<f32>,
    /// Share of the pixels at full scale, one per image.
    clipped: Vec<f32>,
}

impl Trace {
    /// An empty trace of `channels` groups from a camera of `bits` per pixel.
    ///
    /// # Errors
    /// No group, or a bit depth outside 1 ..= 16.
    pub fn new(channels: usize, bits: u32) -> Result<Self> {
        if channels == 0 || !(1..=16).contains(&bits) {
            return Err(Error::failed(format!(
                "trace of the sweeps: {channels} groups of {bits} bits: needs groups, and 1 to 16 bits"
            )));
        }
        let full_scale = ((1_u32 << bits) - 1) as u16;
        Ok(Self { channels, full_scale, means: Vec::new(), clipped: Vec::new() })
    }

    /// Adds the next image: `pixels` are split into P runs of equal length.
    pub fn push(&mut self, pixels: &[u16]) {
        let count = pixels.len().max(1);
        let mut clipped = 0;
        for channel in 0..self.channels {
            let from = pixels.len() * channel / self.channels;
            let group = &pixels[from..pixels.len() * (channel + 1) / self.channels];
            let sum: u64 = group.iter().map(|&pixel| u64::from(pixel)).sum();
            clipped += group.iter().filter(|&&pixel| pixel >= self.full_scale).count();
            self.means.push((sum as f64 / group.len().max(1) as f64) as f32);
        }
        self.clipped.push(clipped as f32 / count as f32);
    }

    /// Adds the images of `next`, as when parts of the recording were read side by side.
    ///
    /// # Errors
    /// `next` has other groups or another camera.
    pub fn append(&mut self, next: Self) -> Result<()> {
        if (next.channels, next.full_scale) != (self.channels, self.full_scale) {
            return Err(Error::failed("trace of the sweeps: the parts have different groups"));
        }
        self.means.extend(next.means);
        self.clipped.extend(next.clipped);
        Ok(())
    }

    /// Number of images so far.
    #[must_use]
    pub fn images(&self) -> usize {
        self.clipped.len()
    }

    /// P, groups per image.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Share of the pixels at full scale, one per image.
    #[must_use]
    pub fn clipped(&self) -> &[f32] {
        &self.clipped
    }

    /// Largest count of the camera.
    #[must_use]
    pub fn full_scale(&self) -> u16 {
        self.full_scale
    }

    /// Group means of one image in DN.
    pub(super) fn image(&self, image: usize) -> &[f32] {
        &self.means[image * self.channels..][..self.channels]
    }

    /// Mean over the groups, one per image, in DN.
    #[must_use]
    pub fn brightness(&self) -> Vec<f32> {
        let mean = |image: &[f32]| image.iter().sum::<f32>() / self.channels as f32;
        self.means.chunks_exact(self.channels).map(mean).collect()
    }
}
