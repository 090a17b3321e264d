//! The recording itself, sweep after sweep.
//!
//! One sweep is in memory at a time: images are handed out one by one.

use super::axial::{Axial, LANES, Sample, Scratch};
use super::camera::{Camera, Exposure};
use super::elongation;
use super::field::{Appearance, Field, ROWS};
use super::geometry::Geometry;
use super::motion::{Motion, Piece, motions};
use super::pose::Pose;
use super::scene::OctScene;
use super::schedule::{Event, events};
use super::sweep::{Sweep, power};
use super::tissue::Tissue;
use crate::allocate::zeros;
use crate::error::Result;
use crate::progress::{self, Progress};
use num_complex::Complex32;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Everything that is decided before the first image is made.
pub struct Plan {
    /// The parameters.
    pub scene: OctScene,
    /// What happens in which sweep.
    pub events: Vec<Event>,
    /// How the eye moves.
    pub motions: Vec<Motion>,
    /// Sizes.
    pub geometry: Geometry,
    /// True phase of the tips against the IS/OS inside the x, radians, one per sweep.
    pub phase_rad: Vec<f64>,
}

impl Plan {
    /// Check the scene and decide what happens.
    ///
    /// # Errors
    /// Wrong parameters, or more depth than there are images for.
    pub fn new(scene: OctScene) -> Result<Self> {
        scene.validate()?;
        let events = events(&scene);
        let motions = motions(&scene, &events);
        let geometry = Geometry::new(&scene, &motions)?;
        let phase_rad = elongation::phase_rad(scene.sweeps);
        Ok(Self { scene, events, motions, geometry, phase_rad })
    }

    /// Images in the file.
    #[must_use]
    pub fn images(&self) -> usize {
        self.events.iter().map(|event| event.images(&self.scene)).sum()
    }

    /// Predicted peak memory on `threads` threads, bytes, without the program itself: scatterers,
    /// depth planes with their spectra, one sweep of counts, the camera's maps, and per thread eight
    /// rows of the planes.
    #[must_use]
    pub fn memory_bytes(&self, threads: usize) -> u64 {
        let Self { scene, geometry, .. } = self;
        let rows = ROWS * geometry.planes * geometry.field[1] * size_of::<Complex32>();
        Tissue::memory_bytes(scene, geometry)
            + Field::memory_bytes(scene, geometry)
            + Camera::memory_bytes(scene)
            + (scene.images + 1) as u64 * (scene.pixels() * size_of::<u16>()) as u64
            + (threads * rows) as u64
    }

    /// Make the recording and call `each(image)` for every image of the file, counts (y, x).
    ///
    /// It works on all threads of the ambient rayon pool; the counts are the same for any number of
    /// them. `progress` moves by one per image.
    ///
    /// # Errors
    /// Lack of memory, [`Error::Interrupted`](crate::error::Error::Interrupted), and whatever `each`
    /// returns.
    pub fn record(
        &self,
        progress: &Progress,
        mut each: impl FnMut(&[u16]) -> Result<()>,
    ) -> Result<()> {
        let mut recorder = Recorder::new(self)?;
        let mut image = zeros(self.scene.pixels(), "an image")?;
        for (t, event) in self.events.iter().enumerate() {
            if t > 0 {
                recorder.tissue.walk(t)?;
            }
            recorder.sweep(t)?;
            for m in 0..event.images(&self.scene) {
                recorder.image(m, &mut image);
                each(&image)?;
                progress.advance(1)?;
            }
        }
        Ok(())
    }
}

/// The state from sweep to sweep, and the counts of one.
struct Recorder<'a> {
    plan: &'a Plan,
    tissue: Tissue,
    field: Field,
    axial: Axial,
    camera: Camera,
    /// Counts of the sweep, shape (y, image, x): rows belong to threads.
    counts: Vec<u16>,
}

impl<'a> Recorder<'a> {
    fn new(plan: &'a Plan) -> Result<Self> {
        let (scene, geometry) = (&plan.scene, &plan.geometry);
        Ok(Self {
            plan,
            // The largest first: too much is refused at once.
            field: Field::new(scene, geometry)?,
            counts: zeros(scene.pixels() * scene.images, "the images of a sweep")?,
            axial: Axial::new(geometry),
            camera: Camera::new(scene)?,
            tissue: Tissue::start(scene, geometry)?,
        })
    }

    /// Make the counts of sweep `t`.
    fn sweep(&mut self, t: usize) -> Result<()> {
        let motion = &self.plan.motions[t];
        let dark = matches!(self.plan.events[t], Event::Missing | Event::Blink);
        for piece in &motion.path {
            if !dark {
                self.field.compute(&self.tissue, &self.appearance(t, piece))?;
            }
            self.expose(t, piece, !dark)?;
        }
        Ok(())
    }

