//! A general-purpose timer: up-counter, prescaler, four channels, slave mode, trigger output.
//!
//! A match is the tick at which the counter *becomes* the compare value: one that is written while
//! the counter already has it does not match until the next time round. The filter and the two or
//! three ticks of the synchronisers before capture and slave controller are left out, as are down-
//! and centre-counting, DMA and the pulse modes of TRGO.

/// The counter counts.
const ENABLE: u32 = 1;
/// No update events.
const NO_UPDATE: u32 = 1 << 1;
/// Only the counter's overflow sets UIF.
const ONLY_OVERFLOW: u32 = 1 << 2;
/// The counter stops at the update.
const ONE_PULSE: u32 = 1 << 3;
/// ARR is preloaded.
const PRELOAD: u32 = 1 << 7;

/// Bits of SR that exist: UIF, CCxIF, TIF, CCxOF.
const FLAGS: u32 = 0b1_1110_0101_1111;

/// One channel.
#[derive(Clone, Copy, Default)]
struct Channel {
    /// What was written, or captured.
    value: u32,
    /// What is compared.
    active: u32,
    /// OCxREF.
    reference: bool,
}

/// An output, or the trigger output, has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// OC1 to OC4, counted from 0.
    Output(usize),
    /// TRGO.
    Trigger(bool),
}

/// The timer. Times are in ticks of its clock since power-on.
pub struct Timer {
    /// The counter's largest value.
    mask: u32,
    control: [u32; 2],
    slave: u32,
    enables: u32,
    flags: u32,
    /// When each flag was set.
    since: [u64; 5],
    modes: [u32; 2],
    outputs: u32,
    prescaler: u32,
    prescaler_active: u32,
    reload: u32,
    reload_active: u32,
    channels: [Channel; 4],
    /// The counter had this value at the tick `base`, `phase` ticks after it got it.
    count: u32,
    base: u64,
    phase: u32,
    /// Level of the trigger input.
    gate: bool,
    trigger: bool,
    /// What has changed, and when; for the chip to take.
    pub changes: Vec<(Change, u64)>,
}

impl Timer {
    /// A timer as after a reset, whose counter has so many bits.
    pub fn new(mask: u32) -> Self {
        Self {
            mask,
            control: [0; 2],
            slave: 0,
            enables: 0,
            flags: 0,
            since: [0; 5],
            modes: [0; 2],
            outputs: 0,
            prescaler: 0,
            prescaler_active: 0,
            reload: mask,
            reload_active: mask,
            channels: [Channel::default(); 4],
            count: 0,
            base: 0,
            phase: 0,
            gate: false,
            trigger: false,
            changes: Vec::new(),
        }
    }

    // ---- time ------------------------------------------------------------------------------

    fn counts(&self) -> bool {
        self.control[0] & ENABLE != 0 && (self.slave & 7 != 5 || self.gate)
    }

    /// Steps until the counter becomes `value`; 0 is the update.
    fn steps_to(&self, value: u32) -> Option<u64> {
        let top = if self.count > self.reload_active { self.mask } else { self.reload_active };
        if value > self.count && value <= top {
            return Some(u64::from(value - self.count));
        }
        let wrap = u64::from(top - self.count) + 1;
        (value <= self.reload_active).then(|| wrap + u64::from(value))
    }

    /// The next tick at which something happens.
    pub fn next(&self) -> Option<u64> {
        if !self.counts() {
            return None;
        }
        let outputs = (0..4).filter(|&channel| !self.is_input(channel));
        let values = outputs.map(|channel| self.channels[channel].active);
        let steps = values.chain([0]).filter_map(|value| self.steps_to(value)).min()?;
        let ticks = steps * (u64::from(self.prescaler_active) + 1);
        Some(self.base + ticks - u64::from(self.phase))
    }

