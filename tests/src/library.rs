//! The host library's curves and images of a recording.

use crate::recording::Recording;
use phasewalk::curve::{Region, Selection, curve};
use phasewalk::image::{ImageJob, MemoryPlan};
use phasewalk::io::{CurveRow, Series};
use phasewalk::lanes::Path;
use phasewalk::method::Plan;
use phasewalk::progress::Progress;
use phasewalk::series::survey;
use std::sync::Mutex;

/// The phase curve over `mask`, with the same looks for weights and standard deviations.
///
/// # Panics
/// If the library reports an error.
#[must_use]
pub fn phase_curve(recording: &Recording, mask: &[bool], plan: &Plan, looks: f64) -> Vec<CurveRow> {
    let series = recording.held();
    let progress = Progress::hidden();
    let survey = survey(&series, &plan.depths.all()).expect("usable pixels");
    let selection = Selection::new(&survey.valid, mask, series.shape().width, None);
    let selection = selection.expect("usable pixels of the mask");
    let region =
        Region::read(&series, survey.scale, selection, plan, &progress).expect("a usable region");
    curve(&region, plan, looks, looks, &progress).expect("a curve")
}

/// How images are computed.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// sigma_Gauss, pixels.
    pub sigma_px: f64,
    /// Looks of the weights and of the standard deviations.
    pub looks: f64,
    /// Standard deviations too.
    pub sigma: bool,
    /// Arithmetic in `f64`.
    pub double: bool,
    /// Vector instructions.
    pub path: Path,
    /// Number of threads.
    pub threads: usize,
    /// Bytes for the strips.
    pub memory: u64,
}

impl Settings {
    /// One thread, plenty of memory, portable arithmetic in `f32`, nominal looks.
    #[must_use]
    pub fn new(sigma_px: f64) -> Self {
        Self {
            sigma_px,
            looks: crate::oracle::gaussian_looks(sigma_px),
            sigma: false,
            double: false,
            path: Path::Portable,
            threads: 1,
            memory: 1 << 30,
        }
    }

    /// The same in `f64`.
    #[must_use]
    pub fn in_double(self) -> Self {
        Self { double: true, ..self }
    }
}

/// Phase images (time, y, x) and how they were computed.
pub struct Images {
    /// Radians.
    pub phases: Vec<f32>,
    /// Their standard deviations; empty if not asked for.
    pub sigmas: Vec<f32>,
    /// Strips and memory.
    pub memory: MemoryPlan,
}

/// Compute phase images.
///
/// # Panics
/// If the library reports an error.
#[must_use]
pub fn phase_images(recording: &Recording, plan: &Plan, settings: &Settings) -> Images {
    let series = recording.held();
    let survey = survey(&series, &plan.depths.all()).expect("usable pixels");
    let job = ImageJob {
        tiles: None,
        series: &series,
        survey: &survey,
        plan,
        sigma_px: settings.sigma_px,
        looks: settings.looks,
        effective_looks: settings.looks,
        sigma: settings.sigma,
        double: settings.double,
        path: settings.path,
        threads: settings.threads,
        memory: settings.memory,
    };
    let memory = job.memory_plan().expect("enough memory");
    let size = plan.frames() * recording.pixels();
    let phases = Mutex::new(vec![f32::INFINITY; size]);
    let sigmas = Mutex::new(vec![f32::INFINITY; if settings.sigma { size } else { 0 }]);
    let place = |strip: &[f32], first_row: usize, images: &Mutex<Vec<f32>>| {
        let rows = strip.len() / plan.frames();
        let start = first_row * recording.shape.width;
        let mut images = images.lock().expect("no thread has failed");
        for (from, to) in strip.chunks(rows).zip(images.chunks_mut(recording.pixels())) {
            to[start..start + rows].copy_from_slice(from);
        }
    };
    job.run(&Progress::hidden(), &|strip| {
        place(strip.phases, strip.first_row, &phases);
        if let Some(values) = strip.sigmas {
            place(values, strip.first_row, &sigmas);
        }
        Ok(())
    })
    .expect("images");
    let unwrap = |images: Mutex<Vec<f32>>| images.into_inner().expect("no thread has failed");
    Images { phases: unwrap(phases), sigmas: unwrap(sigmas), memory }
}
