//! A measured disk in rotation, seen by ultrasound: speckle that decorrelates under a known law.
//!
//! A rigid rotation moves each place along z at a speed proportional to x − x₀, so the phase is a
//! plane: it grows linearly in x from shot to shot, at a constant rate, and does not depend on z.
//!
//! At the rim the phase changes by 2 rad per shot, so it wraps within two shots. The extended method
//! unwraps an early phase against the D = 10 before it, which it takes for free of wrapping (paper
//! line 842); here that does not hold. Steps of one shot stay below π, and the one-step walk needs
//! nothing more.

use super::errors::{rms, wrapped};
use super::plane::{Fit, Point};
use crate::error::{Error, Result};
use crate::figures::{Canvas, Measured, Profile};
use crate::image::Imaging;
use crate::io::{Series, Shape};
use crate::looks::{Looks, SpatialCoherence, speckled};
use crate::method::{Depths, Method, Plan};
use crate::series::survey;
use ndarray::{Array3, Axis};
use phasewalk_core::weights::Weighting;
use serde::Serialize;

/// σ_Gauss of the average, pixels.
pub const GAUSSIAN_PX: f64 = 6.0;
/// Radius of the disk's part that is fitted, mm.
pub const RADIUS_MM: f64 = 8.0;
/// The average is periodic: so many pixels at each border see the opposite one.
const BORDER_PX: usize = 12;
/// Bytes that the strips of the images may take.
const MEMORY: u64 = 256 << 20;

/// Where the pixels lie, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Geometry {
    /// x of the first column.
    pub x_mm: f64,
    /// z of the first row.
    pub z_mm: f64,
    /// Pixel pitch along both axes.
    pub pitch_mm: f64,
}

impl Geometry {
    /// x and z of the disk's centre, mm: the centre of brightness of the whole image.
    pub const CENTRE_MM: [f64; 2] = [-1.12, 22.24];

    /// The geometry of the whole image (z 251, x 251) and of the crop (z 64, x 120).
    #[must_use]
    pub fn of(shape: Shape) -> Option<Self> {
        let (x_mm, z_mm) = match (shape.height, shape.width) {
            (251, 251) => (-12.5, 10.0),
            (64, 120) => (-7.1, 19.0),
            _ => return None,
        };
        Some(Self { x_mm, z_mm, pitch_mm: 0.1 })
    }

    /// x and z of a pixel, mm.
    #[must_use]
    pub fn place(&self, row: usize, column: usize) -> [f64; 2] {
        let at = |start: f64, n: usize| start + self.pitch_mm * n as f64;
        [at(self.x_mm, column), at(self.z_mm, row)]
    }
}

/// The law fitted after a number of steps, and how well both methods keep to it; radians and mm.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Step {
    /// Shots since the first.
    pub steps: usize,
    /// Slope of the walked phase along x, rad/mm.
    pub slope_x_rad_per_mm: f64,
    /// Slope of the walked phase along z, rad/mm.
    pub slope_z_rad_per_mm: f64,
    /// Share of the walked phase's variance that the plane describes.
    pub r_squared: f64,
    /// Root mean square of walked phase − plane, rad.
    pub walked_residual_rad: f64,
    /// Root mean square of direct difference − plane, wrapped, rad; noise has 1.81.
    pub direct_residual_rad: f64,
    /// Slope of the linked phase along x, rad/mm; NaN where a method has no phase.
    pub linked_slope_x_rad_per_mm: f64,
    /// Slope of the linked phase along z, rad/mm.
    pub linked_slope_z_rad_per_mm: f64,
    /// Root mean square of linked phase − its own plane, rad.
    pub linked_residual_rad: f64,
    /// Slope of the paper's least squares along x, rad/mm.
    pub paper_slope_x_rad_per_mm: f64,
}

/// The phases of a series by all methods.
pub struct RotatingDisk {
    geometry: Geometry,
    /// Against the first shot, radians, (time, z, x).
    walked: Array3<f32>,
    direct: Array3<f32>,
    linked: Array3<f32>,
    paper: Array3<f32>,
}

