//! What is kept with the result, and what is said about it.

use super::Task;
use crate::cli::{list, print};
use crate::io::Attributes;
use crate::method::Method;
use crate::series::Survey;
use clap::ValueEnum;
use phasewalk_core::reference::reference_span;
use serde_json::{Value, json};
use std::path::PathBuf;

/// How many independent recordings several ones amount to.
const INDEPENDENT: &str = "independent_recordings";

impl Task<'_> {
    /// What made the result, kept with it.
    pub(super) fn facts(
        &self,
        survey: &Survey,
        looks: f64,
        effective: f64,
        recordings: f64,
        memory: u64,
    ) -> Attributes {
        let mut facts = Attributes::new();
        let paper = matches!(self.plan.method, Method::Paper(_));
        let left_out = self.good.left_out();
        let several = self.arguments.series.len() > 1;
        for (key, value) in [
            ("software", json!(concat!("phasewalk ", env!("CARGO_PKG_VERSION")))),
            ("series", json!(self.arguments.series)),
            ("method", name(&self.arguments.method)),
            ("weights", if paper { name(&self.arguments.weights) } else { Value::Null }),
            ("ensemble", name(&self.arguments.ensemble)),
            ("max_lag", if paper { json!(self.plan.params.max_lag) } else { Value::Null }),
            ("acceleration", json!(self.arguments.acceleration)),
            ("layers", self.layers().map_or(Value::Null, Value::from)),
            ("times_from", json!(self.times_from())),
            ("time_unit", json!(self.time_unit())),
            ("frames_left_out", if left_out.is_empty() { Value::Null } else { json!(left_out) }),
            ("mask", json!(self.arguments.mask)),
            ("control", json!(self.arguments.control)),
            (
                "rim_px",
                if self.arguments.rim > 0 { json!(self.arguments.rim) } else { Value::Null },
            ),
            ("gaussian_px", json!(self.arguments.gaussian)),
            ("looks", json!(looks)),
            ("effective_looks", json!(effective)),
            (INDEPENDENT, if several { json!(recordings) } else { Value::Null }),
            ("wavelength_nm", json!(self.wavelength_nm)),
            ("pixels_not_finite", json!(survey.not_finite)),
            ("pixels_dark", json!(survey.dark)),
            ("memory_bytes", json!(memory)),
        ] {
            if !value.is_null() {
                facts.insert(key.to_owned(), value);
            }
        }
        facts
    }

    pub(super) fn report(&self, region: &str, mut facts: Attributes, files: &[PathBuf]) {
        let seconds = self.start.elapsed().as_secs_f64();
        if self.common.json {
            facts.insert("files".to_owned(), json!(files));
            facts.insert("seconds".to_owned(), json!(seconds));
            print(&Value::Object(facts).to_string());
            return;
        }
        let left_out = self.good.left_out();
        if !left_out.is_empty() {
            let numbers: Vec<String> = left_out.iter().map(usize::to_string).collect();
            print(&format!(
                "{} of {} frames left out (bad sweeps, or not finite): {}",
                left_out.len(),
                self.good.in_all(),
                numbers.join(", ")
            ));
        }
        let looks = |key: &str| facts.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN);
        let layers = self.layers().map(|layers| format!(", layers {layers}")).unwrap_or_default();
        let recordings = facts.get(INDEPENDENT).and_then(Value::as_f64).map(|amount| {
            let count = self.arguments.series.len();
            format!(" of {count} recordings ({amount:.2} of them independent)")
        });
        let recordings = recordings.unwrap_or_default();
        print(&format!(
            "{} frames{recordings}{layers}, {region}, {} pairs; {:.1} looks, {:.1} of them independent",
            self.plan.frames(),
            self.plan.pairs().len(),
            looks("looks"),
            looks("effective_looks"),
        ));
        match &self.times_from {
            Some(path) => print(&format!("times in seconds from {}", path.display())),
            None => print("no times are known: frames are counted (--times gives them in seconds)"),
        }
        print(&format!("wrote {} in {seconds:.1} s", list(files)));
    }

    /// The numbers, counting bad sweeps, of the frames whose mean phase is zero: of the first good ones those that have a
    /// phase; of linked phases, where none has, the first that have.
    pub(super) fn reference_frames(&self, has_phase: impl Fn(usize) -> bool) -> Value {
        let span = self.reference_span(&has_phase);
        let first = self.good.numbers().iter().take(span).enumerate();
        json!(first.filter(|&(t, _)| has_phase(t)).map(|(_, number)| number).collect::<Vec<_>>())
    }

    /// How many leading frames hold the reference.
    fn reference_span(&self, has_phase: &impl Fn(usize) -> bool) -> usize {
        let usable: Vec<f64> =
            (0..self.plan.frames()).map(|t| f64::from(u8::from(has_phase(t)))).collect();
        let wanted = self.plan.params.reference_frames;
        let linked = self.plan.method == Method::Linked;
        if linked { reference_span(&usable, wanted) } else { wanted }
    }

    /// In words, where the reference is not where it is looked for.
    pub(super) fn other_reference(&self, has_phase: impl Fn(usize) -> bool) -> Option<String> {
        let wanted = self.plan.params.reference_frames;
        let last = self.reference_span(&has_phase).saturating_sub(1);
        let frame = self.good.numbers().get(last).filter(|_| last >= wanted)?;
        Some(format!(
            "none of the first {wanted} frames is usable: phases refer to the first usable ones, up to frame {frame}"
        ))
    }

    /// What the times are counted in.
    pub(super) fn time_unit(&self) -> &'static str {
        if self.times_from.is_some() { "s" } else { "frame" }
    }

    fn times_from(&self) -> String {
        let name = |path: &PathBuf| path.display().to_string();
        self.times_from.as_ref().map_or_else(|| "numbers of the frames".to_owned(), name)
    }

    /// The depths compared, of two layers.
    fn layers(&self) -> Option<String> {
        let planes = &self.plan.depths;
        planes.has_two_layers().then(|| planes.to_string())
    }
}

/// An option's value as the user writes it.
fn name(value: &impl ValueEnum) -> Value {
    value.to_possible_value().map_or(Value::Null, |value| json!(value.get_name()))
}
