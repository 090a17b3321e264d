//! Large pages for large buffers.
//!
//! `unsafe` is here for one reason: the system is asked through a function of C.

use std::ffi::c_void;

/// Smaller buffers gain nothing: of pages of 4 KiB a processor remembers some 2,000.
const LARGE: usize = 8 << 20;
/// The smallest page there is: requests begin at one.
const PAGE: usize = 4096;

/// Ask the system to put what lies between the vector's begin and its capacity on pages of 2 MiB. It may decline, and
/// then all is as before, but slower: where samples of 2,415 pairs are read side by side, their pages are looked up
/// again and again.
pub(super) fn advise<T>(buffer: &mut Vec<T>) {
    let bytes = buffer.capacity().saturating_mul(size_of::<T>());
    if bytes < LARGE {
        return;
    }
    let begin = buffer.as_mut_ptr().cast::<u8>();
    let gap = begin.align_offset(PAGE);
    let whole = (bytes - gap) / PAGE * PAGE;
    // SAFETY: gap < PAGE and whole bytes behind it lie in the vector's own allocation. The advice changes neither what
    // they hold nor who may use them.
    let _ = unsafe { libc::madvise(begin.add(gap).cast::<c_void>(), whole, libc::MADV_HUGEPAGE) };
}
