//! What a camera's header says about its images, whichever file it stands in.

use super::samples::Packing;
use crate::error::{Error, Result};
use std::path::Path;

/// More than any camera has; a damaged number is usually far beyond.
const LARGEST_SIDE: usize = 65_536;
/// Three hours at 100,000 images per second; with the largest sides, bytes still fit 64 bits.
const MOST_IMAGES: usize = 1 << 30;

/// Where the significant bits lie in a count that has room for more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// In the lowest bits.
    Lower,
    /// In the highest bits.
    Higher,
}

impl Side {
    /// The camera's word for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Lower => "Lower",
            Self::Higher => "Higher",
        }
    }
}

/// The header of a recording: layout of its images, and how they were taken.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraHeader {
    /// Images in the file.
    pub images: usize,
    /// Rows of an image.
    pub height: usize,
    /// Columns of an image.
    pub width: usize,
    /// How a count lies in the file.
    pub packing: Packing,
    /// Bits the camera's converter gives.
    pub effective_bits: u32,
    /// Where they lie in the stored count.
    pub side: Side,
    /// Images per second while recording.
    pub rate_hz: Option<f64>,
    /// Every so many of the recorded images is in the file; 1 is all.
    pub save_step: usize,
    /// Exposure time of an image in seconds.
    pub shutter_s: Option<f64>,
    /// Images in the camera's memory, of which the file may hold a part.
    pub recorded_images: usize,
    /// Number the camera gave the first image in the file; negative before a trigger.
    pub start_image: i64,
    /// Type of the camera.
    pub device: String,
    /// The user's comment.
    pub comment: String,
    /// Day of the recording as the camera writes it, such as `2026/4/21`.
    pub date: String,
    /// Time of day as the camera writes it, such as `00:11`.
    pub time: String,
}

impl CameraHeader {
    /// The header of grey images with all stored bits significant, and nothing else known.
    #[must_use]
    pub fn new(images: usize, height: usize, width: usize, packing: Packing) -> Self {
        Self {
            images,
            height,
            width,
            packing,
            effective_bits: packing.bits(),
            side: Side::Lower,
            rate_hz: None,
            save_step: 1,
            shutter_s: None,
            recorded_images: images,
            start_image: 0,
            device: String::new(),
            comment: String::new(),
            date: String::new(),
            time: String::new(),
        }
    }

    /// Bits of a count once it is unpacked: it saturates at 2^bits - 1.
    ///
    /// A camera of 12 bits also writes files of 8.
    #[must_use]
    pub fn significant_bits(&self) -> u32 {
        self.effective_bits.min(self.packing.bits())
    }

    /// Images per second in the file.
    #[must_use]
    pub fn image_rate_hz(&self) -> Option<f64> {
        self.rate_hz.map(|rate| rate / self.save_step as f64)
    }

    /// Counts of an image.
    pub(super) fn counts_per_image(&self) -> usize {
        self.height * self.width
    }

    /// Bytes of an image.
    pub(super) fn bytes_per_image(&self) -> u64 {
        self.packing.bytes_of(self.counts_per_image()) as u64
    }

    /// Bytes of all images.
    pub(super) fn image_bytes(&self) -> u64 {
        self.images as u64 * self.bytes_per_image()
    }

    /// Bits by which a stored count lies above the significant one.
    pub(super) fn shift(&self) -> u32 {
        match self.side {
            Side::Lower => 0,
            Side::Higher => self.packing.bits() - self.significant_bits(),
        }
    }

    /// Refuse a layout that no camera has or no file can hold.
    pub(super) fn check(&self, path: &Path) -> Result<()> {
        let refuse = |what: String| Err(Error::file(path, what));
        for (name, value, most) in [
            ("image width", self.width, LARGEST_SIDE),
            ("image height", self.height, LARGEST_SIDE),
            ("number of images", self.images, MOST_IMAGES),
        ] {
            if !(1..=most).contains(&value) {
                return refuse(format!(
                    "the header's {name} is {value}, which cannot be: copy the header file again"
                ));
            }
        }
        if !(1..=16).contains(&self.effective_bits) {
            return refuse(format!(
                "the header claims {} effective bits, 1 to 16 can be: copy the header file again",
                self.effective_bits
            ));
        }
        let (group, _) = self.packing.group();
        if !self.counts_per_image().is_multiple_of(group) {
            return refuse(format!(
                "{} x {} pixels of {} bits do not fill whole bytes: take another width, or 16 bits",
                self.width,
                self.height,
                self.packing.bits()
            ));
        }
        Ok(())
    }
}
