//! From a header's texts to numbers, with the key named when one of them is no good.
//!
//! CIH and CIHX name the same facts differently; both become a [`CameraHeader`] here.

use super::header::{CameraHeader, Side};
use super::samples::Packing;
use crate::error::{Error, Result};
use std::path::Path;
use std::str::FromStr;

/// Faster than any camera.
const FASTEST_HZ: f64 = 1e10;

/// Which name each fact has in one kind of header.
pub(super) struct Keys {
    pub(super) file_format: &'static str,
    pub(super) width: &'static str,
    pub(super) height: &'static str,
    pub(super) images: &'static str,
    pub(super) stored_bits: &'static str,
    pub(super) effective_bits: &'static str,
    pub(super) side: &'static str,
    pub(super) color: &'static str,
    pub(super) rate_hz: &'static str,
    pub(super) save_step: &'static str,
    pub(super) recorded_images: &'static str,
    pub(super) start_image: &'static str,
    pub(super) device: &'static str,
    pub(super) comment: &'static str,
    pub(super) date: &'static str,
    pub(super) time: &'static str,
}

/// The texts of a header by their keys.
pub(super) struct Fields<'a> {
    pub(super) path: &'a Path,
    /// The text of a key, trimmed.
    pub(super) text: &'a dyn Fn(&str) -> Option<String>,
}

impl Fields<'_> {
    /// All facts but the shutter, which the two kinds write differently.
    pub(super) fn header(&self, keys: &Keys, shutter_s: Option<f64>) -> Result<CameraHeader> {
        self.expect_raw_grey(keys)?;
        let images = self.number(keys.images)?;
        let header = CameraHeader {
            images,
            height: self.number(keys.height)?,
            width: self.number(keys.width)?,
            packing: self.packing(keys)?,
            effective_bits: self.number(keys.effective_bits)?,
            side: self.side(keys)?,
            rate_hz: self.rate_hz(keys)?,
            save_step: self.optional(keys.save_step).filter(|&step| step > 0).unwrap_or(1),
            shutter_s: shutter_s.filter(|&s| s.is_finite() && s > 0.0),
            recorded_images: self.optional(keys.recorded_images).unwrap_or(images),
            start_image: self.optional(keys.start_image).unwrap_or(0),
            device: self.words(keys.device),
            comment: self.words(keys.comment),
            date: self.words(keys.date),
            time: self.words(keys.time),
        };
        header.check(self.path)?;
        Ok(header)
    }

    /// A number that need not be there.
    pub(super) fn optional<T: FromStr>(&self, key: &str) -> Option<T> {
        (self.text)(key)?.parse().ok()
    }

    /// A text that need not be there.
    fn words(&self, key: &str) -> String {
        (self.text)(key).unwrap_or_default()
    }

    fn required(&self, key: &str) -> Result<String> {
        (self.text)(key).filter(|text| !text.is_empty()).ok_or_else(|| {
            self.refuse(format!("'{key}' is missing in the header: copy the header file again"))
        })
    }

    fn number<T: FromStr>(&self, key: &str) -> Result<T> {
        let text = self.required(key)?;
        text.parse().map_err(|_| {
            let shown = shortened(&text);
            self.refuse(format!(
                "'{key}' is '{shown}', which cannot be: copy the header file again"
            ))
        })
    }

    /// One number per pixel, in a file of raw images.
    fn expect_raw_grey(&self, keys: &Keys) -> Result<()> {
        let format = self.required(keys.file_format)?;
        if !format.eq_ignore_ascii_case("mraw") {
            let shown = shortened(&format);
            return Err(self.refuse(format!(
                "the images are saved as '{shown}': save them as MRAW in the camera's program"
            )));
        }
        // `Raw` is what newer cameras write for counts as they come from the sensor.
        match (self.text)(keys.color) {
            Some(color) if !["mono", "raw", ""].contains(&color.to_lowercase().as_str()) => {
                let shown = shortened(&color);
                Err(self.refuse(format!(
                    "the images are of colour type '{shown}': one grey value per pixel is needed"
                )))
            }
            _ => Ok(()),
        }
    }

    fn packing(&self, keys: &Keys) -> Result<Packing> {
        let bits = self.number(keys.stored_bits)?;
        Packing::of_bits(bits).ok_or_else(|| {
            self.refuse(format!(
                "{bits} bits per pixel are not known: save the images with 8, 10, 12 or 16 bits"
            ))
        })
    }

    fn side(&self, keys: &Keys) -> Result<Side> {
        let text = self.required(keys.side)?;
        let sides = [Side::Lower, Side::Higher];
        sides.into_iter().find(|side| text.eq_ignore_ascii_case(side.word())).ok_or_else(|| {
            let (key, shown) = (keys.side, shortened(&text));
            self.refuse(format!("'{key}' is '{shown}': Lower or Higher is needed"))
        })
    }

    /// Cameras that a foreign clock drives may not know their rate and write 0.
    fn rate_hz(&self, keys: &Keys) -> Result<Option<f64>> {
        let Some(text) = (self.text)(keys.rate_hz).filter(|text| !text.is_empty()) else {
            return Ok(None);
        };
        match text.parse::<f64>() {
            Ok(0.0) => Ok(None),
            Ok(rate) if rate > 0.0 && rate <= FASTEST_HZ => Ok(Some(rate)),
            _ => {
                let (key, shown) = (keys.rate_hz, shortened(&text));
                Err(self.refuse(format!(
                    "'{key}' is '{shown}', which cannot be: copy the header file again"
                )))
            }
        }
    }

    fn refuse(&self, what: String) -> Error {
        Error::file(self.path, what)
    }
}

/// Enough of a damaged text to recognise it, in one line.
pub(super) fn shortened(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(80).collect()
}

/// A text without the characters that neither header can hold.
pub(super) fn one_line(text: &str) -> String {
    let forbidden = |c: char| {
        c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}' | '\u{2028}' | '\u{2029}' | '\u{85}')
    };
    text.chars().map(|c| if forbidden(c) { ' ' } else { c }).collect()
}
