//! The parameters of a recording, their limits, and their names for `--set`.

use super::retina::{ISOS, Layer, TIPS, layers};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Longest side of an image and largest number of sweeps and images.
const MAX_COUNT: usize = 65_536;

/// Everything that determines a recording, byte for byte.
///
/// A sweep's band coordinate is q(m) = (m − (K − 1)/2)/(K/2), m the image in the sweep, K images a
/// sweep. One depth pixel is one bin of the unpadded Fourier transform, λ²/(2nΔλ).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OctScene {
    /// Number of sweeps, V.
    pub sweeps: usize,
    /// Images per sweep, K.
    pub images: usize,
    /// Rows of an image.
    pub height: usize,
    /// Columns of an image.
    pub width: usize,
    /// Bits a pixel takes in the file: 12, packed, or 16. The camera has 12 bits either way.
    pub bits: u32,
    /// Key of all random numbers.
    pub seed: u64,
    /// Wavelength in the middle of the band, in air (paper line 697: 841 nm).
    pub wavelength_nm: f64,
    /// Width of the band (line 698: 51 nm).
    pub bandwidth_nm: f64,
    /// Refractive index of the retina.
    pub refractive_index: f64,
    /// Images per second (line 687: 60,000).
    pub frame_rate_hz: f64,
    /// Time from sweep to sweep, seconds (70 sweeps of the paper take 14.6 s).
    pub sweep_period_s: f64,
    /// Whether the wavenumber descends during a sweep.
    pub down_sweep: bool,
    /// The layers of the retina.
    pub layers: Vec<Layer>,
    /// Rise of the retina over the height and over the width, depth pixels.
    pub surface_tilt_px: [f64; 2],
    /// Depth of the retina's middle below its corners, depth pixels.
    pub curvature_px: f64,
    /// Scatterers per pixel and layer.
    pub scatterers_per_pixel: usize,
    /// Cut-off of the circular aperture, cycles per pixel.
    pub aperture_cycles_per_pixel: f64,
    /// Pixel pitch in wavelengths (line 613).
    pub pitch_wavelengths: f64,
    /// σ of a scatterer's random step from sweep to sweep in x, y and z, wavelengths in the retina:
    /// for the layers in front of the outer segments, and for those behind.
    pub micro_motion_wavelengths: [f64; 2],
    /// Lateral motion, uniform within ± this, each sweep its own, pixels.
    pub lateral_px: f64,
    /// Axial motion, uniform within ± this, each sweep its own, depth pixels.
    pub axial_px: f64,
    /// Lateral drift over the whole recording, uniform between these, pixels.
    pub drift_px: [f64; 2],
    /// Number of saccades, each within one sweep.
    pub saccades: usize,
    /// Length of a saccade, uniform between these, pixels.
    pub saccade_px: [f64; 2],
    /// Number of successive sweeps that a blink hides.
    pub blink_sweeps: usize,
    /// Largest torsion of the eye, degrees.
    pub torsion_deg: f64,
    /// Depth shift by axial velocity during a sweep: standard deviation, depth pixels.
    pub doppler_px: f64,
    /// Depth shift by axial velocity in the wildest sweeps, depth pixels; most have far less.
    pub doppler_peak_px: f64,
    /// Phase c of c·q² by axial acceleration during a sweep: standard deviation, radians.
    pub chirp_rad: f64,
    /// Tilt of the bulk phase over the width and over the height, uniform within ± this, radians.
    pub phase_tilt_rad: f64,
    /// A sweep's first image is up to this late, images.
    pub start_jitter_images: f64,
    /// Dispersion (a₂, a₃): the phase a₂q² + a₃q³ in the recording for positive depth, radians.
    pub dispersion_rad: [f64; 2],
    /// Nonlinearity ε of the sweep: depth d shows the phase πd(q + ε(q² − 1)).
    pub nonlinearity: f64,
    /// Counts of an average pixel, averaged over the band.
    pub mean_dn: f64,
    /// Counts without light.
    pub offset_dn: f64,
    /// Root mean square amplitude of the fringes of the IS/OS in an average pixel, counts.
    pub isos_fringe_dn: f64,
    /// Electrons per count.
    pub electrons_per_dn: f64,
    /// Read noise, electrons.
    pub read_noise_electrons: f64,
    /// Light missing in the corners, as a fraction.
    pub vignetting: f64,
    /// Standard deviation of the pixels' gain.
    pub gain_pattern: f64,
    /// Amplitude of the source's drift from sweep to sweep.
    pub power_drift: f64,
    /// Number of parasitic interference patterns.
    pub fixed_fringes: usize,
    /// Their amplitude over that of the IS/OS.
    pub fixed_fringe_brightness: f64,
    /// Sweeps with too much light.
    pub saturated_sweeps: usize,
    /// How much too much.
    pub saturation_factor: f64,
    /// Sweeps without any light.
    pub missing_sweeps: usize,
    /// Sweeps that end early.
    pub short_sweeps: usize,
    /// Images of such a sweep.
    pub short_images: usize,
    /// Fraction of dead pixels.
    pub dead_pixel_fraction: f64,
}

