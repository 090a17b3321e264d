//! `cargo xtask compare`: the program, NumPy + SciPy and dolphin on the paper's scene.

use crate::command::{cargo, command, run};
use crate::{Result, folders, python};

/// Size of the scene, and of what dolphin computes of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) frames: usize,
    /// Side of the square in the middle that dolphin computes.
    pub(crate) crop: usize,
}

impl Size {
    /// The paper's.
    pub(crate) const FULL: Self = Self { width: 640, height: 368, frames: 70, crop: 128 };

    /// `--width 640 --height 368 --frames 70 --crop 128`, any of them.
    pub(crate) fn parse(options: &[String]) -> Result<Self> {
        let mut size = Self::FULL;
        for option in options.chunks(2) {
            let (name, value) = match option {
                [name, value] => (name.as_str(), Some(value)),
                [name] => (name.as_str(), None),
                _ => continue,
            };
            let number = match name {
                "--width" => &mut size.width,
                "--height" => &mut size.height,
                "--frames" => &mut size.frames,
                "--crop" => &mut size.crop,
                _ => return Err(format!("'{name}' is not understood")),
            };
            let value = value.ok_or_else(|| format!("{name} needs a number"))?;
            *number = match value.parse() {
                Ok(n) if n > 0 => n,
                _ => return Err(format!("{name} needs a number above 0, not '{value}'")),
            };
        }
        Ok(size)
    }
}

/// Simulate the scene unless it is there, run all, print the table.
pub(crate) fn compare(size: Size) -> Result {
    let Size { width, height, frames, crop } = size;
    let python = python::environment()?;
    python.add_dolphin()?;
    run(&mut cargo("build --release"))?;
    let folder = folders::target()?.join("compare");
    std::fs::create_dir_all(&folder)
        .map_err(|e| format!("cannot make {}: {e}", folder.display()))?;
    let series = folder.join(format!("speckle-{width}x{height}x{frames}.npy"));
    let phasewalk = folders::phasewalk()?;
    if !series.exists() {
        let scene = format!(
            "simulate speckle --width {width} --height {height} --frames {frames} --sigma 1/32 --seed 1 -o"
        );
        run(command(&phasewalk).args(scene.split_whitespace()).arg(&series))?;
    }
    let mut all = python.script("side_by_side.py");
    run(all.arg(&phasewalk).arg(&series).arg("--crop").arg(crop.to_string()))
}
