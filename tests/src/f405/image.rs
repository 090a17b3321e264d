//! Program images: ELF as the linker writes it.

use super::chip::{FLASH_SIZE, FLASH_START};
use object::elf::{EM_ARM, PT_LOAD};
use object::read::elf::{ElfFile32, FileHeader, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol};
use std::collections::HashMap;
use std::path::Path;
use std::{fmt, fs, io};

/// Why an image was not loaded.
#[derive(Debug)]
pub enum ImageError {
    /// It could not be read.
    Unread(io::Error),
    /// It is no ELF file for this chip, or it is damaged.
    Malformed(String),
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

impl From<object::read::Error> for ImageError {
    fn from(error: object::read::Error) -> Self {
        Self::Malformed(error.to_string())
    }
}

/// Contents of the flash, and the symbols.
#[derive(Clone, Debug)]
pub struct Image {
    /// The whole flash; what is not programmed is 0xFF.
    pub flash: Vec<u8>,
    /// One past the last programmed byte.
    pub end: usize,
    symbols: HashMap<String, u32>,
}

impl Image {
    /// Read an ELF file.
    ///
    /// # Errors
    /// If it cannot be read, or holds no image for this chip.
    pub fn read(path: &Path) -> Result<Self, ImageError> {
        Self::elf(&fs::read(path).map_err(ImageError::Unread)?)
    }

    /// Machine code alone, which begins with the table of vectors.
    #[must_use]
    pub fn raw(code: &[u8]) -> Self {
        let mut flash = vec![0xff; FLASH_SIZE];
        flash[..code.len()].copy_from_slice(code);
        Self { flash, end: code.len(), symbols: HashMap::new() }
    }

    /// Value of a symbol: an address.
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    /// All symbols with their values, in no order.
    pub fn symbols(&self) -> impl Iterator<Item = (&str, u32)> {
        self.symbols.iter().map(|(name, &value)| (name.as_str(), value))
    }

    /// Segments by their load addresses.
    fn elf(bytes: &[u8]) -> Result<Self, ImageError> {
        let file = ElfFile32::<Endianness>::parse(bytes)?;
        let (header, endian) = (file.raw_header(), file.endian());
        if header.e_machine(endian) != EM_ARM {
            return Err(ImageError::Malformed("an ELF file for another processor".into()));
        }
        let mut image = Self::raw(&[]);
        for segment in header.program_headers(endian, bytes)? {
            if segment.p_type(endian) != PT_LOAD || segment.p_filesz(endian) == 0 {
                continue;
            }
            let unread = |()| ImageError::Malformed("a segment lies outside of the file".into());
            image.put(segment.p_paddr(endian), segment.data(endian, bytes).map_err(unread)?)?;
        }
        for symbol in file.symbols() {
            if let Ok(name) = symbol.name() {
                let _ = image.symbols.insert(name.to_owned(), symbol.address() as u32);
            }
        }
        Ok(image)
    }

    fn put(&mut self, address: u32, bytes: &[u8]) -> Result<(), ImageError> {
        let start = address.wrapping_sub(FLASH_START) as usize;
        let end = start.saturating_add(bytes.len());
        let outside = || ImageError::Malformed(format!("{address:#010x} is not in the flash"));
        self.flash.get_mut(start..end).ok_or_else(outside)?.copy_from_slice(bytes);
        self.end = self.end.max(end);
        Ok(())
    }
}
