//! The loop over what a source delivers.

use crate::error::{Error, Result};
use crate::io::{Arrival, ArrivingFrames};
use crate::progress;
use num_complex::Complex32;
use std::time::{Duration, Instant};

/// How long the loop sleeps when nothing has come.
const PAUSE: Duration = Duration::from_millis(5);

/// Why no more frames come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The source has ended.
    Source,
    /// Nothing has come for as long as was to be waited.
    Idle,
    /// The user has asked to stop.
    Interrupted,
}

impl Ended {
    /// In one word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Source => "end",
            Self::Idle => "idle",
            Self::Interrupted => "interrupted",
        }
    }
}

/// A source and how long to wait for it.
pub struct Frames {
    /// Where the frames come from.
    pub source: Box<dyn ArrivingFrames>,
    /// To wait for a frame; without, until the source ends.
    pub idle: Option<Duration>,
}

impl Frames {
    /// Show every frame (y, x) with its number to `each`, until no more come or the user interrupts.
    ///
    /// # Errors
    /// What the source and `each` report; that the last frame is not whole.
    pub fn for_each(
        &mut self,
        mut each: impl FnMut(usize, &[Complex32]) -> Result<()>,
    ) -> Result<Ended> {
        let mut frame = vec![Complex32::default(); self.source.format().pixels()];
        let (mut number, mut last) = (0, Instant::now());
        loop {
            if let Err(Error::Interrupted) = progress::check() {
                return Ok(Ended::Interrupted);
            }
            match self.source.next(&mut frame)? {
                Arrival::Frame => {
                    each(number, &frame)?;
                    number += 1;
                    last = Instant::now();
                }
                Arrival::End => return Ok(Ended::Source),
                Arrival::Nothing if self.idle.is_some_and(|idle| last.elapsed() >= idle) => {
                    self.source.check_whole()?;
                    return Ok(Ended::Idle);
                }
                Arrival::Nothing => std::thread::sleep(PAUSE),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::FrameFormat;

    /// Three frames with nothing between them, then nothing, or the end.
    struct Slow {
        asked: usize,
        ends: bool,
    }

    impl ArrivingFrames for Slow {
        fn format(&self) -> FrameFormat {
            FrameFormat { height: 1, width: 1, interval_s: None, wavelength_nm: None }
        }

        fn next(&mut self, frame: &mut [Complex32]) -> Result<Arrival> {
            self.asked += 1;
            frame[0].re = self.asked as f32;
            Ok(match self.asked {
                2 | 4 | 6 => Arrival::Frame,
                7.. if self.ends => Arrival::End,
                _ => Arrival::Nothing,
            })
        }

        fn check_whole(&self) -> Result<()> {
            Ok(())
        }
    }

    fn seen(ends: bool, idle: Option<Duration>) -> (Ended, Vec<(usize, f32)>) {
        let mut seen = Vec::new();
        let mut frames = Frames { source: Box::new(Slow { asked: 0, ends }), idle };
        let ended = frames.for_each(|number, frame| {
            seen.push((number, frame[0].re));
            Ok(())
        });
        (ended.unwrap(), seen)
    }

    #[test]
    fn frames_are_counted_until_the_source_ends_or_nothing_comes() {
        let all = vec![(0, 2.0), (1, 4.0), (2, 6.0)];
        assert_eq!(seen(true, None), (Ended::Source, all.clone()));
        assert_eq!(seen(false, Some(Duration::from_millis(40))), (Ended::Idle, all));
    }

    #[test]
    fn what_goes_wrong_with_a_frame_ends_the_loop() {
        let mut frames = Frames { source: Box::new(Slow { asked: 0, ends: true }), idle: None };
        let mut count = 0;
        let error = frames.for_each(|_, _| {
            count += 1;
            Err(Error::failed("the disk is full"))
        });
        assert_eq!((error.unwrap_err().to_string().as_str(), count), ("the disk is full", 1));
    }
}
