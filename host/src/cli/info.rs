//! `phasewalk info FILE`.

use super::{Common, print};
use crate::error::{Error, Result};
use crate::io::describe;
use std::path::PathBuf;

/// Options of `info`.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// An .npy or .csv file, a .zarr folder, or a camera recording (.cihx, .cih, .mraw)
    file: PathBuf,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let description = describe(&arguments.file)?;
    if common.json {
        let json = serde_json::to_string(&description);
        print(&json.map_err(|e| Error::failed(format!("cannot print the description: {e}")))?);
    } else {
        print(&description.to_string());
    }
    Ok(())
}
