//! A clock of many hours from a 16-bit counter and the interrupts of its overflow.

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

#[cfg(test)]
mod tests {
    use super::extend;

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
