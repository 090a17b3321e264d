//! `phasewalk trigger abort`: all outputs low, now.

use super::line::Line;
use crate::cli::{Common, print};
use crate::error::{Error, Result};
use crate::trigger::link::BOOT_PATIENCE;
use crate::trigger::words;
use phasewalk_firmware::message::Status;
use serde_json::json;

/// Options of `trigger abort`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    line: Line,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let mut connection = arguments.line.open()?;
    // First of all, whatever state, protocol or numbering the board has: it takes this always.
    let aborted = connection.link.abort(BOOT_PATIENCE);
    aborted.map_err(|failure| unsure(connection.explain(failure)))?;
    let status = connection.link.status().map_err(|failure| unsure(connection.explain(failure)))?;
    report(&connection.port, &status.status, common.json)
}

fn report(port: &str, status: &Status, as_json: bool) -> Result<()> {
    let (safe, state) = (words::is_safe(&status.state), words::state(&status.state));
    if as_json {
        print(&json!({ "port": port, "safe": safe, "status": status }).to_string());
    } else {
        print(&format!("{port}: {state}"));
    }
    if safe {
        return Ok(());
    }
    Err(Error::failed(format!("{port}: the board is still {state}: cut its power")))
}

fn unsure(error: Error) -> Error {
    match error {
        Error::Failed(what) => Error::failed(format!("not aborted: cut the board's power; {what}")),
        other => other,
    }
}
