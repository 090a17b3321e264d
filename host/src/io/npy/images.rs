//! Raw images as unsigned integers, axes (image, y, x).

use super::header::{Header, Kind, cannot_read};
use super::writer::NpyWriter;
use crate::error::{Error, Result};
use crate::io::raw::{RawFormat, RawImages, visit_images};
use std::fs::File;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Bytes that pass through memory at once.
const BLOCK: usize = 1 << 17;

/// Open an array of 8 or 16 bits; all of them are taken for significant.
pub(crate) fn open_images(path: &Path) -> Result<Box<dyn RawImages>> {
    let (file, header) = Header::open(path)?;
    let number_type = header.number_type;
    if number_type.kind != Kind::Unsigned || !matches!(number_type.bytes, 1 | 2) {
        return Err(Error::file(
            path,
            format!("holds {number_type}; raw images are uint8 or uint16: save them so"),
        ));
    }
    let (images, height, width) = match header.shape[..] {
        [images, height, width] if images.min(height).min(width) > 0 => (images, height, width),
        _ => {
            let shape = header.shape;
            return Err(Error::file(
                path,
                format!("has shape {shape:?}; raw images need axes (image, y, x), none of them 0"),
            ));
        }
    };
    if header.fortran_order {
        return Err(Error::file(path, "is in Fortran order: save numpy.ascontiguousarray of it"));
    }
    let bits = 8 * number_type.bytes as u32;
    Ok(Box::new(NpyImages {
        file,
        path: path.to_owned(),
        format: RawFormat { images, height, width, bits, rate_hz: None },
        big_endian: number_type.big_endian,
        data_offset: header.data_offset,
    }))
}

/// Write raw images as uint16, axes (image, y, x).
///
/// # Errors
/// When they cannot be read, the folder cannot be written to, or the disk is full.
pub fn save_images(path: &Path, raw: &dyn RawImages) -> Result<PathBuf> {
    let RawFormat { images, height, width, .. } = raw.format();
    let array = NpyWriter::<u16>::create(path, &[images, height, width])?;
    let mut first = 0;
    visit_images(raw, |counts| {
        array.write_at(first, counts)?;
        first += counts.len();
        Ok(())
    })?;
    array.finish()
}

struct NpyImages {
    file: File,
    path: PathBuf,
    format: RawFormat,
    big_endian: bool,
    data_offset: u64,
}

impl NpyImages {
    /// Neighbouring counts, from number `first` of the whole array on.
    fn read_run(&self, first: usize, out: &mut [u16]) -> Result<()> {
        let bytes_per_count = self.format.bits as usize / 8;
        let mut position = self.data_offset + (first * bytes_per_count) as u64;
        let mut block = vec![0_u8; BLOCK.min(out.len() * bytes_per_count)];
        for piece in out.chunks_mut(BLOCK / bytes_per_count) {
            let bytes = &mut block[..piece.len() * bytes_per_count];
            self.file
                .read_exact_at(bytes, position)
                .map_err(|error| cannot_read(&self.path, &error))?;
            self.decode(bytes, piece);
            position += bytes.len() as u64;
        }
        Ok(())
    }

    fn decode(&self, bytes: &[u8], out: &mut [u16]) {
        if self.format.bits == 8 {
            out.iter_mut().zip(bytes).for_each(|(count, &byte)| *count = byte.into());
            return;
        }
        let number = if self.big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
        let (pairs, _) = bytes.as_chunks();
        out.iter_mut().zip(pairs).for_each(|(count, &pair)| *count = number(pair));
    }
}

impl RawImages for NpyImages {
    fn format(&self) -> RawFormat {
        self.format
    }

    fn read(&self, images: Range<usize>, rows: Range<usize>, out: &mut [u16]) -> Result<()> {
        self.format.check_request(&images, &rows, out.len())?;
        let RawFormat { height, width, .. } = self.format;
        let runs = out.chunks_mut((rows.len() * width).max(1));
        for (image, run) in images.zip(runs) {
            self.read_run((image * height + rows.start) * width, run)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::open_raw;
    use std::fs;
    use tempfile::TempDir;

    /// A file with this type, order and shape.
    fn save(folder: &TempDir, dictionary: &str, data: &[u8]) -> PathBuf {
        let path = folder.path().join("raw.npy");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((dictionary.len() as u16).to_le_bytes());
        bytes.extend(dictionary.as_bytes());
        bytes.extend(data);
        fs::write(&path, bytes).unwrap();
        path
    }

    #[test]
    fn images_go_out_and_come_back() {
        let folder = TempDir::new().unwrap();
        let data: Vec<u8> = (0..2 * 3 * 4).collect();
        for (kind, bits) in [("|u1", 8), ("<u2", 16), (">u2", 16)] {
            let data: Vec<u8> = match kind {
                "|u1" => data.clone(),
                "<u2" => data.iter().flat_map(|&n| [n, 0]).collect(),
                _ => data.iter().flat_map(|&n| [0, n]).collect(),
            };
            let text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (2, 3, 4)}}");
            let raw = open_raw(&save(&folder, &text, &data)).unwrap();
            let format = RawFormat { images: 2, height: 3, width: 4, bits, rate_hz: None };
            assert_eq!(raw.format(), format);
            let mut out = [0; 2 * 2 * 4];
            raw.read(0..2, 1..3, &mut out).unwrap();
            assert!(out.iter().copied().eq((4..12).chain(16..24)), "{kind} {out:?}");
            let copy = save_images(&folder.path().join("copy.npy"), raw.as_ref()).unwrap();
            let mut out = [0; 24];
            open_raw(&copy).unwrap().read(0..2, 0..3, &mut out).unwrap();
            assert!(out.iter().copied().eq(0..24), "{kind} {out:?}");
        }
    }

    #[test]
    fn other_arrays_are_refused() {
        let folder = TempDir::new().unwrap();
        for (kind, order, shape, words) in [
            ("<f4", "False", "(2, 3, 4)", "uint8 or uint16"),
            ("<i2", "False", "(2, 3, 4)", "uint8 or uint16"),
            ("<u2", "True", "(2, 3, 4)", "Fortran"),
            ("<u2", "False", "(6, 4)", "(image, y, x)"),
            ("<u2", "False", "(2, 0, 4)", "(image, y, x)"),
            ("<u2", "False", "(2, 3, 40)", "cut short"),
        ] {
            let text = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}}}");
            let path = save(&folder, &text, &[0; 96]);
            let refused = open_raw(&path).err().unwrap().to_string();
            assert!(refused.contains(words), "{refused}");
        }
    }
}
