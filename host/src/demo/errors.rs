//! How far the results are from the truth.
//!
//! The difference of a curve to the truth is taken as it is. An image of direct differences is known
//! modulo 2π only, so the images are compared wrapped into −π..π: phases that are pure noise then
//! have an rms error of π/√3 = 1.81 rad. A walk knows more, so its images are also compared as they
//! are, which counts every wrong turn.

use super::evaluation::PhaseCurve;
use super::recording::Recording;
use super::scene::SceneResult;
use crate::error::{Error, Result};
use crate::method::Method;
use crate::report::Table;
use ndarray::ArrayView2;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// The errors of one method in one scene, radians.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Errors {
    /// Root mean square over the frames of curve − truth.
    pub curve_rms_rad: f64,
    /// Curve − truth in the last frame.
    pub curve_last_rad: f64,
    /// Root mean square over the pixels of the x of image − truth in the last frame, wrapped.
    pub image_wrapped_rms_rad: f64,
    /// The same, not wrapped; none for the direct difference.
    pub image_rms_rad: Option<f64>,
}

/// A line of the table.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorRow {
    /// The scene, such as `σ = λ/32`.
    pub scene: String,
    /// σ of the random motion, wavelengths per frame.
    pub sigma_wavelengths: f64,
    /// The method.
    pub method: &'static str,
    /// The phase put in, in the last frame.
    pub truth_last_rad: f64,
    /// Its errors.
    #[serde(flatten)]
    pub errors: Errors,
}

impl Errors {
    pub(super) fn of(
        recording: &Recording,
        method: Method,
        curve: &PhaseCurve,
        last_image: ArrayView2<'_, f32>,
    ) -> Self {
        let truth = &recording.truth_rad;
        let differences = || curve.phase_rad.iter().zip(truth).map(|(phase, truth)| phase - truth);
        let end = recording.final_truth_rad();
        let image = || {
            let inside = last_image.iter().zip(&recording.mask).filter(|&(_, &inside)| inside);
            inside.map(|(&phase, _)| f64::from(phase) - end)
        };
        Self {
            curve_rms_rad: rms(differences()),
            curve_last_rad: differences().next_back().unwrap_or(f64::NAN),
            image_wrapped_rms_rad: rms(image().map(wrapped)),
            image_rms_rad: (method != Method::Direct).then(|| rms(image())),
        }
    }
}

/// A phase difference moved into −π..π, radians.
#[must_use]
pub fn wrapped(difference: f64) -> f64 {
    (difference + PI).rem_euclid(TAU) - PI
}

/// Root mean square; NaN of nothing.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v * v, count + 1));
    (sum / f64::from(count)).sqrt()
}

/// One line per scene and method.
#[must_use]
pub fn error_rows(scenes: &[SceneResult]) -> Vec<ErrorRow> {
    let of_scene = |scene: &SceneResult| {
        let truth_last_rad = scene.truth_rad.last().copied().unwrap_or(f64::NAN);
        scene.errors.named().map(|(method, &errors)| ErrorRow {
            scene: scene.label.clone(),
            sigma_wavelengths: scene.sigma_wavelengths,
            method,
            truth_last_rad,
            errors,
        })
    };
    scenes.iter().flat_map(of_scene).collect()
}

/// The table for people, in radians.
#[must_use]
pub fn table(rows: &[ErrorRow], frames: usize) -> Table {
    let (truth, last) = (rows.first().map_or(f64::NAN, |row| row.truth_last_rad), frames - 1);
    let header = ["", "curve, rms", "curve, end", "image, wrapped", "image, rms"];
    let number = |value: f64| format!("{value:.2}");
    let cells = |row: &ErrorRow| {
        let errors = &row.errors;
        vec![
            format!("{:<8}  {}", row.scene, row.method),
            number(errors.curve_rms_rad),
            format!("{:+.2}", errors.curve_last_rad).replace('-', "\u{2212}"),
            number(errors.image_wrapped_rms_rad),
            errors.image_rms_rad.map_or("\u{2013}".to_owned(), number),
        ]
    };
    Table {
        caption: format!(
            "Errors in radians; the phase put in rises from 0 to {truth:.2} rad in frame {last}"
        ),
        header: header.map(str::to_owned).to_vec(),
        rows: rows.iter().map(cells).collect(),
    }
}

