//! From a camera recording to volumes: two passes over the raw data, resumable.
//!
//! ```text
//! recording ── preparation (sweeps, light, dispersion) ── first pass (background, |U|, motion, mean volume)
//!           ── analysis (motions, starts, dispersion at the IS/OS, surfaces) ── second pass ── V.zarr
//! ```

use super::analysis::{Analysis, analyse};
use super::background::Grid;
use super::first_pass::{FirstPass, LEAST_SIDE, State};
use super::preparation::{self, Preparation};
use super::register::MATCHED;
use super::second_pass::SecondPass;
use super::segment::Surfaces;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::io::{Attributes, Companions, RawImages, Unfinished, VolumesLayout, VolumesWriter};
use crate::progress::Progress;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;
use std::path::{Path, PathBuf};

/// The state of the first pass, kept when it is interrupted.
const FIRST: &str = "first-pass";
/// What the passes have in common, kept from the first to the end.
const ANALYSIS: &str = "analysis";
/// The sweep at which the second pass goes on.
const NEXT: &str = "next-sweep";
/// Which recording and settings an unfinished run belongs to.
const JOB: &str = "job";

/// A reconstruction to be done.
pub struct Job<'a> {
    /// The recording.
    pub raw: &'a dyn RawImages,
    /// Its name, for the result's attributes.
    pub name: &'a Path,
    /// What the user says about it.
    pub settings: &'a Settings,
    /// When each sweep was taken, in seconds, where a run log tells.
    pub times_s: Option<Vec<f64>>,
    /// Where the result goes.
    pub output: &'a Path,
    /// Go on with an unfinished run.
    pub resume: bool,
}

/// What was found on the way: for the summary and the pictures.
pub struct Findings {
    /// Before the passes.
    pub plan: Preparation,
    /// Between them.
    pub analysis: Analysis,
    /// How the layers were chosen; none when the first pass was done by an earlier run.
    pub surfaces: Option<Surfaces>,
    /// Mean intensity (z, y, x) of the depths of the first pass; as above.
    pub mean: Option<Vec<f32>>,
    /// In words, per sweep.
    pub verdicts: Vec<String>,
    /// Predicted memory, bytes.
    pub memory: u64,
    /// Wall time of preparation, first pass, analysis and second pass, seconds.
    pub seconds: [f64; 4],
}

/// What the user is told while it goes on.
pub trait Observer {
    /// Sweeps are known, the passes begin.
    fn prepared(&self, plan: &Preparation, memory: u64);
    /// The layers are known: time for pictures.
    ///
    /// # Errors
    /// When a picture cannot be written.
    fn analysed(&self, findings: &Findings) -> Result<()>;
}

