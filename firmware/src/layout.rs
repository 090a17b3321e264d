//! Bytes of a compiled plan: its numbers in the order of [`Plan`]'s definition.
//!
//! A number below 128 is one byte, whatever its type; a larger one is 128 + the count of its bytes,
//! and these, low ones first. So the paper's plan takes 65 bytes; one routine reads them all, which
//! matters where flash is 32 KiB; and nothing is shifted, which takes an 8-bit processor a thousand
//! cycles for 64 bits.

use crate::compiled::Bytes;
use crate::plan::{Action, Interlock, PhaseLimit, Plan, Pulse, Start, Stimulus};

/// The first byte of a number that does not fit into it: this, plus the count of the others.
const LONG: u8 = 0x80;
const WIDTH: usize = size_of::<u64>();

/// Append a plan; `None` when the bytes have no room.
pub(crate) fn write(plan: &Plan, bytes: &mut Bytes) -> Option<()> {
    let mut put = |number: u64| put(bytes, number);
    put(match plan.inputs.interlock {
        Interlock::Off => 0,
        Interlock::On => 1,
        Interlock::Pulsed => 2,
    })?;
    put(plan.inputs.ready.into())?;
    put((plan.inputs.start == Start::External).into())?;
    put(plan.repeats.into())?;
    put(plan.repeat_period)?;
    put(plan.bursts.into())?;
    put(plan.interval)?;
    put(plan.sweeps.into())?;
    for pulse in [Pulse { delay: plan.spacing[0], width: plan.spacing[1] }, plan.laser, plan.camera]
    {
        put(pulse.delay.into())?;
        put(pulse.width.into())?;
    }
    put(plan.frame.into())?;
    put(plan.stimulus.is_some().into())?;
    if let Some(stimulus) = &plan.stimulus {
        put(stimulus.burst.into())?;
        put(stimulus.sweep.into())?;
        put(stimulus.delay)?;
        put(stimulus.on)?;
        put(stimulus.pulses.into())?;
        put(stimulus.period.into())?;
        put(stimulus.sham.into())?;
    }
    put(match &plan.phase_limit {
        None => 0,
        Some(PhaseLimit { action: Action::Line, .. }) => 1,
        Some(PhaseLimit { action: Action::Stimulus, .. }) => 2,
        Some(PhaseLimit { action: Action::Stop, .. }) => 3,
    })?;
    if let Some(limit) = &plan.phase_limit {
        put(limit.milliradians.into())?;
        put(limit.silence.into())?;
    }
    let caps = &plan.caps;
    put(caps.laser_pulse.into())?;
    put(caps.laser_total)?;
    put(caps.stimulus_pulse)?;
    put(caps.stimulus_total)?;
    put(caps.images_per_sweep.into())?;
    put(caps.camera_images.into())?;
    put(caps.heartbeat.into())
}

fn put(bytes: &mut Bytes, number: u64) -> Option<()> {
    if number < u64::from(LONG) {
        return bytes.push(number as u8).ok();
    }
    let count = WIDTH - number.leading_zeros() as usize / 8;
    bytes.push(LONG + count as u8).ok()?;
    bytes.extend_from_slice(number.to_le_bytes().get(..count)?).ok()
}

/// Make `plan` the plan that the bytes mean; false, and `plan` is of no use, when they mean none.
#[inline(never)]
pub(crate) fn read(bytes: &[u8], plan: &mut Plan) -> bool {
    let mut numbers = Numbers { bytes: bytes.iter(), valid: true };
    let n = &mut numbers;
    plan.inputs.interlock = n.interlock();
    plan.inputs.ready = n.flag();
    plan.inputs.start = n.start();
    plan.repeats = n.short();
    plan.repeat_period = n.next();
    plan.bursts = n.short();
    plan.interval = n.next();
    plan.sweeps = n.byte();
    plan.spacing = [n.long(), n.long()];
    n.pulse(&mut plan.laser);
    n.pulse(&mut plan.camera);
    n.frame(plan);
    plan.stimulus = n.stimulus();
    n.phase_limit(plan);
    plan.caps.laser_pulse = n.long();
    plan.caps.laser_total = n.next();
    plan.caps.stimulus_pulse = n.next();
    plan.caps.stimulus_total = n.next();
    plan.caps.images_per_sweep = n.long();
    plan.caps.camera_images = n.long();
    plan.caps.heartbeat = n.long();
    numbers.valid && numbers.bytes.as_slice().is_empty()
}

/// Reads numbers; what cannot be one is 0 and makes the whole invalid.
struct Numbers<'a> {
    bytes: core::slice::Iter<'a, u8>,
    valid: bool,
}

