//! `phasewalk paper`.

use super::folder::Folder;
use super::{Common, list, print};
use crate::demo::errors::aligned;
use crate::error::{Error, Result};
use crate::paper::documents::{
    claims_csv, claims_json, claims_long, claims_markdown, claims_short, ends_table, markdown,
};
use crate::paper::figure1::figure1;
use crate::paper::figure2::figure2;
use crate::paper::figure3::figure3;
use crate::paper::page::{self, Figures};
use crate::paper::settings::{GAUSSIAN_PX, SHOWN, SIGMAS};
use crate::paper::{
    BoundRow, Claim, Evidence, Scene, Settings, Statistics, Store, bound, claims, run as runs,
};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

/// Options of `paper`.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Folder for figures, tables and page; the runs in it are taken up again
    #[arg(long, value_name = "DIR", default_value = "phasewalk-paper")]
    out: PathBuf,
    /// Scenes for each σ of Figure 3
    #[arg(long, value_name = "N", default_value_t = 100)]
    runs: usize,
    /// Seed of the first run; run r has this seed + r
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Pixels along x
    #[arg(long, value_name = "PX", default_value_t = 640)]
    width: usize,
    /// Pixels along y
    #[arg(long, value_name = "PX", default_value_t = 368)]
    height: usize,
    /// σ of the Gaussian of Figure 2's images, pixels; the paper gives none
    #[arg(long, value_name = "PX", default_value_t = GAUSSIAN_PX)]
    gaussian: f64,
    /// Trials of each entry of the table against the bound [default: 4 for each run]
    #[arg(long, value_name = "N")]
    trials: Option<usize>,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let start = Instant::now();
    let settings = settings(arguments, common)?;
    let folder = Folder::prepare(&arguments.out)?;
    let mut store = Store::open(&arguments.out.join(RUNS), &settings)?;
    if !common.json {
        announce(&settings, &store);
    }
    let results =
        Results::compute(&settings, &mut store).map_err(|error| kept(error, arguments))?;
    let mut files = folder.write(&results.files(&settings)?)?;
    files.insert(0, arguments.out.join(RUNS));
    let seconds = start.elapsed().as_secs_f64();
    if common.json {
        let facts =
            json!({ "files": files, "seconds": seconds, "claims": claims_json(&results.claims) });
        print(&facts.to_string());
        return Ok(());
    }
    print(&aligned(&claims_short(&results.claims)));
    print(&format!("\n{}", aligned(&ends_table(&settings, &results.statistics))));
    print(&format!("\nwrote {} in {seconds:.0} s", list(&files)));
    print(&format!("open {}", arguments.out.join(PAGE).display()));
    Ok(())
}

const RUNS: &str = "runs.csv";
const PAGE: &str = "index.html";

fn settings(arguments: &Arguments, common: &Common) -> Result<Settings> {
    let Arguments { width, height, seed, runs, gaussian, trials, .. } = *arguments;
    let mut settings = Settings::new([width, height], seed, runs, gaussian, common.threads())?;
    match trials {
        Some(0) => return Err(Error::usage("--trials 0: at least 1 is needed")),
        Some(trials) => settings.trials = trials,
        None => {}
    }
    Ok(settings)
}

fn announce(settings: &Settings, store: &Store) {
    print(&settings.words());
    if !store.is_empty() {
        print(&format!("{} scenes of Figure 3 are there already", store.len()));
    }
}

/// The runs that are there are kept when the user stops.
fn kept(error: Error, arguments: &Arguments) -> Error {
    match error {
        Error::Interrupted => Error::Kept(format!(
            "interrupted: the runs so far are kept in {}; the same command goes on",
            arguments.out.join(RUNS).display()
        )),
        other => other,
    }
}

/// All there is to show.
struct Results {
    scenes: [Scene; 3],
    statistics: [Statistics; 4],
    bound: Vec<BoundRow>,
    claims: Vec<Claim>,
}

impl Results {
    fn compute(settings: &Settings, store: &mut Store) -> Result<Self> {
        runs::complete(settings, store)?;
        let [still, slow, fast] = SHOWN;
        let scene = |sigma| Scene::compute(settings, sigma);
        let scenes = [scene(still)?, scene(slow)?, scene(fast)?];
        let bound = bound::compute(settings)?;
        let statistics: [Statistics; SIGMAS.len()] =
            std::array::from_fn(|sigma| Statistics::of(settings, store, sigma));
        let evidence = Evidence { scenes: &scenes, statistics: &statistics, bound: &bound };
        Ok(Self { claims: claims(&evidence), scenes, statistics, bound })
    }

    /// Names and contents of all files, the page last.
    fn files(&self, settings: &Settings) -> Result<Vec<(&'static str, Vec<u8>)>> {
        let [still, _, fast] = &self.scenes;
        let figures = Figures {
            cross_spectra: figure1(still, fast),
            images: figure2(settings, &self.scenes),
            curves: figure3(&self.statistics),
        };
        let ends = ends_table(settings, &self.statistics);
        let against_bound = bound::table(&self.bound, settings.trials);
        let about_claims = claims_markdown(settings, &self.claims, &ends);
        let about_bound = markdown(&against_bound);
        let tables = vec![claims_long(&self.claims), ends, against_bound];
        let (fig1, fig2, fig3) = (&figures.cross_spectra, &figures.images, &figures.curves);
        Ok(vec![
            ("fig1.png", fig1.png()?),
            ("fig1.svg", fig1.svg()?.into_bytes()),
            ("fig2.png", fig2.png()?),
            ("fig2.svg", fig2.svg()?.into_bytes()),
            ("fig3.png", fig3.png()?),
            ("fig3.svg", fig3.svg()?.into_bytes()),
            ("claims.md", about_claims.into_bytes()),
            ("claims.csv", claims_csv(&self.claims)?),
            ("bound.md", about_bound.into_bytes()),
            (PAGE, page::html(settings, tables, &figures)?.into_bytes()),
        ])
    }
}
