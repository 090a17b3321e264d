//! `phasewalk watch`.
//!
//! | file | what it holds |
//! |---|---|
//! | `arguments` | the options, and what they alone can tell |
//! | `curve` | the phase of a region, frame by frame |
//! | `images` | the newest phase image |
//! | `follow` | a line for every frame |
//! | `report` | what is said before and after |

mod arguments;
mod curve;
mod follow;
mod images;
mod report;

pub(super) use arguments::Arguments;

use super::Common;
use crate::error::Result;
use crate::io::{FrameFormat, open_arriving};
use crate::watch::Frames;
use report::Tally;

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    arguments.validate()?;
    let source = open_arriving(&arguments.source)?;
    let mut format = source.format();
    format.interval_s = arguments.interval.or(format.interval_s);
    format.wavelength_nm = arguments.wavelength_nm.or(format.wavelength_nm);
    let frames = Frames { source, idle: arguments.idle() };
    let task = Task { arguments, common, format };
    match (&arguments.mask, arguments.gaussian) {
        (Some(path), _) => task.curve(frames, path),
        (None, sigma) => task.images(frames, sigma.unwrap_or_default()),
    }
}

/// What the flags and the source have settled.
struct Task<'a> {
    arguments: &'a Arguments,
    common: &'a Common,
    format: FrameFormat,
}

impl Task<'_> {
    /// When a frame was taken, seconds; its number where the interval is not known.
    fn time_of(&self, number: usize) -> f64 {
        number as f64 * self.format.interval_s.unwrap_or(1.0)
    }
}