/// A table with aligned columns: the first to the left, numbers to the right.
#[must_use]
pub fn aligned(table: &Table) -> String {
    let lines: Vec<&Vec<String>> = std::iter::once(&table.header).chain(&table.rows).collect();
    let width = |column: usize| {
        let cells = lines.iter().filter_map(|line| line.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..table.header.len()).map(width).collect();
    let mut text = table.caption.clone();
    for line in lines {
        let cells = line.iter().zip(&widths).enumerate().map(|(n, (cell, width))| match n {
            0 => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
        text += "\n  ";
        text += &cells.collect::<Vec<_>>().join("   ");
    }
    text
}

/// The table for machines, with a header.
///
/// # Errors
/// When a line cannot be written, which does not happen in memory.
pub fn csv(rows: &[ErrorRow]) -> Result<Vec<u8>> {
    let failed = |what: String| Error::failed(format!("table of errors: {what}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    let header = [
        "sigma_wavelengths",
        "method",
        "truth_last_rad",
        "curve_rms_rad",
        "curve_last_rad",
        "image_wrapped_rms_rad",
        "image_rms_rad",
    ];
    writer.write_record(header).map_err(|e| failed(e.to_string()))?;
    let number = |value: f64| format!("{value:.6}");
    for row in rows {
        let errors = &row.errors;
        let line = [
            row.sigma_wavelengths.to_string(),
            row.method.to_owned(),
            number(row.truth_last_rad),
            number(errors.curve_rms_rad),
            number(errors.curve_last_rad),
            number(errors.image_wrapped_rms_rad),
            errors.image_rms_rad.map_or_else(String::new, number),
        ];
        writer.write_record(line).map_err(|e| failed(e.to_string()))?;
    }
    writer.into_inner().map_err(|e| failed(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_wrapped_to_the_nearest_turn() {
        for (difference, expected) in [(0.5, 0.5), (TAU + 0.5, 0.5), (-0.5 - TAU, -0.5)] {
            assert!((wrapped(difference) - expected).abs() < 1e-12);
        }
        assert!((rms([3.0, -4.0].into_iter()) - 12.5_f64.sqrt()).abs() < 1e-12);
        assert!(rms(std::iter::empty()).is_nan());
    }

    fn rows() -> Vec<ErrorRow> {
        let errors = Errors {
            curve_rms_rad: 0.1234,
            curve_last_rad: -11.0,
            image_wrapped_rms_rad: 1.8,
            image_rms_rad: None,
        };
        ["direct difference", "one-step walk"]
            .map(|method| ErrorRow {
                scene: "σ = λ/32".to_owned(),
                sigma_wavelengths: 0.03125,
                method,
                truth_last_rad: 2.044,
                errors,
            })
            .to_vec()
    }

    #[test]
    fn the_table_is_aligned() {
        let text = aligned(&table(&rows(), 70));
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].contains("2.04 rad in frame 69"));
        assert_eq!(lines[1].chars().count(), lines[2].chars().count());
        assert!(
            lines[2].contains("  0.12       \u{2212}11.00             1.80            \u{2013}"),
            "{text}"
        );
    }

    #[test]
    fn the_csv_has_a_header_and_units() {
        let text = String::from_utf8(csv(&rows()).unwrap()).unwrap();
        assert!(text.starts_with("sigma_wavelengths,method,truth_last_rad,curve_rms_rad"));
        assert!(text.contains("\n0.03125,one-step walk,2.044000,0.123400,-11.000000,1.800000,\n"));
    }
}