impl RotatingDisk {
    /// Evaluate the series, with progress bars.
    ///
    /// # Errors
    /// When the series cannot be read or is too small, or the user interrupts.
    pub fn evaluate(series: &dyn Series, geometry: Geometry, threads: usize) -> Result<Self> {
        let survey = survey(series, &[0])?;
        let coherence = &SpatialCoherence::estimate(series, &speckled(series, &survey, 0)?, &[0])?;
        let imaging = Imaging {
            series,
            survey: &survey,
            coherence,
            sigma_px: GAUSSIAN_PX,
            looks: Looks::Effective,
            threads,
            memory: MEMORY,
        };
        let phases = |method, label| {
            let first = Some(0);
            let frames = series.shape().frames;
            let mut plan = Plan::new(method, frames, None, first, Depths::single())?;
            plan.params.reference_frames = 1;
            imaging.images(&plan, label).map(|images| images.phases)
        };
        let walked = phases(Method::OneStep, "one-step walk")?;
        let direct = phases(Method::Direct, "direct difference")?;
        let linked = phases(Method::Linked, "linked phases")?;
        let paper = phases(Method::Paper(Weighting::Paper), "paper's least squares")?;
        Ok(Self { geometry, walked, direct, linked, paper })
    }

    /// Shots after the first.
    #[must_use]
    pub fn last(&self) -> usize {
        self.walked.dim().0 - 1
    }

    /// Number of pixels that are fitted.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.fitted().count()
    }

    /// Fit the law after `steps` shots.
    ///
    /// # Errors
    /// When there are not that many shots, or too few pixels of the disk.
    pub fn step(&self, steps: usize) -> Result<Step> {
        let fit = self.fit(&self.walked, steps)?;
        let [linked, paper] = [&self.linked, &self.paper].map(|phase| self.fit(phase, steps).ok());
        let of = |fit: &Option<Fit>, value: fn(&Fit) -> f64| fit.as_ref().map_or(f64::NAN, value);
        let direct = self.fitted().map(|[row, column]| {
            let [x, z] = self.geometry.place(row, column);
            wrapped(f64::from(self.direct[[steps, row, column]]) - fit.plane.at(x, z))
        });
        Ok(Step {
            steps,
            slope_x_rad_per_mm: fit.plane.slope_x,
            slope_z_rad_per_mm: fit.plane.slope_z,
            r_squared: fit.r_squared,
            walked_residual_rad: fit.residual,
            direct_residual_rad: rms(direct),
            linked_slope_x_rad_per_mm: of(&linked, |fit| fit.plane.slope_x),
            linked_slope_z_rad_per_mm: of(&linked, |fit| fit.plane.slope_z),
            linked_residual_rad: of(&linked, |fit| fit.residual),
            paper_slope_x_rad_per_mm: of(&paper, |fit| fit.plane.slope_x),
        })
    }

    /// The plane through a phase after `steps` shots.
    fn fit(&self, phase: &Array3<f32>, steps: usize) -> Result<Fit> {
        if steps > self.last() {
            let last = self.last();
            return Err(Error::usage(format!("step {steps}: the series has steps 0 ..= {last}")));
        }
        let point = |[row, column]: [usize; 2]| {
            let [x, z] = self.geometry.place(row, column);
            Point { x, z, phase: f64::from(phase[[steps, row, column]]) }
        };
        let points = self.fitted().map(point).filter(|point| point.phase.is_finite());
        let points: Vec<Point> = points.collect();
        let none = || Error::failed("the disk covers too few pixels of the series for a fit");
        Fit::of(&points).ok_or_else(none)
    }

    /// Row and column of the disk's pixels, away from the border; those without a phase left out.
    fn fitted(&self) -> impl Iterator<Item = [usize; 2]> {
        let (frames, height, width) = self.walked.dim();
        let inner = |side: usize| BORDER_PX..side.saturating_sub(BORDER_PX);
        let places = inner(height).flat_map(move |row| inner(width).map(move |x| [row, x]));
        places.filter(move |&[row, column]| {
            let [x, z] = self.geometry.place(row, column);
            let [centre_x, centre_z] = Geometry::CENTRE_MM;
            let inside = (x - centre_x).hypot(z - centre_z) < RADIUS_MM;
            inside && self.walked[[frames - 1, row, column]].is_finite()
        })
    }

    /// The walked phase after the last shot, and a line through the centre against the law.
    ///
    /// # Errors
    /// Those of [`Self::step`].
    pub fn figure(&self) -> Result<Canvas> {
        let fit = self.fit(&self.walked, self.last())?;
        let (line, slope, last) = (self.line(&fit), fit.plane.slope_x, self.last());
        let left = line.less_law();
        let label = minus(&format!("along x through the centre, {slope:.2} rad/mm"));
        let half = self.geometry.pitch_mm / 2.0;
        let figure = Measured {
            label: &format!("walked phase, shot {last} against 0"),
            phase: self.walked.index_axis(Axis(0), last),
            origin: (self.geometry.z_mm - half, self.geometry.x_mm - half),
            pitch: (self.geometry.pitch_mm, self.geometry.pitch_mm),
            axes: ("z / mm", "x / mm"),
            profiles: vec![
                line.profile(&label),
                left.profile("the same less the fit, direct modulo 2π"),
            ],
        };
        Ok(figure.draw())
    }

    /// The fitted pixels of the row next to the centre, after the last shot.
    fn line(&self, fit: &Fit) -> Line {
        let middle = (Geometry::CENTRE_MM[1] - self.geometry.z_mm) / self.geometry.pitch_mm;
        let mut line = Line::default();
        for [row, column] in self.fitted().filter(|&[row, _]| row == middle.round() as usize) {
            let [x, z] = self.geometry.place(row, column);
            line.x.push(x);
            line.walked.push(f64::from(self.walked[[self.last(), row, column]]));
            line.direct.push(f64::from(self.direct[[self.last(), row, column]]));
            line.law.push(fit.plane.at(x, z));
        }
        line
    }
}

