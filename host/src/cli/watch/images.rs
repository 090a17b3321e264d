//! The newest phase image.

use super::follow::Follow;
use super::{Tally, Task};
use crate::cli::phase::check_looks;
use crate::error::Result;
use crate::image::{Kernel, NewestImages, NewestSettings};
use crate::io::{Attributes, FrameFormat, ImageFile};
use crate::lanes::Path as LanePath;
use crate::method::Method;
use crate::watch::{First, Frames, is_usable};
use num_complex::Complex32;
use phasewalk_core::params::RANDOM_PROBABILITY;
use phasewalk_core::weights::{Weighting, Weights};
use serde_json::json;
use std::path::PathBuf;

impl Task<'_> {
    pub(super) fn images(&self, mut frames: Frames, sigma_px: f64) -> Result<()> {
        let FrameFormat { height, width, .. } = self.format;
        let kernel = Kernel::new(sigma_px, height, width, false)?;
        let path = LanePath::best()?;
        let settings = |looks: f64, scale: f32| NewestSettings {
            kernel: kernel.clone(),
            max_lag: self.arguments.max_lag(),
            weights: Weights::new(Weighting::Paper, looks, RANDOM_PROBABILITY),
            scale,
            threads: self.common.threads(),
            path,
        };
        let bytes = settings(kernel.nominal_looks(), 1.0).bytes()?;
        let memory = [bytes + self.frame_bytes(), 0];
        let threads = self.common.threads();
        self.announce(&format!("images of {width} x {height} pixels on {threads} threads"), memory);
        let create = |path: &PathBuf| ImageFile::create(path, height, width, self.facts());
        let mut file = self.arguments.output.as_ref().map(create).transpose()?;
        let follow = Follow::images(self);
        let mut images: Option<NewestImages> = None;
        let mut tally = Tally::new(memory);
        let ended = frames.for_each(|number, field| {
            let usable = is_usable(field);
            tally.count(number, usable);
            if !usable {
                follow.image(number, self.time_of(number), None);
                return file.as_mut().map_or(Ok(()), ImageFile::push_missing);
            }
            if images.is_none() {
                let (looks, scale) = self.first_image(field, &kernel)?;
                images = Some(NewestImages::start(&settings(looks, scale))?);
            }
            let Some(images) = &mut images else { return Ok(()) };
            let image = images.push(field)?;
            follow.image(number, self.time_of(number), Some(&image));
            tally.unmeasured += image.unmeasured;
            file.as_mut().map_or(Ok(()), |file| file.push(&image.phases))
        });
        let files = file.iter().map(|file| file.path().to_owned()).collect();
        self.finish(ended, &tally, &format!("{width} x {height} pixels"), files)
    }

    /// Looks of the weights and the scale, by what the first usable frame tells.
    fn first_image(&self, field: &[Complex32], kernel: &Kernel) -> Result<(f64, f32)> {
        let first = First::of(field, kernel.height, kernel.width)?;
        let effective = first.looks_of_kernel(kernel)?;
        let nominal = kernel.nominal_looks();
        let looks = self.arguments.looks().choose(nominal, effective);
        check_looks(Method::Paper(Weighting::Paper), looks, nominal, "--gaussian")?;
        Ok((looks, first.scale()))
    }

    /// What is kept with images of all frames.
    fn facts(&self) -> Attributes {
        let mut facts = Attributes::new();
        for (key, value) in [
            ("software", json!(concat!("phasewalk ", env!("CARGO_PKG_VERSION")))),
            ("series", json!(self.arguments.source)),
            ("gaussian_px", json!(self.arguments.gaussian)),
            ("max_lag", json!(self.arguments.max_lag())),
            ("interval_s", json!(self.format.interval_s)),
            ("wavelength_nm", json!(self.format.wavelength_nm)),
        ] {
            if !value.is_null() {
                facts.insert(key.to_owned(), value);
            }
        }
        facts
    }
}
