//! Recorded spectra, axes (y, x, k), read B-scan by B-scan.

use super::array::{Convert, converter};
use super::header::{Header, cannot_read};
use crate::error::{Error, Result};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A volume of real spectra on disk: floats or integers.
pub struct SpectraFile {
    file: File,
    path: PathBuf,
    data_offset: u64,
    number_bytes: usize,
    convert: Convert,
    /// Number of B-scans.
    pub bscans: usize,
    /// A-lines of a B-scan.
    pub lines: usize,
    /// Samples of a spectrum.
    pub images: usize,
}

impl SpectraFile {
    /// Open an `.npy` file with axes (B-scan y, A-line x, spectral sample k).
    ///
    /// # Errors
    /// When the file is missing, damaged, of another rank, in Fortran order or not real.
    pub fn open(path: &Path) -> Result<Self> {
        let (file, header) = Header::open(path)?;
        let [bscans, lines, images] = header.shape[..] else {
            let shape = &header.shape;
            return Err(Error::file(
                path,
                format!("has shape {shape:?}; spectra need axes (B-scan, A-line, sample)"),
            ));
        };
        if bscans * lines * images == 0 {
            return Err(Error::file(path, format!("is empty: shape {:?}", header.shape)));
        }
        if header.fortran_order {
            return Err(Error::file(
                path,
                "is in Fortran order: save numpy.ascontiguousarray of it",
            ));
        }
        Ok(Self {
            convert: converter(path, &header)?,
            file,
            path: path.to_owned(),
            data_offset: header.data_offset,
            number_bytes: header.number_type.bytes,
            bscans,
            lines,
            images,
        })
    }

    /// The spectra (x, k) of B-scan `y`.
    ///
    /// # Errors
    /// When it cannot be read, or holds NaN or infinity.
    pub fn read_bscan(&self, y: usize) -> Result<Vec<f32>> {
        let numbers = self.lines * self.images;
        let mut bytes = vec![0_u8; numbers * self.number_bytes];
        let position = self.data_offset + (y * bytes.len()) as u64;
        self.file
            .read_exact_at(&mut bytes, position)
            .map_err(|error| cannot_read(&self.path, &error))?;
        let numbers = bytes.chunks_exact(self.number_bytes).map(self.convert);
        let spectra: Vec<f32> = numbers.map(|number| number as f32).collect();
        match spectra.iter().position(|value| !value.is_finite()) {
            None => Ok(spectra),
            Some(place) => {
                let (x, m) = (place / self.images, place % self.images);
                let what = format!("sample {m} of A-line {x} in B-scan {y} is {}", spectra[place]);
                Err(Error::file(&self.path, format!("{what}: remove or replace it")))
            }
        }
    }

    /// Where it lies.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}
