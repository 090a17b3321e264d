//! The newest phase image of frames as they come, in memory that does not grow.
//!
//! Every thread has a band of rows for itself: the last frames in lane-block layout with their halo, the phases that
//! they were given, and the filter's buffers. With each frame it averages the pairs with the L frames before by the
//! Gaussian, strip by strip, and puts every pixel's newest phase where its pairs want it (`phasewalk_core::held`).

use super::Kernel;
use super::band::{self, Band};
use crate::error::{Error, Result};
use crate::lanes::{LaneTask, Lanes, Path};
use num_complex::Complex32;
use phasewalk_core::weights::Weights;
use std::ops::Range;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Parameters of [`NewestImages`].
#[derive(Clone, Debug)]
pub struct NewestSettings {
    /// The Gaussian and the size of the images.
    pub kernel: Kernel,
    /// L: pairs up to so many frames apart.
    pub max_lag: usize,
    /// Weights of the pairs: the paper's.
    pub weights: Weights,
    /// Factor on all fields.
    pub scale: f32,
    /// Number of threads.
    pub threads: usize,
    /// Vector instructions.
    pub path: Path,
}

impl NewestSettings {
    /// Rows of each thread's band.
    fn bands(&self) -> Vec<Range<usize>> {
        let height = self.kernel.height;
        let rows = height.div_ceil(self.threads.max(1));
        (0..height).step_by(rows).map(|first| first..(first + rows).min(height)).collect()
    }

    /// Bytes that all bands take together, and the frames on their way to them.
    ///
    /// # Errors
    /// When the machine does not have the path.
    pub fn bytes(&self) -> Result<u64> {
        let pixels = (self.kernel.height * self.kernel.width) as u64;
        // Two frames with their flags, the phases and what was seen in the bands and in the image.
        let passed =
            pixels * (2 * (size_of::<Complex32>() as u64 + 1) + 4 * size_of::<f32>() as u64);
        Ok(passed + self.path.run(Sizes(self))?)
    }
}

struct Sizes<'a>(&'a NewestSettings);

impl LaneTask for Sizes<'_> {
    type Output = u64;

    fn run<L: Lanes<Element = f32>>(self) -> u64 {
        self.0.bands().iter().map(|rows| Band::<L>::bytes(self.0, rows)).sum()
    }
}

/// A frame on its way to the threads.
pub(super) struct Incoming {
    /// (y, x).
    pub field: Vec<Complex32>,
    /// Which pixels are finite.
    pub finite: Vec<bool>,
}

/// What a band gives back, (row, x).
pub(super) struct Outgoing {
    pub phases: Vec<f32>,
    /// 1 where a pair has a weight, or there can be none yet.
    pub seen: Vec<f32>,
}

/// A phase image.
#[derive(Clone, Debug)]
pub struct NewestImage {
    /// (y, x), radians against the mean of the first five frames; NaN where the frame is not finite.
    pub phases: Vec<f32>,
    /// Pixels that no pair says anything of: their phase is that of the frame before.
    pub unmeasured: usize,
}

/// One thread, seen from outside.
struct Hand {
    frames: Option<SyncSender<Arc<Incoming>>>,
    results: Receiver<Outgoing>,
    thread: Option<JoinHandle<Result<()>>>,
}

/// Phase images of frames as they come.
pub struct NewestImages {
    hands: Vec<Hand>,
    pixels: usize,
}

impl NewestImages {
    /// Start the threads, which have seen no frame.
    ///
    /// # Errors
    /// When the machine refuses a thread.
    pub fn start(settings: &NewestSettings) -> Result<Self> {
        let hands = settings.bands().into_iter().map(|rows| Hand::start(settings, rows));
        let pixels = settings.kernel.height * settings.kernel.width;
        Ok(Self { hands: hands.collect::<Result<_>>()?, pixels })
    }

    /// The phases of the next usable frame, (y, x).
    ///
    /// # Errors
    /// When the frame has another size, or a thread has failed.
    pub fn push(&mut self, field: &[Complex32]) -> Result<NewestImage> {
        if field.len() != self.pixels {
            let (found, pixels) = (field.len(), self.pixels);
            return Err(Error::failed(format!("a frame of {found} pixels, not {pixels}")));
        }
        let finite = field.iter().map(|u| u.re.is_finite() && u.im.is_finite()).collect();
        let frame = Arc::new(Incoming { field: field.to_vec(), finite });
        for hand in &mut self.hands {
            hand.send(&frame)?;
        }
        let mut image = NewestImage { phases: Vec::with_capacity(self.pixels), unmeasured: 0 };
        for hand in &mut self.hands {
            let Outgoing { phases, seen } = hand.receive()?;
            image.phases.extend(phases);
            image.unmeasured += seen.iter().filter(|&&seen| seen == 0.0).count();
        }
        for (phase, _) in image.phases.iter_mut().zip(&frame.finite).filter(|(_, finite)| !**finite)
        {
            *phase = f32::NAN;
        }
        Ok(image)
    }
}

