//! `phasewalk trigger preview`

use super::check::{PlanOptions, SafetyOptions};
use crate::cli::{Common, print};
use crate::error::Result;
use crate::io::write_atomic;
use crate::trigger::preview::{Trace, ascii, draw};
use serde_json::json;
use std::path::PathBuf;

/// Options of `trigger preview`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    plan: PlanOptions,
    #[command(flatten)]
    safety: SafetyOptions,
    /// Picture .svg, logic signals .vcd or WaveDrom .json [default: an overview on the terminal]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let (loaded, board) = arguments.plan.load()?;
    let checked = arguments.safety.check(&loaded, &board)?;
    let trace = Trace::new(&loaded, &checked, &board)?;
    if let Some(path) = &arguments.output {
        let bytes = draw(&trace, path)?;
        write_atomic(path, &bytes)?;
    }
    if common.json {
        let (edges, hash) = (trace.edges.len(), format!("{:08x}", trace.hash));
        let files: Vec<&PathBuf> = arguments.output.iter().collect();
        print(
            &json!({ "plan": trace.name, "hash": hash, "edges": edges, "files": files })
                .to_string(),
        );
    } else if let Some(path) = &arguments.output {
        print(&format!("wrote {}: {} edges", path.display(), trace.edges.len()));
    } else {
        print(&ascii(&trace));
    }
    Ok(())
}
