//! `phasewalk trigger flash`: write the firmware into the board.

use super::line::Line;
use crate::cli::{Common, print};
use crate::error::{Error, Result};
use crate::trigger::connection::Connection;
use crate::trigger::flash::Image;
use crate::trigger::{port, words};
use serde_json::json;
use std::path::PathBuf;

/// Options of `trigger flash`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    line: Line,
    /// Image of an Arduino Uno in Intel HEX [default: target/firmware/uno.hex]
    #[arg(long, value_name = "FILE.hex")]
    image: Option<PathBuf>,
    /// Only print the command that would be run
    #[arg(long)]
    dry_run: bool,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let image = Image::read(arguments.image.as_deref())?;
    let port = match &arguments.line.port {
        Some(port) if port.starts_with("sim:") => {
            return Err(Error::usage("--port sim: takes its image by name, as sim:IMAGE.elf"));
        }
        Some(port) => port.clone(),
        None => port::the_board()?,
    };
    if !common.json {
        let (bytes, hash) = (image.bytes.len(), words::hex(image.hash()));
        print(&format!("{}: {bytes} bytes, hash {hash}", image.path.display()));
    }
    if arguments.dry_run {
        print(&image.command(&port).join(" "));
        return Ok(());
    }
    image.write(&port)?;
    verify(&image, &port, arguments.line.baud, common)
}

/// The board itself says what is in its program memory.
fn verify(image: &Image, port: &str, baud: u32, common: &Common) -> Result<()> {
    let mut connection = Connection::open(Some(port), baud, &[])?;
    let hello = connection.greet()?;
    image.compare(&hello)?;
    let version = words::version(hello.version);
    let hash = words::hex(hello.image);
    if common.json {
        let bytes = image.bytes.len();
        let model = words::model(hello.model);
        let facts = json!({
            "port": port, "image": image.path, "bytes": bytes, "hash": hash, "board": model,
            "version": version,
        });
        print(&facts.to_string());
    } else {
        print(&format!("{port}: firmware {version} runs, its program memory verified ({hash})"));
    }
    Ok(())
}
