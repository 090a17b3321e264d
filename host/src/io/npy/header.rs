//! Type, shape and order of the array in a file, and whether the file is whole.
//!
//! The header is a Python dictionary of three entries. It is read here, and not by a general
//! parser, because a damaged header must end in a message whatever its nesting and its numbers.

use crate::error::{Error, Result};
use crate::io::shape::byte_count;
use crate::io::staged::cannot_open;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// NumPy's own headers have about a hundred characters.
const LONGEST_HEADER: u64 = 65_536;

/// What a number is, apart from its size and byte order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Bool,
    Signed,
    Unsigned,
    Float,
    Complex,
}

/// A plain number type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NumberType {
    pub(crate) kind: Kind,
    pub(crate) bytes: usize,
    pub(crate) big_endian: bool,
}

impl NumberType {
    /// From NumPy's type string, such as `<c8`.
    fn parse(text: &str) -> Option<Self> {
        let (order, rest) = text.split_at_checked(1)?;
        let (kind, bytes) = rest.split_at_checked(1)?;
        let kind = match kind {
            "b" => Kind::Bool,
            "i" => Kind::Signed,
            "u" => Kind::Unsigned,
            "f" => Kind::Float,
            "c" => Kind::Complex,
            _ => return None,
        };
        let big_endian = match order {
            "<" | "|" => false,
            ">" => true,
            "=" => cfg!(target_endian = "big"),
            _ => return None,
        };
        let bytes = bytes.parse().ok().filter(|n| (1..=32).contains(n))?;
        Some(Self { kind, bytes, big_endian })
    }
}

impl std::fmt::Display for NumberType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let bits = 8 * self.bytes;
        match self.kind {
            Kind::Bool => write!(f, "bool"),
            Kind::Signed => write!(f, "int{bits}"),
            Kind::Unsigned => write!(f, "uint{bits}"),
            Kind::Float => write!(f, "float{bits}"),
            Kind::Complex => write!(f, "complex{bits}"),
        }
    }
}

/// The header of a file.
#[derive(Debug)]
pub(crate) struct Header {
    pub(crate) number_type: NumberType,
    pub(crate) fortran_order: bool,
    pub(crate) shape: Vec<usize>,
    /// Where the array begins.
    pub(crate) data_offset: u64,
    /// Bytes of the array.
    pub(crate) data_bytes: usize,
}

impl Header {
    /// Open a file and read its header.
    pub(crate) fn open(path: &Path) -> Result<(File, Self)> {
        let (file, header, length) = Self::open_growing(path)?;
        header.check_length(path, length)?;
        Ok((file, header))
    }

    /// Open a file that need not hold the whole array yet, and tell how long it is.
    pub(crate) fn open_growing(path: &Path) -> Result<(File, Self, u64)> {
        let file = File::open(path).map_err(|error| cannot_open(path, &error))?;
        let metadata = file.metadata().map_err(|error| cannot_open(path, &error))?;
        if metadata.is_dir() {
            return Err(Error::file(path, "is a folder, an .npy file was expected"));
        }
        if metadata.len() == 0 {
            return Err(Error::file(path, "the file is empty: write it again"));
        }
        let (text, data_offset) = read_text(path, &file, metadata.len())?;
        let header = Self::parse(path, &text, data_offset)?;
        Ok((file, header, metadata.len()))
    }

    fn parse(path: &Path, text: &str, data_offset: u64) -> Result<Self> {
        let damaged = || Error::file(path, "the .npy header is damaged: write the file again");
        let number_text = entry(text, "descr").and_then(quoted).ok_or_else(|| {
            Error::file(path, "the .npy file holds records, an array of plain numbers is needed")
        })?;
        let number_type = NumberType::parse(number_text).ok_or_else(|| {
            let shown: String = number_text.chars().take(16).collect();
            Error::file(path, format!("elements of type {shown:?}, plain numbers are needed"))
        })?;
        let order = entry(text, "fortran_order").ok_or_else(damaged)?;
        let fortran_order = match (order.starts_with("True"), order.starts_with("False")) {
            (true, _) => true,
            (_, true) => false,
            _ => return Err(damaged()),
        };
        let shape = entry(text, "shape").and_then(tuple).ok_or_else(damaged)?;
        let data_bytes = byte_count(&shape, number_type.bytes).ok_or_else(|| {
            Error::file(
                path,
                format!("the header names the shape {shape:?}, larger than any memory"),
            )
        })?;
        Ok(Self { number_type, fortran_order, shape, data_offset, data_bytes })
    }

