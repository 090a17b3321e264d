//! A picture of every step of a reconstruction, and a page with all of them.

use crate::error::{Error, Result};
use crate::figures::{
    BScan, BScans, Canvas, DepthProfile, EnFace, EnFaces, Layer, LayerDepths, Motion, Peak,
    Residual, Source, Surface,
};
use crate::io::{RawImages, write_atomic};
use crate::reconstruct::dispersion::Dispersion;
use crate::reconstruct::findings::{Findings, Survey};
use crate::reconstruct::preview;
use crate::reconstruct::segment;
use crate::reconstruct::settings::Settings;
use crate::report::{Reconstruction, Step};
use ndarray::{Array1, Array2, ArrayView2, ArrayView3, Axis};
use std::path::{Path, PathBuf};

/// Depths nearer to zero hold what is left of the source, and would set the grey scale.
const FIRST_DEPTH: usize = 4;
/// Depths around a layer that its image is averaged over.
const HALF_LAYER: isize = 1;

/// Where the pictures go: `V.steps` beside `V.zarr`.
pub(super) struct Folder(PathBuf);

impl Folder {
    /// # Errors
    /// When there is something else of that name.
    pub(super) fn beside(output: &Path) -> Result<Self> {
        let folder = output.with_extension("steps");
        if folder.exists() && !folder.is_dir() {
            return Err(Error::file(
                &folder,
                "is a file, the pictures need a folder of that name: remove it, or leave the pictures \
                 out (--no-pictures)",
            ));
        }
        Ok(Self(folder))
    }

    pub(super) fn path(&self) -> &Path {
        &self.0
    }
}

/// Draw all of them; `survey` is what the first pass has seen.
pub(super) fn draw(
    folder: &Folder,
    raw: &dyn RawImages,
    settings: &Settings,
    pitch_um: Option<f64>,
    findings: &Findings,
    survey: &Survey,
) -> Result<()> {
    let size = [raw.format().height, raw.format().width];
    let show = Show { settings, pitch_um, findings, survey, size };
    let pictures = [
        (Step::Source, show.source()),
        (Step::Dispersion, show.dispersion(raw)?),
        (Step::Motion, show.motion()),
        (Step::Surfaces, show.surfaces()),
        (Step::Layers, show.layers()),
        (Step::EnFace, show.enface()),
    ];
    std::fs::create_dir_all(folder.path())
        .map_err(|error| Error::file(folder.path(), format!("cannot be created: {error}")))?;
    for (step, canvas) in &pictures {
        write_atomic(&folder.path().join(format!("{}.png", step.name())), &canvas.png()?)?;
    }
    let page = Reconstruction {
        recording: &findings.name.display().to_string(),
        summary: &survey.surfaces.reason,
        results: show.results(),
        pictures: pictures.iter().map(|(step, canvas)| (*step, canvas)).collect(),
    };
    write_atomic(&folder.path().join("report.html"), page.html()?.as_bytes())
}

struct Show<'a> {
    settings: &'a Settings,
    pitch_um: Option<f64>,
    findings: &'a Findings,
    survey: &'a Survey,
    size: [usize; 2],
}

