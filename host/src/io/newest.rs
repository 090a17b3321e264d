//! Results that are written frame by frame, so that others can read them meanwhile.
//!
//! A curve is a table under its final name, which grows by one whole line per frame. Images are one `.npy` file, the
//! newest image, replaced in one step; or a `.zarr` group whose array grows by one image per frame.

use super::curve::{Columns, CurveRow};
use super::npy::NpyWriter;
use super::staged::{behind_links, cannot_create, cannot_write};
use super::zarr::ImageAppender;
use super::{Attributes, Format, format};
use crate::error::{Error, Result};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// How a line is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Notation {
    /// Numbers between commas under a line of names.
    Csv,
    /// One JSON object per line; what is no number is null.
    Ndjson,
}

impl Notation {
    /// By the extension of a name.
    fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("csv") => Ok(Self::Csv),
            Some("ndjson" | "jsonl") => Ok(Self::Ndjson),
            _ => Err(Error::usage(format!(
                "{}: the extension of an output chooses its format: give .csv or .ndjson for a curve that grows",
                path.display()
            ))),
        }
    }
}

/// A curve that grows by whole lines.
pub struct CurveFile {
    path: PathBuf,
    file: File,
    notation: Notation,
    columns: Columns,
    /// Bytes of whole lines.
    length: u64,
}

impl CurveFile {
    /// Could a curve be written to `path`?
    ///
    /// # Errors
    /// [`Error::Usage`] with the possible extensions when there is none or an unknown one.
    pub fn check(path: &Path) -> Result<()> {
        Notation::of(path).map(|_| ())
    }

    /// Begin a table in the place of an earlier one: with path lengths of `nm_per_rad` for each radian, and with the
    /// `quality` of each frame, where they are wanted.
    ///
    /// # Errors
    /// When the extension is unknown or the file cannot be written.
    pub fn create(path: &Path, nm_per_rad: Option<f64>, quality: bool) -> Result<Self> {
        let notation = Notation::of(path)?;
        let path = behind_links(path);
        if fs::metadata(&path).is_ok_and(|found| !found.is_file()) {
            return Err(Error::file(
                &path,
                "exists and is not an ordinary file, so it is not replaced: choose another name",
            ));
        }
        let file = File::create(&path).map_err(|error| cannot_create(&path, &error))?;
        let columns = Columns { nm_per_rad, quality };
        let mut curve = Self { path, file, notation, columns, length: 0 };
        if notation == Notation::Csv {
            curve.append(&columns.header())?;
        }
        Ok(curve)
    }

    /// Append the line of a frame; where that fails, no part of it stays behind.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn push(&mut self, row: &CurveRow) -> Result<()> {
        let line = match self.notation {
            Notation::Csv => self.columns.line(row),
            Notation::Ndjson => self.columns.json_line(row),
        };
        self.append(&line)
    }

    /// Its name.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn append(&mut self, line: &str) -> Result<()> {
        if let Err(error) = self.file.write_all(line.as_bytes()) {
            // What has failed is told; a half line that stays as well is not worth another message.
            let _ = self.file.set_len(self.length);
            return Err(cannot_write(&self.path, &error, line.len() as u64));
        }
        self.length += line.len() as u64;
        Ok(())
    }
}

/// Images, the newest or all.
pub struct ImageFile {
    path: PathBuf,
    height: usize,
    width: usize,
    kind: Kind,
}

enum Kind {
    Replaced,
    Appended(Box<ImageAppender>),
}

impl ImageFile {
    /// Begin with images of so many rows and columns; `attributes` are kept by Zarr.
    ///
    /// # Errors
    /// When the extension is unknown or the folder cannot be written to.
    pub fn create(
        path: &Path,
        height: usize,
        width: usize,
        attributes: Attributes,
    ) -> Result<Self> {
        let kind = match Format::of(path)? {
            Format::Csv => return Err(format::not_a_table(path)),
            Format::Zarr => {
                let group = ImageAppender::create(path, height, width, attributes)?;
                Kind::Appended(Box::new(group))
            }
            Format::Npy => {
                // A folder that takes no files is refused at once.
                drop(NpyWriter::<f32>::create(path, &[height, width])?);
                Kind::Replaced
            }
        };
        Ok(Self { path: path.to_owned(), height, width, kind })
    }

    /// Write the next image, (y, x), float32.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn push(&mut self, image: &[f32]) -> Result<()> {
        match &mut self.kind {
            Kind::Appended(group) => group.push(image),
            Kind::Replaced => {
                let file = NpyWriter::create(&self.path, &[self.height, self.width])?;
                file.write_at(0, image)?;
                file.publish()
            }
        }
    }

    /// Go on to the next frame, which has no image: nan in a group of all images.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn push_missing(&mut self) -> Result<()> {
        match &mut self.kind {
            Kind::Appended(group) => group.push(&vec![f32::NAN; self.height * self.width]),
            Kind::Replaced => Ok(()),
        }
    }

    /// Its name.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::npy::read_real;

    #[test]
    fn curves_grow_by_whole_lines() {
        let folder = tempfile::tempdir().unwrap();
        let row = CurveRow { phase_rad: 0.5, ..CurveRow::missing(7, 3.5) };
        for (name, first, second) in [
            (
                "C.csv",
                "frame,time_s,phase_rad,sigma_rad,opl_nm,sigma_nm\n",
                "7,3.5,0.5,inf,1.0,inf\n",
            ),
            (
                "C.ndjson",
                "",
                "{\"frame\":7,\"time_s\":3.5,\"phase_rad\":0.5,\"sigma_rad\":null,\"opl_nm\":1.0,\"sigma_nm\":null}\n",
            ),
        ] {
            let path = folder.path().join(name);
            fs::write(&path, "an earlier result").unwrap();
            let mut curve = CurveFile::create(&path, Some(2.0), false).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), first);
            curve.push(&row).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), format!("{first}{second}"));
        }
        let unknown = CurveFile::check(Path::new("C.npy")).unwrap_err();
        assert_eq!(unknown.exit_status(), 2);
        assert!(CurveFile::create(&folder.path().join("no/C.csv"), None, true).is_err());
    }

    #[test]
    fn the_newest_image_replaces_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("P.npy");
        let mut images = ImageFile::create(&path, 1, 2, Attributes::new()).unwrap();
        assert!(!path.exists());
        for number in [1.0, 2.0] {
            images.push(&[number, -number]).unwrap();
            let (shape, values) = read_real(&path).unwrap();
            assert_eq!((shape, values), (vec![1, 2], vec![f64::from(number), f64::from(-number)]));
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(ImageFile::create(Path::new("P.csv"), 1, 2, Attributes::new()).is_err());
    }

    #[test]
    fn a_zarr_array_grows_by_images() {
        use crate::io::zarr::{Node, open_array, single_threaded};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("P.zarr");
        let mut images = ImageFile::create(&path, 3, 2, Attributes::new()).unwrap();
        let shape = || Node::read_array(&path.join("phase_rad")).unwrap().shape;
        assert_eq!(shape(), [0, 3, 2]);
        for count in 1..4 {
            images.push(&[count as f32; 6]).unwrap();
            assert_eq!(shape(), [count, 3, 2]);
        }
        let array = open_array(&path.join("phase_rad")).unwrap();
        let all = array.subset_all();
        let values: Vec<f32> = array.retrieve_array_subset_opt(&all, &single_threaded()).unwrap();
        assert_eq!((values[0], values[6], values[17]), (1.0, 2.0, 3.0));
    }
}
