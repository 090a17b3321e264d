//! Walk the phase of a measured rotating disk (ultrasound) and compare it with the law of rotation.
//!
//! ```text
//! cargo run --release --example rotating_disk                       the crop in tests/data
//! cargo run --release --example rotating_disk -- rotdisk_iq.npy     the whole image
//! ```
//! Other files need their geometry: `--x-mm`, `--z-mm` of the first pixel and `--pitch-mm`.

use clap::Parser;
use phasewalk::demo::rotating_disk::{GAUSSIAN_PX, Geometry, RADIUS_MM, RotatingDisk, Step};
use phasewalk::error::{Error, Result};
use phasewalk::io::{Shape, open_series, write_atomic};
use phasewalk::progress::install_interrupt_handler;
use std::path::PathBuf;
use std::process::ExitCode;

const CROP: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/rotating_disk/rotating_disk.npy");
const STEPS: [usize; 6] = [1, 2, 4, 8, 16, 31];

/// Walk the phase of a rotating disk and fit the law of rotation.
#[derive(Parser)]
struct Arguments {
    /// Complex series (time, z, x)
    #[arg(default_value = CROP, hide_default_value = true)]
    series: PathBuf,
    /// x of the first column, mm [default: by the size of the image]
    #[arg(long, requires_all = ["z_mm", "pitch_mm"], allow_negative_numbers = true)]
    x_mm: Option<f64>,
    /// z of the first row, mm
    #[arg(long, requires = "x_mm", allow_negative_numbers = true)]
    z_mm: Option<f64>,
    /// Pixel pitch, mm
    #[arg(long, requires = "x_mm")]
    pitch_mm: Option<f64>,
    /// Figure
    #[arg(short, long, default_value = "rotating-disk.png")]
    output: PathBuf,
    /// Print the numbers as one line of JSON
    #[arg(long)]
    json: bool,
}

impl Arguments {
    fn geometry(&self, shape: Shape) -> Result<Geometry> {
        if let (Some(x_mm), Some(z_mm), Some(pitch_mm)) = (self.x_mm, self.z_mm, self.pitch_mm) {
            return Ok(Geometry { x_mm, z_mm, pitch_mm });
        }
        let unknown = "geometry unknown: give --x-mm, --z-mm and --pitch-mm";
        Geometry::of(shape).ok_or_else(|| Error::file(&self.series, unknown))
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match install_interrupt_handler().and_then(|()| run(&arguments)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("rotating_disk: {error}");
            ExitCode::from(error.exit_status())
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let series = open_series(&arguments.series)?;
    let geometry = arguments.geometry(series.shape())?;
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let disk = RotatingDisk::evaluate(series.as_ref(), geometry, threads)?;
    let wanted = STEPS.into_iter().filter(|&steps| steps <= disk.last());
    let steps = wanted.map(|steps| disk.step(steps)).collect::<Result<Vec<Step>>>()?;
    write_atomic(&arguments.output, &disk.figure()?.png()?)?;
    if arguments.json {
        let facts = serde_json::json!({
            "series": arguments.series, "figure": arguments.output, "geometry": geometry,
            "gaussian_px": GAUSSIAN_PX, "pixels": disk.pixels(), "steps": steps,
        });
        println!("{facts}");
        return Ok(());
    }
    println!(
        "{} pixels within {RADIUS_MM} mm of the centre; sigma_Gauss = {GAUSSIAN_PX} px\n\
         planes fitted to the walked, the linked and the paper's phase; residuals in rad, noise wrapped to\n\
         -pi..pi has 1.81 (direct: against the plane of the walked phase)\n",
        disk.pixels()
    );
    println!(
        "  {:>5} {:>38} {:>23} {:>11} {:>26}\n  {:>5} {:>12} {:>12} {:>12} {:>11} {:>11} {:>11} {:>8} {:>8} {:>8}",
        "",
        "walked",
        "linked",
        "paper",
        "residuals",
        "steps",
        "x: rad/mm",
        "z: rad/mm",
        "R^2",
        "x: rad/mm",
        "z: rad/mm",
        "x: rad/mm",
        "walked",
        "linked",
        "direct"
    );
    for step in &steps {
        print_step(step);
    }
    println!("\nwrote {}", arguments.output.display());
    Ok(())
}

fn print_step(step: &Step) {
    println!(
        "  {:>5} {:>12.3} {:>12.3} {:>12.4} {:>11.3} {:>11.3} {:>11.3} {:>8.3} {:>8.3} {:>8.3}",
        step.steps,
        step.slope_x_rad_per_mm,
        step.slope_z_rad_per_mm,
        step.r_squared,
        step.linked_slope_x_rad_per_mm,
        step.linked_slope_z_rad_per_mm,
        step.paper_slope_x_rad_per_mm,
        step.walked_residual_rad,
        step.linked_residual_rad,
        step.direct_residual_rad,
    );
}
