//! Writing the firmware into the board: the image, the tool, and whether it arrived.
//!
//! | board | image | tool |
//! |---|---|---|
//! | Arduino Uno | Intel HEX | avrdude, by the boot loader at the serial port |
//! | STM32F405 | bytes from 0x08000000 | dfu-util, by the boot loader in ROM at the USB |

mod tool;

use super::emulated::built;
use super::words;
use crate::error::{Error, Result};
use phasewalk_firmware::compiled::Hasher;
use phasewalk_firmware::message::Hello;
use std::path::{Path, PathBuf};

/// What the boot loader leaves of the Uno's 32 KiB.
const ROOM: usize = 0x7E00;

/// Program memory of the STM32F405: where it begins, and its size.
const F405_FLASH: usize = 0x0800_0000;
const F405_ROOM: usize = 1 << 20;

/// What flash memory holds where nothing was written.
const ERASED: u8 = 0xFF;

/// The board that is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// Arduino Uno.
    Uno,
    /// STM32F405.
    F405,
}

/// An image as it will lie in the program memory, from its beginning.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// For which board.
    pub target: Target,
    /// The file it came from.
    pub path: PathBuf,
    /// Its bytes; gaps are 0xFF, as erased memory.
    pub bytes: Vec<u8>,
}

impl Image {
    /// Read an image, Intel HEX for the Uno and plain bytes for the STM32F405; without a name, the
    /// one that was built last.
    ///
    /// # Errors
    /// When it cannot be found or read, or is damaged or too large.
    pub fn read(target: Target, path: Option<&Path>) -> Result<Self> {
        let name = match target {
            Target::Uno => "uno.hex",
            Target::F405 => "f405.bin",
        };
        let path = path.map_or_else(|| built(name), |path| Ok(path.to_owned()))?;
        let file = std::fs::read(&path)
            .map_err(|error| Error::file(&path, format!("cannot be read: {error}")))?;
        let bytes = match target {
            Target::Uno => parse(&String::from_utf8_lossy(&file)),
            Target::F405 => plain(file),
        };
        let bytes = bytes.map_err(|what| Error::file(&path, what))?;
        Ok(Self { target, path, bytes })
    }

    /// CRC-32 of all bytes.
    #[must_use]
    pub fn hash(&self) -> u32 {
        self.hash_over(self.bytes.len())
    }

    /// CRC-32 of the first `length` bytes of the program memory, erased after the image's end.
    #[must_use]
    pub fn hash_over(&self, length: usize) -> u32 {
        let mut hasher = Hasher::new();
        let within = self.bytes.len().min(length);
        hasher.update(self.bytes.get(..within).unwrap_or_default());
        (within..length).for_each(|_| hasher.update(&[ERASED]));
        hasher.finish()
    }

    /// Whether the board says that this is the image in its program memory.
    ///
    /// # Errors
    /// When it is another one, or the board does not look at the whole of it.
    pub fn compare(&self, hello: &Hello) -> Result<()> {
        let covered = hello.image_bytes as usize;
        if covered < self.bytes.len() {
            return Err(Error::failed(format!(
                "the board verifies {covered} bytes of its program memory, the image has {}: the \
                 firmware on it is another one",
                self.bytes.len()
            )));
        }
        let ours = self.hash_over(covered);
        if ours == hello.image {
            return Ok(());
        }
        Err(Error::failed(format!(
            "the board's program memory has the hash {}, the image {}: write it again, with \
             another cable",
            words::hex(hello.image),
            words::hex(ours)
        )))
    }
}

/// The bytes themselves, if they can be a program of the STM32F405.
fn plain(bytes: Vec<u8>) -> std::result::Result<Vec<u8>, String> {
    if bytes.len() > F405_ROOM {
        return Err(format!("{} bytes: the STM32F405 has room for {F405_ROOM}", bytes.len()));
    }
    // It begins with the stack's end and the address of the first instruction.
    let first = bytes.get(4..8).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
    let flash = F405_FLASH..F405_FLASH + bytes.len();
    if first.is_some_and(|first| flash.contains(&(first as usize))) {
        return Ok(bytes);
    }
    Err("no image of the STM32F405: give the plain bytes that lie from 0x08000000 on (f405.bin)"
        .to_owned())
}