/// Counts of a saturated pixel: the camera has 12 bits.
pub const FULL_SCALE: u16 = 4095;

impl Default for OctScene {
    /// A still, clean recording; the presets start from it.
    fn default() -> Self {
        Self {
            sweeps: 24,
            images: 256,
            height: 96,
            width: 144,
            bits: 16,
            seed: 1,
            wavelength_nm: 841.0,
            bandwidth_nm: 51.0,
            refractive_index: 1.36,
            frame_rate_hz: 60_000.0,
            sweep_period_s: 14.6 / 70.0,
            down_sweep: false,
            layers: layers(),
            surface_tilt_px: [0.0; 2],
            curvature_px: 0.0,
            scatterers_per_pixel: 3,
            aperture_cycles_per_pixel: 0.24,
            pitch_wavelengths: 4.0,
            micro_motion_wavelengths: [0.0; 2],
            lateral_px: 0.0,
            axial_px: 0.0,
            drift_px: [0.0; 2],
            saccades: 0,
            saccade_px: [15.0, 40.0],
            blink_sweeps: 0,
            torsion_deg: 0.0,
            doppler_px: 0.0,
            doppler_peak_px: 0.0,
            chirp_rad: 0.0,
            phase_tilt_rad: 0.0,
            start_jitter_images: 0.0,
            dispersion_rad: [0.0; 2],
            nonlinearity: 0.0,
            mean_dn: 1900.0,
            offset_dn: 40.0,
            isos_fringe_dn: 30.0,
            electrons_per_dn: 4.9,
            read_noise_electrons: 5.0,
            vignetting: 0.25,
            gain_pattern: 0.015,
            power_drift: 0.01,
            fixed_fringes: 3,
            fixed_fringe_brightness: 1.0,
            saturated_sweeps: 0,
            saturation_factor: 3.0,
            missing_sweeps: 0,
            short_sweeps: 0,
            short_images: 37,
            dead_pixel_fraction: 0.0,
        }
    }
}

impl OctScene {
    /// Change the parameter `name` to what `text` says, a number, `true`, or a list as in JSON.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no such parameter or the text is no value for it.
    pub fn set(&mut self, name: &str, text: &str) -> Result<()> {
        let wrong =
            |why: &dyn std::fmt::Display| Error::usage(format!("--set {name}={text}: {why}"));
        let mut all = self.parameters()?;
        if !all.contains_key(name) {
            let known: Vec<&str> = all.keys().map(String::as_str).collect();
            return Err(wrong(&format!(
                "there is no such parameter; known are {}",
                known.join(", ")
            )));
        }
        let value: Value = serde_json::from_str(text)
            .map_err(|_| wrong(&"the value must be a number, true, false or a [list]"))?;
        all.insert(name.to_owned(), value);
        *self = serde_json::from_value(Value::Object(all)).map_err(|error| wrong(&error))?;
        Ok(())
    }

    /// All parameters by name.
    ///
    /// # Errors
    /// When they cannot be written as JSON.
    pub fn parameters(&self) -> Result<serde_json::Map<String, Value>> {
        match serde_json::to_value(self) {
            Ok(Value::Object(all)) => Ok(all),
            other => Err(Error::failed(format!("the parameters cannot be written: {other:?}"))),
        }
    }

    /// Check every parameter by itself.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the parameter, the value and the allowed range.
    pub fn validate(&self) -> Result<()> {
        self.validate_counts()?;
        self.validate_optics()?;
        self.validate_motion()?;
        self.validate_camera()?;
        self.validate_layers()
    }

