//! defmt's logger: frames into memory, from where a debug probe takes them (SEGGER's RTT), and so does
//! an emulator's user.
//!
//! It is our own because the ready-made one can panic. It never waits: what nobody takes in time is
//! written over.

use core::cell::UnsafeCell;
use core::ptr::{addr_of_mut, write_volatile};
use core::sync::atomic::{AtomicU8, Ordering, compiler_fence};

/// Bytes that wait to be taken: those of a whole run as the paper has it.
const BYTES: usize = 16_384;

/// What a probe looks for, with one channel from and none to the board.
#[repr(C)]
struct ControlBlock {
    /// "SEGGER RTT"
    id: [u8; 16],
    channels_up: u32,
    channels_down: u32,
    name: *const u8,
    bytes: *mut u8,
    size: u32,
    /// Where the next byte goes; ours.
    write: u32,
    /// Where the next byte is taken; the probe's.
    read: u32,
    flags: u32,
}

/// The channel and its encoder, used by who has begun a frame.
struct Channel {
    encoder: UnsafeCell<defmt::Encoder>,
    /// Where in the buffer the next byte goes.
    write: UnsafeCell<usize>,
    /// Frames begun and not ended. Who interrupts a frame ends before it goes on, so the first one is
    /// written and those within it are dropped.
    begun: AtomicU8,
}

// SAFETY: cells are used by the first frame begun only, see `begun`.
unsafe impl Sync for Channel {}

static CHANNEL: Channel = Channel {
    encoder: UnsafeCell::new(defmt::Encoder::new()),
    write: UnsafeCell::new(0),
    begun: AtomicU8::new(0),
};

static mut BUFFER: [u8; BYTES] = [0; BYTES];

// Debug probes and tests find it by this name.
#[unsafe(no_mangle)]
static mut _SEGGER_RTT: ControlBlock = ControlBlock {
    id: *b"SEGGER RTT\0\0\0\0\0\0",
    channels_up: 1,
    channels_down: 0,
    name: c"defmt".as_ptr().cast(),
    bytes: addr_of_mut!(BUFFER).cast(),
    size: BYTES as u32,
    write: 0,
    read: 0,
    flags: 0,
};

fn put(bytes: &[u8]) {
    // SAFETY: called within the first frame begun; `BUFFER` is written here only.
    let (write, buffer) = unsafe { (&mut *CHANNEL.write.get(), addr_of_mut!(BUFFER).cast::<u8>()) };
    for &byte in bytes {
        // SAFETY: `write` is below `BYTES`.
        unsafe { write_volatile(buffer.add(*write), byte) };
        *write = (*write + 1) % BYTES;
    }
}

#[defmt::global_logger]
struct Logger;

// SAFETY: frames are not mixed, see `begun`. Interrupts are never disabled: edges would be late.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        if CHANNEL.begun.fetch_add(1, Ordering::SeqCst) == 0 {
            // SAFETY: this is the first frame begun.
            unsafe { (*CHANNEL.encoder.get()).start_frame(put) };
        }
    }

    unsafe fn flush() {}

    unsafe fn release() {
        if CHANNEL.begun.load(Ordering::SeqCst) == 1 {
            // SAFETY: as above; the bytes are there before the probe is told.
            unsafe {
                (*CHANNEL.encoder.get()).end_frame(put);
                compiler_fence(Ordering::SeqCst);
                write_volatile(addr_of_mut!(_SEGGER_RTT.write), *CHANNEL.write.get() as u32);
            }
        }
        CHANNEL.begun.fetch_sub(1, Ordering::SeqCst);
    }

    unsafe fn write(bytes: &[u8]) {
        if CHANNEL.begun.load(Ordering::SeqCst) == 1 {
            // SAFETY: as above.
            unsafe { (*CHANNEL.encoder.get()).write(bytes, put) };
        }
    }
}

defmt::timestamp!("{=u64}", crate::near::NEAR.with(|near| near.now()));
