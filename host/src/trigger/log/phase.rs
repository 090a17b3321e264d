//! What the board's on-line solver said of a volume.

use phasewalk_firmware::message::Estimate;
use serde::{Deserialize, Serialize};

/// What the board's on-line solver said of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// Number of the volume in its series, from 0.
    pub volume: u32,
    /// Phase against the mean of the reference volumes so far, in radians.
    #[serde(with = "number")]
    pub phase_rad: f32,
    /// Its standard deviation in radians; infinite where nothing was measured yet.
    #[serde(with = "number")]
    pub sigma_rad: f32,
    /// How long the solver took, in ticks.
    pub took: u32,
    /// When the host read it, in seconds since the log began.
    pub host_s: f64,
}

impl Phase {
    /// As the board said it.
    #[must_use]
    pub fn new(estimate: &Estimate, host_s: f64) -> Self {
        Self {
            volume: estimate.volume,
            phase_rad: f32::from_bits(estimate.phase),
            sigma_rad: f32::from_bits(estimate.sigma),
            took: estimate.took,
            host_s,
        }
    }
}

/// JSON has no infinity and no NaN: they are the texts `inf`, `-inf` and `nan`.
mod number {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Told {
        Number(f32),
        Text(String),
    }

    pub(super) fn serialize<S: Serializer>(number: &f32, to: S) -> Result<S::Ok, S::Error> {
        match number {
            finite if finite.is_finite() => to.serialize_f32(*finite),
            nan if nan.is_nan() => to.serialize_str("nan"),
            infinite if *infinite > 0.0 => to.serialize_str("inf"),
            _ => to.serialize_str("-inf"),
        }
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f32, D::Error> {
        match Told::deserialize(from)? {
            Told::Number(number) => Ok(number),
            Told::Text(text) => match text.as_str() {
                "nan" => Ok(f32::NAN),
                "inf" => Ok(f32::INFINITY),
                "-inf" => Ok(f32::NEG_INFINITY),
                other => Err(D::Error::custom(format!("'{other}' is no number, inf or nan"))),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trigger::log::Record;

    #[test]
    fn every_number_survives() {
        let numbers = [0.1, -3.402_823_5e38, f32::INFINITY, f32::NEG_INFINITY, 1e-45];
        for (volume, phase_rad) in (0..).zip(numbers) {
            let phase = Phase { volume, phase_rad, sigma_rad: f32::NAN, took: 1, host_s: 0.5 };
            let line = serde_json::to_string(&Record::Phase(phase)).unwrap();
            let Record::Phase(read) = serde_json::from_str(&line).unwrap() else {
                panic!("{line}")
            };
            assert_eq!(read.phase_rad.to_bits(), phase_rad.to_bits(), "{line}");
            assert!(read.sigma_rad.is_nan() && line.contains("\"record\":\"phase\""), "{line}");
        }
        let wrong = r#"{"volume":0,"phase_rad":"x","sigma_rad":0,"took":0,"host_s":0}"#;
        assert!(serde_json::from_str::<Phase>(wrong).unwrap_err().to_string().contains("'x'"));
    }
}