    /// Let time pass. Everything due at `tick` has happened after it.
    pub fn advance(&mut self, tick: u64) {
        while let Some(at) = self.next().filter(|&at| at <= tick) {
            self.arrive(at);
        }
        if self.counts() && tick > self.base {
            let ticks = tick - self.base + u64::from(self.phase);
            let period = u64::from(self.prescaler_active) + 1;
            self.count += (ticks / period) as u32;
            self.phase = (ticks % period) as u32;
        }
        self.base = self.base.max(tick);
    }

    /// The counter becomes the next value that matters.
    fn arrive(&mut self, at: u64) {
        let ticks = at - self.base + u64::from(self.phase);
        let steps = ticks / (u64::from(self.prescaler_active) + 1);
        let top = if self.count > self.reload_active { self.mask } else { self.reload_active };
        (self.base, self.phase) = (at, 0);
        if u64::from(self.count) + steps > u64::from(top) {
            self.count = 0;
            self.update(at, true);
        } else {
            self.count += steps as u32;
        }
        for channel in 0..4 {
            if !self.is_input(channel) && self.channels[channel].active == self.count {
                self.matched(channel, at);
            }
        }
        self.compare(at);
    }

    fn update(&mut self, at: u64, overflow: bool) {
        if self.control[0] & NO_UPDATE != 0 {
            return;
        }
        self.prescaler_active = self.prescaler;
        self.reload_active = self.reload;
        for channel in &mut self.channels {
            channel.active = channel.value;
        }
        if overflow || self.control[0] & ONLY_OVERFLOW == 0 {
            self.flag(0, at);
        }
        if overflow && self.control[0] & ONE_PULSE != 0 {
            self.control[0] &= !ENABLE;
        }
    }

    fn flag(&mut self, which: usize, at: u64) {
        if self.flags & 1 << which == 0 {
            self.since[which] = at;
        }
        self.flags |= 1 << which;
    }

    // ---- channels --------------------------------------------------------------------------

    /// The byte of CCMR1 or CCMR2 that belongs to a channel.
    fn mode(&self, channel: usize) -> u32 {
        self.modes[channel / 2] >> (8 * (channel % 2)) & 0xff
    }

    fn is_input(&self, channel: usize) -> bool {
        self.mode(channel) & 3 != 0
    }

    fn matched(&mut self, channel: usize, at: u64) {
        self.flag(channel + 1, at);
        let before = self.channels[channel].reference;
        let after = match self.mode(channel) >> 4 & 7 {
            1 => true,
            2 => false,
            3 => !before,
            _ => before,
        };
        self.set_reference(channel, after, at);
    }

    /// Levels that do not wait for a match: forced ones and pulse-width modulation.
    fn compare(&mut self, at: u64) {
        for channel in 0..4 {
            if self.is_input(channel) {
                continue;
            }
            let below = self.count < self.channels[channel].active;
            match self.mode(channel) >> 4 & 7 {
                4 => self.set_reference(channel, false, at),
                5 => self.set_reference(channel, true, at),
                6 => self.set_reference(channel, below, at),
                7 => self.set_reference(channel, !below, at),
                _ => {}
            }
        }
        self.set_trigger(at);
    }

    fn set_reference(&mut self, channel: usize, level: bool, at: u64) {
        if self.channels[channel].reference != level {
            self.channels[channel].reference = level;
            self.changes.push((Change::Output(channel), at));
            self.set_trigger(at);
        }
    }

    fn set_trigger(&mut self, at: u64) {
        let level = match self.control[1] >> 4 & 7 {
            1 => self.control[0] & ENABLE != 0,
            source @ 4..=7 => self.channels[source as usize - 4].reference,
            _ => false,
        };
        if self.trigger != level {
            self.trigger = level;
            self.changes.push((Change::Trigger(level), at));
        }
    }

    /// Level of an output; none when it is off.
    pub fn output(&self, channel: usize) -> Option<bool> {
        let bits = self.outputs >> (4 * channel);
        (bits & 1 != 0 && !self.is_input(channel))
            .then(|| self.channels[channel].reference != (bits & 2 != 0))
    }