impl Numbers<'_> {
    fn octet(&mut self) -> u8 {
        if let Some(&byte) = self.bytes.next() {
            byte
        } else {
            self.valid = false;
            0
        }
    }

    /// The bytes of a number, into so many zeros.
    #[inline(never)]
    fn fill(&mut self, number: &mut [u8]) {
        let first = self.octet();
        let mut count = 0;
        if first >= LONG {
            count = first - LONG;
        } else if let Some(low) = number.first_mut() {
            *low = first;
        }
        for slot in number {
            if count == 0 {
                return;
            }
            count -= 1;
            *slot = self.octet();
        }
        self.valid &= count == 0;
    }

    #[inline(never)]
    fn next(&mut self) -> u64 {
        let mut number = [0; WIDTH];
        self.fill(&mut number);
        u64::from_le_bytes(number)
    }

    #[inline(never)]
    fn long(&mut self) -> u32 {
        let mut number = [0; 4];
        self.fill(&mut number);
        u32::from_le_bytes(number)
    }

    fn short(&mut self) -> u16 {
        let mut number = [0; 2];
        self.fill(&mut number);
        u16::from_le_bytes(number)
    }

    fn byte(&mut self) -> u8 {
        let mut number = [0];
        self.fill(&mut number);
        u8::from_le_bytes(number)
    }

    /// A number below `end`.
    fn choice(&mut self, end: u8) -> u8 {
        let number = self.byte();
        self.valid &= number < end;
        number
    }

    fn flag(&mut self) -> bool {
        self.choice(2) == 1
    }

    fn interlock(&mut self) -> Interlock {
        match self.choice(3) {
            0 => Interlock::Off,
            1 => Interlock::On,
            _ => Interlock::Pulsed,
        }
    }

    fn start(&mut self) -> Start {
        if self.flag() { Start::External } else { Start::Command }
    }

    fn pulse(&mut self, pulse: &mut Pulse) {
        pulse.delay = self.long();
        pulse.width = self.long();
    }

    #[cfg(feature = "extended")]
    fn frame(&mut self, plan: &mut Plan) {
        plan.frame = self.long();
    }

    #[cfg(feature = "extended")]
    fn phase_limit(&mut self, plan: &mut Plan) {
        let action = match self.choice(4) {
            0 => None,
            1 => Some(Action::Line),
            2 => Some(Action::Stimulus),
            _ => Some(Action::Stop),
        };
        plan.phase_limit = action.map(|action| PhaseLimit {
            milliradians: self.long(),
            silence: self.long(),
            action,
        });
    }

    // What a board does not have is no plan for it.

    #[cfg(not(feature = "extended"))]
    fn frame(&mut self, _plan: &mut Plan) {
        self.choice(1);
    }

    #[cfg(not(feature = "extended"))]
    fn phase_limit(&mut self, _plan: &mut Plan) {
        self.choice(1);
    }

    fn stimulus(&mut self) -> Option<Stimulus> {
        self.flag().then(|| Stimulus {
            burst: self.short(),
            sweep: self.byte(),
            delay: self.next(),
            on: self.next(),
            pulses: self.long(),
            period: self.long(),
            sham: self.flag(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Inputs;
    use crate::presets::paper;

    fn read(bytes: &[u8]) -> Option<Plan> {
        let mut plan = Plan::EMPTY;
        super::read(bytes, &mut plan).then_some(plan)
    }

    fn bytes_of(plan: &Plan) -> Bytes {
        let mut bytes = Bytes::new();
        write(plan, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn a_plan_comes_back_from_its_bytes() {
        let mut plan = paper();
        assert_eq!(read(&bytes_of(&plan)), Some(plan));
        assert_eq!(bytes_of(&plan).len(), 65);
        plan.stimulus = None;
        plan.interval = u64::MAX;
        plan.inputs = Inputs { interlock: Interlock::Pulsed, ready: false, start: Start::External };
        assert_eq!(read(&bytes_of(&plan)), Some(plan));
    }

    #[test]
    fn what_is_not_a_plan_is_not_taken_for_one() {
        let bytes = bytes_of(&paper());
        for end in 0..bytes.len() {
            assert_eq!(read(&bytes[..end]), None, "{end} bytes");
        }
        let mut longer = bytes.clone();
        longer.push(0).unwrap();
        assert_eq!(read(&longer), None);
        let mut interlock = bytes.clone();
        interlock[0] = 3;
        assert_eq!(read(&interlock), None);
        assert_eq!(read(&[0xFF; 90]), None);
    }
}
