//! `cargo xtask peers`: the program beside NumPy + SciPy on the paper's scene.

use crate::command::{cargo, command, run};
use crate::{Result, folders, python};

/// Size of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) frames: usize,
}

impl Size {
    /// The paper's.
    pub(crate) const FULL: Self = Self { width: 640, height: 368, frames: 70 };

    /// `--width 640 --height 368 --frames 70`, any of them.
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

/// Simulate the scene unless it is there, run both, print the table.
pub(crate) fn compare(size: Size) -> Result {
    let Size { width, height, frames } = size;
    let python = python::environment()?;
    run(&mut cargo("build --release"))?;
    let folder = folders::target()?.join("peers");
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
    run(python.script("side_by_side.py").arg(&phasewalk).arg(&series))
}
