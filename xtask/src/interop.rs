//! What NumPy and zarr-python say about our files, and the NumPy peer about our images.

use crate::command::{command, run};
use crate::python::Environment;
use crate::{Result, folders};
use std::path::Path;

/// Small, but with every kind of pair: more frames than the unwrapping's ten neighbours, sides
/// that differ and are no multiple of a vector, decorrelation beyond the weights' threshold.
const SCENE: &str =
    "simulate speckle --width 150 --height 92 --frames 24 --sigma 1/16 --scatterers 20 --seed 7";

/// Run the program and have Python look at the results.
///
/// Needs the release build.
pub(crate) fn check(python: &Environment) -> Result {
    let folder = folders::scratch("interop")?;
    let phasewalk = |arguments: &str| run_in(&folder, arguments);
    for output in ["F.npy", "F.zarr"] {
        phasewalk(&format!("{SCENE} -o {output}"))?;
    }
    run(python.script("write_series.py").arg(folder.join("F.npy")).arg(&folder))?;
    for (series, output) in
        [("F.npy", "P.npy"), ("F.npy", "P.zarr"), ("holes.npy", "H.npy"), ("holes.zarr", "H.zarr")]
    {
        phasewalk(&format!("phase {series} --gaussian 3 --method paper -o {output}"))?;
    }
    phasewalk("phase F.npy --gaussian 2.5 --method paper --max-lag 12 -o L.npy")?;
    for output in ["C.npy", "C.zarr", "C.csv"] {
        phasewalk(&format!("phase F.npy --mask F.mask.npy --method paper -o {output}"))?;
    }
    run(python.script("check_files.py").arg(&folder))?;
    let agrees = |series: &str, images: &str, method: &str| {
        let mut peer = python.script("numpy_phase.py");
        peer.arg(folder.join(series)).args(["--double", "--check"]).arg(folder.join(images));
        run(peer.args(method.split_whitespace()))
    };
    agrees("F.npy", "P.npy", "--gaussian 3")?;
    agrees("holes.npy", "H.npy", "--gaussian 3")?;
    agrees("F.npy", "L.npy", "--gaussian 2.5 --max-lag 12")
}

fn run_in(folder: &Path, arguments: &str) -> Result {
    run(command(folders::phasewalk()?).args(arguments.split_whitespace()).current_dir(folder))
}
