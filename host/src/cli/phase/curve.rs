//! The phase of a region over time, less that of a control region.

use super::figure::FigureFile;
use super::{AddedLooks, Task, check_looks, closure};
use crate::cli::print;
use crate::curve::{Linked, Region, Selection, curve, link_region, subtract, window_looks};
use crate::error::{Error, Result};
use crate::figures::{Canvas, PhaseCurve};
use crate::image::Gaps;
use crate::io::{CurveRow, Series, Shape, read_mask, without_rim, write_curve};
use crate::looks::{PointSpread, SpatialCoherence};
use crate::method::{Method, Plan};
use crate::notes;
use crate::progress::Progress;
use crate::series::Survey;
use phasewalk_core::closure::Closure;
use serde_json::{Value, json};
use std::path::Path;

/// A standard deviation that only Gamma_2 (1000 rad a step) leaves behind.
const BRIDGED_RAD: f64 = 100.0;

impl Task<'_> {
    pub(super) fn curve(&self, path: &Path) -> Result<()> {
        let Shape { height, width, .. } = self.good.shape();
        let mask = self.masks(read_mask(path, height, width)?, path)?;
        let control = match &self.arguments.control {
            Some(path) => Some((self.masks(read_control(path, &mask.inner, width)?, path)?, path)),
            None => None,
        };
        let figure = FigureFile::wanted("--figure", self.arguments.figure.as_deref())?;

        let survey = self.survey()?;
        let ground = Ground { task: self, survey: &survey, spread: self.spread(&survey)? };
        let mut result = ground.evaluate("phase curve", &mask, path, "--mask")?;
        let control = control
            .map(|(mask, path)| ground.evaluate("control curve", &mask, path, "--control"))
            .transpose()?;
        if let Some(control) = &control {
            result.subtract(control);
        }
        self.finish(&survey, &result, control.as_ref(), figure)
    }

    /// The mask, and what is left without the rim that `--rim` takes off.
    fn masks(&self, drawn: Vec<bool>, path: &Path) -> Result<Masks> {
        let rim = self.arguments.rim;
        let inner = without_rim(&drawn, self.good.shape().width, rim);
        if inner.contains(&true) {
            return Ok(Masks { drawn, inner });
        }
        let what = "no pixel is left: take a smaller one";
        Err(Error::file(path, format!("--rim {rim}: {what}")))
    }

    /// How the aperture spreads light, seen wherever there is speckle, if it is asked for.
    fn spread(&self, survey: &Survey) -> Result<Option<PointSpread>> {
        if self.plan.method != Method::Linked || self.arguments.keep_leakage {
            return Ok(None);
        }
        let speckled = self.speckled(survey)?;
        Ok(Some(PointSpread::of(&self.coherence(&speckled)?)))
    }

    /// Write, draw and report.
    fn finish(
        &self,
        survey: &Survey,
        result: &Evaluated,
        control: Option<&Evaluated>,
        figure: Option<FigureFile>,
    ) -> Result<()> {
        let memory = result.bytes.max(control.map_or(0, |control| control.bytes));
        let mut facts =
            self.facts(survey, result.looks, result.effective_looks, result.recordings, memory);
        facts.insert("pixels".to_owned(), json!(result.pixels));
        if let Some(linked) = &result.linked {
            facts.insert("coherence_model".to_owned(), model(linked));
        }
        let regions = [Some(result), control].into_iter().flatten();
        let gaps = regions.filter_map(|region| region.linked.as_ref()?.least_sure_gap);
        let gap = gaps.max_by(|(_, a), (_, b)| a.total_cmp(b));
        if let Some((_, error)) = gap {
            facts.insert("gap_error_rad".to_owned(), json!(error));
        }
        for (closure, region) in closures(result, control) {
            closure::add_facts(closure, region, &mut facts);
        }
        let has_phase = |t: usize| result.rows[t].phase_rad.is_finite();
        facts.insert("reference_frames".to_owned(), self.reference_frames(has_phase));
        facts.insert("pixels_left_out".to_owned(), json!(result.left_out));
        if let Some(leakage) = result.leakage {
            facts.insert("light_from_outside".to_owned(), json!(leakage));
        }
        if let Some(control) = control {
            facts.insert("control_pixels".to_owned(), json!(control.pixels));
        }
        // Bridges have hundreds of radians, measured frames at most that of a random walk.
        let bridged = result.rows.iter().filter(|row| row.sigma_rad > BRIDGED_RAD).count();
        facts.insert("frames_bridged".to_owned(), json!(bridged));
        let rows = self.good.rows_of_all(&result.rows);
        let nm_per_rad = self.wavelength_nm.map(notes::nm_per_rad);
        let coherence = result.linked.as_ref().map(|linked| self.good.matrix_of_all(&linked.gamma));
        let output = &self.arguments.output;
        let mut files =
            write_curve(output, &rows, nm_per_rad, coherence.as_deref(), facts.clone())?;
        if let Some(figure) = figure {
            files.push(figure.finish(&self.draw(&rows, result, control))?);
        }
        if bridged > 0 && !self.common.json {
            print(&self.without_phase(bridged));
        }
        let has_phase = |frame: usize| result.rows[frame].phase_rad.is_finite();
        let other = self.other_reference(has_phase).filter(|_| !self.common.json);
        if let Some(other) = other {
            print(&other);
        }
        let less = control.map(|c| format!(" less {}", c.in_words())).unwrap_or_default();
        self.report(&format!("{}{less}", result.in_words()), facts, &files);
        if let Some((frame, error)) = gap.filter(|_| !self.common.json) {
            self.warn_of_gap(frame, error);
        }
        for (closure, region) in closures(result, control).filter(|_| !self.common.json) {
            print(&closure::in_words(closure, region));
        }
        Ok(())
    }

    /// Say where a turn across a gap is not sure ([`Gaps::is_unsure`]).
    fn warn_of_gap(&self, frame: usize, error: f64) {
        if !Gaps::is_unsure(error) {
            return;
        }
        let known = if error.is_finite() {
            format!("predicts the change across it to {error:.1} rad only")
        } else {
            "is not known".to_owned()
        };
        print(&format!(
            "warning: the velocity around the gap behind frame {} {known}: the phases behind it may be off by whole turns, \
             which their standard deviation does not count. Measure in shorter gaps, or more frames on each side",
            self.good.numbers()[frame]
        ));
    }

    /// So many frames have no phase of their own.
    fn without_phase(&self, count: usize) -> String {
        let frames = self.plan.frames();
        match self.plan.method {
            Method::Linked => format!("{count} of {frames} frames have no usable phase: nan"),
            _ => format!("{count} of {frames} frames have no pair above random phases: bridged"),
        }
    }

    /// The curve of all frames with the direct difference.
    fn draw(&self, rows: &[CurveRow], result: &Evaluated, control: Option<&Evaluated>) -> Canvas {
        let column = |rows: &[CurveRow], value: fn(&CurveRow) -> f64| -> Vec<f64> {
            rows.iter().map(value).collect()
        };
        let phase = |row: &CurveRow| row.phase_rad;
        let direct = result.direct.as_ref().map(|direct| self.good.rows_of_all(direct));
        let direct = direct.map(|direct| column(&direct, phase));
        let name = self.arguments.label();
        let less = control.map(|c| format!(" less {} of the control", c.pixels));
        let figure = PhaseCurve {
            label: &format!("{name}: {} pixels{}", result.pixels, less.unwrap_or_default()),
            method: self.method_name(),
            times: &column(rows, |row| row.time_s),
            time_axis: if self.good.times_s().is_some() { "time / s" } else { "frame" },
            phase: &column(rows, phase),
            sigma: &column(rows, |row| row.sigma_rad),
            direct: direct.as_deref(),
            onset: notes::stimulus_onset(&self.good),
            nm_per_rad: self.wavelength_nm.map(notes::nm_per_rad),
        };
        figure.draw()
    }
}