impl Job<'_> {
    /// Do it; the result appears under its name when it is whole.
    ///
    /// # Errors
    /// When the recording cannot be used, the disk is full, or the user interrupts: then what is
    /// done is kept for `resume`.
    pub fn run(&self, observer: &dyn Observer) -> Result<(Findings, PathBuf)> {
        self.settings.validate()?;
        let format = self.raw.format();
        if format.height < LEAST_SIDE || format.width < LEAST_SIDE {
            return Err(Error::failed(format!(
                "images of {} x {} pixels: at least {LEAST_SIDE} x {LEAST_SIDE} are needed",
                format.width, format.height
            )));
        }
        let clock = Clock::start();
        let plan = preparation::prepare(self.raw, self.settings)?;
        self.check_times(&plan)?;
        let memory = self.memory(&plan);
        observer.prepared(&plan, memory);
        let work = self.open_work()?;
        let prepared_s = clock.seconds();
        let (analysis, surfaces, mean, passed_s) = self.first_pass(&plan, &work)?;
        let analysed_s = clock.seconds();
        let verdicts = verdicts(&plan, &analysis);
        let seconds = [prepared_s, passed_s, analysed_s - prepared_s - passed_s, 0.0];
        let mut findings = Findings { plan, analysis, surfaces, mean, verdicts, memory, seconds };
        observer.analysed(&findings)?;
        findings.mean = None;
        let before = clock.seconds();
        let path = self.second_pass(&findings, work)?;
        findings.seconds[3] = clock.seconds() - before;
        Ok((findings, path))
    }

    /// A run log that knows another number of sweeps belongs to another recording.
    fn check_times(&self, plan: &Preparation) -> Result<()> {
        let (Some(times), found) = (&self.times_s, plan.sweeps.len()) else { return Ok(()) };
        if times.len() == found {
            return Ok(());
        }
        let told = times.len();
        Err(Error::failed(format!(
            "the run log tells of {told} sweeps, the recording holds {found}: give the log of this run"
        )))
    }

    /// Peak memory of the passes, bytes.
    fn memory(&self, plan: &Preparation) -> u64 {
        let format = self.raw.format();
        let (height, width) = (format.height, format.width);
        let depth = if self.settings.full { plan.images / 2 } else { plan.depths.len().min(24) };
        let first = FirstPass::bytes(plan, height, width);
        first.max(SecondPass::bytes(plan.images, depth, height, width))
    }

    fn open_work(&self) -> Result<Unfinished> {
        let format = self.raw.format();
        let pixels = (format.height * format.width * size_of::<num_complex::Complex32>()) as u64;
        let depth = if self.settings.full { self.settings.images as u64 / 2 } else { 24 };
        let sweeps = (format.images / self.settings.images) as u64 + 1;
        let work = Unfinished::open(self.output, sweeps * depth * pixels, self.resume)?;
        let job = serde_json::to_vec(&(self.name, self.settings, format.images, format.bits))
            .map_err(|error| Error::failed(format!("cannot describe the job: {error}")))?;
        match work.load(JOB)? {
            Some(earlier) if earlier != job => Err(Error::usage(format!(
                "--resume: the unfinished run beside {} is of another recording or other settings; \
                 leave --resume out to begin anew",
                self.output.display()
            ))),
            Some(_) => Ok(work),
            None => {
                work.save(JOB, &job)?;
                Ok(work)
            }
        }
    }

    #[expect(clippy::type_complexity, reason = "what the pass gives, used once")]
    fn first_pass(
        &self,
        plan: &Preparation,
        work: &Unfinished,
    ) -> Result<(Analysis, Option<Surfaces>, Option<Vec<f32>>, f64)> {
        if let Some(analysis) = load(work, ANALYSIS)? {
            return Ok((analysis, None, None, 0.0));
        }
        let clock = Clock::start();
        let mut pass = FirstPass::new(self.raw, plan, load::<State>(work, FIRST)?)?;
        let progress = Progress::new("first pass", plan.sweeps.len() as u64);
        let outcome = pass.run(&progress);
        drop(progress);
        if let Err(error) = outcome {
            save(work, FIRST, &pass.state)?;
            return Err(self.kept(error, work.folder()));
        }
        let passed_s = clock.seconds();
        let state = pass.state;
        let format = self.raw.format();
        let size = [format.height, format.width];
        let fixed = state.fixed_fringes(&Grid::new(format.height, format.width));
        let (analysis, surfaces) = analyse(plan, &state, fixed, self.settings, size)?;
        save(work, ANALYSIS, &analysis)?;
        Ok((analysis, Some(surfaces), Some(state.mean.intensity()), passed_s))
    }

    fn second_pass(&self, findings: &Findings, work: Unfinished) -> Result<PathBuf> {
        let Findings { plan, analysis, .. } = findings;
        let format = self.raw.format();
        let next = load::<usize>(&work, NEXT)?.unwrap_or(0);
        let layout = VolumesLayout {
            sweeps: plan.sweeps.len(),
            depth: analysis.depths.len(),
            height: format.height,
            width: format.width,
        };
        let companions = self.companions(findings);
        let writer = VolumesWriter::create(work, layout, self.attributes(findings), &companions)?;
        let mut pass = SecondPass::new(self.raw, plan, analysis, self.settings.direction)?;
        let progress = Progress::new("second pass", plan.sweeps.len() as u64);
        let done = |next: usize| writer.save(NEXT, &encode(&next)?);
        if let Err(error) = pass.run(next, &writer, &progress, done) {
            drop(progress);
            let folder = writer.folder().unwrap_or(self.output).to_owned();
            return Err(self.kept(error, &folder));
        }
        writer.finish()
    }

    /// The same error, which says what was kept.
    fn kept(&self, error: Error, folder: &Path) -> Error {
        match error {
            Error::Interrupted => Error::Kept(format!(
                "interrupted: the sweeps done so far are kept in {}; --resume goes on with them",
                folder.display()
            )),
            other => other,
        }
    }

    fn companions(&self, findings: &Findings) -> Companions {
        let Findings { plan, analysis, .. } = findings;
        let motion = |sweep: &Option<super::register::Motion>| {
            sweep.map_or([f64::NAN; 4], |m| {
                let [z, y, x] = m.shift;
                [z, y, x, m.rotation_rad]
            })
        };
        let motions: Vec<[f64; 4]> = analysis.motions.iter().map(motion).collect();
        Companions {
            shift_px: motions.iter().flat_map(|m| m[..3].to_vec()).collect(),
            rotation_rad: motions.iter().map(|m| m[3]).collect(),
            sweep_ok: analysis.motions.iter().map(Option::is_some).collect(),
            match_quality: analysis.quality.clone(),
            first_image: plan.sweeps.iter().map(|s| s.first_image as f64).collect(),
            start_jitter_images: analysis.jitter.clone(),
            surface_isos_px: analysis.isos.clone(),
            surface_ost_px: analysis.ost.clone(),
            dispersion_rad: vec![analysis.dispersion.a2, analysis.dispersion.a3],
            dead_pixel: plan.illumination.dead.clone(),
            time_s: self.times_s.clone(),
        }
    }

    fn attributes(&self, findings: &Findings) -> Attributes {
        let Findings { plan, analysis, verdicts, .. } = findings;
        let [tips, isos] = analysis.layers;
        let values = [
            ("software", json!(concat!("phasewalk ", env!("CARGO_PKG_VERSION")))),
            ("recording", json!(self.name)),
            ("wavelength_nm", json!(self.settings.wavelength_nm)),
            ("bandwidth_nm", json!(self.settings.bandwidth_nm)),
            ("depth_px_um", json!(self.settings.depth_px_um())),
            ("sweep", json!(self.settings.direction)),
            ("images_per_sweep", json!(self.settings.images)),
            ("layer_ost_z", json!(tips)),
            ("layer_isos_z", json!(isos)),
            ("flat_isos_z", json!(analysis.flat - analysis.depths.start)),
            ("dispersion_reliable", json!(plan.estimate.is_reliable())),
            ("start_jitter_sigma_images", json!(analysis.jitter_sigma)),
            ("verdicts", json!(verdicts)),
        ];
        values.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }
}

