//! Figure 1, b-g: magnitude and phase of the cross-spectrum without decorrelation, without averaging
//! and averaged, with the two ways through it (lines 118-140).

use super::scene::Scene;
use crate::demo::figures::coherent_lag;
use crate::figures::{Canvas, CrossSpectra, CrossSpectrum};

/// From a scene that does not decorrelate and one that does.
#[must_use]
pub fn figure1(still: &Scene, moving: &Scene) -> Canvas {
    let averaged = format!("{}, averaged over the x", moving.label);
    let single = format!("{}, one pixel", moving.label);
    let still_note = format!("{}, averaged over the x", still.label);
    let column = |label, note, values| CrossSpectrum { label, note, values };
    let figure = CrossSpectra {
        columns: vec![
            column("no decorrelation", still_note.as_str(), still.spectra.averaged.view()),
            column("decorrelation, no averaging", &single, moving.spectra.single.view()),
            column("decorrelation, averaging", &averaged, moving.spectra.averaged.view()),
        ],
        step: coherent_lag(&moving.autocorrelation),
    };
    figure.draw()
}
