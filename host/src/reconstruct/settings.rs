//! What the user says about a recording.

use super::dispersion::Dispersion;
use super::spectra::Compensation;
use super::spectrum::Direction;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Parameters of a reconstruction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// K: images of a sweep.
    pub images: usize,
    /// Centre wavelength, nm.
    pub wavelength_nm: f64,
    /// Width of the band that the K images span, nm.
    pub bandwidth_nm: f64,
    /// Refractive index of the sample.
    pub refractive_index: f64,
    /// Direction of the sweep.
    pub direction: Direction,
    /// Write whole volumes instead of the layers' surroundings.
    pub full: bool,
    /// How dispersion is found.
    pub compensation: Compensation,
    /// Known depth of the IS/OS at the centre of the field, depth pixels.
    pub isos_px: Option<f64>,
    /// Known length of the outer segments, um.
    pub outer_segment_um: Option<f64>,
}

impl Settings {
    /// One depth pixel: lambda^2 / (2 n bandwidth), um in tissue.
    #[must_use]
    pub fn depth_px_um(&self) -> f64 {
        self.wavelength_nm.powi(2) / (2.0 * self.refractive_index * self.bandwidth_nm) / 1000.0
    }

    /// Check all of them.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag.
    pub fn validate(&self) -> Result<()> {
        if !(16..=8192).contains(&self.images) {
            let images = self.images;
            return Err(Error::usage(format!("--images {images}: must be between 16 and 8192")));
        }
        for (flag, value) in [
            ("--wavelength-nm", self.wavelength_nm),
            ("--bandwidth-nm", self.bandwidth_nm),
            ("--index", self.refractive_index),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::usage(format!("{flag} {value}: must be a positive number")));
            }
        }
        if let Compensation::Known(Dispersion { a2, a3 }) = self.compensation {
            // Beyond that its phase turns by more than pi from image to image.
            let most = std::f64::consts::PI * self.images as f64 / 2.0;
            let turns = 2.0 * a2.abs() + 3.0 * a3.abs();
            if turns.is_nan() || turns > most {
                return Err(Error::usage(format!(
                    "--dispersion {a2},{a3}: 2 |A2| + 3 |A3| must be at most {most:.0} with {} images",
                    self.images
                )));
            }
        }
        if self.bandwidth_nm >= self.wavelength_nm {
            return Err(Error::usage(format!(
                "--bandwidth-nm {}: must be less than the wavelength of {} nm",
                self.bandwidth_nm, self.wavelength_nm
            )));
        }
        for (flag, value) in
            [("--isos-px", self.isos_px), ("--outer-segment-um", self.outer_segment_um)]
        {
            if value.is_some_and(|value| !(value.is_finite() && value > 0.0)) {
                return Err(Error::usage(format!("{flag}: must be a positive number")));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn settings() -> Settings {
        Settings {
            images: 256,
            wavelength_nm: 841.0,
            bandwidth_nm: 51.0,
            direction: Direction::Up,
            full: false,
            compensation: Compensation::Estimated,
            refractive_index: 1.36,
            isos_px: None,
            outer_segment_um: None,
        }
    }

    #[test]
    fn a_depth_pixel_of_the_papers_source() {
        assert!((settings().depth_px_um() - 5.1).abs() < 0.01);
        assert!(settings().validate().is_ok());
    }

    #[test]
    fn wrong_parameters_name_their_flag() {
        type Change = fn(&mut Settings);
        let cases: [(&str, Change); 6] = [
            ("--images 3", |s| s.images = 3),
            ("--wavelength-nm NaN", |s| s.wavelength_nm = f64::NAN),
            ("--bandwidth-nm 0", |s| s.bandwidth_nm = 0.0),
            ("--bandwidth-nm 900", |s| s.bandwidth_nm = 900.0),
            ("--dispersion", |s| {
                s.compensation = Compensation::Known(Dispersion { a2: 1e9, a3: 0.0 });
            }),
            ("--isos-px", |s| s.isos_px = Some(-1.0)),
        ];
        for (words, change) in cases {
            let mut wrong = settings();
            change(&mut wrong);
            let error = wrong.validate().unwrap_err();
            assert!(error.to_string().contains(words), "{error}");
        }
    }
}
