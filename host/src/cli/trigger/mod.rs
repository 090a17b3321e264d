//! `phasewalk trigger`: the board that starts laser, camera and stimulus.

mod abort;
mod check;
mod confirm;
mod flash;
mod info;
mod line;
mod log;
mod outcome;
mod ports;
mod preview;
mod run;
mod selftest;
mod solve;
mod speckles;

use super::Common;
use crate::error::Result;
use clap::Subcommand;

/// Commands of the trigger board.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Serial ports, and which of them a trigger board may be at
    Ports(ports::Arguments),
    /// Who the board is, what it can do and how it is
    Info(info::Arguments),
    /// Check a plan: rules, timing certificate, exposure, camera memory
    Check(check::Arguments),
    /// Draw what the board will do with a plan: SVG, VCD or WaveDrom
    Preview(preview::Arguments),
    /// Write the firmware into the board
    Flash(flash::Arguments),
    /// Run a plan on the board and record every edge
    Run(run::Arguments),
    /// All outputs low, now
    Abort(abort::Arguments),
    /// What a run log says
    Log(log::Arguments),
    /// Stream a series to the board's on-line solver and compare its phases with the same code here
    Solve(solve::Arguments),
    /// The board measures its own edges, over a jumper
    Selftest(selftest::Arguments),
}

/// Run one of them.
///
/// # Errors
/// Those of the command.
pub fn run(command: &Command, common: &Common) -> Result<()> {
    match command {
        Command::Ports(arguments) => ports::run(arguments, common),
        Command::Info(arguments) => info::run(arguments, common),
        Command::Check(arguments) => check::run(arguments, common),
        Command::Preview(arguments) => preview::run(arguments, common),
        Command::Flash(arguments) => flash::run(arguments, common),
        Command::Run(arguments) => run::run(arguments, common),
        Command::Abort(arguments) => abort::run(arguments, common),
        Command::Log(arguments) => log::run(arguments, common),
        Command::Solve(arguments) => solve::run(arguments, common),
        Command::Selftest(arguments) => selftest::run(arguments, common),
    }
}
