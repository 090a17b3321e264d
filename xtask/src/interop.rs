//! What NumPy, zarr-python and pyMRAW say about our files, and the NumPy peer about our images.

use crate::command::{cargo, command, run};
use crate::python::Environment;
use crate::{Result, folders};
use std::path::Path;

/// Small, but with more frames than the unwrapping's ten neighbours, and sides that differ and are
/// no multiple of a vector.
const SCENE: &str = "simulate speckle --width 150 --height 92 --frames 24 --scatterers 20 --seed 7";

/// Every pair of frames can be trusted.
const GENTLE: &str = "--sigma 1/32";

/// Weights fall to zero and frames hang together by little, which must not amplify rounding.
const ROUGH: &str = "--sigma 1/16";

/// Run the program and have Python look at the results.
///
/// Needs the release build.
pub(crate) fn check(python: &Environment) -> Result {
    let folder = folders::scratch("interop")?;
    let phasewalk = |arguments: &str| run_in(&folder, arguments);
    for (motion, output) in [(GENTLE, "F.npy"), (GENTLE, "F.zarr"), (ROUGH, "R.npy")] {
        phasewalk(&format!("{SCENE} {motion} -o {output}"))?;
    }
    run(python.script("write_series.py").arg(folder.join("F.npy")).arg(&folder))?;
    for (series, output) in
        [("F.npy", "P.npy"), ("F.npy", "P.zarr"), ("holes.npy", "H.npy"), ("holes.zarr", "H.zarr")]
    {
        phasewalk(&format!("phase {series} --gaussian 3 --method paper -o {output}"))?;
    }
    for output in ["C.npy", "C.zarr", "C.csv"] {
        phasewalk(&format!("phase F.npy --mask F.mask.npy --method paper -o {output}"))?;
    }
    run(python.script("check_files.py").arg(&folder))?;

    let agrees = |series: &str, images: &str, ensemble: &str| {
        let mut peer = python.script("numpy_phase.py");
        peer.arg(folder.join(series)).args(["--double", "--check"]).arg(folder.join(images));
        run(peer.args(ensemble.split_whitespace()))
    };
    agrees("F.npy", "P.npy", "--gaussian 3")?;
    agrees("holes.npy", "H.npy", "--gaussian 3")?;
    for (ensemble, output) in [("--gaussian 3", "R3.npy"), ("--gaussian 2.5 --max-lag 12", "L.npy")]
    {
        phasewalk(&format!("phase R.npy {ensemble} --method paper -o {output}"))?;
        agrees("R.npy", output, ensemble)?;
    }
    check_recordings(python)
}

/// Recordings of cameras in tests/data, whose header is named.
const RECORDINGS: [&str; 3] = ["ball_12bit.cihx", "beam.cihx", "sample_60k_16bit.cih"];

/// Camera recordings, written and read beside pyMRAW.
fn check_recordings(python: &Environment) -> Result {
    // As for the tests, which have most of it compiled.
    let build = "build --workspace --features phasewalk-tests/emulated-boards --example";
    run(cargo(build).arg("photron_frames"))?;
    let data = folders::workspace().join("tests").join("data").join("photron");
    let mut peer = python.script("check_photron.py");
    peer.arg(folders::example("photron_frames")?).arg(folders::scratch("photron")?);
    run(peer.args(RECORDINGS.map(|name| data.join(name))))
}

fn run_in(folder: &Path, arguments: &str) -> Result {
    run(command(folders::phasewalk()?).args(arguments.split_whitespace()).current_dir(folder))
}
