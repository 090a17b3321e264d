//! Arrays of known shape, written in pieces.

use crate::error::{Error, Result};
use crate::io::element::Element;
use crate::io::shape::byte_count;
use crate::io::staged::StagedFile;
use npyz::WriterBuilder;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// Bytes that are turned round at once.
const BLOCK: usize = 1 << 20;

/// A C-ordered array of `T` on its way to its final name.
pub(crate) struct NpyWriter<T> {
    file: StagedFile,
    path: PathBuf,
    data_offset: u64,
    element: PhantomData<fn(T)>,
}

impl<T: Element> NpyWriter<T> {
    /// Begin a file and write its header.
    pub(crate) fn create(path: &Path, shape: &[usize]) -> Result<Self> {
        let bytes = byte_count(shape, size_of::<T>()).ok_or_else(|| {
            Error::file(path, format!("shape {shape:?} is larger than any memory"))
        })?;
        let header = header::<T>(shape)
            .map_err(|error| Error::file(path, format!("the header cannot be formed: {error}")))?;
        let data_offset = header.len() as u64;
        let file = StagedFile::create(path, data_offset + bytes as u64)?;
        file.write_at(&header, 0)?;
        Ok(Self { file, path: path.to_owned(), data_offset, element: PhantomData })
    }

    /// The same array, of which the disk gets what is there while it grows (`StagedFile::flushed`).
    pub(crate) fn flushed(self) -> Self {
        Self { file: self.file.flushed(), ..self }
    }

    /// Write `values` from element `first` on; several threads may do so at once.
    pub(crate) fn write_at(&self, first: usize, values: &[T]) -> Result<()> {
        let position = self.data_offset + (first * size_of::<T>()) as u64;
        let bytes = bytemuck::cast_slice(values);
        if cfg!(target_endian = "little") {
            return self.file.write_at(bytes, position);
        }
        for (begin, block) in (position..).step_by(BLOCK).zip(bytes.chunks(BLOCK)) {
            self.file.write_at(&turned(block, T::PART), begin)?;
        }
        Ok(())
    }

    /// Give the file its final name without waiting for the disk (`StagedFile::publish`).
    pub(crate) fn publish(self) -> Result<()> {
        self.file.publish()
    }

    /// Give the file its final name, which is returned.
    pub(crate) fn finish(self) -> Result<PathBuf> {
        self.file.finish()?;
        Ok(self.path)
    }
}

/// Numbers of `part` bytes each in the other order of bytes.
fn turned(bytes: &[u8], part: usize) -> Vec<u8> {
    bytes.chunks_exact(part).flat_map(|number| number.iter().rev().copied()).collect()
}

fn header<T: Element>(shape: &[usize]) -> std::io::Result<Vec<u8>> {
    let number_type = T::NPY_TYPE
        .parse()
        .map_err(|_| std::io::Error::other(format!("unknown type {}", T::NPY_TYPE)))?;
    let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
    npyz::WriteOptions::new_header_only()
        .dtype(npyz::DType::Plain(number_type))
        .shape(&shape)
        .writer(Vec::new())
        .write_header_only()
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;

    #[test]
    fn numbers_are_turned_round_part_by_part() {
        let numbers = [Complex32::new(1.5, -2.0), Complex32::new(0.1, 1e9)];
        let other_way: Vec<u8> = numbers
            .iter()
            .flat_map(|u| [u.re.to_be_bytes(), u.im.to_be_bytes()])
            .flatten()
            .collect();
        let own: Vec<u8> = numbers
            .iter()
            .flat_map(|u| [u.re.to_le_bytes(), u.im.to_le_bytes()])
            .flatten()
            .collect();
        assert_eq!(turned(&own, Complex32::PART), other_way);
        assert_eq!(turned(&[1, 2, 3, 4], u16::PART), [2, 1, 4, 3]);
        assert_eq!(turned(&[0, 1], bool::PART), [0, 1]);
    }
}
