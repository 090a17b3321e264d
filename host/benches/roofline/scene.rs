//! The paper's scene at full size, its phase images as the program computes them, and one of their strips
//! timed.

use num_complex::Complex32;
use phasewalk::error::Result;
use phasewalk::image::stages::{Timed, time};
use phasewalk::image::{Fit, ImageJob, Kernel};
use phasewalk::io::{Series, Shape};
use phasewalk::lanes::Path;
use phasewalk::looks::SpatialCoherence;
use phasewalk::method::{Depths, Method, Plan};
use phasewalk::progress::Progress;
use phasewalk::series::{HeldSeries, Survey, survey};
use phasewalk::simulate::SpeckleScene;
use phasewalk_core::weights::Weighting;
use std::time::Instant;

/// What is timed.
pub const METHODS: [Method; 2] = [Method::Paper(Weighting::Paper), Method::Linked];

/// sigma_Gauss, pixels.
const SIGMA_PX: f64 = 3.0;

/// The frames, and what is known of them before their phases.
pub struct Scene {
    series: HeldSeries,
    survey: Survey,
    coherence: SpatialCoherence,
}

/// A method's whole run, and its timed strip.
pub struct Run {
    /// The strip.
    pub timed: Timed,
    /// Frames of the series.
    pub frames: usize,
    /// Strips of the image; the last may be lower.
    pub strips: f64,
    /// CPU time of all strips on one thread, seconds.
    pub cpu_s: f64,
    /// That of the tiles which linked phases start from.
    pub tiles_s: f64,
}

impl Scene {
    /// With a tenth of the paper's scatterers a pixel, which the speckle does not show.
    pub fn simulate() -> Result<Self> {
        let scene = SpeckleScene { scatterers_per_pixel: 5, ..SpeckleScene::default() };
        let SpeckleScene { frames, height, width, .. } = scene;
        let mut field: Vec<Complex32> = Vec::with_capacity(frames * height * width);
        scene.for_each_frame(&Progress::hidden(), |_, frame| {
            field.extend_from_slice(frame);
            Ok(())
        })?;
        let series = HeldSeries::new(Shape { frames, depth: 1, height, width }, field)?;
        let survey = survey(&series, &[0])?;
        let coherence = SpatialCoherence::estimate(&series, &survey, &[0])?;
        Ok(Self { series, survey, coherence })
    }

    /// All images on one thread, then a strip with the clock.
    pub fn run(&self, path: Path, method: Method, repetitions: usize) -> Result<Run> {
        let Shape { frames, height, width, .. } = self.series.shape();
        let plan = Plan::new(method, frames, None, None, Depths::single())?;
        let kernel = Kernel::new(SIGMA_PX, height, width, false)?;
        let looks = self.coherence.looks_of_kernel(&kernel);
        let begun = cpu_seconds();
        let (series, survey) = (&self.series, &self.survey);
        let fit = Fit::of_one_plane(series, survey, &plan, &self.coherence, looks, path);
        let linked = method == Method::Linked;
        let tiles = linked.then(|| fit.tiles(&Progress::hidden())).transpose()?;
        let tiles_s = cpu_seconds() - begun;
        let job = ImageJob {
            series: &self.series,
            survey: &self.survey,
            plan: &plan,
            sigma_px: SIGMA_PX,
            looks,
            effective_looks: looks,
            tiles: tiles.as_ref(),
            sigma: linked,
            double: false,
            path,
            threads: 1,
            memory: u64::MAX,
        };
        let begun = cpu_seconds();
        job.run(&Progress::hidden(), &|_| Ok(()))?;
        let cpu_s = cpu_seconds() - begun;
        let timed = time(&job, repetitions)?;
        let strips = height as f64 / timed.rows as f64;
        Ok(Run { timed, frames, strips, cpu_s, tiles_s })
    }
}

/// CPU time of this process so far, where Linux tells it (in hundredths of a second), else the time of the
/// clock on the wall.
fn cpu_seconds() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let wall = START.get_or_init(Instant::now).elapsed().as_secs_f64();
    let Ok(stat) = std::fs::read_to_string("/proc/self/stat") else { return wall };
    // Behind the name in brackets: state, ten numbers, then user and system time.
    let behind = stat.rsplit(')').next().unwrap_or_default();
    let times = behind.split_whitespace().skip(11).take(2);
    times.filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}