impl Hand {
    fn start(settings: &NewestSettings, rows: Range<usize>) -> Result<Self> {
        let (frames, incoming) = sync_channel(1);
        let (outgoing, results) = sync_channel(1);
        let settings = settings.clone();
        let thread = std::thread::Builder::new().name("band".to_owned()).spawn(move || {
            let path = settings.path;
            path.run(Work { settings, rows, incoming, outgoing })?
        });
        let thread =
            thread.map_err(|error| Error::failed(format!("cannot start the threads: {error}")))?;
        Ok(Self { frames: Some(frames), results, thread: Some(thread) })
    }

    fn send(&mut self, frame: &Arc<Incoming>) -> Result<()> {
        let sent = self.frames.as_ref().map(|frames| frames.send(Arc::clone(frame)));
        if matches!(sent, Some(Ok(()))) { Ok(()) } else { Err(self.failure()) }
    }

    fn receive(&mut self) -> Result<Outgoing> {
        self.results.recv().map_err(|_| self.failure())
    }

    /// Why the thread has gone.
    fn failure(&mut self) -> Error {
        self.frames = None;
        let result = self.thread.take().map(JoinHandle::join);
        match result {
            Some(Ok(Err(error))) => error,
            _ => Error::failed("a thread of the images has stopped"),
        }
    }
}

impl Drop for Hand {
    fn drop(&mut self) {
        self.frames = None;
        if let Some(thread) = self.thread.take() {
            // What it has to say was asked for by `push`.
            let _ = thread.join();
        }
    }
}

/// What a thread does until no more frames come.
struct Work {
    settings: NewestSettings,
    rows: Range<usize>,
    incoming: Receiver<Arc<Incoming>>,
    outgoing: SyncSender<Outgoing>,
}