    fn check_length(&self, path: &Path, found: u64) -> Result<()> {
        let expected = self.data_offset.saturating_add(self.data_bytes as u64);
        if found < expected {
            return Err(Error::file(
                path,
                format!(
                    "the file is cut short: its header needs {expected} bytes, it has {found}; copy or write it again"
                ),
            ));
        }
        Ok(())
    }

    /// The whole array as stored.
    pub(crate) fn read_all(&self, path: &Path, file: &File) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        bytes.try_reserve_exact(self.data_bytes).map_err(|_| {
            Error::file(path, format!("{} bytes do not fit in memory", self.data_bytes))
        })?;
        bytes.resize(self.data_bytes, 0);
        file.read_exact_at(&mut bytes, self.data_offset)
            .map_err(|error| cannot_read(path, &error))?;
        Ok(bytes)
    }
}

/// A read that failed after the file was opened.
pub(super) fn cannot_read(path: &Path, error: &std::io::Error) -> Error {
    Error::file(path, format!("cannot be read: {error}"))
}

/// The dictionary, and where the array behind it begins.
fn read_text(path: &Path, file: &File, length: u64) -> Result<(String, u64)> {
    let not_npy = || Error::file(path, "not an .npy file: write it with numpy.save");
    let mut prefix = [0_u8; 12];
    let prefix_length = if length < 12 { 10 } else { 12 };
    file.read_exact_at(&mut prefix[..prefix_length], 0).map_err(|_| not_npy())?;
    let [b'\x93', b'N', b'U', b'M', b'P', b'Y', major, _, a, b, c, d] = prefix else {
        return Err(not_npy());
    };
    let (start, text_length) = match major {
        1 => (10, u64::from(u16::from_le_bytes([a, b]))),
        2 | 3 => (12, u64::from(u32::from_le_bytes([a, b, c, d]))),
        _ => {
            return Err(Error::file(
                path,
                format!("version {major} of the .npy format is unknown: write version 1, 2 or 3"),
            ));
        }
    };
    if text_length > LONGEST_HEADER || start + text_length > length {
        return Err(Error::file(
            path,
            format!(
                "the .npy header claims {text_length} bytes: the file is damaged, write it again"
            ),
        ));
    }
    let mut text = vec![0_u8; text_length as usize];
    file.read_exact_at(&mut text, start).map_err(|error| cannot_read(path, &error))?;
    Ok((String::from_utf8_lossy(&text).into_owned(), start + text_length))
}

/// What follows `'key':`.
fn entry<'a>(dictionary: &'a str, key: &str) -> Option<&'a str> {
    let quoted_keys = [format!("'{key}'"), format!("\"{key}\"")];
    let (_, rest) = quoted_keys.iter().find_map(|quoted| dictionary.split_once(quoted.as_str()))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

/// A string in single or double quotes.
fn quoted(text: &str) -> Option<&str> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    Some(text.get(1..)?.split_once(quote)?.0)
}

/// A tuple of lengths; Python 2 wrote `3L` for 3.
fn tuple(text: &str) -> Option<Vec<usize>> {
    let (inside, _) = text.strip_prefix('(')?.split_once(')')?;
    let inside = inside.trim();
    let inside = inside.strip_suffix(',').unwrap_or(inside);
    if inside.is_empty() {
        return Some(Vec::new());
    }
    inside.split(',').map(|n| n.trim().trim_end_matches('L').parse().ok()).collect()
}
