//! The on-line solver: speckles come from the passes, phases go back to them; it works in the time that
//! is left.

use crate::near::NEAR;
use crate::shared::Shared;
use crate::timers;
use heapless::Vec;
use num_complex::Complex;
use phasewalk_core::online::{OnlineWalk, SPECKLES, online_walk, online_weights};
use phasewalk_firmware::message::{Estimate, SPECKLE_BYTES};

type Volume = Vec<Complex<f32>, SPECKLES>;

/// What is asked of the solver.
enum Job {
    Nothing,
    /// Begin anew, with so many speckles and effective looks.
    Begin(u16, f32),
    /// Solve the volume.
    Solve,
}

/// Between passes and solver.
struct Mailbox {
    job: Job,
    /// The solver works on the volume.
    busy: bool,
    speckles: u16,
    volume: Volume,
    solved: Option<Estimate>,
}

static MAILBOX: Shared<Mailbox> = Shared::new(Mailbox {
    job: Job::Nothing,
    busy: false,
    speckles: 0,
    volume: Vec::new(),
    solved: None,
});

/// Forget all volumes; from now on they have so many speckles. False when the solver cannot, or works.
pub fn begin(speckles: u16, looks: f32) -> bool {
    if online_weights(speckles.into(), looks.into()).is_err() {
        return false;
    }
    MAILBOX.with(|mailbox| {
        if mailbox.busy {
            return false;
        }
        mailbox.job = Job::Begin(speckles, looks);
        mailbox.speckles = speckles;
        mailbox.volume.clear();
        mailbox.solved = None;
        true
    })
}

/// Speckles of the next volume, from number `first` on; with the last one it is to be solved. False
/// when it is not their turn.
pub fn samples(first: u16, bytes: &[u8]) -> bool {
    let (samples, rest) = bytes.as_chunks::<SPECKLE_BYTES>();
    MAILBOX.with(|mailbox| {
        let waits = mailbox.busy || !matches!(mailbox.job, Job::Nothing);
        let end = usize::from(first) + samples.len();
        if waits
            || !rest.is_empty()
            || usize::from(first) != mailbox.volume.len()
            || end > usize::from(mailbox.speckles)
        {
            return false;
        }
        for sample in samples {
            // There is room: `begin` has seen to it.
            let _ = mailbox.volume.push(speckle(sample));
        }
        if end == usize::from(mailbox.speckles) {
            mailbox.job = Job::Solve;
        }
        true
    })
}

fn speckle(bytes: &[u8; SPECKLE_BYTES]) -> Complex<f32> {
    let [a, b, c, d, e, f, g, h] = *bytes;
    Complex { re: f32::from_le_bytes([a, b, c, d]), im: f32::from_le_bytes([e, f, g, h]) }
}

/// A volume that was solved.
pub fn solved() -> Option<Estimate> {
    MAILBOX.with(|mailbox| mailbox.solved.take())
}

/// Solve what comes, for ever.
pub fn run() -> ! {
    let mut walk: Option<OnlineWalk<f32>> = None;
    let mut volume = Volume::new();
    loop {
        match take(&mut volume) {
            Job::Nothing => cortex_m::asm::wfi(),
            Job::Begin(speckles, looks) => walk = online_walk(speckles.into(), looks.into()).ok(),
            Job::Solve => {
                let estimate = walk.as_mut().map(|walk| solve(walk, &volume));
                MAILBOX.with(|mailbox| {
                    mailbox.solved = estimate;
                    mailbox.busy = false;
                });
            }
        }
    }
}

/// The job that waits, and its volume.
fn take(volume: &mut Volume) -> Job {
    MAILBOX.with(|mailbox| {
        let job = core::mem::replace(&mut mailbox.job, Job::Nothing);
        if let Job::Solve = job {
            mailbox.busy = true;
            volume.clone_from(&mailbox.volume);
            mailbox.volume.clear();
        }
        job
    })
}

fn solve(walk: &mut OnlineWalk<f32>, volume: &Volume) -> Estimate {
    let begin = own_time();
    let estimate = walk.push(volume);
    Estimate {
        volume: estimate.frame as u32,
        phase: estimate.phase_rad.to_bits(),
        sigma: estimate.sigma_rad.to_bits(),
        took: own_time().wrapping_sub(begin),
    }
}

/// Ticks of which passes have taken none, wrapping.
fn own_time() -> u32 {
    NEAR.with(|near| timers::counter().wrapping_sub(near.in_passes))
}