    /// The pin of a channel has changed.
    pub fn input(&mut self, channel: usize, high: bool, tick: u64) {
        let bits = self.outputs >> (4 * channel);
        let (falling, both) = (bits & 2 != 0, bits & 0b1010 == 0b1010);
        if bits & 1 == 0 || self.mode(channel) & 3 != 1 || !(both || high != falling) {
            return;
        }
        self.advance(tick);
        self.capture(channel, tick);
    }

    fn capture(&mut self, channel: usize, tick: u64) {
        self.channels[channel].value = self.count;
        if self.flags & 2 << channel != 0 {
            self.flags |= 0x200 << channel;
        }
        self.flag(channel + 1, tick);
    }

    // ---- slave mode ------------------------------------------------------------------------

    /// The trigger input has changed.
    pub fn triggered(&mut self, level: bool, tick: u64) {
        self.advance(tick);
        let rose = level && !self.gate;
        self.gate = level;
        if self.slave & 7 >= 4 && rose {
            self.flags |= 1 << 6;
        }
        match self.slave & 7 {
            4 if rose => self.restart(tick),
            6 if rose => self.control[0] |= ENABLE,
            _ => {}
        }
        self.compare(tick);
    }

    /// Which trigger it listens to: ITR0 to ITR3 are 0 to 3.
    pub fn trigger_source(&self) -> u32 {
        self.slave >> 4 & 7
    }

    /// The level it sends to its slaves.
    pub fn trigger_level(&self) -> bool {
        self.trigger
    }

    fn restart(&mut self, tick: u64) {
        (self.count, self.phase, self.base) = (0, 0, tick);
        self.update(tick, false);
        self.compare(tick);
    }

    // ---- registers -------------------------------------------------------------------------

    /// Since when it requests its interrupt.
    pub fn request(&self) -> Option<u64> {
        let wanted = self.flags & self.enables & 0x1f;
        (0..5).filter(|flag| wanted >> flag & 1 != 0).map(|flag| self.since[flag]).min()
    }

    /// Read a register; none when there is no such.
    pub fn read(&mut self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 | 0x04 => self.control[offset as usize / 4],
            0x08 => self.slave,
            0x0c => self.enables,
            0x10 => self.flags,
            0x14 => 0,
            0x18 | 0x1c => self.modes[(offset as usize - 0x18) / 4],
            0x20 => self.outputs,
            0x24 => self.count,
            0x28 => self.prescaler,
            0x2c => self.reload,
            0x34..=0x40 => self.read_channel((offset as usize - 0x34) / 4),
            _ => return None,
        })
    }

    fn read_channel(&mut self, channel: usize) -> u32 {
        if self.is_input(channel) {
            self.flags &= !(2 << channel);
        }
        self.channels[channel].value
    }

    /// Write a register at a tick up to which it has advanced; none when there is no such.
    pub fn write(&mut self, offset: u32, value: u32, tick: u64) -> Option<()> {
        match offset {
            0x00 | 0x04 => self.control[offset as usize / 4] = value,
            0x08 => self.slave = value,
            0x0c => self.enable(value, tick),
            0x10 => self.flags &= value & FLAGS,
            0x14 => self.generate(value, tick),
            0x18 | 0x1c => self.set_modes((offset as usize - 0x18) / 4, value, tick),
            0x20 => self.set_outputs(value, tick),
            0x24 => (self.count, self.phase) = (value & self.mask, 0),
            0x28 => self.prescaler = value & 0xffff,
            0x2c => self.write_reload(value & self.mask),
            0x34..=0x40 => self.write_channel((offset as usize - 0x34) / 4, value & self.mask),
            _ => return None,
        }
        self.compare(tick);
        Some(())
    }

    /// A flag that was set before requests from now on only.
    fn enable(&mut self, enables: u32, tick: u64) {
        let new = enables & !self.enables & self.flags;
        for flag in (0..5).filter(|flag| new >> flag & 1 != 0) {
            self.since[flag] = tick;
        }
        self.enables = enables;
    }

    fn generate(&mut self, events: u32, tick: u64) {
        if events & 1 != 0 {
            self.restart(tick);
        }
        for channel in (0..4).filter(|channel| events >> (channel + 1) & 1 != 0) {
            if self.is_input(channel) {
                self.capture(channel, tick);
            } else {
                self.flag(channel + 1, tick);
            }
        }
    }

    fn set_modes(&mut self, register: usize, value: u32, tick: u64) {
        self.modes[register] = value;
        self.set_outputs(self.outputs, tick);
    }

    fn set_outputs(&mut self, value: u32, tick: u64) {
        self.outputs = value;
        self.changes.extend((0..4).map(|channel| (Change::Output(channel), tick)));
    }

    fn write_reload(&mut self, value: u32) {
        self.reload = value;
        if self.control[0] & PRELOAD == 0 {
            self.reload_active = value;
        }
    }

    fn write_channel(&mut self, channel: usize, value: u32) {
        if self.is_input(channel) {
            return;
        }
        self.channels[channel].value = value;
        if self.mode(channel) & 8 == 0 {
            self.channels[channel].active = value;
        }
    }

    /// What was asked for that is not modelled, if anything.
    pub fn beyond(&self) -> bool {
        let counting_down = self.control[0] & 0x70 != 0;
        let dma = self.enables & 0x5f00 != 0;
        let slave = matches!(self.slave & 7, 1..=3 | 7);
        let pulse = matches!(self.control[1] >> 4 & 7, 2 | 3);
        counting_down || dma || slave || pulse
    }
}

