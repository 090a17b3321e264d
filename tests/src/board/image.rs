//! Program images: ELF as the linker writes it, and Intel HEX.

use std::collections::HashMap;
use std::path::Path;
use std::{fmt, fs, io};

/// Flash of the ATmega328P.
const FLASH: usize = 0x8000;
/// Where avr-gcc puts the data space; below it lies flash.
const DATA_SPACE: u32 = 0x0080_0000;

/// Why an image was not loaded.
#[derive(Debug)]
pub enum ImageError {
    /// It could not be read.
    Unread(io::Error),
    /// It is neither an ELF file for AVR nor Intel HEX, or it is damaged.
    Malformed(&'static str),
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unread(error) => write!(f, "the image cannot be read: {error}"),
            Self::Malformed(reason) => write!(f, "the image is unusable: {reason}"),
        }
    }
}

impl std::error::Error for ImageError {}

/// Contents of the flash, and the symbols if the file has them.
#[derive(Clone, Debug)]
pub struct Image {
    /// The whole flash; what is not programmed is 0xFF.
    pub flash: Vec<u8>,
    /// One past the last programmed byte.
    pub end: usize,
    symbols: HashMap<String, u32>,
}

impl Image {
    /// Read a file, by its contents: ELF or Intel HEX.
    ///
    /// # Errors
    /// If it cannot be read, or holds no image for this board.
    pub fn read(path: &Path) -> Result<Self, ImageError> {
        let bytes = fs::read(path).map_err(ImageError::Unread)?;
        let mut image = Self { flash: vec![0xff; FLASH], end: 0, symbols: HashMap::new() };
        if bytes.starts_with(b"\x7fELF") {
            image.elf(&bytes).ok_or(ImageError::Malformed("a damaged or foreign ELF file"))??;
        } else {
            image.hex(&bytes)?;
        }
        Ok(image)
    }

    /// Value of a symbol; for a variable, its address in memory.
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        let value = *self.symbols.get(name)?;
        Some(if value >= DATA_SPACE { value - DATA_SPACE } else { value })
    }

    /// All symbols with their values, in no order.
    pub fn symbols(&self) -> impl Iterator<Item = (&str, u32)> {
        self.symbols.keys().filter_map(|name| Some((name.as_str(), self.symbol(name)?)))
    }

    fn put(&mut self, address: usize, bytes: &[u8]) -> Result<(), ImageError> {
        let end = address + bytes.len();
        let place = self.flash.get_mut(address..end);
        place.ok_or(ImageError::Malformed("it does not fit into 32 KiB"))?.copy_from_slice(bytes);
        self.end = self.end.max(end);
        Ok(())
    }

    /// Segments by their load addresses; those of EEPROM and fuses lie above the data space.
    fn elf(&mut self, bytes: &[u8]) -> Option<Result<(), ImageError>> {
        const AVR: u16 = 83;
        if bytes.get(4..6)? != [1, 1] || half(bytes, 18)? != AVR {
            return Some(Err(ImageError::Malformed("an ELF file for another processor")));
        }
        let (start, size, count) = (word(bytes, 28)?, half(bytes, 42)?, half(bytes, 44)?);
        for at in (0..usize::from(count)).map(|i| start as usize + i * usize::from(size)) {
            let (kind, offset) = (word(bytes, at)?, word(bytes, at + 4)? as usize);
            let (address, length) = (word(bytes, at + 12)?, word(bytes, at + 16)? as usize);
            if kind != 1 || address >= DATA_SPACE || length == 0 {
                continue;
            }
            if let Err(error) = self.put(address as usize, bytes.get(offset..offset + length)?) {
                return Some(Err(error));
            }
        }
        self.elf_symbols(bytes)?;
        Some(Ok(()))
    }

    fn elf_symbols(&mut self, bytes: &[u8]) -> Option<()> {
        const SYMBOLS: u32 = 2;
        let (start, size, count) = (word(bytes, 32)? as usize, half(bytes, 46)?, half(bytes, 48)?);
        let section = |i: usize| start + i * usize::from(size);
        for at in (0..usize::from(count)).map(section) {
            if word(bytes, at + 4)? != SYMBOLS {
                continue;
            }
            let (offset, length) = (word(bytes, at + 16)? as usize, word(bytes, at + 20)? as usize);
            let names = word(bytes, section(word(bytes, at + 24)? as usize) + 16)? as usize;
            for entry in (offset..offset + length).step_by(16) {
                let name = names + word(bytes, entry)? as usize;
                let name = bytes.get(name..)?.split(|&byte| byte == 0).next()?;
                let name = String::from_utf8_lossy(name).into_owned();
                let _ = self.symbols.insert(name, word(bytes, entry + 4)?);
            }
        }
        Some(())
    }

    fn hex(&mut self, bytes: &[u8]) -> Result<(), ImageError> {
        const BAD: ImageError = ImageError::Malformed("neither ELF nor Intel HEX");
        let text = std::str::from_utf8(bytes).map_err(|_| BAD)?;
        let mut base = 0;
        for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
            let record = record(line).ok_or(BAD)?;
            let address = usize::from(u16::from_be_bytes([record[1], record[2]]));
            let data = &record[4..record.len() - 1];
            match (record[3], data) {
                (0, data) => self.put(base + address, data)?,
                (1, _) => return Ok(()),
                (2, &[high, low]) => base = usize::from(u16::from_be_bytes([high, low])) << 4,
                (4, &[high, low]) => base = usize::from(u16::from_be_bytes([high, low])) << 16,
                (3 | 5, _) => {}
                _ => return Err(BAD),
            }
        }
        Err(ImageError::Malformed("the Intel HEX file has no end record"))
    }
}

/// Bytes of one record of Intel HEX, if its length and check sum are right.
fn record(line: &str) -> Option<Vec<u8>> {
    let digits = line.strip_prefix(':')?.as_bytes();
    let pair = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let bytes = digits.chunks(2).map(pair).collect::<Option<Vec<u8>>>()?;
    let sum = bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    (bytes.len() >= 5 && bytes.len() == usize::from(bytes[0]) + 5 && sum == 0).then_some(bytes)
}

fn half(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}
