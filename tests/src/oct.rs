//! A simulated recording from raw images to the phase curve, as a user does it, against its truth.

use crate::npy;
use crate::program::Bench;
use std::path::Path;
use std::sync::Arc;
use zarrs::array::{Array, ArrayBytes};
use zarrs::filesystem::FilesystemStore;

/// Sweeps that the curve's phase refers to.
const REFERENCE_SWEEPS: usize = 5;
/// The unstimulated rim bleeds in through the aperture: so many pixels of the mask are left out, where methods do not
/// take it off.
const RIM_PX: usize = 2;
/// So many that nothing of it is left.
const WIDE_RIM_PX: usize = 5;

/// How far a curve is from the truth.
#[derive(Clone, Copy, Debug)]
pub struct CurveError {
    /// Root mean square over the sweeps, rad.
    pub rms: f64,
    /// At the last sweep, rad.
    pub end: f64,
}

/// How far the results are from the truth: root mean squares over sweeps or pixels.
#[derive(Clone, Debug)]
pub struct Scores {
    /// a2 and a3, rad (absolute).
    pub dispersion: [f64; 2],
    /// z, y, x, px.
    pub shift: [f64; 3],
    /// rad.
    pub rotation: f64,
    /// IS/OS and tips, px; a common offset included.
    pub surfaces: [f64; 2],
    /// Curve by the paper's method.
    pub paper: CurveError,
    /// Linked curve of the whole mask, and of what is left for the other methods.
    pub linked: [CurveError; 2],
    /// Curve by the direct difference.
    pub direct: CurveError,
    /// The paper's method on unit phasors.
    pub phasor: CurveError,
    /// Sweeps taken for good that are bad.
    pub bad_missed: Vec<usize>,
    /// Sweeps taken for bad that are good.
    pub good_lost: Vec<usize>,
    /// Dead pixels that were not found, and live ones taken for dead.
    pub dead_pixels: [usize; 2],
}

/// Simulate with `scene` (options of `simulate oct`), reconstruct with `options`, evaluate.
///
/// # Panics
/// If a command fails or leaves something unexpected.
#[must_use]
pub fn score(bench: &Bench, scene: &str, options: &str) -> Scores {
    let _ = bench.succeed(&format!("simulate oct {scene} -o R"));
    let line = "--wavelength-nm 841 --bandwidth-nm 51 --no-pictures -o V.zarr";
    let _ = bench.succeed(&format!("reconstruct R/run.cihx {options} {line}"));
    compare(bench)
}

/// Compare `V.zarr` with the truth in `R`.
///
/// # Panics
/// As [`score`].
#[must_use]
pub fn compare(bench: &Bench) -> Scores {
    let found = |name: &str| numbers(&bench.path("V.zarr").join(name));
    let truth = |name: &str| numbers(&bench.path("R/truth.zarr").join(name));
    let (ok, truly_ok) = (found("sweep_ok").1, truth("sweep_ok").1);
    let which = |test: fn(f64, f64) -> bool| -> Vec<usize> {
        (0..ok.len()).filter(|&t| test(ok[t], truly_ok[t])).collect()
    };
    let used = used_sweeps(bench);
    let first = used.first().copied().unwrap_or(0);
    let (shifts, true_shifts) = (found("shift_px").1, truth("shift_px").1);
    let shift = [0, 1, 2].map(|axis| {
        rms(used.iter().map(|&t| {
            let moved = true_shifts[3 * t + axis] - true_shifts[3 * first + axis];
            shifts[3 * t + axis] - moved
        }))
    });
    let (turned, truly_turned) = (found("rotation_rad").1, truth("rotation_rad").1);
    let rotation = rms(used.iter().map(|&t| turned[t] - truly_turned[t]));
    let surface = |name: &str| {
        let (found, truth) = (found(name).1, truth(name).1);
        rms(found.iter().zip(&truth).map(|(a, b)| a - b))
    };
    let (a, b) = (found("dispersion_rad").1, truth("dispersion_rad").1);
    let (dead, truly_dead) = (found("dead_pixel").1, truth("dead_pixel").1);
    let differ = |test: fn(f64, f64) -> bool| {
        dead.iter().zip(&truly_dead).filter(|&(&a, &b)| test(a, b)).count()
    };
    let error = |method: &str, rim: usize| curve_error(bench, method, rim, &used);
    Scores {
        dispersion: [0, 1].map(|i| (a[i] - b[i]).abs()),
        shift,
        rotation,
        surfaces: ["surface_isos_px", "surface_ost_px"].map(surface),
        paper: error(PAPER, RIM_PX),
        linked: [0, RIM_PX].map(|rim| error(LINKED, rim)),
        direct: error("--method direct", RIM_PX),
        phasor: error(PHASOR, RIM_PX),
        bad_missed: which(|ok, truly| ok > truly),
        good_lost: which(|ok, truly| ok < truly),
        dead_pixels: [differ(|a, b| a < b), differ(|a, b| a > b)],
    }
}