/// What became of each sweep, in words.
fn verdicts(plan: &Preparation, analysis: &Analysis) -> Vec<String> {
    let sweeps = plan.sweeps.iter().zip(&analysis.motions).zip(&analysis.quality);
    sweeps
        .map(|((sweep, motion), quality)| match motion {
            None if sweep.is_ok() => {
                format!("matches no other sweep (saccade or blink): {quality:.1} of {MATCHED} sigma")
            }
            _ => sweep.verdict.to_string(),
        })
        .collect()
}

fn encode(state: &impl Serialize) -> Result<Vec<u8>> {
    postcard::to_stdvec(state).map_err(|error| Error::failed(format!("cannot keep state: {error}")))
}

fn save(work: &Unfinished, name: &str, state: &impl Serialize) -> Result<()> {
    work.save(name, &encode(state)?)
}

fn load<T: DeserializeOwned>(work: &Unfinished, name: &str) -> Result<Option<T>> {
    let Some(bytes) = work.load(name)? else { return Ok(None) };
    postcard::from_bytes(&bytes).map(Some).map_err(|_| {
        Error::file(work.folder(), "its state is damaged: leave --resume out to begin anew")
    })
}

/// Wall time since it was started.
struct Clock(std::time::Instant);

impl Clock {
    fn start() -> Self {
        Self(std::time::Instant::now())
    }

    fn seconds(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}
