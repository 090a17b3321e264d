//! From a camera recording to volumes: two passes over the raw data, resumable.
//!
//! ```text
//! recording ── preparation (sweeps, light, dispersion) ── first pass (background, |U|, motion, mean volume)
//!           ── analysis (motions, starts, dispersion at the IS/OS, surfaces) ── second pass ── V.zarr
//! ```

use super::analysis::{Analysis, analyse};
use super::findings::{Findings, Survey};
use super::first_pass::{FirstPass, LEAST_SIDE, State};
use super::grid::Grid;
use super::preparation::{self, Preparation};
use super::second_pass::SecondPass;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::io::{Attributes, RawImages, Unfinished, VolumesLayout, VolumesWriter};
use crate::progress::Progress;
use serde::Serialize;
use serde::de::DeserializeOwned;
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
    /// Further attributes of the result, for the figure: pixel pitch, stimulus.
    pub notes: Attributes,
    /// Where the result goes.
    pub output: &'a Path,
    /// Go on with an unfinished run.
    pub resume: bool,
}

/// What the user is told while it goes on.
pub trait Observer {
    /// An earlier run did so many sweeps of a pass already.
    fn goes_on(&self, pass: &str, sweeps: usize);
    /// Sweeps are known, the passes begin.
    fn prepared(&self, plan: &Preparation, memory: u64);
    /// The layers are known: time for pictures. Not called again when a later run goes on.
    ///
    /// # Errors
    /// When a picture cannot be written.
    fn analysed(&self, findings: &Findings, survey: &Survey) -> Result<()>;
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
        if self.resume && self.output.exists() && !Unfinished::is_left(self.output) {
            return Err(Error::usage(format!(
                "--resume: {} is finished, there is nothing to go on with; leave --resume out to \
                 replace it",
                self.output.display()
            )));
        }
        let clock = Clock::start();
        let plan = preparation::prepare(self.raw, self.settings)?;
        self.check_times(&plan)?;
        self.check_stimulus(&plan)?;
        let memory = self.memory(&plan);
        observer.prepared(&plan, memory);
        let work = self.open_work()?;
        let earlier = Earlier::load(&work)?;
        let prepared_s = clock.seconds();
        let (analysis, survey, passed_s) = self.first_pass(&plan, &work, earlier, observer)?;
        let analysed_s = clock.seconds() - prepared_s - passed_s;
        let seconds = [prepared_s, passed_s, analysed_s, 0.0];
        let name = self.name.to_owned();
        let mut findings = Findings::new(name, plan, analysis, memory, seconds);
        if let Some(survey) = survey {
            observer.analysed(&findings, &survey)?;
        }
        let clock = Clock::start();
        let path = self.second_pass(&findings, work, observer)?;
        findings.seconds[3] = clock.seconds();
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

    /// A stimulus after the last sweep is a slip.
    fn check_stimulus(&self, plan: &Preparation) -> Result<()> {
        let began = self.notes.get("stimulus_sweep").and_then(serde_json::Value::as_u64);
        match began.filter(|&sweep| sweep >= plan.sweeps.len() as u64) {
            Some(sweep) => Err(Error::usage(format!(
                "--stimulus-sweep {sweep}: the sweeps are 0..{}",
                plan.sweeps.len() - 1
            ))),
            None => Ok(()),
        }
    }

    /// Peak memory of the passes, bytes.
    fn memory(&self, plan: &Preparation) -> u64 {
        let format = self.raw.format();
        let (height, width) = (format.height, format.width);
        let depth = if self.settings.full { plan.images / 2 } else { plan.depths.len().min(24) };
        let first = FirstPass::bytes(plan, height, width);
        first.max(SecondPass::bytes(plan.images, depth, height, width))
    }

    /// Size of the file that names the recording, its header as a rule, and when it was written: another
    /// recording of the same name is not gone on with.
    fn recorded(&self) -> Result<(u64, Option<std::time::SystemTime>)> {
        let file = std::fs::metadata(self.name)
            .map_err(|error| Error::file(self.name, format!("cannot be read: {error}")))?;
        Ok((file.len(), file.modified().ok()))
    }

