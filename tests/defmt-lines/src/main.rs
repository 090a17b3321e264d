//! `defmt-lines IMAGE.elf < FRAMES`: defmt's frames as lines, `TIMESTAMP WORDS`.

use defmt_decoder::{DecodeError, Table};
use std::io::Read;
use std::process::ExitCode;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("defmt-lines: {what}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), String> {
    let image = std::env::args_os().nth(1).ok_or("which image?")?;
    let bytes = std::fs::read(&image).map_err(|e| format!("{}: {e}", image.display()))?;
    let table = Table::parse(&bytes).map_err(|e| format!("{}: {e}", image.display()))?;
    let table = table.ok_or_else(|| format!("{}: it does not log", image.display()))?;
    let mut frames = Vec::new();
    std::io::stdin().read_to_end(&mut frames).map_err(|e| format!("no frames: {e}"))?;
    let mut decoder = table.new_stream_decoder();
    decoder.received(&frames);
    loop {
        match decoder.decode() {
            Ok(frame) => {
                let time = frame.display_timestamp().map(|time| time.to_string());
                println!("{} {}", time.unwrap_or_default(), frame.display_message());
            }
            Err(DecodeError::UnexpectedEof) => return Ok(()),
            Err(DecodeError::Malformed) => return Err("a damaged frame".to_owned()),
        }
    }
}
