//! The phase of a region, frame by frame.

use super::arguments::MethodName;
use super::follow::Follow;
use super::{Tally, Task};
use crate::cli::phase::check_looks;
use crate::error::Result;
use crate::io::{Attributes, CurveFile, CurveRow, read_mask, write_curve};
use crate::method::Method;
use crate::notes;
use crate::watch::{
    First, Frames, LinkedCurve, LinkedSettings, PaperCurve, PaperSettings, WatchedCurve, is_usable,
};
use phasewalk_core::weights::Weighting;
use std::path::{Path, PathBuf};

impl Task<'_> {
    pub(super) fn curve(&self, mut frames: Frames, path: &Path) -> Result<()> {
        let mask = read_mask(path, self.format.height, self.format.width)?;
        let pixels = mask.iter().filter(|&&inside| inside).count();
        let memory = self.curve_bytes(&mask, pixels);
        self.announce(&format!("curve of {pixels} pixels"), memory);
        let nm_per_rad = self.format.wavelength_nm.map(notes::nm_per_rad);
        let quality = self.arguments.method() == MethodName::Linked;
        let create = |path: &PathBuf| CurveFile::create(path, nm_per_rad, quality);
        let mut file = self.arguments.output.as_ref().map(create).transpose()?;
        let mut follow = Follow::curve(self, nm_per_rad, quality);
        let mut curve: Option<Box<dyn WatchedCurve>> = None;
        let mut tally = Tally::new(memory);
        let ended = frames.for_each(|number, field| {
            let usable = is_usable(field);
            if usable && curve.is_none() {
                curve = Some(self.begin_curve(field, &mask).map_err(|error| error.about(path))?);
            }
            let row = match curve.as_mut().filter(|_| usable) {
                Some(curve) => curve.push(number, field),
                None => CurveRow::missing(number, 0.0),
            };
            let row = CurveRow { time_s: self.time_of(number), ..row };
            tally.count(number, usable);
            follow.curve_row(&row);
            file.as_mut().map_or(Ok(()), |file| file.push(&row))
        });
        let mut files: Vec<PathBuf> = file.iter().map(|file| file.path().to_owned()).collect();
        files.extend(self.write_smoothed(curve.as_deref(), nm_per_rad)?);
        let pixels = curve.map_or(pixels, |curve| curve.pixels());
        self.finish(ended, &tally, &format!("{pixels} pixels"), files)
    }

    /// Memory whatever the number of frames, and that of each frame.
    fn curve_bytes(&self, mask: &[bool], pixels: usize) -> [u64; 2] {
        let history = self.arguments.history;
        let [curve, per_frame] = match self.arguments.method() {
            MethodName::Linked => LinkedCurve::bytes(mask, self.format.width, history),
            MethodName::Paper => PaperCurve::bytes(pixels, &self.paper_settings()),
        };
        [curve + self.frame_bytes(), per_frame]
    }

    fn paper_settings(&self) -> PaperSettings {
        PaperSettings {
            max_lag: self.arguments.max_lag(),
            looks: self.arguments.looks(),
            history: self.arguments.history,
        }
    }

    /// The curve, by what the first usable frame tells.
    fn begin_curve(
        &self,
        field: &[num_complex::Complex32],
        mask: &[bool],
    ) -> Result<Box<dyn WatchedCurve>> {
        let first = First::of(field, self.format.height, self.format.width)?;
        let pixels = first.chosen(mask).len() as f64;
        if self.arguments.method() == MethodName::Linked {
            let settings = LinkedSettings {
                looks: self.arguments.looks(),
                keep_leakage: self.arguments.keep_leakage,
                history: self.arguments.history,
            };
            let curve = LinkedCurve::new(&first, mask, settings)?;
            check_looks(Method::Linked, curve.looks(), pixels, "--mask")?;
            return Ok(Box::new(curve));
        }
        let curve = PaperCurve::new(&first, mask, self.paper_settings())?;
        check_looks(Method::Paper(Weighting::Paper), curve.looks(), pixels, "--mask")?;
        Ok(Box::new(curve))
    }

    /// The smoothed curve, where a history was kept.
    fn write_smoothed(
        &self,
        curve: Option<&dyn WatchedCurve>,
        nm_per_rad: Option<f64>,
    ) -> Result<Vec<PathBuf>> {
        let rows = curve.and_then(WatchedCurve::smoothed).filter(|rows| !rows.is_empty());
        let (Some(path), Some(mut rows)) = (self.arguments.smoothed(), rows) else {
            return Ok(Vec::new());
        };
        for row in &mut rows {
            row.time_s = self.time_of(row.frame);
        }
        write_curve(&path, &rows, nm_per_rad, None, Attributes::new())
    }
}
