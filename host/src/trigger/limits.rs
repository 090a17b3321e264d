//! A laboratory's limits file: what no plan may exceed, and what reaches the eye.
//!
//! Its figures are inputs. Which limits apply (ISO 15004-2, IEC 60825-1), and what power arrives on
//! which area, is measured and decided by those responsible for the set-up; the program multiplies
//! and compares. Without a file it takes the example in `presets/limits.toml`.

use super::plan_values::toml_error;
use crate::error::{Error, Result};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::plan::{Caps, Plan};
use serde::{Deserialize, Serialize};
use std::path::Path;

const EXAMPLE: &str = include_str!("presets/limits.toml");

/// The limits of a laboratory.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitsFile {
    /// The file, for messages.
    #[serde(skip)]
    pub source: String,
    /// What the laboratory calls it.
    pub name: String,
    /// The swept laser.
    pub laser: LaserLimits,
    /// The stimulation LED.
    pub stimulus: StimulusLimits,
    /// The camera.
    #[serde(default)]
    pub camera: CameraLimits,
    /// What reaches the eye.
    #[serde(default)]
    pub exposure: Vec<Exposure>,
}

/// Whether the laser emits while its trigger is low.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Emission {
    /// It is dark then: the pulses count.
    Gated,
    /// It may emit: the whole run counts.
    Continuous,
}

/// Limits of the laser's trigger.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LaserLimits {
    /// Whether it emits while its trigger is low.
    pub emission: Emission,
    /// High without a break, in milliseconds.
    pub pulse_ms: f64,
    /// High over a run, in seconds.
    pub on_time_per_run_s: f64,
    /// Largest share of time high within any window, 0 to 1.
    pub duty: f64,
    /// The window, in seconds.
    #[serde(default = "one")]
    pub duty_window_s: f64,
}

/// Limits of the stimulus.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StimulusLimits {
    /// Light without a break, in seconds.
    pub pulse_s: f64,
    /// Light over a run, in seconds.
    pub on_time_per_run_s: f64,
}

/// Limits of the camera.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraLimits {
    /// Images its memory holds.
    pub memory_images: Option<u32>,
}

/// A part of the eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
pub enum Plane {
    /// The retina.
    #[serde(rename = "retina")]
    Retina,
    /// Cornea, iris and lens.
    #[serde(rename = "anterior segment")]
    Anterior,
}

impl Plane {
    /// As in the file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Retina => "retina",
            Self::Anterior => "anterior segment",
        }
    }
}

/// A source of light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The swept laser.
    Laser,
    /// The stimulation LED.
    Stimulus,
}

impl Source {
    /// As in the file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Laser => "laser",
            Self::Stimulus => "stimulus",
        }
    }
}

/// What one source brings to one plane, and what is allowed there.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// Where.
    pub plane: Plane,
    /// From what.
    pub source: Source,
    /// Power arriving while the source is on, in milliwatts.
    pub power_mw: f64,
    /// Irradiated area in square millimetres; or `size_mm`, or `diameter_mm`.
    pub area_mm2: Option<f64>,
    /// Width and height of a rectangle in millimetres.
    pub size_mm: Option<[f64; 2]>,
    /// Diameter of a disk in millimetres.
    pub diameter_mm: Option<f64>,
    /// Limit of the irradiance in W/cm2.
    pub limit_irradiance_w_cm2: f64,
    /// Limit of the radiant exposure of a run in J/cm2.
    pub limit_per_run_j_cm2: f64,
    /// Limit of the radiant exposure of 24 hours in J/cm2.
    pub limit_per_day_j_cm2: f64,
}

impl Exposure {
    /// `retina, laser`: its name in tables and in the ledger.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}, {}", self.plane.name(), self.source.name())
    }

    /// Irradiance while the source is on, in W/cm2.
    #[must_use]
    pub fn irradiance_w_cm2(&self) -> f64 {
        // mW to W and mm2 to cm2.
        self.power_mw * 1e-3 / (self.area_mm2().unwrap_or(f64::NAN) * 1e-2)
    }

    /// `None` unless exactly one of the three ways to give it was taken.
    fn area_mm2(&self) -> Option<f64> {
        let disk = |diameter: f64| std::f64::consts::FRAC_PI_4 * diameter * diameter;
        let ways = [self.area_mm2, self.size_mm.map(|[w, h]| w * h), self.diameter_mm.map(disk)];
        let mut given = ways.into_iter().flatten();
        let area = given.next()?;
        given.next().is_none().then_some(area)
    }

    fn validate(&self) -> std::result::Result<(), String> {
        let area = self.area_mm2().ok_or("give one of area_mm2, size_mm and diameter_mm")?;
        if self.power_mw < 0.0 || !self.power_mw.is_finite() {
            return Err("power_mw must not be negative".to_owned());
        }
        positive("area", area)?;
        positive("limit_irradiance_w_cm2", self.limit_irradiance_w_cm2)?;
        positive("limit_per_run_j_cm2", self.limit_per_run_j_cm2)?;
        positive("limit_per_day_j_cm2", self.limit_per_day_j_cm2)
    }
}

