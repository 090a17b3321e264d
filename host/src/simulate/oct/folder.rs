//! The folder of a recording: camera files and truth, whole or not at all.

use super::record::Plan;
use super::scene::{FULL_SCALE, OctScene};
use super::truth::Truth;
use crate::error::{Error, Result};
use crate::io::StagedFolder;
use crate::io::npy::NpyWriter;
use crate::io::photron::{CameraHeader, Packing, PhotronWriter};
use crate::progress::Progress;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the truth; a camera's recording has none beside it.
const TRUTH: &str = "truth.zarr";
/// Names in the folder.
const NAMES: [&str; 7] =
    ["run.cihx", "run.cih", "run.mraw", "mask.npy", "control.npy", "phase.npy", TRUTH];
/// Exposure time over the time between two images.
const SHUTTER: f64 = 0.8;

/// The two headers of a Photron recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeaderKind {
    /// XML.
    Cihx,
    /// Lines of text.
    Cih,
}

/// Make the recording of `plan` and write it to `folder`: `run.mraw` with its header, `mask.npy` (the
/// x), `control.npy`, `phase.npy` and `truth.zarr`. Returned are the files.
///
/// An earlier recording there is replaced once the new one is whole.
///
/// # Errors
/// When the folder holds anything else or cannot be written to, and those of
/// [`record`](Plan::record).
pub fn write_recording(
    plan: &Plan,
    folder: &Path,
    kind: HeaderKind,
    progress: &Progress,
) -> Result<Vec<PathBuf>> {
    let bytes = recording_bytes(plan);
    let staged = StagedFolder::create_unless(folder, bytes, refuse_foreign)?;
    let path = staged.path();
    let scene = &plan.scene;
    let header = match kind {
        HeaderKind::Cihx => NAMES[0],
        HeaderKind::Cih => NAMES[1],
    };
    let mut writer = PhotronWriter::create(&path.join(header), camera_header(plan)?)?;
    plan.record(progress, |image| writer.push(image))?;
    writer.finish()?;
    let truth = Truth::of(plan)?;
    let image = [scene.height, scene.width];
    write_npy(&path.join("mask.npy"), &image, &truth.mask)?;
    write_npy(&path.join("control.npy"), &image, &truth.control)?;
    write_npy(&path.join("phase.npy"), &[scene.sweeps], &truth.phase_rad)?;
    truth.write(plan, &path.join(TRUTH))?;
    staged.finish()?;
    let written = NAMES.iter().map(|name| folder.join(name)).filter(|path| path.exists());
    Ok(written.collect())
}

/// Bytes of the images in the file.
fn recording_bytes(plan: &Plan) -> u64 {
    plan.images() as u64 * (plan.scene.pixels() as u64 * u64::from(plan.scene.bits)).div_ceil(8)
}

fn write_npy<T: crate::io::Element>(path: &Path, shape: &[usize], values: &[T]) -> Result<()> {
    let writer = NpyWriter::create(path, shape)?;
    writer.write_at(0, values)?;
    writer.finish()?;
    Ok(())
}

fn camera_header(plan: &Plan) -> Result<CameraHeader> {
    let OctScene { height, width, bits, frame_rate_hz, .. } = plan.scene;
    let packing = Packing::of_bits(bits)
        .ok_or_else(|| Error::usage(format!("--bits {bits}: must be 12 or 16")))?;
    Ok(CameraHeader {
        effective_bits: FULL_SCALE.count_ones(),
        rate_hz: Some(frame_rate_hz),
        shutter_s: Some(SHUTTER / frame_rate_hz),
        device: "Phasewalk digital twin".to_owned(),
        comment: format!("simulated, seed {}", plan.scene.seed),
        date: "2019/1/1".to_owned(),
        time: "00:00".to_owned(),
        ..CameraHeader::new(plan.images(), height, width, packing)
    })
}

/// Only an empty folder or an earlier recording of ours is replaced.
fn refuse_foreign(target: &Path) -> Result<()> {
    let Ok(found) = fs::metadata(target) else { return Ok(()) };
    if !found.is_dir() {
        return Err(Error::file(target, "is a file, a recording is a folder: choose another name"));
    }
    let cannot_read =
        |error: std::io::Error| Error::file(target, format!("cannot be read: {error}"));
    let recorded = NAMES.iter().any(|name| name.starts_with("run.") && target.join(name).exists());
    if recorded && !target.join(TRUTH).is_dir() {
        return Err(Error::file(
            target,
            "holds a recording without truth.zarr, so it may be a camera's and is not replaced: \
             choose another name",
        ));
    }
    for entry in fs::read_dir(target).map_err(cannot_read)? {
        let name = entry.map_err(cannot_read)?.file_name();
        if !NAMES.iter().any(|known| name == *known) {
            return Err(Error::file(
                target,
                format!(
                    "holds {}, which is not part of a simulated recording, so it is not replaced: choose another name",
                    name.to_string_lossy()
                ),
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read_mask;
    use crate::simulate::oct::presets::Preset;

    fn plan() -> Plan {
        let scene =
            OctScene { sweeps: 6, images: 128, height: 16, width: 24, ..Preset::Easy.scene() };
        Plan::new(scene).unwrap()
    }

    #[test]
    fn the_folder_holds_recording_and_truth() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = temporary.path().join("eye");
        let plan = plan();
        for kind in [HeaderKind::Cihx, HeaderKind::Cih, HeaderKind::Cihx] {
            let files = write_recording(&plan, &folder, kind, &Progress::hidden()).unwrap();
            assert_eq!(files.len(), 6);
            assert_eq!(fs::read_dir(&folder).unwrap().count(), 6);
        }
        assert_eq!(fs::read_dir(temporary.path()).unwrap().count(), 1);
        assert_eq!(fs::metadata(folder.join("run.mraw")).unwrap().len(), 6 * 128 * 16 * 24 * 2);
        let mask = read_mask(&folder.join("mask.npy"), 16, 24).unwrap();
        assert_eq!(mask, read_mask(&folder.join("truth.zarr"), 16, 24).unwrap());
    }

    #[test]
    fn a_folder_with_something_else_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("thesis.tex"), "years of work").unwrap();
        let written =
            write_recording(&plan(), folder.path(), HeaderKind::Cihx, &Progress::hidden());
        assert!(written.unwrap_err().to_string().contains("thesis.tex"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