/// A line along x: places in mm, phases in radians.
#[derive(Default)]
struct Line {
    x: Vec<f64>,
    walked: Vec<f64>,
    direct: Vec<f64>,
    law: Vec<f64>,
}

impl Line {
    /// What the law leaves; of the direct difference modulo 2π.
    fn less_law(&self) -> Self {
        let less = |values: &[f64]| -> Vec<f64> {
            values.iter().zip(&self.law).map(|(phase, law)| phase - law).collect()
        };
        Self {
            x: self.x.clone(),
            walked: less(&self.walked),
            direct: less(&self.direct).into_iter().map(wrapped).collect(),
            law: less(&self.law),
        }
    }

    fn profile<'a>(&'a self, label: &'a str) -> Profile<'a> {
        let Self { x, walked, direct, law } = self;
        Profile { label, axis: "x / mm", positions: x, walked, direct, fit: law }
    }
}

/// The sign that people read.
fn minus(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::HeldSeries;
    use num_complex::Complex32;

    /// A rigid rotation without decorrelation.
    fn rotation(rate: f64) -> RotatingDisk {
        let shape = Shape { frames: 5, depth: 1, height: 64, width: 120 };
        let geometry = Geometry::of(shape).unwrap();
        let field = (0..5 * 64 * 120).map(|i| {
            let (t, column) = (i / (64 * 120), i % 120);
            let [x, _] = geometry.place(0, column);
            Complex32::from_polar(1.0, (rate * x * t as f64) as f32)
        });
        let series = HeldSeries::new(shape, field.collect()).unwrap();
        RotatingDisk::evaluate(&series, geometry, 1).unwrap()
    }

    #[test]
    fn the_rate_of_a_rotation_is_found() {
        let disk = rotation(-0.26);
        let step = disk.step(4).unwrap();
        assert!((step.slope_x_rad_per_mm + 4.0 * 0.26).abs() < 0.02, "{step:?}");
        assert!(step.slope_z_rad_per_mm.abs() < 1e-3 && step.r_squared > 0.999, "{step:?}");
        assert!(disk.step(5).is_err());
        assert!(disk.figure().unwrap().png().is_ok());
    }

    #[test]
    fn the_crop_lies_inside_the_disk() {
        let shape = Shape { frames: 32, depth: 1, height: 64, width: 120 };
        let geometry = Geometry::of(shape).unwrap();
        let [x, z] = Geometry::CENTRE_MM;
        for (row, column) in [(0, 0), (0, 119), (63, 0), (63, 119)] {
            let [corner_x, corner_z] = geometry.place(row, column);
            assert!((corner_x - x).hypot(corner_z - z) < RADIUS_MM);
        }
        assert_eq!(Geometry::of(Shape { height: 63, ..shape }), None);
    }
}