/// Closure of the mask and of the control, where they have one.
fn closures<'a>(
    result: &'a Evaluated,
    control: Option<&'a Evaluated>,
) -> impl Iterator<Item = (&'a Closure, &'static str)> {
    let regions = [(Some(result), "mask"), (control, "control")];
    let closure = |evaluated: &'a Evaluated| evaluated.linked.as_ref()?.closure.as_ref();
    regions
        .into_iter()
        .filter_map(move |(evaluated, region)| Some((evaluated.and_then(closure)?, region)))
}

/// The fitted coherence h(tau) = sum of share_k exp(-rate_k tau), for the attributes.
fn model(linked: &Linked) -> Value {
    let mixture = &linked.mixture;
    let mut terms = mixture.rates.iter().zip(&mixture.shares).filter(|&(_, &share)| share > 0.0);
    json!({
        "rates_per_time": terms.clone().map(|(rate, _)| rate).collect::<Vec<_>>(),
        "shares": terms.by_ref().map(|(_, share)| share).collect::<Vec<_>>(),
        "static": mixture.floor(),
        "noise": mixture.noise(),
        "decay_rate_per_time": mixture.decay_rate(),
        "periodic": linked.periodic,
        "misfit": linked.misfit,
    })
}

/// The control region's mask, which shares no pixel with `mask`.
fn read_control(path: &Path, mask: &[bool], width: usize) -> Result<Vec<bool>> {
    let control = read_mask(path, mask.len() / width, width)?;
    if control == mask {
        return Err(Error::file(path, "is the same region as --mask: nothing would be left"));
    }
    let shared = control.iter().zip(mask).filter(|&(&c, &m)| c && m).count();
    if shared > 0 {
        return Err(Error::file(
            path,
            format!("{shared} pixels belong to --mask as well: the control must lie outside of it"),
        ));
    }
    Ok(control)
}

