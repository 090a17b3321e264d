//! `phasewalk trigger flash`: write the firmware into the board.

use super::check::BoardName;
use super::line::Line;
use crate::cli::{Common, print};
use crate::error::{Error, Result};
use crate::trigger::connection::Connection;
use crate::trigger::flash::{Image, Target};
use crate::trigger::{port, words};
use serde_json::json;
use std::path::PathBuf;

/// Options of `trigger flash`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    line: Line,
    /// Board that is written: an Uno at --port; an STM32F405 in DFU mode at the USB, verified if
    /// --port is given
    #[arg(long, value_enum, default_value_t = BoardName::Uno)]
    board: BoardName,
    /// Image: Intel HEX of an Uno, plain bytes of an STM32F405 [default: target/firmware/uno.hex,
    /// target/firmware/f405.bin]
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// Only print the command that would be run
    #[arg(long)]
    dry_run: bool,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let target = match arguments.board {
        BoardName::Uno => Target::Uno,
        BoardName::F405 => Target::F405,
    };
    let image = Image::read(target, arguments.image.as_deref())?;
    let port = match &arguments.line.port {
        Some(port) if port.starts_with("sim:") => {
            return Err(Error::usage("--port sim: takes its image by name, as sim:IMAGE.elf"));
        }
        Some(port) => Some(port.clone()),
        // Its boot loader is not at a serial port.
        None if target == Target::F405 => None,
        None => Some(port::the_board()?),
    };
    let at = port.as_deref().unwrap_or_default();
    if !common.json {
        let (bytes, hash) = (image.bytes.len(), words::hex(image.hash()));
        print(&format!("{}: {bytes} bytes, hash {hash}", image.path.display()));
    }
    if arguments.dry_run {
        print(&image.command(at).join(" "));
        return Ok(());
    }
    image.write(at)?;
    match &port {
        Some(port) => verify(&image, port, arguments.line.baud, common),
        None => written(&image, common),
    }
}

/// Nobody was asked what has arrived.
fn written(image: &Image, common: &Common) -> Result<()> {
    if common.json {
        let (bytes, hash) = (image.bytes.len(), words::hex(image.hash()));
        print(&json!({ "image": image.path, "bytes": bytes, "hash": hash }).to_string());
    } else {
        print("written; with --port the board is asked what is in its program memory");
    }
    Ok(())
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