    fn validate_counts(&self) -> Result<()> {
        within("--sweeps", self.sweeps, 2, MAX_COUNT)?;
        within("--images", self.images, 32, MAX_COUNT)?;
        within("--height", self.height, 8, MAX_COUNT)?;
        within("--width", self.width, 8, MAX_COUNT)?;
        within("scatterers_per_pixel", self.scatterers_per_pixel, 1, 1000)?;
        within("short_images", self.short_images, 1, self.images - 1)?;
        if !matches!(self.bits, 12 | 16) {
            return Err(Error::usage(format!("--bits {}: must be 12 or 16", self.bits)));
        }
        let pixels = self.height * self.width;
        if pixels > u32::MAX as usize || (self.bits == 12 && !pixels.is_multiple_of(2)) {
            return Err(Error::usage(format!(
                "--height {} --width {}: 12 bits need an even number of pixels, below 2^32",
                self.height, self.width
            )));
        }
        Ok(())
    }

    fn validate_optics(&self) -> Result<()> {
        within("--wavelength-nm", self.wavelength_nm, 1.0, 1e6)?;
        within("--bandwidth-nm", self.bandwidth_nm, 0.1, self.wavelength_nm)?;
        within("refractive_index", self.refractive_index, 1.0, 4.0)?;
        within("frame_rate_hz", self.frame_rate_hz, 1.0, 1e9)?;
        within("sweep_period_s", self.sweep_period_s, 1e-9, 1e6)?;
        within("aperture_cycles_per_pixel", self.aperture_cycles_per_pixel, 0.01, 0.25)?;
        within("pitch_wavelengths", self.pitch_wavelengths, 0.1, 1e6)?;
        within("nonlinearity", self.nonlinearity, -0.05, 0.05)?;
        all_within("dispersion_rad", &self.dispersion_rad, -200.0, 200.0)
    }

    fn validate_motion(&self) -> Result<()> {
        all_within("micro_motion_wavelengths", &self.micro_motion_wavelengths, 0.0, 1.0)?;
        within("lateral_px", self.lateral_px, 0.0, 1000.0)?;
        within("axial_px", self.axial_px, 0.0, 1000.0)?;
        all_within("drift_px", &self.drift_px, 0.0, 1000.0)?;
        all_within("saccade_px", &self.saccade_px, 0.0, 1000.0)?;
        within("torsion_deg", self.torsion_deg, 0.0, 10.0)?;
        within("doppler_px", self.doppler_px, 0.0, 100.0)?;
        within("doppler_peak_px", self.doppler_peak_px, 0.0, 100.0)?;
        within("chirp_rad", self.chirp_rad, 0.0, 100.0)?;
        within("phase_tilt_rad", self.phase_tilt_rad, 0.0, 100.0)?;
        within("start_jitter_images", self.start_jitter_images, 0.0, 1.0)?;
        let special = self.saturated_sweeps + self.missing_sweeps + self.short_sweeps;
        let special = special + self.saccades + self.blink_sweeps;
        if 2 * special >= self.sweeps {
            return Err(Error::usage(format!(
                "--sweeps {}: too few for {special} sweeps with faults, saccades or a blink",
                self.sweeps
            )));
        }
        Ok(())
    }

    fn validate_camera(&self) -> Result<()> {
        let full = f64::from(FULL_SCALE);
        within("mean_dn", self.mean_dn, 1.0, full)?;
        within("offset_dn", self.offset_dn, 0.0, self.mean_dn / 2.0)?;
        within("isos_fringe_dn", self.isos_fringe_dn, 0.0, full)?;
        within("electrons_per_dn", self.electrons_per_dn, 1e-3, 1e6)?;
        within("read_noise_electrons", self.read_noise_electrons, 0.0, 1e6)?;
        within("vignetting", self.vignetting, 0.0, 0.9)?;
        within("gain_pattern", self.gain_pattern, 0.0, 0.1)?;
        within("power_drift", self.power_drift, 0.0, 0.5)?;
        within("fixed_fringes", self.fixed_fringes, 0, 8)?;
        within("fixed_fringe_brightness", self.fixed_fringe_brightness, 0.0, 100.0)?;
        within("saturation_factor", self.saturation_factor, 1.0, 1e3)?;
        within("dead_pixel_fraction", self.dead_pixel_fraction, 0.0, 0.5)
    }

