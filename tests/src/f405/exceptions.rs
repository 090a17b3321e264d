//! Which exception is served next: the interrupt controller, the masks and the priorities.

/// Exceptions of the chip: 16 of the core and 82 interrupts.
pub const COUNT: usize = 16 + 82;
/// Exception number of the hard fault.
pub const HARD_FAULT: u8 = 3;
/// Exception number of the bus fault.
pub const BUS_FAULT: u8 = 5;
/// Exception number of the usage fault.
pub const USAGE_FAULT: u8 = 6;
/// Exception number of the supervisor call.
pub const SUPERVISOR_CALL: u8 = 11;
/// Exception number of PendSV.
pub const PEND_SV: u8 = 14;
/// Exception number of SysTick.
pub const SYS_TICK: u8 = 15;

/// The priority when nothing is active: below all others.
const IDLE: i16 = 256;
/// Always enabled: reset, NMI, hard fault, supervisor call, debug, PendSV, SysTick.
const ALWAYS: u128 = 0b1101_1000_0000_1110;

/// How long an exception waited at worst.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Waited {
    /// Cycles from its cause to the first instruction of its handler.
    pub worst: u64,
    /// How often it was served.
    pub served: u64,
}

/// Pending, enabled and active exceptions.
pub struct Exceptions {
    pub pending: u128,
    pub enabled: u128,
    pub active: u128,
    /// Requests that peripherals hold up.
    lines: u128,
    /// When each was requested.
    since: [u64; COUNT],
    priority: [u8; COUNT],
    /// Bits of a priority that say whether one handler interrupts another.
    pub group_bits: u8,
    pub primask: bool,
    pub faultmask: bool,
    pub basepri: u8,
    /// What is served now, if anything.
    pub next: Option<u8>,
    /// Something would be served if PRIMASK did not forbid it: ends sleep.
    pub wakes: bool,
    masked_since: Option<u64>,
    /// Longest time for which interrupts were masked, in cycles.
    pub longest_masked: u64,
    pub waited: [Waited; COUNT],
}

impl Default for Exceptions {
    fn default() -> Self {
        Self {
            pending: 0,
            enabled: ALWAYS,
            active: 0,
            lines: 0,
            since: [0; COUNT],
            priority: [0; COUNT],
            group_bits: 0xff,
            primask: false,
            faultmask: false,
            basepri: 0,
            next: None,
            wakes: false,
            masked_since: None,
            longest_masked: 0,
            waited: [Waited::default(); COUNT],
        }
    }
}

const fn bit(number: u8) -> u128 {
    1 << number
}

impl Exceptions {
    /// After a reset; figures are kept.
    pub fn reset(&mut self) {
        let (longest_masked, waited) = (self.longest_masked, self.waited);
        *self = Self { longest_masked, waited, ..Self::default() };
    }

    /// Request one, as software does.
    pub fn pend(&mut self, number: u8, cycle: u64) {
        if self.pending & bit(number) == 0 {
            self.since[usize::from(number)] = cycle;
        }
        self.pending |= bit(number);
        self.refresh();
    }

    /// Take requests back. What a peripheral still holds up stays.
    pub fn unpend(&mut self, which: u128) {
        self.pending &= !(which & !(self.lines & !self.active));
        self.refresh();
    }

    pub fn set_enabled(&mut self, which: u128, on: bool) {
        self.enabled = if on { self.enabled | which } else { self.enabled & !which };
        self.refresh();
    }

    /// What a peripheral requests, and since when.
    pub fn set_line(&mut self, number: u8, since: Option<u64>) {
        let Some(since) = since else {
            self.lines &= !bit(number);
            return;
        };
        self.since[usize::from(number)] = since;
        if self.lines & bit(number) == 0 {
            self.lines |= bit(number);
            self.pending |= bit(number);
            self.refresh();
        }
    }

    pub fn priority(&self, number: usize) -> u8 {
        self.priority.get(number).copied().unwrap_or(0)
    }

    /// Only the upper four bits exist.
    pub fn set_priority(&mut self, number: usize, priority: u8) {
        if let Some(place) = self.priority.get_mut(number) {
            *place = priority & 0xf0;
            self.refresh();
        }
    }

    /// Its handler begins.
    pub fn begin(&mut self, number: u8, cycle: u64) {
        self.pending &= !bit(number);
        self.active |= bit(number);
        let waited = &mut self.waited[usize::from(number)];
        waited.worst = waited.worst.max(cycle.saturating_sub(self.since[usize::from(number)]));
        waited.served += 1;
        self.refresh();
    }

    /// Its handler is done. What its peripheral still requests is pending again.
    pub fn end(&mut self, number: u8) {
        self.active &= !bit(number);
        self.pending |= self.lines & bit(number);
        if number != 2 {
            self.faultmask = false;
        }
        self.refresh();
    }

    /// After a change of PRIMASK, FAULTMASK or BASEPRI.
    pub fn masks_changed(&mut self, cycle: u64) {
        let masked = self.primask || self.faultmask || self.basepri != 0;
        match (masked, self.masked_since) {
            (true, None) => self.masked_since = Some(cycle),
            (false, Some(since)) => {
                self.masked_since = None;
                self.longest_masked = self.longest_masked.max(cycle.saturating_sub(since));
            }
            _ => {}
        }
        self.refresh();
    }

    /// Time asleep does not count as masked.
    pub fn slept(&mut self, cycles: u64) {
        self.masked_since = self.masked_since.map(|since| since + cycles);
    }

    /// Priority of what runs.
    pub fn running(&self) -> i16 {
        let primask = if self.primask { 0 } else { IDLE };
        let faultmask = if self.faultmask { -1 } else { IDLE };
        self.running_but_primask().min(primask).min(faultmask)
    }

    /// Whether this exception would interrupt what runs.
    pub fn interrupts(&self, number: u8) -> bool {
        self.enabled & bit(number) != 0 && self.group(number) < self.running()
    }

    fn running_but_primask(&self) -> i16 {
        let basepri = if self.basepri == 0 { IDLE } else { self.grouped(self.basepri) };
        numbers(self.active).map(|number| self.group(number)).fold(basepri, i16::min)
    }

    fn grouped(&self, priority: u8) -> i16 {
        i16::from(priority & self.group_bits)
    }

    fn group(&self, number: u8) -> i16 {
        match number {
            0..=3 => i16::from(number) - 4,
            _ => self.grouped(self.priority[usize::from(number)]),
        }
    }

    fn full(&self, number: u8) -> i16 {
        if number <= 3 { self.group(number) } else { self.priority[usize::from(number)].into() }
    }

    fn refresh(&mut self) {
        let waiting = self.pending & self.enabled;
        if waiting == 0 {
            (self.next, self.wakes) = (None, false);
            return;
        }
        let first = numbers(waiting).min_by_key(|&number| (self.full(number), number));
        self.next = first.filter(|&number| self.group(number) < self.running());
        let wakes = |number| self.group(number) < self.running_but_primask();
        self.wakes = first.is_some_and(wakes);
    }
}

/// The numbers of the bits that are set.
fn numbers(mut set: u128) -> impl Iterator<Item = u8> {
    std::iter::from_fn(move || {
        let number = set.trailing_zeros() as u8;
        set &= set.wrapping_sub(1);
        (number < 128).then_some(number)
    })
}
