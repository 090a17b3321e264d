//! Variables shared between passes, interrupts and the solver.

use core::cell::UnsafeCell;
use cortex_m::interrupt::{CriticalSection, free};

/// A variable that can be reached with interrupts disabled only.
pub struct Shared<T>(UnsafeCell<T>);

// SAFETY: one core; `with` disables interrupts, so no two accesses overlap.
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Shared<T> {
    pub const fn new(value: T) -> Self {
        Self(UnsafeCell::new(value))
    }

    /// Use it with interrupts disabled. `use_it` must not reach for the same variable again: none here
    /// does, since each of our functions that calls this is a leaf.
    #[inline(always)]
    pub fn with<R>(&self, use_it: impl FnOnce(&mut T) -> R) -> R {
        free(|_: &CriticalSection| {
            // SAFETY: interrupts are disabled and calls are not nested.
            use_it(unsafe { &mut *self.0.get() })
        })
    }
}
