//! Bytes of a compiled plan: its numbers in the order of [`Plan`]'s definition, each with seven bits
//! per byte, high bits first, the top bit set on all but the last byte.
//!
//! A number that is small takes a byte whatever its type, so the paper's plan takes 57 bytes; and one
//! routine reads them all, which matters where flash is 32 KiB. High bits first, because then every
//! shift is by seven: an 8-bit processor needs a thousand cycles to shift 64 bits by a variable.

use crate::compiled::Bytes;
use crate::plan::{Interlock, Plan, Pulse, Start, Stimulus};

const BITS: u32 = 7;
const MORE: u8 = 1 << BITS;

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
    let groups = (u64::BITS - number.leading_zeros()).div_ceil(BITS).max(1);
    for group in (0..groups).rev() {
        let more = if group > 0 { MORE } else { 0 };
        bytes.push((number >> (group * BITS)) as u8 & !MORE | more).ok()?;
    }
    Some(())
}

/// Make `plan` the plan that the bytes mean; false, and `plan` is of no use, when they mean none.
#[inline(never)]
pub(crate) fn read(bytes: &[u8], plan: &mut Plan) -> bool {
    let mut numbers = Numbers { bytes, valid: true };
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
    plan.stimulus = n.stimulus();
    plan.caps.laser_pulse = n.long();
    plan.caps.laser_total = n.next();
    plan.caps.stimulus_pulse = n.next();
    plan.caps.stimulus_total = n.next();
    plan.caps.images_per_sweep = n.long();
    plan.caps.camera_images = n.long();
    plan.caps.heartbeat = n.long();
    numbers.valid && numbers.bytes.is_empty()
}

/// Reads numbers; what cannot be one is 0 and makes the whole invalid.
struct Numbers<'a> {
    bytes: &'a [u8],
    valid: bool,
}

impl Numbers<'_> {
    #[inline(never)]
    fn next(&mut self) -> u64 {
        let mut number = 0_u64;
        while let Some((&byte, rest)) = self.bytes.split_first() {
            self.bytes = rest;
            // What is pushed out at the top was no number of 64 bits.
            self.valid &= number >> (u64::BITS - BITS) == 0;
            number = (number << BITS) | u64::from(byte & !MORE);
            if byte & MORE == 0 {
                return number;
            }
        }
        self.valid = false;
        0
    }

    #[inline(never)]
    fn at_most(&mut self, most: u32) -> u32 {
        let number = self.next();
        self.valid &= number <= u64::from(most);
        number as u32
    }

    fn long(&mut self) -> u32 {
        self.at_most(u32::MAX)
    }

    fn short(&mut self) -> u16 {
        self.at_most(u16::MAX.into()) as u16
    }

    fn byte(&mut self) -> u8 {
        self.at_most(u8::MAX.into()) as u8
    }

    fn flag(&mut self) -> bool {
        self.at_most(1) == 1
    }

    fn interlock(&mut self) -> Interlock {
        match self.at_most(2) {
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
        assert_eq!(bytes_of(&plan).len(), 57);
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