    /// How the tissue appears in a piece of sweep `t`.
    fn appearance(&self, t: usize, piece: &Piece) -> Appearance {
        let scene = &self.plan.scene;
        let motion = &self.plan.motions[t];
        let [over_height, over_width] = motion.tilt_rad;
        Appearance {
            pose: Pose::new([scene.height, scene.width], piece.shift_px, motion.rotation_rad),
            tilt_turns: [
                over_height / TAU / scene.height as f64,
                over_width / TAU / scene.width as f64,
            ],
            elongation_turns: self.plan.phase_rad[t] / TAU,
            conjugate: scene.down_sweep,
        }
    }

    /// Counts of a piece of sweep `t`, with the fringes of the retina if `lit`.
    fn expose(&mut self, t: usize, piece: &Piece, lit: bool) -> Result<()> {
        let Self { plan, field, axial, camera, counts, .. } = self;
        let scene = &plan.scene;
        let sweep = Sweep::new(scene, &plan.motions[t]);
        let samples = axial.samples(&sweep, piece.images.clone());
        let light = light(plan, t);
        let exposures: Vec<Exposure> = piece
            .images
            .clone()
            .map(|m| {
                let wavenumber = sweep.wavenumber(sweep.band_coordinate(m));
                camera.exposure(t, m, wavenumber, light * sweep.source(m))
            })
            .collect();
        let job = Job {
            scene,
            field: lit.then_some(&*field),
            axial,
            camera,
            first_image: piece.images.start,
            samples: &samples,
            exposures: &exposures,
        };
        let block = ROWS * scene.images * scene.width;
        let blocks = counts.par_chunks_mut(block).enumerate();
        blocks.try_for_each_init(
            || job.scratch(),
            |scratch, (i, counts)| {
                progress::check()?;
                job.rows(i * ROWS, counts, scratch);
                Ok(())
            },
        )
    }

    /// Image `m` of the sweep, (y, x).
    fn image(&self, m: usize, image: &mut [u16]) {
        let (width, images) = (self.plan.scene.width, self.plan.scene.images);
        for (y, row) in image.chunks_exact_mut(width).enumerate() {
            row.copy_from_slice(&self.counts[(y * images + m) * width..][..width]);
        }
        self.camera.kill(image);
    }
}

/// Light of sweep `t` over the usual.
fn light(plan: &Plan, t: usize) -> f64 {
    let factor = match plan.events[t] {
        Event::Missing => 0.0,
        Event::Saturated => plan.scene.saturation_factor,
        _ => 1.0,
    };
    factor * power(&plan.scene, t)
}

/// The work on one piece of a sweep, which threads share by rows.
struct Job<'a> {
    scene: &'a OctScene,
    field: Option<&'a Field>,
    axial: &'a Axial,
    camera: &'a Camera,
    first_image: usize,
    samples: &'a [Sample],
    exposures: &'a [Exposure],
}

/// Work space of one thread.
struct JobScratch {
    rows: Vec<Complex32>,
    axial: Scratch,
}

impl Job<'_> {
    fn scratch(&self) -> JobScratch {
        JobScratch { rows: Vec::new(), axial: self.axial.scratch() }
    }

    /// Counts (y, image, x) of the rows from `first` on.
    fn rows(&self, first: usize, counts: &mut [u16], scratch: &mut JobScratch) {
        let OctScene { width, images, .. } = *self.scene;
        let height = counts.len() / (width * images);
        let [left, field_width] = self.field.map_or([0; 2], Field::columns_of_image);
        let row = self.axial.planes() * field_width;
        if let Some(field) = self.field {
            scratch.rows.resize(height * row, Complex32::ZERO);
            field.rows(first, &mut scratch.rows);
        }
        for (y, counts) in counts.chunks_exact_mut(width * images).enumerate() {
            for x in (0..width).step_by(LANES) {
                let columns = x..(x + LANES).min(width);
                if self.field.is_some() {
                    let planes = &scratch.rows[y * row..(y + 1) * row];
                    let shifted = columns.start + left..columns.end + left;
                    self.axial.transform(planes, field_width, shifted, &mut scratch.axial);
                }
                for (i, (sample, exposure)) in self.samples.iter().zip(self.exposures).enumerate() {
                    let signal = match self.field {
                        Some(_) => sample.fringe(&scratch.axial),
                        None => [0.0; LANES],
                    };
                    let start = (self.first_image + i) * width;
                    let counts = &mut counts[start + columns.start..start + columns.end];
                    self.camera.expose(exposure, [first + y, x], &signal, counts);
                }
            }
        }
    }
}
