//! A clock of many hours from a counter of 16 or 32 bits.

/// Ticks since the start: `overflows`·2¹⁶ + `counter`.
///
/// `overflow_pending` says that the counter has wrapped and its interrupt has not yet been served,
/// read *after* `counter`, both with interrupts disabled. A pending overflow counts only if the
/// counter was read after the wrap, which its small value tells: the wrap and the two reads lie
/// within a few ticks. 32 bits of overflows are 203 days at 16 MHz.
#[must_use]
pub const fn extend(overflows: u32, counter: u16, overflow_pending: bool) -> u64 {
    let wrapped = overflow_pending && counter < 0x8000;
    let overflows = overflows as u64 + wrapped as u64;
    (overflows << 16) | counter as u64
}

/// Ticks since the start, from a 32-bit counter that is read at least once in each of its wraps.
#[derive(Debug, Clone, Copy, Default)]
pub struct Extended {
    wraps: u32,
    last: u32,
}

impl Extended {
    /// Nothing counted yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { wraps: 0, last: 0 }
    }

    /// wraps·2³² + `counter`, which was read just now. 32 bits of wraps are 6,900 years at 84 MHz.
    pub fn ticks(&mut self, counter: u32) -> u64 {
        if counter < self.last {
            self.wraps = self.wraps.wrapping_add(1);
        }
        self.last = counter;
        (self.wraps as u64) << 32 | counter as u64
    }
}

#[cfg(test)]
mod tests {
    use super::{Extended, extend};

    #[test]
    fn wraps_of_a_32_bit_counter_are_counted() {
        let mut clock = Extended::new();
        assert_eq!(clock.ticks(7), 7);
        assert_eq!(clock.ticks(u32::MAX), u32::MAX.into());
        assert_eq!(clock.ticks(3), (1 << 32) + 3);
        assert_eq!(clock.ticks(3), (1 << 32) + 3);
        assert_eq!(clock.ticks(2), (2 << 32) + 2);
    }

    #[test]
    fn time_goes_on_across_a_wrap() {
        // The counter wraps between the reads, before them, or its interrupt has been served.
        assert_eq!(extend(7, 0xFFFF, false), 0x7_FFFF);
        assert_eq!(extend(7, 0xFFFF, true), 0x7_FFFF);
        assert_eq!(extend(7, 0x0003, true), 0x8_0003);
        assert_eq!(extend(8, 0x0003, false), 0x8_0003);
    }

    #[test]
    fn hours_are_counted() {
        // Two hours at 16 MHz, then 203 days.
        assert_eq!(extend(1_757_812, 32_768, false), 115_200_000_000);
        assert_eq!(extend(u32::MAX, u16::MAX, false), (1 << 48) - 1);
        assert_eq!(extend(u32::MAX, 0, true), 1 << 48);
    }
}
