//! Small arrays, read whole.

use super::header::{Header, Kind};
use crate::error::{Error, Result};
use std::path::Path;

/// Shape and elements, in C order, of an array of real numbers or integers.
///
/// # Errors
/// When the file is missing or damaged, or holds complex numbers.
pub fn read_real(path: &Path) -> Result<(Vec<usize>, Vec<f64>)> {
    let (file, header) = Header::open(path)?;
    let convert = converter(path, &header)?;
    let bytes = header.read_all(path, &file)?;
    let stored: Vec<f64> = bytes.chunks_exact(header.number_type.bytes).map(convert).collect();
    let elements = if header.fortran_order { to_c_order(&header.shape, &stored) } else { stored };
    Ok((header.shape, elements))
}

/// The elements of an array of one axis.
///
/// # Errors
/// When the file is missing or damaged, holds complex numbers, or has another rank.
pub fn read_f64_1d(path: &Path) -> Result<Vec<f64>> {
    let (shape, elements) = read_real(path)?;
    if shape.len() == 1 {
        Ok(elements)
    } else {
        Err(Error::file(path, format!("has shape {shape:?}; an array of one axis is needed")))
    }
}

/// Shape and elements of an array of booleans or integers: true where not zero.
pub(crate) fn read_flags(path: &Path) -> Result<(Vec<usize>, Vec<bool>)> {
    let (file, header) = Header::open(path)?;
    if !matches!(header.number_type.kind, Kind::Bool | Kind::Signed | Kind::Unsigned) {
        return Err(Error::file(
            path,
            format!("holds {}; a mask needs booleans or integers", header.number_type),
        ));
    }
    let bytes = header.read_all(path, &file)?;
    let stored: Vec<bool> = bytes
        .chunks_exact(header.number_type.bytes)
        .map(|number| number.iter().any(|&byte| byte != 0))
        .collect();
    let flags = if header.fortran_order { to_c_order(&header.shape, &stored) } else { stored };
    Ok((header.shape, flags))
}

/// How the bytes of one number become a number.
pub(super) type Convert = fn(&[u8]) -> f64;

/// The conversion for the numbers of a file.
pub(super) fn converter(path: &Path, header: &Header) -> Result<Convert> {
    macro_rules! number {
        ($type:ty) => {
            if header.number_type.big_endian {
                |bytes| bytes.try_into().map_or(f64::NAN, |b| <$type>::from_be_bytes(b) as f64)
            } else {
                |bytes| bytes.try_into().map_or(f64::NAN, |b| <$type>::from_le_bytes(b) as f64)
            }
        };
    }
    Ok(match (header.number_type.kind, header.number_type.bytes) {
        (Kind::Float, 4) => number!(f32),
        (Kind::Float, 8) => number!(f64),
        (Kind::Signed, 1) => number!(i8),
        (Kind::Signed, 2) => number!(i16),
        (Kind::Signed, 4) => number!(i32),
        (Kind::Signed, 8) => number!(i64),
        (Kind::Unsigned | Kind::Bool, 1) => number!(u8),
        (Kind::Unsigned, 2) => number!(u16),
        (Kind::Unsigned, 4) => number!(u32),
        (Kind::Unsigned, 8) => number!(u64),
        _ => {
            let found = header.number_type;
            return Err(Error::file(path, format!("holds {found}; real numbers are needed")));
        }
    })
}

/// Reorder from first axis fastest to last axis fastest.
fn to_c_order<T: Copy>(shape: &[usize], stored: &[T]) -> Vec<T> {
    let mut index = vec![0; shape.len()];
    let mut ordered = Vec::with_capacity(stored.len());
    for _ in 0..stored.len() {
        let position = index.iter().zip(shape).rev().fold(0, |sum, (&i, &n)| sum * n + i);
        ordered.push(stored[position]);
        for (i, &n) in index.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < n {
                break;
            }
            *i = 0;
        }
    }
    ordered
}
