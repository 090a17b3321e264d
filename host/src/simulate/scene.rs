//! The parameters of the speckle scene, their limits, and the truth they imply.

use super::scatterers::{BLOCK, Block};
use super::stimulus::{displacement_wavelengths, inside_x, movement_wavelengths};
use super::vector_math::{FIXED_LIMIT, MAX_NORMAL};
use crate::error::{Error, Result};
use crate::io::check_times;
use std::f64::consts::PI;

/// Longest side, in pixels: positions are 32-bit fractions of a side.
const MAX_SIDE: usize = 65_536;
/// Largest σ, in wavelengths: the depth of the scene. Already at λ/2 no speckle lasts two frames.
const MAX_SIGMA: f64 = 10.0;
/// Latest time, in intervals: the movement is summed interval by interval.
const MAX_TIME: f64 = 1e6;
/// Smallest and largest pixel pitch, in wavelengths.
const PITCHES: [f64; 2] = [0.1, 1e6];
/// The longest step of any legal scene, over one pixel or in phase, can be represented.
const _: () = {
    let longest = MAX_SIGMA * MAX_NORMAL as f64;
    assert!(longest / PITCHES[0] < FIXED_LIMIT as f64 && 2.0 * longest < FIXED_LIMIT as f64);
};

/// The scene of the paper (lines 613–642): scatterers between 0 and 10λ deep that walk at random,
/// and an x-shaped region that also moves as a whole.
///
/// The complex field is U(t, y, x) = Σ A exp(i 2k z), k = 2π/λ, summed over the scatterers inside
/// the pixel and low-pass filtered by a circular aperture. There is no defocus, so z counts only as
/// 2kz modulo 2π; the lateral edges are periodic.
///
/// ```no_run
/// use phasewalk::{progress::Progress, simulate::SpeckleScene};
/// let scene = SpeckleScene { sigma_wavelengths: 1.0 / 16.0, ..SpeckleScene::default() };
/// scene.for_each_frame(&Progress::hidden(), |t, field| {
///     println!("frame {t}: U(0, 0) = {}", field[0]);
///     Ok(())
/// })?;
/// # Ok::<(), phasewalk::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SpeckleScene {
    /// Pixels along x (line 613: 640).
    pub width: usize,
    /// Pixels along y (line 613: 368).
    pub height: usize,
    /// Number of frames (line 629: 70).
    pub frames: usize,
    /// Scatterers per pixel on average (line 616: 50).
    pub scatterers_per_pixel: usize,
    /// Standard deviation σ of each scatterer's random step between two frames in x, in y and in z,
    /// in wavelengths (lines 629–632). The paper's examples are 1/32 and 1/16; 0 is legal.
    pub sigma_wavelengths: f64,
    /// Cut-off of the circular aperture, in cycles per wavelength. The paper filters (line 625) and
    /// gives no number; ours is 0.06.
    pub aperture_cycles_per_wavelength: f64,
    /// Pixel pitch, in wavelengths (line 613: 4).
    pub pitch_wavelengths: f64,
    /// When the frames are taken, in units of the interval that σ and the movement are given for: not below 0,
    /// strictly ascending, one per frame. `None`: 0, 1, 2, ...
    pub times: Option<Vec<f64>>,
    /// Key of all random numbers.
    pub seed: u64,
}

impl Default for SpeckleScene {
    fn default() -> Self {
        Self {
            width: 640,
            height: 368,
            frames: 70,
            scatterers_per_pixel: 50,
            sigma_wavelengths: 1.0 / 32.0,
            aperture_cycles_per_wavelength: 0.06,
            pitch_wavelengths: 4.0,
            times: None,
            seed: 1,
        }
    }
}

impl SpeckleScene {
    /// Check every parameter before anything is computed.
    ///
    /// # Errors
    /// [`Error::Usage`] that names the flag, the value and the allowed range.
    pub fn validate(&self) -> Result<()> {
        within("--width", self.width, 1, MAX_SIDE)?;
        within("--height", self.height, 1, MAX_SIDE)?;
        within("--frames", self.frames, 2, u32::MAX as usize)?;
        within("--scatterers", self.scatterers_per_pixel, 1, u32::MAX as usize)?;
        within("--sigma", self.sigma_wavelengths, 0.0, MAX_SIGMA)?;
        self.validate_times()?;
        within("--pitch", self.pitch_wavelengths, PITCHES[0], PITCHES[1])?;
        let na = self.aperture_cycles_per_wavelength;
        if !(na.is_finite() && na > 0.0) {
            return Err(Error::usage(format!(
                "--na {na}: the aperture's cut-off must be a positive number of cycles per wavelength"
            )));
        }
        if self.pixels() > u32::MAX as usize || self.memory_bytes(1) > isize::MAX as u64 {
            return Err(Error::usage(format!(
                "--width {} --height {} --scatterers {}: the scene cannot be addressed; choose a smaller one",
                self.width, self.height, self.scatterers_per_pixel
            )));
        }
        Ok(())
    }

