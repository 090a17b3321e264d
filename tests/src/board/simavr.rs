//! The calls into C: the only unsafe code of the tests.
//!
//! [`Core`] owns a `struct board` of `shim/board.h`. Pins and vectors are enumerations whose numbers
//! are in the range the C side expects; every pointer it gives is copied from before the next call.

#![allow(unsafe_code)]

use super::pin::{Pin, PinEdge};
use std::ffi::{CStr, c_char, c_int, c_uint};
use std::ptr::NonNull;

/// `struct board`, of which only the address is known here.
#[repr(C)]
struct Board {
    _opaque: [u8; 0],
}

/// `struct edge`.
#[repr(C)]
struct RawEdge {
    cycle: u64,
    pin: u8,
    level: u8,
}

/// `struct byte_sent`.
#[repr(C)]
struct RawByte {
    cycle: u64,
    value: u8,
}

unsafe extern "C" {
    fn board_new(flash: *const u8, size: usize) -> *mut Board;
    fn board_free(board: *mut Board);
    fn board_reset(board: *mut Board, cause: u8);
    fn board_run(board: *mut Board, until: u64) -> bool;
    fn board_step(board: *mut Board) -> bool;
    fn board_cycle(board: *const Board) -> u64;
    fn board_alive(board: *const Board) -> bool;
    fn board_asleep(board: *const Board) -> bool;
    fn board_resets(board: *const Board) -> u64;
    fn board_message(board: *const Board) -> *const c_char;
    fn board_pc(board: *const Board) -> u32;
    fn board_set_pc(board: *mut Board, pc: u32);
    fn board_depth(board: *const Board) -> c_int;
    fn board_interrupts_on(board: *const Board) -> bool;
    fn board_set_interrupts(board: *mut Board, on: bool);
    fn board_stack_low(board: *const Board) -> u16;
    fn board_latency(board: *const Board, vector: c_uint) -> u64;
    fn board_entries(board: *const Board, vector: c_uint) -> u64;
    fn board_forget_latency(board: *mut Board);
    fn board_set_watchdog_hz(board: *mut Board, hz: f64);
    fn board_peek(board: *mut Board, address: u16) -> u8;
    fn board_poke(board: *mut Board, address: u16, value: u8);
    fn board_flash(board: *const Board, address: u32) -> u8;
    fn board_set_flash(board: *mut Board, address: u32, value: u8);
    fn board_drive(board: *mut Board, pin: c_uint, level: c_int);
    fn board_drive_at(board: *mut Board, cycle: u64, pin: c_uint, level: c_int);
    fn board_stick(board: *mut Board, pin: c_uint, level: c_int);
    fn board_connect(board: *mut Board, from: c_int, to: c_uint);
    fn board_level(board: *const Board, pin: c_uint) -> bool;
    fn board_edges(board: *const Board, edges: *mut *const RawEdge) -> usize;
    fn board_forget_edges(board: *mut Board);
    fn board_send(board: *mut Board, bytes: *const u8, count: usize);
    fn board_unsent(board: *const Board) -> usize;
    fn board_overruns(board: *const Board) -> u64;
    fn board_cycles_per_byte(board: *const Board) -> u64;
    fn board_sent(board: *const Board, sent: *mut *const RawByte) -> usize;
    fn board_forget_sent(board: *mut Board);
}

/// A board in C.
pub(super) struct Core(NonNull<Board>);

// SAFETY: a board has no thread of its own, shares nothing with other boards but simavr's logger,
// which is set to the same function every time, and is reached through its owner alone.
unsafe impl Send for Core {}

impl Drop for Core {
    fn drop(&mut self) {
        // SAFETY: the pointer came from `board_new` and is not used again.
        unsafe { board_free(self.0.as_ptr()) }
    }
}

/// A level as C has it: 0, 1, or -1 for none.
fn number(level: Option<bool>) -> c_int {
    level.map_or(-1, c_int::from)
}

impl Core {
    /// A board with this flash, at power-on.
    pub(super) fn new(flash: &[u8]) -> Option<Self> {
        // SAFETY: the slice is read during the call only.
        NonNull::new(unsafe { board_new(flash.as_ptr(), flash.len()) }).map(Self)
    }

    /// The edges since the last call.
    pub(super) fn take_edges(&mut self, into: &mut Vec<PinEdge>) {
        let mut raw = std::ptr::null();
        // SAFETY: the board is alive; it stores a pointer to as many items as it returns, which stay
        // until the next call; a null pointer comes with no items.
        let raw = unsafe {
            let count = board_edges(self.0.as_ptr(), &raw mut raw);
            if count == 0 { &[] } else { std::slice::from_raw_parts(raw, count) }
        };
        into.extend(raw.iter().map(|edge| PinEdge {
            cycle: edge.cycle,
            pin: Pin::ALL[usize::from(edge.pin)],
            level: edge.level != 0,
        }));
        // SAFETY: the board is alive, and the items are no longer used.
        unsafe { board_forget_edges(self.0.as_ptr()) }
    }

