//! What a group of volumes says beside its field: layers, wavelength, pixel pitch, stimulus.

use crate::error::{Error, Result};
use crate::io::Series;
use crate::method::Depths;
use serde_json::Value;
use std::f64::consts::PI;
use std::ops::RangeInclusive;

/// Z1 minus Z2 as the attributes `layer_ost_z` and `layer_isos_z` have them (first and last depth
/// pixel): the outer segments' tips against the junction of inner and outer segments, so that the
/// phase of an elongation is positive. `None` unless the series has depths and both attributes.
///
/// # Errors
/// When one of them is no range of depth pixels of the series, or both are the same.
pub fn layers(series: &dyn Series) -> Result<Option<Depths>> {
    let (tips, junction) = ("layer_ost_z", "layer_isos_z");
    let (Some(first), Some(second)) = (series.attribute(tips), series.attribute(junction)) else {
        return Ok(None);
    };
    let depth = series.shape().depth;
    if depth == 1 {
        return Ok(None);
    }
    let (first, second) = (range(tips, first, depth)?, range(junction, second, depth)?);
    if first == second {
        return Err(Error::failed(format!(
            "attributes {tips} and {junction} name the same depths: correct one or give --layers"
        )));
    }
    Ok(Some(Depths { first, second: Some(second) }))
}

fn range(name: &str, value: &Value, depth: usize) -> Result<RangeInclusive<usize>> {
    let pixel = |end: &Value| end.as_u64().and_then(|z| usize::try_from(z).ok());
    let ends = value.as_array().map(Vec::as_slice).unwrap_or_default();
    if let [first, last] = ends
        && let (Some(first), Some(last)) = (pixel(first), pixel(last))
        && first <= last
        && last < depth
    {
        return Ok(first..=last);
    }
    Err(Error::failed(format!(
        "attribute {name} = {value}: must ascend within the depth pixels 0 ..= {}: correct it or \
         give --layers",
        depth - 1
    )))
}

/// Vacuum wavelength in nm: attribute `wavelength_nm`.
///
/// # Errors
/// When it is no length.
pub fn wavelength_nm(series: &dyn Series) -> Result<Option<f64>> {
    length(series, "wavelength_nm", "correct it or give --wavelength-nm")
}

/// Lateral pitch of the pixels in micrometres: attribute `pixel_pitch_um`.
///
/// # Errors
/// When it is no length.
pub fn pixel_pitch_um(series: &dyn Series) -> Result<Option<f64>> {
    length(series, "pixel_pitch_um", "correct it")
}

fn length(series: &dyn Series, name: &str, remedy: &str) -> Result<Option<f64>> {
    let Some(value) = series.attribute(name).filter(|value| !value.is_null()) else {
        return Ok(None);
    };
    match value.as_f64().filter(|length| length.is_finite() && *length > 0.0) {
        Some(length) => Ok(Some(length)),
        None => {
            let what = format!("attribute {name} = {value}: must be a number above 0: {remedy}");
            Err(Error::failed(what))
        }
    }
}

/// When the stimulus began, on the axis of the acquisition times: attribute `stimulus_s` beside
/// times in seconds, `stimulus_sweep` beside sweep numbers.
#[must_use]
pub fn stimulus_onset(series: &dyn Series) -> Option<f64> {
    let name = if series.times_s().is_some() { "stimulus_s" } else { "stimulus_sweep" };
    series.attribute(name).and_then(Value::as_f64).filter(|onset| onset.is_finite())
}

/// Optical path length of one radian, one way: opl = phase lambda / (4 pi), nm.
#[must_use]
pub fn nm_per_rad(wavelength_nm: f64) -> f64 {
    wavelength_nm / (4.0 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Attributes, Shape};
    use num_complex::Complex32;
    use serde_json::json;

    struct Noted(Attributes);

    impl Noted {
        fn new(notes: Value) -> Self {
            Self(notes.as_object().cloned().unwrap())
        }
    }

    impl Series for Noted {
        fn shape(&self) -> Shape {
            Shape { frames: 2, depth: 9, height: 1, width: 1 }
        }

        fn read_rows(
            &self,
            _: usize,
            _: usize,
            _: std::ops::Range<usize>,
            _: &mut [Complex32],
        ) -> Result<()> {
            Ok(())
        }

        fn attribute(&self, name: &str) -> Option<&Value> {
            self.0.get(name)
        }
    }

    #[test]
    fn tips_come_first() {
        let noted = Noted::new(json!({"layer_ost_z": [6, 8], "layer_isos_z": [1, 2]}));
        assert_eq!(layers(&noted).unwrap(), Some("6..8,1..2".parse().unwrap()));
        let one = Noted::new(json!({"layer_ost_z": [6, 8]}));
        assert_eq!(layers(&one).unwrap(), None);
    }

    #[test]
    fn impossible_layers_are_named() {
        for wrong in [json!([6, 9]), json!([8, 6]), json!([-1, 2]), json!([1]), json!("6..8")] {
            let noted = Noted::new(json!({"layer_ost_z": wrong, "layer_isos_z": [1, 2]}));
            let error = layers(&noted).unwrap_err().to_string();
            assert!(error.contains("layer_ost_z") && error.contains("0 ..= 8"), "{error}");
        }
        let same = Noted::new(json!({"layer_ost_z": [1, 2], "layer_isos_z": [1, 2]}));
        assert!(layers(&same).unwrap_err().to_string().contains("same depths"));
    }

    #[test]
    fn lengths_are_above_zero() {
        let noted = Noted::new(json!({"wavelength_nm": 841, "pixel_pitch_um": null}));
        assert_eq!(wavelength_nm(&noted).unwrap(), Some(841.0));
        assert_eq!(pixel_pitch_um(&noted).unwrap(), None);
        for wrong in [json!("red"), json!(0), json!(-841.0)] {
            let noted = Noted::new(json!({"wavelength_nm": wrong}));
            assert!(wavelength_nm(&noted).unwrap_err().to_string().contains("wavelength_nm"));
        }
        assert!((nm_per_rad(841.0) * 4.0 * PI - 841.0).abs() < 1e-12);
    }

    #[test]
    fn the_stimulus_is_on_the_axis_of_the_times() {
        let noted = Noted::new(json!({"stimulus_s": 2.5, "stimulus_sweep": 5}));
        assert_eq!(stimulus_onset(&noted), Some(5.0), "no times: sweep numbers");
    }
}