    fn validate_times(&self) -> Result<()> {
        let Some(times) = &self.times else { return Ok(()) };
        let refuse = |what: String| Err(Error::usage(format!("--times: {what}")));
        if times.len() != self.frames {
            return refuse(format!("{} times for {} frames", times.len(), self.frames));
        }
        if let Err(frame) = check_times(times) {
            return refuse(format!(
                "frame {frame} is not after the one before, or by 1e12 times another interval"
            ));
        }
        if times[0] < 0.0 {
            return refuse("the first frame is before time 0".to_owned());
        }
        let longest = (1..self.frames).map(|t| self.interval(t)).fold(0.0, f64::max);
        let step = self.sigma_wavelengths * longest.sqrt();
        if step <= MAX_SIGMA && times[self.frames - 1] < MAX_TIME {
            return Ok(());
        }
        refuse(format!(
            "in the longest interval, {longest}, scatterers move by {step:.1} wavelengths; at most \
             {MAX_SIGMA}, and no time above {MAX_TIME}"
        ))
    }

    /// When frame t is taken.
    #[must_use]
    pub fn time(&self, t: usize) -> f64 {
        self.times.as_ref().and_then(|times| times.get(t)).copied().unwrap_or(t as f64)
    }

    /// From frame t - 1 to frame t.
    pub(super) fn interval(&self, t: usize) -> f64 {
        self.time(t) - self.time(t - 1)
    }

    /// How far the x moves from frame t - 1 to frame t, in wavelengths.
    pub(super) fn movement(&self, t: usize) -> f64 {
        let until = |t: usize| displacement_wavelengths(self.time(t));
        match self.times {
            Some(_) => until(t) - until(t - 1),
            None => movement_wavelengths(t),
        }
    }

    /// Pixels of one frame, width · height.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.width.saturating_mul(self.height)
    }

    /// The x-shaped region that moves, shape (y, x), evaluated at the centres of the pixels.
    #[must_use]
    pub fn mask(&self) -> Vec<bool> {
        let size = [self.width, self.height];
        let row = |y| (0..self.width).map(move |x| inside_x([x, y], size));
        (0..self.height).flat_map(row).collect()
    }

    /// True phase inside the x, radians, one value per frame: 4π/λ · Σ_{s ≤ t} Δz(s).
    ///
    /// It is 0 up to frame 4 and 2.044 rad in frame 69.
    #[must_use]
    pub fn true_phase_rad(&self) -> Vec<f64> {
        (0..self.frames).map(|t| 4.0 * PI * displacement_wavelengths(self.time(t))).collect()
    }

    /// Predicted peak memory of [`for_each_frame`](Self::for_each_frame) on `threads` threads, in
    /// bytes, without the program itself: 16 per scatterer, and per pixel 8 for each thread's sums,
    /// 8 for the field, up to 8 for the part of its spectrum inside the aperture and 1 for the mask.
    /// It does not depend on the number of frames.
    #[must_use]
    pub fn memory_bytes(&self, threads: usize) -> u64 {
        let scatterers = (self.blocks() as u64).saturating_mul(size_of::<Block>() as u64);
        let per_pixel = (threads as u64).saturating_mul(8).saturating_add(17);
        (self.pixels() as u64).saturating_mul(per_pixel).saturating_add(scatterers)
    }

    /// Number of scatterers.
    pub(super) fn scatterers(&self) -> usize {
        self.pixels().saturating_mul(self.scatterers_per_pixel)
    }

    /// Number of blocks that hold the scatterers; the last one may be filled up.
    pub(super) fn blocks(&self) -> usize {
        self.scatterers().div_ceil(BLOCK)
    }
}

