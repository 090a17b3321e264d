//! Options of every command that talks to a board.

use crate::error::Result;
use crate::trigger::connection::Connection;
use crate::trigger::port::BAUD;

/// The line to the board.
#[derive(Debug, clap::Args)]
pub(super) struct Line {
    /// Serial port of the board; `sim:`, `sim:f405` or `sim:IMAGE.elf` starts an emulated board
    /// [default: the one port that has a known board]
    #[arg(long, value_name = "PORT")]
    pub(super) port: Option<String>,
    /// Bits per second
    #[arg(long, default_value_t = BAUD, value_parser = clap::value_parser!(u32).range(300..=4_000_000))]
    pub(super) baud: u32,
}

impl Line {
    /// Open it.
    pub(super) fn open(&self) -> Result<Connection> {
        self.open_with(&[])
    }

    /// Open it; an emulated board gets these jumpers.
    pub(super) fn open_with(&self, jumpers: &[&str]) -> Result<Connection> {
        Connection::open(self.port.as_deref(), self.baud, jumpers)
    }
}
