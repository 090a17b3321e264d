//! The board's on-line solver, seen from the host: speckles out, phases in, and the same code here to
//! compare with.
//!
//! ```text
//! Series ─► Samples, Samples, … ─► (solver) ─► Solved ─┐
//!             one volume                               ├─► comparison: same bits? how far from f64?
//!           the same speckles ─► twin, f32 and f64 ────┘
//! ```

pub mod comparison;
pub mod table;
pub mod twin;

use super::failure::{Failure, Result};
use super::link::Link;
use super::speckles::Speckles;
use num_complex::Complex32;
use phasewalk_firmware::message::{
    Command, Estimate, Event, Refusal, SPECKLE_BYTES, SPECKLES_PER_REQUEST,
};
use std::time::{Duration, Instant};

/// A volume is solved within this time, or its event is lost.
const PATIENCE: Duration = Duration::from_secs(10);

/// A solver that is still at work takes its next order within this time.
const BUSY: Duration = Duration::from_millis(300);

/// Why a volume has no phase.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unsolved {
    /// The line, the board or the user.
    Failed(Failure),
    /// The board's event did not come.
    Lost,
}

impl From<Failure> for Unsolved {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

/// The board's solver begins anew, for these speckles.
///
/// # Errors
/// Any [`Failure`].
pub fn begin(link: &mut Link, speckles: &Speckles) -> Result<()> {
    // The board's limit is below.
    let count = u16::try_from(speckles.count()).unwrap_or(u16::MAX);
    let command = Command::Series { speckles: count, looks: speckles.looks.to_bits() };
    patiently(|| link.order(command))
}

/// Ask again while the solver may be at work.
fn patiently(mut ask: impl FnMut() -> Result<()>) -> Result<()> {
    let give_up = Instant::now() + BUSY;
    loop {
        let outcome = ask();
        let busy = outcome == Err(Failure::Refused(Refusal::Solver));
        if !busy || Instant::now() >= give_up {
            return outcome;
        }
    }
}

/// The requests that a volume takes.
#[must_use]
pub fn requests(volume: &[Complex32]) -> usize {
    volume.len().div_ceil(SPECKLES_PER_REQUEST)
}

/// Send one of the requests of a volume.
///
/// # Errors
/// Any [`Failure`].
pub fn send(link: &mut Link, volume: &[Complex32], request: usize) -> Result<()> {
    let first = request * SPECKLES_PER_REQUEST;
    let mut bytes = Vec::with_capacity(SPECKLES_PER_REQUEST * SPECKLE_BYTES);
    for speckle in volume.iter().skip(first).take(SPECKLES_PER_REQUEST) {
        bytes.extend_from_slice(&speckle.re.to_le_bytes());
        bytes.extend_from_slice(&speckle.im.to_le_bytes());
    }
    // The board's limit is below.
    let first = u16::try_from(first).unwrap_or(u16::MAX);
    link.order(Command::Samples { first, bytes: &bytes })
}

/// Send volume number `number` to a board at rest and wait for its phase.
///
/// # Errors
/// Any [`Failure`], or its event is lost.
pub fn solve(
    link: &mut Link,
    volume: &[Complex32],
    number: u32,
) -> std::result::Result<Estimate, Unsolved> {
    for request in 0..requests(volume) {
        patiently(|| send(link, volume, request))?;
    }
    let until = Instant::now() + PATIENCE;
    while let Some(heard) = link.event(until)? {
        match heard.event {
            Event::Solved(estimate) if estimate.volume == number => return Ok(estimate),
            Event::Solved(estimate) if estimate.volume > number => return Err(Unsolved::Lost),
            _ if heard.missing > 0 => return Err(Unsolved::Lost),
            _ => {}
        }
    }
    Err(Unsolved::Lost)
}
