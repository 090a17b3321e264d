//! `phasewalk trigger solve`: the board's on-line solver beside the same code on the host.

use super::line::Line;
use super::speckles::SpeckleOptions;
use crate::cli::{Common, check_output, list, print};
use crate::error::{Error, Result};
use crate::figures::Online;
use crate::io::write_atomic;
use crate::progress::Progress;
use crate::trigger::connection::Connection;
use crate::trigger::failure::Failure;
use crate::trigger::solve::comparison::{Comparison, Row};
use crate::trigger::solve::table::csv;
use crate::trigger::solve::twin::Twin;
use crate::trigger::solve::{Unsolved, begin, solve};
use crate::trigger::speckles::Speckles;
use crate::trigger::{units, words};
use phasewalk_firmware::message::{Hello, Model};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Options of `trigger solve`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Complex series: .npy with axes (time, y, x) or (time, z, y, x), or a .zarr group with `field`
    series: PathBuf,
    #[command(flatten)]
    speckles: SpeckleOptions,
    #[command(flatten)]
    line: Line,
    /// Only the first N volumes
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    volumes: Option<u32>,
    /// Write the phases as a table
    #[arg(short, long, value_name = "OUT.csv")]
    output: Option<PathBuf>,
    /// Draw the phases of board and host
    #[arg(long, value_name = "OUT.png")]
    plot: Option<PathBuf>,
}

impl Arguments {
    /// What the flags alone can tell.
    fn validate(&self) -> Result<()> {
        let inputs = self.speckles.inputs(&self.series);
        for (flag, path, wanted) in [("-o", &self.output, "csv"), ("--plot", &self.plot, "png")] {
            let Some(path) = path else { continue };
            if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case(wanted)) {
                let path = path.display();
                return Err(Error::usage(format!("{flag} {path}: give a name with .{wanted}")));
            }
            check_output(flag, path, &inputs)?;
        }
        Ok(())
    }
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    arguments.validate()?;
    let mut connection = arguments.line.open()?;
    let hello = connection.greet()?;
    let volumes = arguments.volumes.map(|volumes| volumes as usize);
    let speckles = arguments.speckles.read(&arguments.series, &hello.limits, volumes)?;
    let rows = rows(&mut connection, &hello, &speckles)?;
    let files = write(arguments, &speckles, &rows)?;
    let comparison = Comparison::of(&rows);
    if common.json {
        let facts = facts(arguments, &hello, &speckles, &rows, &files);
        print(&facts.to_string());
    } else {
        print(&report(&hello, &speckles, &rows, &comparison));
        if !files.is_empty() {
            print(&format!("wrote {}", list(&files)));
        }
    }
    match comparison.first_other {
        None => Ok(()),
        Some(volume) => Err(Error::failed(format!(
            "volume {volume}: the board's phase is not that of the same code here, bit for bit: \
             write its firmware anew with `phasewalk trigger flash`"
        ))),
    }
}

/// Every volume, by the board and here.
fn rows(connection: &mut Connection, hello: &Hello, speckles: &Speckles) -> Result<Vec<Row>> {
    let mut twin = Twin::new(speckles)?;
    begin(&mut connection.link, speckles)?;
    let progress = Progress::new("on-line phase", speckles.volumes() as u64);
    let mut rows = Vec::new();
    for number in 0.. {
        let Some(volume) = speckles.volume(number as usize) else { break };
        let board =
            solve(&mut connection.link, volume, number).map_err(|why| about(number, why))?;
        rows.push(Row::new(&board, &twin.push(volume), hello.limits.ticks_per_second));
        progress.advance(1)?;
    }
    Ok(rows)
}

fn about(volume: u32, why: Unsolved) -> Error {
    match why {
        Unsolved::Failed(Failure::Interrupted) => Error::Interrupted,
        Unsolved::Failed(failure) => Error::failed(format!("volume {volume}: {failure}")),
        Unsolved::Lost => Error::failed(format!(
            "volume {volume}: the board did not say its phase, or what it said was lost: try again, \
             with another cable"
        )),
    }
}

fn write(arguments: &Arguments, speckles: &Speckles, rows: &[Row]) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    if let Some(path) = &arguments.output {
        write_atomic(path, csv(rows).as_bytes())?;
        files.push(path.clone());
    }
    if let Some(path) = &arguments.plot {
        plot(path, speckles, rows)?;
        files.push(path.clone());
    }
    Ok(files)
}

fn plot(path: &Path, speckles: &Speckles, rows: &[Row]) -> Result<()> {
    let column = |value: fn(&Row) -> f64| rows.iter().map(value).collect::<Vec<f64>>();
    let label = format!("{} speckles, {} volumes", speckles.count(), rows.len());
    let figure = Online {
        label: &label,
        board: &column(|row| row.phase_rad.into()),
        sigma: &column(|row| row.sigma_rad.into()),
        host: &column(|row| row.host_phase_rad),
    };
    write_atomic(path, &figure.draw().png()?)
}

fn report(hello: &Hello, speckles: &Speckles, rows: &[Row], comparison: &Comparison) -> String {
    let Comparison { volumes, same_bits, largest_rad, rms_rad, .. } = comparison;
    let left_out = match speckles.left_out {
        0 => String::new(),
        pixels => format!(" ({pixels} pixels not finite or always zero: left out)"),
    };
    let mut lines = vec![
        format!(
            "{volumes} volumes of {} speckles{left_out}, {} looks, on the {}",
            speckles.count(),
            units::figures(speckles.looks.into()),
            words::model(hello.model)
        ),
        format!("same bits: {same_bits} of {volumes}"),
        format!(
            "against f64: largest difference {} rad, rms {} rad",
            small(*largest_rad),
            small(*rms_rad)
        ),
        format!(
            "solver: mean {} per volume, longest {}{}",
            units::rounded(comparison.mean_us * 1e-6),
            units::rounded(comparison.longest_us * 1e-6),
            if emulated(hello) { " (by the emulator's clock, not a board's)" } else { "" }
        ),
    ];
    if let Some(last) = rows.last() {
        lines.push(format!("last phase: {:.4} ± {:.4} rad", last.phase_rad, last.sigma_rad));
    }
    lines.join("\n")
}

/// Its time is not a board's.
fn emulated(hello: &Hello) -> bool {
    hello.model == Model::Rehearsal
}

/// Differences are often far below a thousandth.
fn small(radians: f64) -> String {
    format!("{radians:.1e}")
}

fn facts(
    arguments: &Arguments,
    hello: &Hello,
    speckles: &Speckles,
    rows: &[Row],
    files: &[PathBuf],
) -> Value {
    let comparison = Comparison::of(rows);
    let last = rows.last();
    json!({
        "software": concat!("phasewalk ", env!("CARGO_PKG_VERSION")),
        "series": arguments.series,
        "board": words::model(hello.model),
        "volumes": comparison.volumes,
        "speckles": speckles.count(),
        "looks": speckles.looks,
        "pixels_left_out": speckles.left_out,
        "same_bits": comparison.same_bits,
        "first_other_volume": comparison.first_other,
        "largest_difference_rad": comparison.largest_rad,
        "rms_difference_rad": comparison.rms_rad,
        "emulated": emulated(hello),
        "mean_us": comparison.mean_us,
        "longest_us": comparison.longest_us,
        "last_phase_rad": last.map(|row| row.phase_rad),
        "last_sigma_rad": last.map(|row| row.sigma_rad),
        "files": files,
    })
}