impl LimitsFile {
    /// The example that comes with the program.
    ///
    /// # Errors
    /// None, unless the program was built with a damaged one.
    pub fn example() -> Result<Self> {
        Self::parse(EXAMPLE, "built-in example limits")
    }

    /// Read a file; without one, the example.
    ///
    /// # Errors
    /// When it cannot be read, has unknown or missing keys (with line), or figures out of range.
    pub fn load(path: Option<&Path>) -> Result<Self> {
        let Some(path) = path else { return Self::example() };
        let text = std::fs::read_to_string(path)
            .map_err(|error| Error::file(path, format!("cannot be read: {error}")))?;
        Self::parse(&text, &path.display().to_string())
    }

    fn parse(text: &str, source: &str) -> Result<Self> {
        let mut file: Self =
            toml::from_str(text).map_err(|error| toml_error(source, text, &error))?;
        source.clone_into(&mut file.source);
        file.validate().map_err(|what| Error::failed(format!("{source}: {what}")))?;
        Ok(file)
    }

    fn validate(&self) -> std::result::Result<(), String> {
        positive("laser.pulse_ms", self.laser.pulse_ms)?;
        positive("laser.on_time_per_run_s", self.laser.on_time_per_run_s)?;
        positive("laser.duty", self.laser.duty)?;
        positive("laser.duty_window_s", self.laser.duty_window_s)?;
        positive("stimulus.pulse_s", self.stimulus.pulse_s)?;
        positive("stimulus.on_time_per_run_s", self.stimulus.on_time_per_run_s)?;
        if self.laser.duty > 1.0 {
            return Err("laser.duty must not be above 1".to_owned());
        }
        for (number, entry) in self.exposure.iter().enumerate() {
            let name = entry.name();
            entry.validate().map_err(|what| format!("exposure {} ({name}): {what}", number + 1))?;
            if self.exposure.iter().take(number).any(|other| other.name() == name) {
                return Err(format!("exposure {} ({name}) is given twice", number + 1));
            }
        }
        Ok(())
    }

    /// The caps of a plan, lowered to the limits of this file where they are above them.
    #[must_use]
    pub fn caps(&self, plan: &Plan, board: &Limits) -> Caps {
        let ticks = |seconds: f64| (seconds * f64::from(board.ticks_per_second)).floor() as u64;
        let own = plan.caps;
        let pulse = ticks(self.laser.pulse_ms * 1e-3).min(own.laser_pulse.into());
        Caps {
            // At most the plan's own cap, which fits.
            laser_pulse: pulse as u32,
            laser_total: own.laser_total.min(ticks(self.laser.on_time_per_run_s)),
            stimulus_pulse: own.stimulus_pulse.min(ticks(self.stimulus.pulse_s)),
            stimulus_total: own.stimulus_total.min(ticks(self.stimulus.on_time_per_run_s)),
            camera_images: own.camera_images.min(self.camera.memory_images.unwrap_or(u32::MAX)),
            ..own
        }
    }
}

fn positive(name: &str, value: f64) -> std::result::Result<(), String> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(format!("{name} must be above 0")) }
}

fn one() -> f64 {
    1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_irradiance() {
        let limits = LimitsFile::example().unwrap();
        let [retina, anterior, ..] = limits.exposure.as_slice() else { panic!("two at least") };
        assert!((retina.irradiance_w_cm2() - 5e-3 / 0.039).abs() < 1e-12);
        let disk = std::f64::consts::FRAC_PI_4 * 0.01;
        assert!((anterior.irradiance_w_cm2() - 5e-3 / disk).abs() < 1e-12);
        assert_eq!(limits.laser.emission, Emission::Continuous);
    }

    #[test]
    fn wrong_files_are_refused_with_their_line() {
        for (from, to, words) in [
            ("power_mw = 5.0", "power_w = 5.0", ["line 30", "power_w"]),
            ("\"continuous\"\n", "\"sometimes\"\n", ["sometimes", "gated"]),
            ("diameter_mm = 1.0", "", ["exposure 2", "diameter_mm"]),
            ("duty = 0.2", "duty = 2", ["laser.duty", "above 1"]),
            ("pulse_ms = 20", "pulse_ms = nan", ["laser.pulse_ms", "above 0"]),
            ("limit_per_day_j_cm2 = 50", "", ["limit_per_day_j_cm2", "line"]),
            ("source = \"stimulus\"", "source = \"laser\"", ["exposure 3", "twice"]),
        ] {
            let text = EXAMPLE.replace(from, to);
            let message = LimitsFile::parse(&text, "L.toml").unwrap_err().to_string();
            for word in words {
                assert!(message.contains(word), "{from}: {message}");
            }
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }
}