/// Errors of linked phases, the paper's method and phasors without a wide rim.
///
/// # Panics
/// As [`score`].
#[must_use]
pub fn without_wide_rim(bench: &Bench) -> [CurveError; 3] {
    let used = used_sweeps(bench);
    [LINKED, PAPER, PHASOR].map(|method| curve_error(bench, method, WIDE_RIM_PX, &used))
}

/// Sweeps that are good and were taken for it.
fn used_sweeps(bench: &Bench) -> Vec<usize> {
    let [found, truth] =
        ["V.zarr", "R/truth.zarr"].map(|group| numbers(&bench.path(group).join("sweep_ok")).1);
    (0..found.len()).filter(|&t| found[t] * truth[t] > 0.0).collect()
}

const LINKED: &str = "--method linked";
const PAPER: &str = "--method paper";
const PHASOR: &str = "--method paper --ensemble phasor";

/// Difference of the curve over the x without its rim to the true phase, in the used sweeps.
fn curve_error(bench: &Bench, method: &str, rim: usize, used: &[usize]) -> CurveError {
    let _ = bench.succeed(&format!("phase V.zarr --mask R/mask.npy --rim {rim} {method} -o C.csv"));
    let table = std::fs::read_to_string(bench.path("C.csv")).expect("the curve was written");
    let column = |line: &str| line.split(',').nth(2).and_then(|text| text.parse::<f64>().ok());
    let phases: Vec<f64> =
        table.lines().skip(1).map(|line| column(line).expect("a phase")).collect();
    let truth = npy::load_f64(&bench.path("R/phase.npy")).1;
    assert_eq!(phases.len(), truth.len(), "a row per sweep");
    let head = &used[..REFERENCE_SWEEPS.min(used.len())];
    let reference = head.iter().map(|&t| truth[t]).sum::<f64>() / head.len() as f64;
    let error = |&t: &usize| phases[t] - (truth[t] - reference);
    CurveError { rms: rms(used.iter().map(error)), end: used.last().map_or(f64::NAN, error) }
}

/// Root mean square; NaN of nothing.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
    (sum / count).sqrt()
}

/// Shape and numbers of a Zarr array of booleans or reals.
///
/// # Panics
/// If it is missing or of another kind.
#[must_use]
pub fn numbers(folder: &Path) -> (Vec<u64>, Vec<f64>) {
    let store = FilesystemStore::new(folder).expect("a folder");
    let array = Array::open(Arc::new(store), "/")
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let all = array.subset_all();
    let bytes: ArrayBytes<'_> = array.retrieve_array_subset(&all).expect("readable");
    let bytes = bytes.into_fixed().expect("numbers of one size");
    let size = array.data_type().fixed_size().expect("numbers of one size");
    let number = |b: &[u8]| match size {
        1 => f64::from(b[0]),
        4 => f64::from(f32::from_le_bytes(b.try_into().expect("4 bytes"))),
        _ => f64::from_le_bytes(b.try_into().expect("8 bytes")),
    };
    (array.shape().to_vec(), bytes.chunks_exact(size).map(number).collect())
}