/// Of a region, (y, x).
struct Masks {
    /// As it was drawn: what moves as one.
    drawn: Vec<bool>,
    /// The pixels that are averaged.
    inner: Vec<bool>,
}

/// What the curves of all regions start from.
struct Ground<'a> {
    task: &'a Task<'a>,
    survey: &'a Survey,
    /// How light spreads, where that from outside of the masks is taken off.
    spread: Option<PointSpread>,
}

impl Ground<'_> {
    /// The pixels of the mask, how far their speckle reaches, and what depths and recordings add to their looks.
    fn select(
        &self,
        masks: &Masks,
        path: &Path,
    ) -> Result<(Selection, SpatialCoherence, AddedLooks)> {
        let Task { good, plan, .. } = self.task;
        let width = good.shape().width;
        let usable = self.survey.within(&masks.inner);
        let coherence = self.task.coherence(&usable)?;
        let added = self.task.added_looks(&usable, &coherence)?;
        let linked = plan.method == Method::Linked;
        let looks = coherence.looks_of_mask(&usable.valid, width);
        let wanted = window_looks(looks * added.depths);
        let window = (linked && plan.depths.has_two_layers())
            .then(|| coherence.block_of_looks(wanted, added.depths, good.shape()));
        let valid = &self.survey.valid;
        let mut selection = Selection::new(valid, &masks.inner, width, window)
            .map_err(|error| error.about(path))?;
        if let Some(spread) = &self.spread {
            selection = selection.without_leakage(spread, &coherence, &masks.drawn, valid);
        }
        Ok((selection, coherence, added))
    }

    /// The curve of the region that `flag` asked for, and the direct difference for the figure.
    fn evaluate(&self, name: &str, masks: &Masks, path: &Path, flag: &str) -> Result<Evaluated> {
        let Task { arguments, good, plan, .. } = self.task;
        let frames = good.shape().frames;
        let progress = Progress::new(name, 2 * frames as u64);
        let (selection, coherence, added) = self.select(masks, path)?;
        let bytes = selection.bytes(frames, plan.depths.all().len());
        let (left_out, leakage) = (selection.left_out(), selection.leakage());
        let region = Region::read(good, self.survey.scale, selection, plan, &progress)?;
        let effective_looks = region.looks(&coherence) * added.product();
        let nominal = (region.pixels() * arguments.series.len()) as f64;
        let looks = arguments.looks().choose(nominal, effective_looks);
        let averaged = nominal * plan.depths.all().len() as f64;
        check_looks(plan.method, looks, averaged, flag)?;
        let (rows, linked) = if plan.method == Method::Linked {
            let linked = link_region(&region, plan, looks, &progress).map_err(|e| e.about(path))?;
            (linked.rows.clone(), Some(linked))
        } else {
            (curve(&region, plan, looks, effective_looks, &progress)?, None)
        };
        let beside = arguments.figure.is_some() && plan.method != Method::Direct;
        let direct = beside.then(|| {
            let plan = Plan { method: Method::Direct, ..plan.clone() };
            curve(&region, &plan, looks, effective_looks, &Progress::hidden())
        });
        Ok(Evaluated {
            rows,
            linked,
            direct: direct.transpose()?,
            pixels: region.pixels(),
            left_out,
            leakage,
            looks,
            effective_looks,
            recordings: added.recordings,
            bytes,
        })
    }
}

/// A region's curve, one row for each good frame.
struct Evaluated {
    rows: Vec<CurveRow>,
    linked: Option<Linked>,
    direct: Option<Vec<CurveRow>>,
    pixels: usize,
    left_out: usize,
    /// Share of the light that came from outside of the mask, where it was taken off.
    leakage: Option<f64>,
    looks: f64,
    effective_looks: f64,
    /// How many independent recordings those that there are amount to.
    recordings: f64,
    /// Memory of its fields.
    bytes: u64,
}

impl Evaluated {
    fn subtract(&mut self, control: &Self) {
        subtract(&mut self.rows, &control.rows);
        if let (Some(direct), Some(control)) = (&mut self.direct, &control.direct) {
            subtract(direct, control);
        }
    }

    fn in_words(&self) -> String {
        let left_out = if self.left_out > 0 {
            format!(" ({} of the mask left out: not finite, or always zero)", self.left_out)
        } else {
            String::new()
        };
        // Less is chance where pixels are independent.
        let seen = self.leakage.filter(|&share| share >= 0.001);
        let leakage = seen.map_or_else(String::new, |share| {
            format!(" ({:.1} % of their light, from outside, taken off)", 100.0 * share)
        });
        format!("{} pixels{left_out}{leakage}", self.pixels)
    }
}