/// `Ok` when `value` lies between `low` and `high` (NaN never does).
fn within<T: PartialOrd + std::fmt::Display>(flag: &str, value: T, low: T, high: T) -> Result<()> {
    if low <= value && value <= high {
        return Ok(());
    }
    Err(Error::usage(format!("{flag} {value}: must be between {low} and {high}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_scene_is_valid() {
        let scene = SpeckleScene::default();
        scene.validate().unwrap();
        assert_eq!(scene.scatterers(), 11_776_000);
        assert_eq!(scene.scatterers() % BLOCK, 0);
        let expected = 11_776_000 * 16 + 640 * 368 * (2 * 8 + 17);
        assert_eq!(scene.memory_bytes(2), expected);
    }

    #[test]
    fn bad_parameters_name_their_flag() {
        type Change = fn(&mut SpeckleScene);
        let cases: [(&str, Change); 19] = [
            ("--width 0", |s| s.width = 0),
            ("--width 65537", |s| s.width = 65_537),
            ("--height 0", |s| s.height = 0),
            ("--frames 0", |s| s.frames = 0),
            ("--frames 1", |s| s.frames = 1),
            ("--scatterers 0", |s| s.scatterers_per_pixel = 0),
            ("--sigma -0.1", |s| s.sigma_wavelengths = -0.1),
            ("--sigma NaN", |s| s.sigma_wavelengths = f64::NAN),
            ("--sigma inf", |s| s.sigma_wavelengths = f64::INFINITY),
            ("--sigma 10.5", |s| s.sigma_wavelengths = 10.5),
            ("1 times for 70", |s| s.times = Some(vec![0.0])),
            ("frame 2 is not after", |s| (s.frames, s.times) = (3, Some(vec![0.0, 2.0, 1.0]))),
            ("longest interval", |s| (s.frames, s.times) = (2, Some(vec![0.0, 2e5]))),
            ("--na 0", |s| s.aperture_cycles_per_wavelength = 0.0),
            ("--na NaN", |s| s.aperture_cycles_per_wavelength = f64::NAN),
            ("--pitch 0.05", |s| s.pitch_wavelengths = 0.05),
            ("--pitch NaN", |s| s.pitch_wavelengths = f64::NAN),
            ("cannot be addressed", |s| (s.width, s.height) = (65_536, 65_536)),
            ("cannot be addressed", |s| {
                (s.width, s.height) = (60_000, 60_000);
                s.scatterers_per_pixel = u32::MAX as usize;
            }),
        ];
        for (expected, change) in cases {
            let mut scene = SpeckleScene::default();
            change(&mut scene);
            let error = scene.validate().unwrap_err();
            assert!(matches!(error, Error::Usage(_)));
            assert!(error.to_string().contains(expected), "{error} lacks {expected}");
        }
    }

    #[test]
    fn sigma_zero_and_tiny_images_are_legal() {
        let scene = SpeckleScene {
            width: 1,
            height: 1,
            frames: 2,
            sigma_wavelengths: 0.0,
            ..SpeckleScene::default()
        };
        scene.validate().unwrap();
    }

    #[test]
    fn the_truth_ends_at_2_044_rad() {
        let truth = SpeckleScene::default().true_phase_rad();
        assert_eq!(truth.len(), 70);
        assert!(truth[..5].iter().all(|&phase| phase == 0.0));
        assert!((truth[5] - PI / 100.0).abs() < 1e-15);
        assert!((truth[69] - 2.044).abs() < 5e-4, "{}", truth[69]);
    }

    /// The x looks alike when the image is turned by half a turn; a square one also when mirrored
    /// and transposed.
    #[test]
    fn the_mask_is_symmetric() {
        for (width, height) in [(640, 368), (368, 640), (160, 92), (8, 6), (7, 7), (64, 64)] {
            let scene = SpeckleScene { width, height, ..SpeckleScene::default() };
            let mask = scene.mask();
            assert_eq!(mask.len(), width * height);
            let at = |x: usize, y: usize| mask[y * width + x];
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                assert_eq!(at(x, y), at(width - 1 - x, height - 1 - y));
                assert_eq!(at(x, y), at(width - 1 - x, y));
                assert!(width != height || at(x, y) == at(y, x));
            }
        }
    }

    /// Two bars of 0.2 s by 0.912 s that share a square of 0.2 s: area 0.3248 s². The count at
    /// 160 × 92 is also that of an independent plain implementation.
    #[test]
    fn the_mask_has_the_area_of_two_bars() {
        for (width, height, pixels) in [(640, 368, 44_364), (160, 92, 2848)] {
            let scene = SpeckleScene { width, height, ..SpeckleScene::default() };
            let count = scene.mask().iter().filter(|&&inside| inside).count();
            assert_eq!(count, pixels);
            let area = (2.0 * 0.2 * 0.912 - 0.2 * 0.2) * (height * height) as f64;
            assert!((count as f64 / area - 1.0).abs() < 0.05, "{count} pixels, area {area}");
        }
    }
}
