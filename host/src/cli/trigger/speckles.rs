//! Options that choose the speckles for the board's on-line solver.

use crate::error::{Error, Result};
use crate::looks::Looks;
use crate::trigger::speckles::{Choice, Speckles};
use phasewalk_firmware::limits::Limits;
use std::path::{Path, PathBuf};

/// Which speckles of a series.
#[derive(Debug, clap::Args)]
pub(super) struct SpeckleOptions {
    /// Pixels of this mask (y, x), true or non-zero inside [default: all]
    #[arg(long, value_name = "M.npy")]
    mask: Option<PathBuf>,
    /// Only so many of these pixels, taken evenly
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pick: Option<u16>,
    /// Depth pixel of a series with axes (time, z, y, x)
    #[arg(long, value_name = "Z")]
    depth: Option<usize>,
    /// Looks of the speckles, for qualities and standard deviation: nominal (each is one), effective
    /// (estimated from the volumes) or a number [default: nominal]
    #[arg(long, value_name = "LOOKS")]
    looks: Option<Looks>,
}

impl SpeckleOptions {
    /// The name of an option that was given, if one was.
    pub(super) fn given(&self) -> Option<&'static str> {
        let Self { mask, pick, depth, looks } = self;
        [
            ("--mask", mask.is_some()),
            ("--pick", pick.is_some()),
            ("--depth", depth.is_some()),
            ("--looks", looks.is_some()),
        ]
        .into_iter()
        .find_map(|(name, given)| given.then_some(name))
    }

    /// Read them for a board.
    pub(super) fn read(
        &self,
        series: &Path,
        board: &Limits,
        volumes: Option<usize>,
    ) -> Result<Speckles> {
        if board.speckles == 0 {
            return Err(Error::usage(
                "the board has no on-line solver: take one that has (STM32F405)",
            ));
        }
        let choice = Choice {
            mask: self.mask.as_deref(),
            pick: self.pick.map(usize::from),
            depth: self.depth,
            looks: self.looks,
        };
        Speckles::read(series, &choice, board.speckles.into(), volumes)
    }

    /// The files that are read.
    pub(super) fn inputs<'a>(&'a self, series: &'a Path) -> Vec<&'a Path> {
        std::iter::once(series).chain(self.mask.as_deref()).collect()
    }
}
