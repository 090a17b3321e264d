//! Whether the phases can be trusted: what closure phases tell of a curve, and of every pixel.

use super::Task;
use crate::error::{Error, Result};
use crate::image::{StripResult, Tiles};
use crate::io::{Attributes, Series, Shape};
use phasewalk_core::closure::Closure;
use serde_json::{Value, json};
use std::sync::{Mutex, PoisonError};

/// p below which the model does not hold.
const REFUTED: f64 = 1e-3;

/// Misfit and p among the facts, those of the control with its name; null where they cannot be told.
pub(super) fn add_facts(closure: &Closure, region: &str, facts: &mut Attributes) {
    let prefix = if region == "mask" { String::new() } else { format!("{region}_") };
    facts.insert(format!("{prefix}closure_misfit"), json!(closure.misfit));
    facts.insert(format!("{prefix}closure_p"), json!(closure.p));
}

/// One line, and a second where the model does not hold; `region` is the mask or the control.
pub(super) fn in_words(closure: &Closure, region: &str) -> String {
    let Closure { misfit, p } = *closure;
    if p.is_nan() {
        return format!(
            "closure phases of the {region}: too few frames, or all alike, to test them"
        );
    }
    let told = format!("closure phases of the {region}: {misfit:.2} of the noise, p = ");
    if p >= REFUTED {
        return format!("{told}{p:.3}");
    }
    format!(
        "{told}{p:.0e}\nwarning: no single motion explains the {region}: frames close in time tell another phase than frames \
         far apart, and the curve lies between. Look for parts that move differently or rest (a static \
         reflection, vessels, a mask or layers that reach into other tissue), in images (--gaussian, \
         closure_p of a .zarr result) and with smaller masks"
    )
}

/// p of every pixel, filled strip by strip.
pub(super) struct ClosureMap {
    width: usize,
    /// (y, x); none where the tiles do not prepare the test.
    p: Option<Mutex<Vec<f32>>>,
}

impl ClosureMap {
    pub(super) fn new(task: &Task<'_>, tiles: Option<&Tiles>) -> Self {
        let Shape { height, width, .. } = task.good.shape();
        let tested = tiles.is_some_and(Tiles::test_closure);
        Self { width, p: tested.then(|| Mutex::new(vec![f32::NAN; height * width])) }
    }

    /// Take a strip's part.
    pub(super) fn keep(&self, strip: &StripResult<'_>) -> Result<()> {
        let (Some(part), Some(p)) = (strip.closure, &self.p) else { return Ok(()) };
        let mut p = p.lock().unwrap_or_else(PoisonError::into_inner);
        let start = strip.first_row * self.width;
        let rows = p.get_mut(start..start + part.len());
        let misfit = || Error::failed(format!("the strip at row {} does not fit", strip.first_row));
        rows.ok_or_else(misfit)?.copy_from_slice(part);
        Ok(())
    }

    pub(super) fn finish(self) -> Option<Vec<f32>> {
        self.p.map(|p| p.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Share of the tested pixels for which the model does not hold; none where no pixel was tested.
fn refuted(p: &[f32]) -> Option<f64> {
    let tested = p.iter().filter(|p| !p.is_nan()).count();
    let refuted = p.iter().filter(|&&p| f64::from(p) < REFUTED).count();
    (tested > 0).then(|| refuted as f64 / tested as f64)
}

/// For the attributes.
pub(super) fn fact(p: &[f32]) -> Value {
    json!({ "p_below": REFUTED, "share": refuted(p) })
}

pub(super) fn map_in_words(p: &[f32]) -> String {
    refuted(p).map_or_else(
        || "closure phases: too few frames, or all alike, to test them".to_owned(),
        |share| {
            let (percent, chance) = (100.0 * share, 100.0 * REFUTED);
            format!("closure phases: p < {REFUTED} in {percent:.2} % of the pixels (by chance {chance:.2} %)")
        },
    )
}
