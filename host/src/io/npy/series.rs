//! Complex frames, read row by row.

use super::header::{Header, Kind, NumberType, cannot_read};
use crate::error::{Error, Result};
use crate::io::{Series, Shape};
use num_complex::Complex32;
use std::fs::File;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Bytes that pass through memory at once.
const BLOCK: usize = 1 << 20;

/// Open a complex array of axes (time, y, x) or (time, z, y, x).
pub(crate) fn open_series(path: &Path) -> Result<Box<dyn Series>> {
    let (file, header) = Header::open(path)?;
    let number_type = complex_type(path, &header)?;
    let shape = Shape::of_series(path, &header.shape)?;
    if header.fortran_order {
        return Ok(Box::new(WholeSeries::read(path, &file, &header, shape)?));
    }
    let data_offset = header.data_offset;
    Ok(Box::new(NpySeries { file, path: path.to_owned(), shape, number_type, data_offset }))
}

/// The numbers of a file of complex ones.
pub(crate) fn complex_type(path: &Path, header: &Header) -> Result<NumberType> {
    let number_type = header.number_type;
    if number_type.kind == Kind::Complex && matches!(number_type.bytes, 8 | 16) {
        return Ok(number_type);
    }
    Err(Error::file(
        path,
        format!("holds {number_type}; the complex field is needed, as complex64 or complex128"),
    ))
}

/// A file in C order: rows are read where they lie.
struct NpySeries {
    file: File,
    path: PathBuf,
    shape: Shape,
    number_type: NumberType,
    data_offset: u64,
}

impl Series for NpySeries {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn read_rows(
        &self,
        frame: usize,
        depth: usize,
        rows: Range<usize>,
        out: &mut [Complex32],
    ) -> Result<()> {
        self.shape.check_request(frame, depth, &rows, out.len())?;
        let first = self.shape.offset_of_row(frame, depth, rows.start);
        let mut position = self.data_offset + (first * self.number_type.bytes) as u64;
        if is_native(self.number_type) {
            return read_exact(&self.file, &self.path, position, bytemuck::cast_slice_mut(out));
        }
        let mut block = vec![0_u8; BLOCK.min(out.len() * self.number_type.bytes)];
        for piece in out.chunks_mut(BLOCK / self.number_type.bytes) {
            let bytes = &mut block[..piece.len() * self.number_type.bytes];
            read_exact(&self.file, &self.path, position, bytes)?;
            decode(self.number_type, bytes, piece);
            position += bytes.len() as u64;
        }
        Ok(())
    }
}

/// Are the numbers stored as this machine holds them?
fn is_native(number_type: NumberType) -> bool {
    number_type.bytes == size_of::<Complex32>()
        && number_type.big_endian == cfg!(target_endian = "big")
}

fn read_exact(file: &File, path: &Path, position: u64, bytes: &mut [u8]) -> Result<()> {
    file.read_exact_at(bytes, position).map_err(|error| cannot_read(path, &error))
}

/// A file in Fortran order, where a row is scattered all over the file: held in memory.
struct WholeSeries {
    shape: Shape,
    /// As stored: the frame index runs fastest, x slowest.
    elements: Vec<Complex32>,
}

impl WholeSeries {
    fn read(path: &Path, file: &File, header: &Header, shape: Shape) -> Result<Self> {
        let bytes = header.read_all(path, file)?;
        let mut elements = vec![Complex32::default(); bytes.len() / header.number_type.bytes];
        decode(header.number_type, &bytes, &mut elements);
        Ok(Self { shape, elements })
    }
}

impl Series for WholeSeries {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn read_rows(
        &self,
        frame: usize,
        depth: usize,
        rows: Range<usize>,
        out: &mut [Complex32],
    ) -> Result<()> {
        self.shape.check_request(frame, depth, &rows, out.len())?;
        let Shape { frames, depth: depths, height, width } = self.shape;
        for (row, line) in rows.zip(out.chunks_exact_mut(width)) {
            for (column, value) in line.iter_mut().enumerate() {
                let index = frame + frames * (depth + depths * (row + height * column));
                *value = self.elements[index];
            }
        }
        Ok(())
    }
}

/// Turn stored complex numbers into complex64.
pub(crate) fn decode(number_type: NumberType, bytes: &[u8], out: &mut [Complex32]) {
    match (number_type.bytes, number_type.big_endian) {
        (8, false) => decode_pairs(bytes, out, f32::from_le_bytes),
        (8, true) => decode_pairs(bytes, out, f32::from_be_bytes),
        (_, false) => decode_pairs(bytes, out, |half: [u8; 8]| f64::from_le_bytes(half) as f32),
        (_, true) => decode_pairs(bytes, out, |half: [u8; 8]| f64::from_be_bytes(half) as f32),
    }
}

fn decode_pairs<const N: usize>(
    bytes: &[u8],
    out: &mut [Complex32],
    real: impl Fn([u8; N]) -> f32,
) {
    let (halves, _) = bytes.as_chunks::<N>();
    for (value, pair) in out.iter_mut().zip(halves.chunks_exact(2)) {
        *value = Complex32::new(real(pair[0]), real(pair[1]));
    }
}