/// The bytes of an Intel HEX file.
fn parse(text: &str) -> std::result::Result<Vec<u8>, String> {
    let (mut image, mut base, mut ended) = (Vec::new(), 0_usize, false);
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let number = index + 1;
        let record = Hex::parse(line.trim()).map_err(|what| format!("line {number}: {what}"))?;
        if ended {
            return Err(format!("line {number}: after the end of the image"));
        }
        match record.kind {
            0 => place(&mut image, base + record.address, record.data)
                .map_err(|what| format!("line {number}: {what}"))?,
            1 => ended = true,
            2 => base = record.number() << 4,
            4 => base = record.number() << 16,
            // Where a program starts: an AVR starts at 0.
            3 | 5 => {}
            other => return Err(format!("line {number}: unknown record {other}")),
        }
    }
    match (ended, image.is_empty()) {
        (false, _) => Err("the image's end is missing: the file was cut off".to_owned()),
        (true, true) => Err("the image is empty".to_owned()),
        (true, false) => Ok(image),
    }
}

fn place(image: &mut Vec<u8>, at: usize, data: Vec<u8>) -> std::result::Result<(), String> {
    let end = at + data.len();
    if end > ROOM {
        return Err(format!("address {end:#x}: the Uno has room up to {ROOM:#x} only"));
    }
    if image.len() < end {
        image.resize(end, ERASED);
    }
    image.splice(at..end, data);
    Ok(())
}

/// One line of an Intel HEX file.
struct Hex {
    address: usize,
    kind: u8,
    data: Vec<u8>,
}

impl Hex {
    fn parse(line: &str) -> std::result::Result<Self, String> {
        let digits = line.strip_prefix(':').ok_or("no Intel HEX record")?;
        let bytes = pairs(digits).ok_or("not pairs of hexadecimal digits")?;
        let [length, high, low, kind, rest @ ..] = bytes.as_slice() else {
            return Err("too short".to_owned());
        };
        let (_, data) = rest.split_last().ok_or("too short")?;
        if data.len() != usize::from(*length) {
            return Err("the length is wrong: the file is damaged".to_owned());
        }
        if bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)) != 0 {
            return Err("the checksum is wrong: the file is damaged".to_owned());
        }
        let address = usize::from(u16::from_be_bytes([*high, *low]));
        Ok(Self { address, kind: *kind, data: data.to_vec() })
    }

    /// The data as a number, high byte first.
    fn number(&self) -> usize {
        self.data.iter().take(2).fold(0, |number, byte| (number << 8) | usize::from(*byte))
    }
}

fn pairs(digits: &str) -> Option<Vec<u8>> {
    let bytes = digits.as_bytes();
    if !bytes.len().is_multiple_of(2) {
        return None;
    }
    let value = |digit: u8| (digit as char).to_digit(16);
    let pair = |pair: &[u8]| {
        let [high, low] = pair else { return None };
        u8::try_from(value(*high)? << 4 | value(*low)?).ok()
    };
    bytes.chunks(2).map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasewalk_firmware::compiled::hash;

    #[test]
    fn an_image_with_a_gap_is_read_and_hashed() {
        // Data at 0 and at 6 (by the checksum's rule), the end.
        let text = ":0400000001020304F2\n:02000600AABB93\n:00000001FF\n";
        let bytes = parse(text).unwrap();
        assert_eq!(bytes, [1, 2, 3, 4, 0xFF, 0xFF, 0xAA, 0xBB]);
        let path = PathBuf::from("a.hex");
        let image = Image { target: Target::Uno, path, bytes: bytes.clone() };
        assert_eq!(image.hash(), hash(&bytes));
        let padded = [&bytes[..], &[0xFF, 0xFF]].concat();
        assert_eq!(image.hash_over(10), hash(&padded));
    }

    #[test]
    fn damage_is_found() {
        let end = ":00000001FF\n";
        for (text, words) in [
            (String::new(), "cut off"),
            (end.to_owned(), "empty"),
            (format!(":0400000001020304F3\n{end}"), "checksum"),
            (format!(":0500000001020304F1\n{end}"), "length"),
            (format!("hello\n{end}"), "no Intel HEX"),
            (format!(":04x\n{end}"), "digits"),
            (format!(":02000004007F7B\n:0100000001FE\n{end}"), "room"),
            (format!("{end}:0100000001FE\n"), "after the end"),
        ] {
            let found = parse(&text).unwrap_err();
            assert!(found.contains(words), "{text}: {found}");
        }
    }

    #[test]
    fn a_program_of_the_f405_starts_in_its_flash() {
        let image = |first: u32| {
            let words = [0x2002_0000_u32, first].map(u32::to_le_bytes).concat();
            plain([words, vec![0; 8]].concat())
        };
        assert_eq!(image(0x0800_0009).unwrap().len(), 16);
        for wrong in [0, 0x0800_0010, 0x2000_0001] {
            assert!(image(wrong).unwrap_err().contains("f405.bin"));
        }
        assert!(plain(b"\x7fELF".to_vec()).is_err());
        assert!(plain(vec![0; F405_ROOM + 1]).unwrap_err().contains("room"));
    }
}
