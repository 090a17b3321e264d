//! Memory: the stack's canary, the program memory's hash.

use phasewalk_firmware::compiled::Hasher;

unsafe extern "C" {
    /// End of the variables; the stack grows down towards it. From the linker.
    static mut _end: u8;
    /// End of the image in program memory. From the linker.
    static __data_load_end: u8;
}

/// What the canary looks like, and how long it is.
const CANARY: u8 = 0xA5;
const CANARY_BYTES: usize = 8;

/// Paint the canary between variables and stack.
pub fn paint_stack() {
    for offset in 0..CANARY_BYTES {
        // SAFETY: the bytes after the variables are free; the stack is far above at the start.
        unsafe { core::ptr::write_volatile((&raw mut _end).add(offset), CANARY) };
    }
}

/// Whether the stack has left the canary alone.
pub fn stack_intact() -> bool {
    (0..CANARY_BYTES).all(|offset| {
        // SAFETY: as above.
        unsafe { core::ptr::read_volatile((&raw const _end).add(offset)) == CANARY }
    })
}

/// Bytes of the image in program memory.
pub fn image_bytes() -> u16 {
    (&raw const __data_load_end).addr() as u16
}

/// Hash of the image as the processor reads it.
pub fn image_hash() -> u32 {
    let mut hasher = Hasher::new();
    for address in 0..image_bytes() {
        if address % 1024 == 0 {
            avr_device::asm::wdr();
        }
        hasher.update(&[program_byte(address)]);
    }
    hasher.finish()
}

fn program_byte(address: u16) -> u8 {
    let byte: u8;
    // SAFETY: reads program memory; any address is allowed.
    unsafe {
        core::arch::asm!(
            "lpm {byte}, Z",
            byte = out(reg) byte,
            in("Z") address,
            options(pure, readonly, nostack, preserves_flags)
        );
    }
    byte
}
