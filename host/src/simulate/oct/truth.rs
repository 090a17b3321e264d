//! What a reconstruction of the recording should find.

use super::camera::Camera;
use super::elongation;
use super::record::Plan;
use super::retina::TIPS;
use super::schedule::Event;
use super::sweep::{Sweep, apparent_dispersion};
use crate::error::Result;
use crate::io::{Attributes, GroupWriter};
use serde_json::json;
use std::path::Path;

/// The truth, sweep by sweep and pixel by pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Where the image of each sweep lies relative to the first, (z, y, x), pixels.
    pub shift_px: Vec<[f64; 3]>,
    /// Rotation about the middle of the image, one per sweep.
    pub rotation_rad: Vec<f64>,
    /// Depth of the IS/OS in the first sweep, shape (y, x), depth pixels.
    pub surface_isos_px: Vec<f32>,
    /// Depth of the outer-segment tips in the first sweep.
    pub surface_ost_px: Vec<f32>,
    /// Dispersion (a₂, a₃) that the recording shows at the IS/OS.
    pub dispersion_rad: [f64; 2],
    /// What is to be said of each sweep.
    pub verdicts: Vec<String>,
    /// Whether a sweep can be used.
    pub sweep_ok: Vec<bool>,
    /// Pixels that always show the same, shape (y, x).
    pub dead_pixel: Vec<bool>,
    /// Phase of the tips against the IS/OS inside the x, one per sweep.
    pub phase_rad: Vec<f64>,
    /// The x in the first sweep, shape (y, x).
    pub mask: Vec<bool>,
    /// Pixels well outside the x, shape (y, x).
    pub control: Vec<bool>,
    /// How late each sweep began, images.
    pub start_jitter_images: Vec<f64>,
    /// Images of each sweep in the file.
    pub images: Vec<usize>,
}

impl Truth {
    /// The truth about `plan`.
    ///
    /// # Errors
    /// Lack of memory, or layers without the two that matter.
    pub fn of(plan: &Plan) -> Result<Self> {
        let Plan { scene, events, motions, geometry, phase_rad } = plan;
        let surface = &geometry.surface;
        let isos = surface.image(0.0);
        let depth = isos.iter().copied().map(f64::from).sum::<f64>() / isos.len() as f64;
        let apparent: Vec<f64> =
            motions.iter().map(|motion| Sweep::new(scene, motion).apparent_depth(depth)).collect();
        let shift = |(z, motion): (&f64, &super::motion::Motion)| {
            [z - apparent[0], motion.shift_px[1], motion.shift_px[2]]
        };
        let first = apparent[0] - depth;
        let mask = elongation::mask(scene.width, scene.height);
        Ok(Self {
            shift_px: apparent.iter().zip(motions).map(shift).collect(),
            rotation_rad: motions.iter().map(|motion| motion.rotation_rad).collect(),
            surface_isos_px: surface.image(first),
            surface_ost_px: surface.image(first + scene.layer_offset_px(TIPS)?),
            dispersion_rad: apparent_dispersion(scene, depth),
            verdicts: events.iter().map(|event| event.verdict(scene)).collect(),
            sweep_ok: events.iter().map(|&event| event == Event::None).collect(),
            dead_pixel: Camera::new(scene)?.dead_mask(),
            phase_rad: phase_rad.clone(),
            control: elongation::control(&mask, scene.width, scene.height),
            mask,
            start_jitter_images: motions.iter().map(|motion| motion.jitter_images).collect(),
            images: events.iter().map(|event| event.images(scene)).collect(),
        })
    }

    /// Write a Zarr group with all of it.
    pub(super) fn write(&self, plan: &Plan, path: &Path) -> Result<()> {
        let scene = &plan.scene;
        let (sweeps, image) = (scene.sweeps, [scene.height, scene.width]);
        let group = GroupWriter::create(path, self.attributes(plan)?, 64 * scene.pixels() as u64)?;
        let images: Vec<f64> = self.images.iter().map(|&n| n as f64).collect();
        let times: Vec<f64> = (0..sweeps).map(|t| t as f64 * scene.sweep_period_s).collect();
        group.write_whole(
            "shift_px",
            &["time", "axis"],
            &[sweeps, 3],
            self.shift_px.as_flattened(),
        )?;
        for (name, values) in [
            ("rotation_rad", &self.rotation_rad),
            ("phase_rad", &self.phase_rad),
            ("start_jitter_images", &self.start_jitter_images),
            ("images", &images),
            ("time_s", &times),
        ] {
            group.write_whole(name, &["time"], &[sweeps], values)?;
        }
        group.write_whole("sweep_ok", &["time"], &[sweeps], &self.sweep_ok)?;
        group.write_whole("dispersion_rad", &["order"], &[2], &self.dispersion_rad)?;
        group.write_whole("surface_isos_px", &["y", "x"], &image, &self.surface_isos_px)?;
        group.write_whole("surface_ost_px", &["y", "x"], &image, &self.surface_ost_px)?;
        group.write_whole("dead_pixel", &["y", "x"], &image, &self.dead_pixel)?;
        group.write_whole("mask", &["y", "x"], &image, &self.mask)?;
        group.write_whole("control", &["y", "x"], &image, &self.control)?;
        group.finish()?;
        Ok(())
    }

    fn attributes(&self, plan: &Plan) -> Result<Attributes> {
        let scene = &plan.scene;
        let motions = &plan.motions;
        let mut attributes = Attributes::new();
        for (key, value) in [
            ("software", json!(concat!("phasewalk ", env!("CARGO_PKG_VERSION")))),
            ("kind", json!("truth of a simulated OCT recording")),
            ("wavelength_nm", json!(scene.wavelength_nm)),
            ("bandwidth_nm", json!(scene.bandwidth_nm)),
            ("depth_px_um", json!(scene.depth_px_um())),
            ("sweep", json!(if scene.down_sweep { "down" } else { "up" })),
            ("images_per_sweep", json!(scene.images)),
            ("verdicts", json!(self.verdicts)),
            ("doppler_px", json!(motions.iter().map(|m| m.doppler_px).collect::<Vec<_>>())),
            ("chirp_rad", json!(motions.iter().map(|m| m.chirp_rad).collect::<Vec<_>>())),
            ("phase_tilt_yx_rad", json!(motions.iter().map(|m| m.tilt_rad).collect::<Vec<_>>())),
            ("parameters", json!(scene.parameters()?)),
        ] {
            attributes.insert(key.to_owned(), value);
        }
        Ok(attributes)
    }
}