    fn open_work(&self) -> Result<Unfinished> {
        let format = self.raw.format();
        let pixels = (format.height * format.width * size_of::<num_complex::Complex32>()) as u64;
        let depth = if self.settings.full { self.settings.images as u64 / 2 } else { 24 };
        let sweeps = (format.images / self.settings.images) as u64 + 1;
        let work = Unfinished::open(self.output, sweeps * depth * pixels, self.resume)?;
        let version = env!("CARGO_PKG_VERSION");
        let job = (version, self.name, self.recorded()?, self.settings, format.images, format.bits);
        let job = serde_json::to_vec(&job)
            .map_err(|error| Error::failed(format!("cannot describe the job: {error}")))?;
        match work.load(JOB)? {
            None if work.load(FIRST)?.or(work.load(ANALYSIS)?).is_some() => Err(damaged(&work)),
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

    /// What the first pass finds, what it has seen (unless an earlier run did it), and its seconds.
    fn first_pass(
        &self,
        plan: &Preparation,
        work: &Unfinished,
        earlier: Earlier,
        observer: &dyn Observer,
    ) -> Result<(Analysis, Option<Survey>, f64)> {
        let state = match earlier {
            Earlier::Analysis(analysis) => return Ok((*analysis, None, 0.0)),
            Earlier::State(state) => {
                observer.goes_on("first", state.next);
                Some(*state)
            }
            Earlier::Nothing => None,
        };
        let (clock, begins) = (Clock::start(), state.is_none());
        let mut pass = FirstPass::new(self.raw, plan, state).inspect_err(|_| {
            if begins {
                work.discard();
            }
        })?;
        let progress = Progress::new("first pass", plan.sweeps.len() as u64);
        let outcome = pass.run(&progress, |state| save(work, FIRST, state));
        drop(progress);
        let state = pass.into_state();
        if let Err(error) = outcome {
            save(work, FIRST, &state)?;
            return Err(kept(error, work.folder()));
        }
        let passed_s = clock.seconds();
        let format = self.raw.format();
        let size = [format.height, format.width];
        let fixed = state.fixed_fringes(&Grid::new(format.height, format.width));
        // It would fail again: there is nothing to go on with.
        let (analysis, surfaces) =
            analyse(plan, &state, fixed, self.settings, size).inspect_err(|_| work.discard())?;
        save(work, ANALYSIS, &analysis)?;
        let survey = Survey { surfaces, mean: state.mean.intensity() };
        Ok((analysis, Some(survey), passed_s))
    }

    fn second_pass(
        &self,
        findings: &Findings,
        work: Unfinished,
        observer: &dyn Observer,
    ) -> Result<PathBuf> {
        let Findings { plan, analysis, .. } = findings;
        let format = self.raw.format();
        let next = load::<usize>(&work, NEXT)?.unwrap_or(0);
        if next > 0 {
            observer.goes_on("second", next);
        }
        let layout = VolumesLayout {
            sweeps: plan.sweeps.len(),
            depth: analysis.depths.len(),
            height: format.height,
            width: format.width,
        };
        let companions = findings.companions(self.times_s.clone());
        let mut attributes = findings.attributes(self.settings);
        attributes.extend(self.notes.clone());
        let writer = VolumesWriter::create(work, layout, attributes, &companions)?;
        let mut pass = SecondPass::new(self.raw, plan, analysis, self.settings.direction)?;
        let progress = Progress::new("second pass", plan.sweeps.len() as u64);
        let done = |next: usize| writer.save(NEXT, &encode(&next)?);
        if let Err(error) = pass.run(next, &writer, &progress, done) {
            drop(progress);
            let folder = writer.folder().unwrap_or(self.output).to_owned();
            return Err(kept(error, &folder));
        }
        writer.finish()
    }
}

/// What an earlier run left.
enum Earlier {
    /// Its first pass is done.
    Analysis(Box<Analysis>),
    /// It ended in its first pass.
    State(Box<State>),
    Nothing,
}

impl Earlier {
    fn load(work: &Unfinished) -> Result<Self> {
        if let Some(analysis) = load(work, ANALYSIS)? {
            return Ok(Self::Analysis(Box::new(analysis)));
        }
        let state = load(work, FIRST)?.map(|state| Self::State(Box::new(state)));
        Ok(state.unwrap_or(Self::Nothing))
    }
}

/// The same error, which says what was kept.
fn kept(error: Error, folder: &Path) -> Error {
    match error {
        Error::Interrupted => Error::Kept(format!(
            "interrupted: the sweeps done so far are kept in {}; --resume goes on with them",
            folder.display()
        )),
        Error::Failed(what) => Error::Failed(format!(
            "{what}; the sweeps done so far are kept in {}: --resume goes on with them",
            folder.display()
        )),
        other => other,
    }
}

/// Guards the state against damage.
const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI);

fn encode(state: &impl Serialize) -> Result<Vec<u8>> {
    postcard::to_stdvec_crc32(state, CHECKSUM.digest())
        .map_err(|error| Error::failed(format!("cannot keep state: {error}")))
}

fn save(work: &Unfinished, name: &str, state: &impl Serialize) -> Result<()> {
    work.save(name, &encode(state)?)
}

fn load<T: DeserializeOwned>(work: &Unfinished, name: &str) -> Result<Option<T>> {
    let Some(bytes) = work.load(name)? else { return Ok(None) };
    postcard::from_bytes_crc32(&bytes, CHECKSUM.digest()).map(Some).map_err(|_| damaged(work))
}

fn damaged(work: &Unfinished) -> Error {
    Error::file(work.folder(), "its state is damaged: leave --resume out to begin anew")
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