    fn validate_layers(&self) -> Result<()> {
        all_within("surface_tilt_px", &self.surface_tilt_px, -1000.0, 1000.0)?;
        within("curvature_px", self.curvature_px, -1000.0, 1000.0)?;
        for layer in &self.layers {
            within("offset_px of a layer", layer.offset_px, -1000.0, 1000.0)?;
            within("thickness_px of a layer", layer.thickness_px, 0.0, 1000.0)?;
            within("brightness of a layer", layer.brightness, 0.0, 1000.0)?;
        }
        for name in [ISOS, TIPS] {
            self.layer_offset_px(name)?;
        }
        Ok(())
    }

    /// Where a layer lies behind the IS/OS, depth pixels.
    ///
    /// # Errors
    /// When no layer has that name.
    pub fn layer_offset_px(&self, name: &str) -> Result<f64> {
        let layer = self.layers.iter().find(|layer| layer.name == name);
        layer
            .map(|layer| layer.offset_px)
            .ok_or_else(|| Error::usage(format!("layers: one of them must have the name {name}")))
    }

    /// Depth pixels of a displacement that turns the phase by one turn, Δλ/λ: the depth turns the
    /// phase at the band's middle by 2k₀ and counts bins by the band's width.
    #[must_use]
    pub fn depth_px_per_turn(&self) -> f64 {
        self.bandwidth_nm / self.wavelength_nm
    }

    /// Depth of one pixel in the retina, λ²/(2nΔλ), µm.
    #[must_use]
    pub fn depth_px_um(&self) -> f64 {
        let [lambda, band] = [self.wavelength_nm, self.bandwidth_nm].map(|nm| nm / 1000.0);
        lambda * lambda / (2.0 * self.refractive_index * band)
    }

    /// Pixels of one image.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.height * self.width
    }
}

/// `Ok` when `value` lies between `low` and `high` (NaN never does).
fn within<T: PartialOrd + std::fmt::Display>(name: &str, value: T, low: T, high: T) -> Result<()> {
    if low <= value && value <= high {
        return Ok(());
    }
    Err(Error::usage(format!("{name} {value}: must be between {low} and {high}")))
}

fn all_within(name: &str, values: &[f64], low: f64, high: f64) -> Result<()> {
    values.iter().try_for_each(|&value| within(name, value, low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pixel_is_five_micrometres() {
        let scene = OctScene::default();
        scene.validate().unwrap();
        assert!((scene.depth_px_um() - 5.1).abs() < 0.01);
    }

    #[test]
    fn parameters_are_set_by_name() {
        let mut scene = OctScene::default();
        scene.set("axial_px", "2.5").unwrap();
        scene.set("dispersion_rad", "[45, -3]").unwrap();
        scene.set("down_sweep", "true").unwrap();
        assert_eq!((scene.axial_px, scene.dispersion_rad), (2.5, [45.0, -3.0]));
        assert!(scene.down_sweep);
    }

    #[test]
    fn a_wrong_setting_says_what_is_wrong() {
        let mut scene = OctScene::default();
        for (name, text, expected) in [
            ("axial", "1", "no such parameter"),
            ("axial_px", "far", "must be a number"),
            ("axial_px", "[1, 2]", "axial_px"),
            ("sweeps", "-1", "sweeps"),
            ("dispersion_rad", "[1]", "dispersion_rad"),
        ] {
            let error = scene.set(name, text).unwrap_err();
            assert!(matches!(error, Error::Usage(_)) && error.to_string().contains(expected));
        }
        assert_eq!(scene, OctScene::default());
    }

    #[test]
    fn limits_are_checked() {
        type Change = fn(&mut OctScene);
        let cases: [(&str, Change); 9] = [
            ("--sweeps", |s| s.sweeps = 1),
            ("--images", |s| s.images = 16),
            ("--bits", |s| s.bits = 8),
            ("12 bits need", |s| (s.bits, s.width, s.height) = (12, 9, 9)),
            ("short_images", |s| s.short_images = 256),
            ("too few", |s| (s.sweeps, s.missing_sweeps) = (4, 2)),
            ("micro_motion", |s| s.micro_motion_wavelengths = [0.1, f64::NAN]),
            ("offset_dn", |s| s.offset_dn = 1900.0),
            ("IS/OS", |s| s.layers.clear()),
        ];
        for (expected, change) in cases {
            let mut scene = OctScene::default();
            change(&mut scene);
            let error = scene.validate().unwrap_err();
            assert!(matches!(error, Error::Usage(_)) && error.to_string().contains(expected));
        }
    }
}