impl Show<'_> {
    fn used(&self) -> usize {
        self.findings.analysis.motions.iter().flatten().count()
    }

    /// S(m) of every sweep, and how strong the fixed fringes are.
    fn source(&self) -> Canvas {
        let (images, sources) = (self.settings.images, &self.findings.analysis.sources);
        let mut counts = Array2::from_elem((sources.len(), images), f32::NAN);
        for (mut row, source) in counts.axis_iter_mut(Axis(0)).zip(sources) {
            row.iter_mut().zip(source).for_each(|(count, s)| *count = *s);
        }
        let fixed = &self.findings.analysis.fixed;
        let blocks = (fixed.len() / images).max(1);
        let rms = |image: &[f32]| {
            let sum: f64 = image.iter().map(|&b| f64::from(b).powi(2)).sum();
            (sum / blocks as f64).sqrt()
        };
        let values: Vec<f64> = fixed.chunks_exact(blocks).map(rms).collect();
        let residual = Residual { title: "fixed fringes, rms / DN", values: &values };
        Source {
            counts: counts.view(),
            verdicts: &self.findings.verdicts,
            residual: Some(residual),
        }
        .draw()
    }

    /// A B-scan before and after.
    fn dispersion(&self, raw: &dyn RawImages) -> Result<Canvas> {
        let found = self.findings.analysis.dispersion;
        let (plan, width) = (&self.findings.plan, self.size[1]);
        let scans = preview::bscans(raw, plan, &[Dispersion::default(), found])?;
        let shown: Vec<Array2<f32>> = scans.iter().map(|scan| rows(scan, width)).collect();
        let after = format!("a2 = {:.1} rad, a3 = {:.1} rad corrected", found.a2, found.a3);
        let labels = ["as recorded", after.as_str()];
        let scans = shown.iter().zip(labels).map(|(scan, label)| BScan {
            label,
            amplitude: scan.view(),
            surfaces: Vec::new(),
        });
        let row = preview::first_row(self.size[0]);
        Ok(BScans {
            label: &format!("mean of rows {row} to {} of one sweep", row + preview::ROWS - 1),
            scans: scans.collect(),
            first_depth_px: FIRST_DEPTH as f64,
            depth_px_um: Some(self.settings.depth_px_um()),
        }
        .draw())
    }

    fn motion(&self) -> Canvas {
        let motions = &self.findings.analysis.motions;
        let mut shifts = Array2::from_elem((motions.len(), 3), f64::NAN);
        let mut rotation = vec![f64::NAN; motions.len()];
        for (t, motion) in motions.iter().enumerate() {
            let Some(motion) = motion else { continue };
            shifts.row_mut(t).assign(&Array1::from(motion.shift.to_vec()));
            rotation[t] = motion.rotation_rad;
        }
        Motion {
            shift_px: shifts.view(),
            rotation_rad: &rotation,
            verdicts: &self.findings.verdicts,
        }
        .draw()
    }

    /// The averaged volume, cut in the middle, with both surfaces.
    fn surfaces(&self) -> Canvas {
        let [height, width] = self.size;
        let first = self.findings.plan.depths.start;
        let Some(volume) = self.volume() else { return Canvas::new(1.0, 1.0, "no volume") };
        let y = height / 2;
        let amplitude = volume.index_axis(Axis(1), y).mapv(f32::sqrt);
        let line = |surface: &[f32]| surface[y * width..][..width].to_vec();
        let analysis = &self.findings.analysis;
        let lines = [line(&analysis.isos), line(&analysis.ost)];
        let layers = [Layer::IsOs, Layer::Tips].into_iter().zip(&lines);
        let surfaces = layers.map(|(layer, depth_px)| Surface { layer, depth_px }).collect();
        BScans {
            label: &format!("row {y}, mean of {} sweeps", self.used()),
            scans: vec![BScan { label: "surfaces", amplitude: amplitude.view(), surfaces }],
            first_depth_px: first as f64,
            depth_px_um: Some(self.settings.depth_px_um()),
        }
        .draw()
    }

    /// The mean A-line and the depths that are compared.
    fn layers(&self) -> Canvas {
        let found = &self.survey.surfaces;
        let amplitude: Vec<f64> =
            found.profile.iter().map(|&p| f64::from(p.max(0.0)).sqrt()).collect();
        let origin = found.origin.round() as usize;
        let [tips, isos] = self.findings.analysis.layers;
        let behind = tips[0] - isos[0];
        let half = (isos[1] - isos[0]) / 2;
        let depths = |middle: usize| (middle.saturating_sub(half), middle + half);
        let peaks: Vec<Peak<'_>> = found
            .peaks
            .iter()
            .map(|peak| Peak { depth_px: peak.depth_px, label: name(peak.layer) })
            .collect();
        DepthProfile {
            label: &format!("mean of {} sweeps along the IS/OS", self.used()),
            amplitude: &amplitude,
            first_depth_px: -found.origin,
            depth_px_um: Some(self.settings.depth_px_um()),
            layers: &[
                LayerDepths { layer: Layer::IsOs, depths: depths(origin) },
                LayerDepths { layer: Layer::Tips, depths: depths(origin + behind) },
            ],
            peaks: &peaks,
        }
        .draw()
    }

    fn enface(&self) -> Canvas {
        let [height, width] = self.size;
        let analysis = &self.findings.analysis;
        let images = [&analysis.isos, &analysis.ost].map(|surface| self.along(surface));
        let labels = ["IS/OS", "outer-segment tips"];
        let layers = images
            .iter()
            .zip(labels)
            .map(|(image, label)| EnFace { label, amplitude: image.view() });
        let dead = &self.findings.plan.illumination.dead;
        EnFaces {
            label: &format!("mean of {} sweeps", self.used()),
            layers: layers.collect(),
            dead: ArrayView2::from_shape((height, width), dead).ok(),
            pitch_um: self.pitch_um,
        }
        .draw()
    }

    /// Amplitude along a surface of the averaged volume.
    fn along(&self, surface: &[f32]) -> Array2<f32> {
        let [height, width] = self.size;
        let first = self.findings.plan.depths.start as isize;
        let Some(volume) = self.volume() else { return Array2::zeros((0, 0)) };
        Array2::from_shape_fn((height, width), |(y, x)| {
            let z = surface[y * width + x].round() as isize - first;
            let depths = z - HALF_LAYER..=z + HALF_LAYER;
            let at = |z| usize::try_from(z).ok().and_then(|z| volume.get((z, y, x)));
            depths.filter_map(at).sum::<f32>().sqrt()
        })
    }

    fn volume(&self) -> Option<ArrayView3<'_, f32>> {
        let [height, width] = self.size;
        let depth = self.findings.plan.depths.len();
        ArrayView3::from_shape((depth, height, width), &self.survey.mean).ok()
    }

    fn results(&self) -> Vec<(String, String)> {
        let Findings { plan, analysis, .. } = self.findings;
        let Dispersion { a2, a3 } = analysis.dispersion;
        let rows = [
            ("sweeps used", format!("{} of {}", self.used(), plan.sweeps.len())),
            ("dead pixels", plan.illumination.dead_pixels().to_string()),
            ("dispersion at the IS/OS", format!("a2 = {a2:.2} rad, a3 = {a3:.2} rad")),
            (
                "sharpness before and after dispersion",
                format!(
                    "{:.2}, {:.2}",
                    plan.estimate.sharpness_before, plan.estimate.sharpness_after
                ),
            ),
            ("depth pixel", format!("{:.2} um in tissue", self.settings.depth_px_um())),
            ("camera start, standard deviation", format!("{:.4} images", analysis.jitter_sigma)),
        ];
        rows.map(|(name, value)| (name.to_owned(), value)).to_vec()
    }
}

/// Amplitudes (z, x) without the first depths.
fn rows(scan: &[f32], width: usize) -> Array2<f32> {
    let depths = (scan.len() / width).saturating_sub(FIRST_DEPTH);
    Array2::from_shape_fn((depths, width), |(z, x)| scan[(z + FIRST_DEPTH) * width + x])
}

fn name(layer: segment::Layer) -> &'static str {
    match layer {
        segment::Layer::InnerOuter => "IS/OS",
        segment::Layer::Tips => "tips",
        segment::Layer::PigmentEpithelium => "RPE",
        segment::Layer::Other => "",
    }
}
