//! Memory: the stack's end, the program memory's hash.

use phasewalk_firmware::compiled::Hasher;

unsafe extern "C" {
    /// Lowest address of the stack; below it there is no memory. From memory.x.
    static _stack_end: u32;
    /// Where the image begins. From the linker.
    static __vector_table: u8;
    /// Where the variables' first values lie in program memory. From the linker.
    static __sidata: u8;
    /// The variables that have them. From the linker.
    static __sdata: u8;
    /// Their end. From the linker.
    static __edata: u8;
}

/// What the stack is painted with before `main`.
const PAINT: u32 = 0xCCCC_CCCC;

/// Words at the stack's end that must still be painted.
const CANARY_WORDS: usize = 8;

/// Whether the stack has left its last words alone.
pub fn stack_intact() -> bool {
    (0..CANARY_WORDS).all(|word| {
        // SAFETY: these words are memory, and no variable's.
        unsafe { core::ptr::read_volatile((&raw const _stack_end).add(word)) == PAINT }
    })
}

/// Bytes of the image in program memory.
pub fn image_bytes() -> u32 {
    let variables = (&raw const __edata).addr() - (&raw const __sdata).addr();
    ((&raw const __sidata).addr() + variables - (&raw const __vector_table).addr()) as u32
}

/// Hash of the image as the processor reads it.
pub fn image_hash() -> u32 {
    let mut hasher = Hasher::new();
    for offset in 0..image_bytes() as usize {
        if offset.is_multiple_of(1024) {
            crate::chip::feed_watchdog();
        }
        // SAFETY: within the image.
        hasher.update(&[unsafe {
            core::ptr::read_volatile((&raw const __vector_table).add(offset))
        }]);
    }
    hasher.finish()
}