impl LaneTask for Work {
    type Output = Result<()>;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> Result<()> {
        let mut band = Band::<L>::new(&self.settings, self.rows)?;
        while let Ok(frame) = self.incoming.recv() {
            let result = band::push(&mut band, &frame);
            drop(frame);
            if self.outgoing.send(result).is_err() {
                break;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::testing;
    use num_complex::Complex64;
    use phasewalk_core::held::{HeldPair, newest_phase};
    use phasewalk_core::weights::{Weighting, unit_phasor};

    const HEIGHT: usize = 21;
    const WIDTH: usize = 37;
    const LAGS: usize = 5;

    /// Speckle that falls apart; the phase grows with time and x. One frame has a pixel that is not finite.
    fn frames() -> Vec<Vec<Complex32>> {
        let phase = |t: usize, i: usize| 0.02 * ((i % WIDTH) * t) as f32;
        let mut all = testing::frames(17, HEIGHT * WIDTH, 0.97, phase);
        all[9][100].im = f32::NAN;
        all
    }

    fn settings(path: Path, threads: usize) -> NewestSettings {
        let kernel = Kernel::new(2.0, HEIGHT, WIDTH, false).unwrap();
        let weights = Weights::new(Weighting::Paper, kernel.nominal_looks(), 0.99999);
        NewestSettings { kernel, max_lag: LAGS, weights, scale: 2.0, threads, path }
    }

    /// Circular Gaussian mean of `image` at every pixel, in f64 and without any layout.
    fn smooth(image: &[Complex64], kernel: &Kernel) -> Vec<Complex64> {
        let radius = kernel.radius() as isize;
        let along = |image: &[Complex64], down: isize, right: isize| -> Vec<Complex64> {
            let mean = |i: usize| {
                let at = |d: isize| {
                    let y = ((i / WIDTH) as isize + d * down).rem_euclid(HEIGHT as isize);
                    let x = ((i % WIDTH) as isize + d * right).rem_euclid(WIDTH as isize);
                    image[y as usize * WIDTH + x as usize]
                };
                (-radius..=radius).map(|d| at(d) * kernel.half[d.unsigned_abs()]).sum()
            };
            (0..image.len()).map(mean).collect()
        };
        along(&along(image, 1, 0), 0, 1)
    }

    /// ⟨C⟩ and ⟨C/|C|⟩ of two fields.
    fn means(u: &[Complex64], v: &[Complex64], kernel: &Kernel) -> [Vec<Complex64>; 2] {
        let cross: Vec<Complex64> = u.iter().zip(v).map(|(u, v)| u * v.conj()).collect();
        let phasors: Vec<Complex64> = cross.iter().map(|&c| unit_phasor(c)).collect();
        [smooth(&cross, kernel), smooth(&phasors, kernel)]
    }

    /// The same recursion in f64, pixel by pixel.
    fn expected(frames: &[Vec<Complex32>], settings: &NewestSettings) -> Vec<Vec<f64>> {
        let double = |u: &Complex32| {
            let double = Complex64::new(f64::from(u.re), f64::from(u.im));
            if double.is_finite() { double } else { Complex64::default() }
        };
        let fields = frames.iter().map(|frame| frame.iter().map(double).collect::<Vec<_>>());
        let fields: Vec<Vec<Complex64>> = fields.collect();
        let mut phases: Vec<Vec<f64>> = vec![vec![0.0; HEIGHT * WIDTH]];
        for n in 1..fields.len() {
            let means: Vec<_> = (1..=LAGS.min(n))
                .map(|dt| means(&fields[n - dt], &fields[n], &settings.kernel))
                .collect();
            let phase = |i: usize| {
                let pair = |(age, [cross, phasor]): (usize, &[Vec<Complex64>; 2])| HeldPair {
                    wanted: phases[n - 1 - age][i] - cross[i].arg(),
                    weight: settings.weights.paper(phasor[i]),
                };
                let pairs: Vec<_> = means.iter().enumerate().map(pair).collect();
                newest_phase(&pairs, phases[n - 1][i]).phase_rad
            };
            let newest = (0..HEIGHT * WIDTH).map(phase).collect();
            phases.push(newest);
        }
        let reference = |i: usize| phases[..5].iter().map(|phases| phases[i]).sum::<f64>() / 5.0;
        phases.iter().map(|all| (0..all.len()).map(|i| all[i] - reference(i)).collect()).collect()
    }

    /// f32 lanes on every path and any number of threads give what is written down.
    #[test]
    fn bands_of_lanes_are_the_recursion_pixel_by_pixel() {
        let frames = frames();
        let expected = expected(&frames, &settings(Path::Portable, 1));
        for (path, threads) in Path::available().into_iter().zip([1, 2, 5]) {
            let mut images = NewestImages::start(&settings(path, threads)).unwrap();
            for (n, (frame, expected)) in frames.iter().zip(&expected).enumerate() {
                let image = images.push(frame).unwrap();
                assert_eq!((image.phases.len(), image.unmeasured), (expected.len(), 0));
                assert_eq!(image.phases[100].is_nan(), n == 9);
                let pixels = image.phases.iter().zip(expected).enumerate();
                for (i, (&found, expected)) in pixels.filter(|&(i, _)| i != 100) {
                    let off = (f64::from(found) - expected).abs();
                    // The reference is whole from the fifth frame on.
                    assert!(n < 4 || off < 1e-4, "{path:?}, frame {n}, pixel {i}: {off}");
                }
            }
        }
    }

    #[test]
    fn a_frame_that_has_nothing_in_common_leaves_the_phase() {
        let undisturbed = expected(&frames(), &settings(Path::Portable, 1));
        let mut frames = frames();
        frames[12] = frames[12].iter().rev().map(|u| u * u * 3.0).collect();
        let mut images = NewestImages::start(&settings(Path::Portable, 2)).unwrap();
        let all: Vec<NewestImage> =
            frames.iter().map(|frame| images.push(frame).unwrap()).collect();
        assert!(all[12].unmeasured > HEIGHT * WIDTH / 2, "{}", all[12].unmeasured);
        assert_eq!(all[16].unmeasured, 0);
        let both = all[16].phases.iter().zip(&undisturbed[16]);
        let off = both.map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.5, "{off}");
    }

    #[test]
    fn another_size_is_refused() {
        let mut images = NewestImages::start(&settings(Path::Portable, 1)).unwrap();
        let error = images.push(&[Complex32::default(); 3]).unwrap_err();
        assert!(error.to_string().contains("3 pixels, not 777"), "{error}");
    }
}
