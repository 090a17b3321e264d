//! `phasewalk demo`.

use super::folder::Folder;
use super::{Common, list, megabytes, print};
use crate::demo::errors::{aligned, csv, table};
use crate::demo::page::{self, Figures};
use crate::demo::{ErrorRow, SceneResult, Setup, error_rows, figures};
use crate::error::Result;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

/// Options of `demo`.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Folder for the figures and the report
    #[arg(long, value_name = "DIR", default_value = "phasewalk-demo")]
    out: PathBuf,
    /// Seed of the random numbers: another one is another experiment
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let start = Instant::now();
    let folder = Folder::prepare(&arguments.out)?;
    let setup = Setup::small(arguments.seed, common.threads());
    if !common.json {
        announce(&setup);
    }
    let scenes = setup.sigmas_wavelengths.iter().map(|&sigma| SceneResult::compute(&setup, sigma));
    let scenes: Vec<SceneResult> = scenes.collect::<Result<_>>()?;
    let rows = error_rows(&scenes);
    let files = folder.write(&results(&setup, &scenes, &rows)?)?;
    let seconds = start.elapsed().as_secs_f64();
    if common.json {
        let memory = setup.memory_bytes();
        let facts = json!({
            "files": files, "seconds": seconds, "memory_bytes": memory, "errors": rows,
        });
        print(&facts.to_string());
        return Ok(());
    }
    print(&aligned(&table(&rows, setup.scene.frames)));
    print(ABOUT_TABLE);
    print(&format!("\nwrote {} in {seconds:.1} s", list(&files)));
    print(&format!("open {}", arguments.out.join(REPORT).display()));
    Ok(())
}

const REPORT: &str = "report.html";

const ABOUT_TABLE: &str =
    "  curve: mean over the x, against the truth, over all frames and in the last one
  image: pixels of the x in the last frame, wrapped to -pi..pi (noise: 1.81) and as they are
  without motion (σ = 0) the errors are those of the x's rim, where the aperture mixes still light in";

fn announce(setup: &Setup) {
    let scene = &setup.scene;
    print(&format!(
        "{} scenes of {} frames, {} x {} pixels, {} scatterers; up to {} of memory",
        setup.sigmas_wavelengths.len(),
        scene.frames,
        scene.width,
        scene.height,
        scene.pixels() * scene.scatterers_per_pixel,
        megabytes(setup.memory_bytes())
    ));
}

/// Names and contents of all files, the report last.
fn results(
    setup: &Setup,
    scenes: &[SceneResult],
    rows: &[ErrorRow],
) -> Result<Vec<(&'static str, Vec<u8>)>> {
    let explained = &scenes[setup.explained.min(scenes.len() - 1)];
    let figures = Figures {
        method: figures::method(explained),
        phase_images: figures::phase_images(setup, scenes),
        curves: figures::curves(scenes),
    };
    Ok(vec![
        ("phase-images.png", figures.phase_images.png()?),
        ("curves.png", figures.curves.png()?),
        ("curves.svg", figures.curves.svg()?.into_bytes()),
        ("method.png", figures.method.png()?),
        ("method.svg", figures.method.svg()?.into_bytes()),
        ("errors.csv", csv(rows)?),
        (REPORT, page::html(setup, scenes, rows, &figures)?.into_bytes()),
    ])
}
