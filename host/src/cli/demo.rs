//! `phasewalk demo`.

use super::Common;
use crate::error::Result;
use std::path::PathBuf;

/// Options of `demo`.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Folder for the figures and the report
    #[arg(long, value_name = "DIR", default_value = "phasewalk-demo")]
    out: PathBuf,
}

pub(super) fn run(_arguments: &Arguments, _common: &Common) -> Result<()> {
    Ok(())
}