#[cfg(test)]
mod tests {
    use super::{Change, Timer};

    /// Run to a tick; the changes of outputs up to then.
    fn run(timer: &mut Timer, until: u64) -> Vec<u64> {
        timer.advance(until);
        let outputs = timer.changes.drain(..);
        outputs.filter(|(change, _)| *change == Change::Output(0)).map(|(_, at)| at).collect()
    }

    /// A timer with these registers, started at tick 10.
    fn started(registers: &[(u32, u32)]) -> Timer {
        let mut timer = Timer::new(0xffff);
        timer.advance(10);
        for &(offset, value) in registers.iter().chain(&[(0x00, 1)]) {
            assert_eq!(timer.write(offset, value, 10), Some(()));
        }
        timer.changes.clear();
        timer
    }

    #[test]
    fn pulse_widths_are_modulated() {
        // PWM mode 1, 3 of 10 ticks.
        let mut timer = started(&[(0x2c, 9), (0x34, 3), (0x18, 0x60), (0x20, 1)]);
        assert_eq!(timer.output(0), Some(true));
        assert_eq!(run(&mut timer, 35), [13, 20, 23, 30, 33]);
    }

    #[test]
    fn a_gated_timer_rests_where_it_was() {
        // PWM mode 2, gated by ITR1.
        let registers = [(0x2c, 9), (0x34, 5), (0x18, 0x70), (0x20, 1), (0x08, 0x15)];
        let mut timer = started(&registers);
        assert!(run(&mut timer, 100).is_empty());
        timer.triggered(true, 100);
        assert_eq!(run(&mut timer, 119), [105, 110, 115]);
        timer.triggered(false, 120);
        assert_eq!(run(&mut timer, 500), [120]);
        assert_eq!(timer.output(0), Some(false));
    }

    #[test]
    fn a_value_written_too_late_waits_for_the_next_round() {
        let mut timer = started(&[(0x18, 0x10), (0x20, 1)]);
        timer.advance(110);
        assert_eq!(timer.write(0x34, 100, 110), Some(()));
        timer.changes.clear();
        assert_eq!(timer.next(), Some(10 + 0x1_0000));
        assert_eq!(run(&mut timer, 10 + 0x1_0000 + 100), [10 + 0x1_0000 + 100]);
    }

    #[test]
    fn the_prescaler_waits_for_an_update() {
        let mut timer = started(&[(0x28, 1)]);
        timer.advance(20);
        assert_eq!(timer.read(0x24), Some(10));
        assert_eq!(timer.write(0x14, 1, 20), Some(()));
        timer.advance(30);
        assert_eq!(timer.read(0x24), Some(5));
    }
}
