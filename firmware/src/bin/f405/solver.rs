//! The on-line solver: speckles come from the passes, phases go back to them; it works in the time that
//! is left.

use crate::near::NEAR;
use crate::shared::Shared;
use crate::timers;
use heapless::Vec;
use num_complex::Complex;
use phasewalk_core::online::{self, OnlineTracker, SPECKLES};
use phasewalk_firmware::message::{Estimate, SPECKLE_BYTES};

#[cfg(not(feature = "plain-f32"))]
use crate::number::Number;
/// To measure what [`crate::number`] saves.
#[cfg(feature = "plain-f32")]
type Number = f32;

type Volume = Vec<Complex<Number>, SPECKLES>;

/// Speckles copied while interrupts wait.
const PIECE: usize = 4;

/// Between passes and solver.
struct Mailbox {
    /// Begin anew, with so many speckles and effective looks, before anything else.
    begin: Option<(u16, f32)>,
    speckles: u16,
    /// Speckles that have come; once all of a volume's are there they wait to be solved.
    volume: Volume,
    solved: Option<Estimate>,
}

static MAILBOX: Shared<Mailbox> =
    Shared::new(Mailbox { begin: None, speckles: 0, volume: Vec::new(), solved: None });

impl Mailbox {
    fn is_full(&self) -> bool {
        self.speckles > 0 && self.volume.len() == usize::from(self.speckles)
    }
}

/// Forget all volumes; from now on they have so many speckles. False when the solver cannot.
pub fn begin(speckles: u16, looks: f32) -> bool {
    if online::check(speckles.into(), looks.into()).is_err() {
        return false;
    }
    MAILBOX.with(|mailbox| {
        mailbox.begin = Some((speckles, looks));
        mailbox.speckles = speckles;
        mailbox.volume.clear();
        mailbox.solved = None;
    });
    true
}

/// Speckles of the next volume, from number `first` on; with the last one it is to be solved. False
/// when it is not their turn. Interrupts wait for one speckle at a time only.
pub fn samples(first: u16, bytes: &[u8]) -> bool {
    let (samples, rest) = bytes.as_chunks::<SPECKLE_BYTES>();
    let end = usize::from(first) + samples.len();
    let their_turn = MAILBOX.with(|mailbox| {
        let next = usize::from(first) == mailbox.volume.len();
        next && !mailbox.is_full() && end <= usize::from(mailbox.speckles)
    });
    if !their_turn || !rest.is_empty() {
        return false;
    }
    for sample in samples {
        let speckle = speckle(sample);
        // There is room: `begin` has seen to it.
        let _ = MAILBOX.with(|mailbox| mailbox.volume.push(speckle));
    }
    true
}

fn speckle(bytes: &[u8; SPECKLE_BYTES]) -> Complex<Number> {
    let [a, b, c, d, e, f, g, h] = *bytes;
    let number = |bytes| Number::from(f32::from_le_bytes(bytes));
    Complex { re: number([a, b, c, d]), im: number([e, f, g, h]) }
}

/// A volume that was solved.
pub fn solved() -> Option<Estimate> {
    MAILBOX.with(|mailbox| mailbox.solved.take())
}

/// Solve what comes, for ever; between, sleep or `stay_awake`, for emulators whose time jumps while the
/// processor sleeps.
pub fn run(stay_awake: bool) -> ! {
    let mut tracker: Option<OnlineTracker<Number>> = None;
    let mut volume = Volume::new();
    loop {
        if let Some((speckles, looks)) = MAILBOX.with(|mailbox| mailbox.begin.take()) {
            begin_anew(&mut tracker, speckles, looks);
        }
        let full = take(&mut volume);
        match &mut tracker {
            Some(tracker) if full => tell(solve(tracker, &volume)),
            _ if stay_awake => idle(),
            _ => cortex_m::asm::wfi(),
        }
    }
}

/// Not inline: making a tracker takes its room once more, which the stack need not hold while it works.
#[inline(never)]
fn begin_anew(tracker: &mut Option<OnlineTracker<Number>>, speckles: u16, looks: f32) {
    *tracker = OnlineTracker::new(speckles.into(), looks.into()).ok();
}

/// Take the volume that waits, if one does. Passes leave a full one alone, but a new series drops it;
/// so it can be copied piece by piece, and interrupts wait for a piece only.
fn take(volume: &mut Volume) -> bool {
    volume.clear();
    loop {
        let (full, whole) = MAILBOX.with(|mailbox| {
            let full = mailbox.is_full() && mailbox.begin.is_none();
            let left = mailbox.volume.get(volume.len()..).unwrap_or(&[]);
            for &speckle in left.iter().take(if full { PIECE } else { 0 }) {
                let _ = volume.push(speckle);
            }
            let whole = full && volume.len() == usize::from(mailbox.speckles);
            if whole {
                mailbox.volume.clear();
            }
            (full, whole)
        });
        if whole || !full {
            return whole;
        }
    }
}

/// For the next pass, unless a new series has begun meanwhile.
fn tell(estimate: Estimate) {
    MAILBOX.with(|mailbox| {
        if mailbox.begin.is_none() {
            mailbox.solved = Some(estimate);
        }
    });
}

/// Nothing, many times, with few branches: an emulator's time flies.
fn idle() {
    for _ in 0..256 {
        cortex_m::asm::nop();
    }
}

fn solve(tracker: &mut OnlineTracker<Number>, volume: &Volume) -> Estimate {
    let begin = own_time();
    let estimate = tracker.push(volume);
    Estimate {
        volume: estimate.frame as u32,
        phase: f32::from(estimate.phase_rad).to_bits(),
        sigma: f32::from(estimate.sigma_rad).to_bits(),
        took: own_time().wrapping_sub(begin),
    }
}

/// Ticks of which passes have taken none, wrapping.
fn own_time() -> u32 {
    NEAR.with(|near| timers::counter().wrapping_sub(near.in_passes))
}
