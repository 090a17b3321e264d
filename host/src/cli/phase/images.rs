//! Phase images of all frames.

use super::decorrelation::Decorrelation;
use super::figure::FigureFile;
use super::shown::Shown;
use super::{Task, check_looks, closure};
use crate::cli::{megabytes, print};
use crate::error::Result;
use crate::image::{
    Doubts, Fit, Gaps, ImageJob, Imaging, Kernel, MemoryPlan, StripResult, Tiles, window_kernel,
};
use crate::io::{Attributes, Format, ImageLayout, ImageWriter, Series, Shape};
use crate::lanes::Path as LanePath;
use crate::looks::SpatialCoherence;
use crate::method::Method;
use crate::progress::Progress;
use crate::series::Survey;
use serde_json::json;

use super::arguments::Precision;

impl Task<'_> {
    pub(super) fn images(&self, sigma_px: f64) -> Result<()> {
        let Shape { height, width, .. } = self.good.shape();
        let double = self.arguments.precision == Precision::F64;
        let kernel = Kernel::new(sigma_px, height, width, double)?;
        let path = LanePath::best()?;
        let figure = self.figure()?;
        let survey = self.survey()?;
        let speckled = self.speckled(&survey)?;
        let coherence = self.coherence(&speckled)?;
        let linked = self.plan.method == Method::Linked;
        let added = self.added_looks(&speckled, &coherence)?;
        let effective = coherence.looks_of_kernel(&kernel) * added.product();
        let nominal = kernel.nominal_looks() * self.arguments.series.len() as f64;
        let looks = self.arguments.looks().choose(nominal, effective);
        let averaged = nominal * self.plan.depths.all().len() as f64;
        check_looks(self.plan.method, looks, averaged, "--gaussian")?;
        let window = self.plan.depths.has_two_layers().then(|| window_kernel(&kernel, double));
        let window_looks = window
            .transpose()?
            .map_or(looks, |window| coherence.looks_of_kernel(&window) * added.depths);
        let fit = Fit {
            series: &self.good,
            survey: &survey,
            plan: &self.plan,
            coherence: &coherence,
            looks_of_layers: added.depths,
            looks_of_recordings: added.recordings,
            looks,
            window_looks,
            closure: self.tests_closure()?,
            path,
        };
        let tiles = linked.then(|| fit.tiles(&Progress::new("coherence", fit.steps())));
        let tiles = tiles.transpose()?;
        let job = ImageJob {
            tiles: tiles.as_ref(),
            series: &self.good,
            survey: &survey,
            plan: &self.plan,
            sigma_px,
            looks,
            effective_looks: effective,
            sigma: self.arguments.sigma || linked,
            double,
            path,
            threads: self.common.threads(),
            memory: self.memory(),
        };
        self.write_images(&job, &coherence, added.recordings, figure)
    }

    /// An .npy file has no place for it, and the noise of the product of two layers is not as the test expects.
    fn tests_closure(&self) -> Result<bool> {
        let zarr = matches!(Format::of(&self.arguments.output)?, Format::Zarr);
        Ok(zarr && !self.plan.depths.has_two_layers())
    }

    /// The figure's file and frames, before anything is computed.
    fn figure(&self) -> Result<Option<(FigureFile, Shown)>> {
        let file = FigureFile::wanted("--figure", self.arguments.figure.as_deref())?;
        file.map(|file| Ok((file, Shown::new(self)?))).transpose()
    }

    /// Compute, write, draw and report.
    fn write_images(
        &self,
        job: &ImageJob<'_>,
        coherence: &SpatialCoherence,
        recordings: f64,
        figure: Option<(FigureFile, Shown)>,
    ) -> Result<()> {
        let memory = job.memory_plan()?;
        let Shape { height, width, .. } = self.good.shape();
        self.tell([in_words(&memory, height)]);
        let mut facts =
            self.facts(job.survey, job.looks, job.effective_looks, recordings, memory.bytes);
        let usable = |frame: usize| job.tiles.is_none_or(|tiles| tiles.is_usable(frame));
        facts.insert("reference_frames".to_owned(), self.reference_frames(usable));
        let map_file =
            FigureFile::wanted("--decorrelation", self.arguments.decorrelation.as_deref())?;
        let layout = self.layout(memory.strip_rows, facts.clone());
        let writer = ImageWriter::create(&self.arguments.output, layout)?;
        let progress = Progress::new("phase images", job.steps()?);
        let closure = closure::ClosureMap::new(self, job.tiles);
        let Doubts { unmeasured, over_gaps } = job.run(&progress, &|strip| {
            if let Some((_, shown)) = &figure {
                shown.keep(&strip)?;
            }
            closure.keep(&strip)?;
            self.write_strip(&writer, &strip)
        })?;
        let map = job.tiles.map(|tiles| self.add_maps(tiles, &writer, &mut facts)).transpose()?;
        let closure = closure.finish();
        if let Some(closure) = &closure {
            writer.write_map("closure_p", closure)?;
            facts.insert("closure".to_owned(), closure::fact(closure));
        }
        let mut files = writer.finish()?;
        drop(progress);
        if let Some((file, shown)) = figure {
            let canvas = shown.draw(self, &self.imaging(job, coherence))?;
            files.push(file.finish(&canvas)?);
        }
        if let (Some(map), Some(file)) = (&map, map_file) {
            files.push(file.finish(&map.draw())?);
        }
        facts.insert("pixels_without_weight".to_owned(), json!(unmeasured));
        if let Some(share) = over_gaps.share_unsure() {
            facts.insert("share_unsure_over_gaps".to_owned(), json!(share));
        }
        let closure = closure.map(|closure| closure::map_in_words(&closure));
        let map = map.map(|map| map.in_words());
        let turns = warning_of_gaps(over_gaps);
        let lines =
            [self.other_reference(usable), map, closure, self.without_weight(unmeasured), turns];
        self.tell(lines.into_iter().flatten());
        let left_out = left_out(job.survey);
        self.report(&format!("{width} x {height} pixels{left_out}"), facts, &files);
        Ok(())
    }

    /// So many pixels have no phase of their own.
    fn without_weight(&self, pixels: usize) -> Option<String> {
        let there = match self.plan.method {
            Method::Linked => "no usable frame: nan there",
            _ => "no pair above random phases: 0 there",
        };
        (pixels > 0).then(|| format!("{pixels} pixels have {there}"))
    }

    /// Lines for people.
    fn tell(&self, lines: impl IntoIterator<Item = String>) {
        for line in lines.into_iter().filter(|_| !self.common.json) {
            print(&line);
        }
    }

    /// What the tiles tell beside the images.
    fn add_maps(
        &self,
        tiles: &Tiles,
        writer: &ImageWriter,
        facts: &mut Attributes,
    ) -> Result<Decorrelation> {
        let map = Decorrelation::of(self, tiles);
        map.write(writer)?;
        facts.insert("decorrelation".to_owned(), map.facts());
        let quality = tiles.quality();
        writer.write_quality(&self.good.images_of_all(&quality, f32::NAN), tiles.origins())?;
        Ok(map)
    }

    fn layout(&self, strip_rows: usize, attributes: Attributes) -> ImageLayout {
        let Shape { height, width, .. } = self.good.shape();
        let frames = self.good.in_all();
        let times = || (0..frames).map(|frame| self.good.time_of(frame)).collect();
        ImageLayout {
            frames,
            height,
            width,
            strip_rows,
            sigma: self.arguments.sigma || self.plan.method == Method::Linked,
            attributes,
            times_s: self.good.times_s().map(|_| times()),
        }
    }

    /// Bad sweeps as images without values: NaN, with an infinite standard deviation.
    fn write_strip(&self, writer: &ImageWriter, strip: &StripResult<'_>) -> Result<()> {
        let phases = self.good.images_of_all(strip.phases, f32::NAN);
        let infinite = |sigmas| self.good.images_of_all(sigmas, f32::INFINITY);
        let sigmas = strip.sigmas.map(infinite);
        writer.write_strip(strip.first_row, &phases, sigmas.as_deref(), strip.valid)
    }

    /// How the images were computed, for the direct difference beside them.
    fn imaging<'a>(&'a self, job: &ImageJob<'a>, coherence: &'a SpatialCoherence) -> Imaging<'a> {
        Imaging {
            series: &self.good,
            survey: job.survey,
            coherence,
            sigma_px: job.sigma_px,
            looks: self.arguments.looks(),
            threads: job.threads,
            memory: job.memory,
        }
    }

    /// Bytes that the images may take.
    fn memory(&self) -> u64 {
        self.arguments.memory.saturating_mul(1_000_000)
    }
}

fn in_words(memory: &MemoryPlan, height: usize) -> String {
    let (strips, threads) = (height.div_ceil(memory.strip_rows), memory.threads);
    let bytes = megabytes(memory.bytes);
    format!("{strips} strips on {threads} threads; {bytes} of memory")
}

/// Where turns over gaps are not sure, of how many of the pixels.
fn warning_of_gaps(gaps: Gaps) -> Option<String> {
    let share = gaps.share_unsure().filter(|&share| share > 0.0)?;
    let percent = match 100.0 * share {
        few if few < 0.1 => "less than 0.1".to_owned(),
        percent => format!("{percent:.1}"),
    };
    Some(format!(
        "warning: in {percent} % of the pixels the velocity around a gap in the times does not tell the whole turns across it: \
         phases behind it may be off by them, which their standard deviation does not count. Measure in shorter gaps, or \
         average over more pixels"
    ))
}

fn left_out(survey: &Survey) -> String {
    let Survey { not_finite, dark, .. } = survey;
    if not_finite + dark == 0 {
        return String::new();
    }
    format!(" ({not_finite} not finite and {dark} always zero: NaN there)")
}
