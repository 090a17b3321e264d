//! Small programs in machine code, the assembly beside it, that show what the emulated chip does.

mod exceptions;
mod line;
mod outputs;
mod watchdog;

use super::{F405, Image};

/// Where programs begin; the vectors come before them.
const START: u32 = 0x0800_0200;

/// A board with a program, and handlers for some exceptions at offsets from its start.
fn board(code: &[u8], handlers: &[(usize, u32)]) -> F405 {
    let mut image = vec![0; 0x200];
    let mut vector = |number: usize, word: u32| {
        image[4 * number..4 * number + 4].copy_from_slice(&word.to_le_bytes());
    };
    vector(0, 0x2001_0000);
    vector(1, START + 1);
    for &(number, offset) in handlers {
        vector(number, START + offset + 1);
    }
    image.extend(code);
    let mut board = F405::flashed(Image::raw(&image));
    // Their variables lie at the start of memory.
    for at in 0..32 {
        board.poke(0x2000_0000 + at, 0);
    }
    board
}

/// A word of the program's variables.
fn variable(board: &F405, at: u32) -> u32 {
    board.peek_u32(0x2000_0000 + 4 * at)
}
