//! Variables shared between main loop and interrupts.

use avr_device::interrupt::CriticalSection;
use core::cell::UnsafeCell;

/// A variable that can be reached with interrupts disabled only.
pub struct Shared<T>(UnsafeCell<T>);

// SAFETY: one core; `with` asks for proof that interrupts are disabled, so no two accesses overlap.
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Shared<T> {
    pub const fn new(value: T) -> Self {
        Self(UnsafeCell::new(value))
    }

    /// Use it. `use_it` must not reach for the same variable again: none here does, since each of
    /// our functions that calls this is a leaf.
    #[inline(always)]
    pub fn with<R>(
        &self,
        _interrupts_off: CriticalSection<'_>,
        use_it: impl FnOnce(&mut T) -> R,
    ) -> R {
        // SAFETY: interrupts are disabled and calls are not nested.
        use_it(unsafe { &mut *self.0.get() })
    }
}

/// Within an interrupt, interrupts are disabled.
///
/// # Safety
/// Call it in an interrupt only.
#[inline(always)]
pub unsafe fn interrupt<'a>() -> CriticalSection<'a> {
    // SAFETY: the hardware disables interrupts on entry and ours do not enable them.
    unsafe { CriticalSection::new() }
}