    /// The bytes sent since the last call, with the cycles at which they ended.
    pub(super) fn take_sent(&mut self) -> Vec<(u64, u8)> {
        let mut raw = std::ptr::null();
        // SAFETY: as in `take_edges`.
        let raw = unsafe {
            let count = board_sent(self.0.as_ptr(), &raw mut raw);
            if count == 0 { &[] } else { std::slice::from_raw_parts(raw, count) }
        };
        let sent = raw.iter().map(|byte| (byte.cycle, byte.value)).collect();
        // SAFETY: the board is alive, and the items are no longer used.
        unsafe { board_forget_sent(self.0.as_ptr()) };
        sent
    }

    /// Queue bytes on the serial line.
    pub(super) fn send(&mut self, bytes: &[u8]) {
        // SAFETY: the board is alive; the slice is read during the call only.
        unsafe { board_send(self.0.as_ptr(), bytes.as_ptr(), bytes.len()) }
    }

    /// The first complaint of simavr, or nothing, without its colours.
    pub(super) fn message(&self) -> String {
        // SAFETY: the board is alive and its message is a string that ends.
        let text = unsafe { CStr::from_ptr(board_message(self.0.as_ptr())) }.to_string_lossy();
        let mut parts = text.split('\x1b');
        let first = parts.next().unwrap_or_default();
        let rest = parts.map(|part| part.split_once('m').map_or(part, |(_, after)| after));
        std::iter::once(first).chain(rest).collect::<String>().trim().to_owned()
    }
}

/// Methods that pass plain numbers on.
macro_rules! pass {
    ($($(#[$doc:meta])* $name:ident = $function:ident($($argument:ident: $kind:ty => $value:expr),*) $(-> $result:ty)?;)*) => {
        impl Core {
            $($(#[$doc])*
            pub(super) fn $name(&mut self $(, $argument: $kind)*) $(-> $result)? {
                // SAFETY: the board is alive, and the arguments are numbers that C accepts: pins and
                // vectors come from enumerations, addresses are checked there.
                unsafe { $function(self.0.as_ptr() $(, $value)*) }
            })*
        }
    };
}

/// Questions that change nothing.
macro_rules! ask {
    ($($(#[$doc:meta])* $name:ident = $function:ident($($argument:ident: $kind:ty => $value:expr),*) -> $result:ty;)*) => {
        impl Core {
            $($(#[$doc])*
            pub(super) fn $name(&self $(, $argument: $kind)*) -> $result {
                // SAFETY: as above, and the board is not changed.
                unsafe { $function(self.0.as_ptr() $(, $value)*) }
            })*
        }
    };
}

pass! {
    /// Reset, with the bit of MCUSR.
    reset = board_reset(cause: u8 => cause);
    /// Run to a cycle; whether the core is alive.
    run = board_run(until: u64 => until) -> bool;
    /// One instruction or one interrupt entry; whether the core is alive.
    step = board_step() -> bool;
    /// Go on elsewhere.
    set_pc = board_set_pc(pc: u32 => pc);
    /// Set or clear I.
    set_interrupts = board_set_interrupts(on: bool => on);
    /// Start measuring latencies anew.
    forget_latency = board_forget_latency();
    /// The watchdog's own clock.
    set_watchdog_hz = board_set_watchdog_hz(hz: f64 => hz);
    /// A byte of registers or memory.
    peek = board_peek(address: u16 => address) -> u8;
    /// Overwrite it.
    poke = board_poke(address: u16 => address, value: u8 => value);
    /// Overwrite a byte of flash.
    set_flash = board_set_flash(address: u32 => address, value: u8 => value);
    /// Drive a wire from outside, or no longer.
    drive = board_drive(pin: Pin => pin as c_uint, level: Option<bool> => number(level));
    /// The same, at a cycle to come.
    drive_at = board_drive_at(cycle: u64 => cycle, pin: Pin => pin as c_uint, level: Option<bool> => number(level));
    /// Hold a wire at a level, or no longer.
    stick = board_stick(pin: Pin => pin as c_uint, level: Option<bool> => number(level));
    /// Drive a wire from another pin, or no longer.
    connect = board_connect(from: Option<Pin> => from.map_or(-1, |pin| pin as c_int), to: Pin => to as c_uint);
}

ask! {
    /// Cycles since power-on.
    cycle = board_cycle() -> u64;
    /// Whether instructions can be executed.
    alive = board_alive() -> bool;
    /// Whether it sleeps.
    asleep = board_asleep() -> bool;
    /// Resets since power-on.
    resets = board_resets() -> u64;
    /// Program counter, in bytes.
    pc = board_pc() -> u32;
    /// Interrupts being served.
    depth = board_depth() -> c_int;
    /// Whether I is set.
    interrupts_on = board_interrupts_on() -> bool;
    /// Lowest stack pointer.
    stack_low = board_stack_low() -> u16;
    /// Worst latency of a vector.
    latency = board_latency(vector: super::Vector => vector as c_uint) -> u64;
    /// How often it was served.
    entries = board_entries(vector: super::Vector => vector as c_uint) -> u64;
    /// A byte of flash.
    flash = board_flash(address: u32 => address) -> u8;
    /// Level of a wire.
    level = board_level(pin: Pin => pin as c_uint) -> bool;
    /// Bytes that wait on the line.
    unsent = board_unsent() -> usize;
    /// Bytes that the receiver lost.
    overruns = board_overruns() -> u64;
    /// Length of a byte on the line.
    cycles_per_byte = board_cycles_per_byte() -> u64;
}
