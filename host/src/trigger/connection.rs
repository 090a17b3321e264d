//! From the name of a port to a board that has said who it is.

use super::emulated::EmulatedBoard;
use super::failure::Failure;
use super::link::{BOOT_PATIENCE, Link};
use super::{port, words};
use crate::error::{Error, Result};
use phasewalk_firmware::message::{Hello, PROTOCOL};
use std::path::Path;

/// Before the path of an image that is to be emulated.
const EMULATED: &str = "sim:";

/// A line to a port, with the emulated board behind it if it is one.
pub struct Connection {
    /// The line.
    pub link: Link,
    /// The port, for messages and the log.
    pub port: String,
    /// Ends after the line is closed.
    _emulated: Option<EmulatedBoard>,
}

impl Connection {
    /// Open `port`: a device file, `sim:`, `sim:f405` or `sim:IMAGE` for an emulated board, or the
    /// one port that may have a board. An emulated board gets the `jumpers` (such as `D9-D8`) that a person
    /// puts on a real one.
    ///
    /// # Errors
    /// When it cannot be found or opened.
    pub fn open(port: Option<&str>, baud: u32, jumpers: &[&str]) -> Result<Self> {
        let name = match port {
            Some(name) => name.to_owned(),
            None => port::the_board()?,
        };
        let Some(image) = name.strip_prefix(EMULATED) else {
            let link = port::open(&name, baud)?;
            return Ok(Self { link, port: name, _emulated: None });
        };
        let image = Some(Path::new(image)).filter(|image| !image.as_os_str().is_empty());
        let emulated = EmulatedBoard::start(image, jumpers)?;
        let link = port::open(&emulated.port, baud)?;
        Ok(Self { link, port: name, _emulated: Some(emulated) })
    }

    /// Ask the board who it is, and see that it speaks the same protocol.
    ///
    /// # Errors
    /// When it does not answer or speaks another one.
    pub fn greet(&mut self) -> Result<Hello> {
        let hello = self.link.hello(BOOT_PATIENCE).map_err(|failure| self.explain(failure))?;
        same_protocol(&hello).map_err(|what| Error::failed(format!("{}: {what}", self.port)))?;
        Ok(hello)
    }

    /// What to do about a board that does not speak.
    #[must_use]
    pub fn explain(&self, failure: Failure) -> Error {
        let port = &self.port;
        match failure {
            Failure::Interrupted => Error::Interrupted,
            Failure::Silent { garbled: 0, .. } => Error::failed(format!(
                "{port}: {failure}: is it the right port (`phasewalk trigger ports`), and is \
                 Phasewalk's firmware on the board (`phasewalk trigger flash --port {port}`)?"
            )),
            Failure::Silent { .. } => Error::failed(format!(
                "{port}: {failure}: other firmware or another --baud; `phasewalk trigger flash \
                 --port {port}` writes Phasewalk's firmware"
            )),
            other => Error::failed(format!("{port}: {other}")),
        }
    }
}

fn same_protocol(hello: &Hello) -> std::result::Result<(), String> {
    if hello.protocol == PROTOCOL {
        return Ok(());
    }
    Err(format!(
        "the board's firmware {} speaks the protocol {}, this program {} the protocol {}: write \
         the firmware that belongs to this program with `phasewalk trigger flash`",
        words::version(hello.version),
        words::hex(hello.protocol),
        env!("CARGO_PKG_VERSION"),
        words::hex(PROTOCOL),
    ))
}
