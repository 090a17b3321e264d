//! An `.npy` file to which another program appends frames.
//!
//! A frame is there once the header counts it and the file is long enough for all of its bytes. So the header may name
//! all frames from the beginning while the file grows, or be rewritten as frames are appended. A file that has its
//! full length from the beginning (`numpy.lib.format.open_memmap`) cannot be seen to grow: its zeros are frames.

use super::pipe::cut_short;
use super::{Arrival, ArrivingFrames, FrameFormat};
use crate::error::{Error, Result};
use crate::io::npy::{Header, NumberType, complex_type, decode};
use num_complex::Complex32;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A growing file.
pub(super) struct GrowingNpy {
    path: PathBuf,
    format: FrameFormat,
    number_type: NumberType,
    /// Frames that have been read.
    read: usize,
    bytes: Vec<u8>,
}

/// The file as it is now.
struct Now {
    file: File,
    frames: usize,
    data_offset: u64,
    length: u64,
}

impl GrowingNpy {
    /// Open a file whose header is there; it need not hold a frame yet.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let (_, header, _) = Header::open_growing(path)?;
        let number_type = complex_type(path, &header)?;
        if header.fortran_order {
            return Err(Error::file(
                path,
                "is in Fortran order, in which frames lie scattered: write it in C order",
            ));
        }
        let format = FrameFormat::of_series(path, &header.shape)?;
        let bytes = vec![0; format.pixels() * number_type.bytes];
        Ok(Self { path: path.to_owned(), format, number_type, read: 0, bytes })
    }

    fn now(&self) -> Result<Now> {
        let (file, header, length) = Header::open_growing(&self.path)?;
        let format = FrameFormat::of_series(&self.path, &header.shape)?;
        self.format.check_same(&self.path, &format)?;
        if header.number_type != self.number_type {
            let (before, now) = (self.number_type, header.number_type);
            let what = format!("the numbers have changed from {before} to {now}: begin again");
            return Err(Error::file(&self.path, what));
        }
        let now = Now { file, frames: header.shape[0], data_offset: header.data_offset, length };
        if now.length < self.end_of(&now, self.read) {
            let what = format!("has shrunk below the {} frames that were there", self.read);
            return Err(Error::file(&self.path, what));
        }
        Ok(now)
    }

    /// Where so many frames end.
    fn end_of(&self, now: &Now, frames: usize) -> u64 {
        now.data_offset + frames as u64 * self.bytes.len() as u64
    }
}

impl ArrivingFrames for GrowingNpy {
    fn format(&self) -> FrameFormat {
        self.format
    }

    fn next(&mut self, frame: &mut [Complex32]) -> Result<Arrival> {
        let now = self.now()?;
        if now.frames <= self.read || now.length < self.end_of(&now, self.read + 1) {
            return Ok(Arrival::Nothing);
        }
        let position = self.end_of(&now, self.read);
        now.file
            .read_exact_at(&mut self.bytes, position)
            .map_err(|error| Error::file(&self.path, format!("cannot be read: {error}")))?;
        decode(self.number_type, &self.bytes, frame);
        self.read += 1;
        Ok(Arrival::Frame)
    }

    fn check_whole(&self) -> Result<()> {
        let now = self.now()?;
        let begun = now.length - self.end_of(&now, self.read);
        if begun == 0 || now.frames <= self.read {
            return Ok(());
        }
        Err(cut_short(&self.path, self.read, begun, self.bytes.len() as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    /// A file whose header names `frames` frames of 2 x 1 pixels, and the header's length.
    fn file(folder: &Path, frames: usize) -> (PathBuf, File, usize) {
        let path = folder.join("F.npy");
        let bytes = header(frames, 1);
        std::fs::write(&path, &bytes).unwrap();
        let file = File::options().append(true).open(&path).unwrap();
        (path, file, bytes.len())
    }

    fn header(frames: usize, height: usize) -> Vec<u8> {
        let text = format!(
            "{{'descr': '<c8', 'fortran_order': False, 'shape': ({frames}, {height}, 2), }}"
        );
        let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        bytes.extend(format!("{text:117}\n").as_bytes());
        bytes
    }

    fn next(growing: &mut GrowingNpy) -> Result<Arrival> {
        growing.next(&mut [Complex32::default(); 2])
    }

    #[test]
    fn the_file_grows_under_a_header_that_names_all() {
        let folder = tempfile::tempdir().unwrap();
        let (path, mut file, _) = file(folder.path(), 2);
        let mut growing = GrowingNpy::open(&path).unwrap();
        assert_eq!(next(&mut growing).unwrap(), Arrival::Nothing);
        assert!(growing.check_whole().is_ok());
        file.write_all(&[0; 10]).unwrap();
        assert_eq!(next(&mut growing).unwrap(), Arrival::Nothing);
        let error = growing.check_whole().unwrap_err().to_string();
        assert!(error.contains("frame 0") && error.contains("10 of its 16 bytes"), "{error}");
        file.write_all(&[0; 22]).unwrap();
        assert_eq!(next(&mut growing).unwrap(), Arrival::Frame);
        assert_eq!(next(&mut growing).unwrap(), Arrival::Frame);
        assert_eq!(next(&mut growing).unwrap(), Arrival::Nothing);
    }

    #[test]
    fn the_header_is_rewritten_as_the_file_grows() {
        let folder = tempfile::tempdir().unwrap();
        let (path, mut appending, _) = file(folder.path(), 0);
        let mut growing = GrowingNpy::open(&path).unwrap();
        appending.write_all(&[0; 16]).unwrap();
        assert_eq!(next(&mut growing).unwrap(), Arrival::Nothing);
        let rewriting = File::options().write(true).open(&path).unwrap();
        rewriting.write_all_at(&header(1, 1), 0).unwrap();
        assert_eq!(next(&mut growing).unwrap(), Arrival::Frame);
        rewriting.write_all_at(&header(2, 3), 0).unwrap();
        let error = next(&mut growing).unwrap_err().to_string();
        assert!(error.contains("changed from 2 x 1 to 2 x 3"), "{error}");
    }

    #[test]
    fn a_file_that_shrinks_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (path, mut file, header) = file(folder.path(), 2);
        file.write_all(&[0; 16]).unwrap();
        let mut growing = GrowingNpy::open(&path).unwrap();
        assert_eq!(next(&mut growing).unwrap(), Arrival::Frame);
        file.set_len(header as u64 + 3).unwrap();
        let error = next(&mut growing).unwrap_err().to_string();
        assert!(error.contains("shrunk below the 1 frames"), "{error}");
    }
}
