//! `phasewalk trigger check`

use crate::cli::{Common, print};
use crate::error::Result;
use crate::trigger::check::{Checked, check_plan};
use crate::trigger::ledger::{Doses, Ledger};
use crate::trigger::limits::LimitsFile;
use crate::trigger::plan_file::{Loaded, load};
use clap::ValueEnum;
use phasewalk_firmware::limits::Limits;
use std::path::PathBuf;

/// Options of `trigger check`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    plan: PlanOptions,
    #[command(flatten)]
    safety: SafetyOptions,
}

/// Which plan.
#[derive(Debug, clap::Args)]
pub(super) struct PlanOptions {
    /// Plan file (TOML), or a preset: paper, pairs, triples
    plan: String,
    /// Change a key, the value with its unit: interval=300s, volumes=10, stimulus.duration=2s
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Board for which it is checked
    #[arg(long, value_enum, default_value_t = BoardName::Uno)]
    board: BoardName,
}

/// The boards there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum BoardName {
    /// Arduino Uno
    Uno,
    /// STM32F405: with on-line solver and frame clock
    F405,
}

impl BoardName {
    /// What it can do.
    pub(super) const fn limits(self) -> Limits {
        match self {
            Self::Uno => Limits::UNO,
            Self::F405 => Limits::F405,
        }
    }
}

impl PlanOptions {
    /// Load it for its board.
    pub(super) fn load(&self) -> Result<(Loaded, Limits)> {
        let board = self.board.limits();
        Ok((load(&self.plan, &self.set, &board)?, board))
    }
}

/// Against what it is checked.
#[derive(Debug, clap::Args)]
pub(super) struct SafetyOptions {
    /// The laboratory's limits (TOML) [default: a built-in example, not certified]
    #[arg(long, value_name = "FILE")]
    limits: Option<PathBuf>,
    /// Dose ledger: what the subject has got in the last 24 hours counts
    #[arg(long, value_name = "FILE", requires = "subject")]
    ledger: Option<PathBuf>,
    /// Label of the subject in the ledger
    #[arg(long, value_name = "LABEL", requires = "ledger")]
    subject: Option<String>,
}

impl SafetyOptions {
    /// Check a plan by them.
    pub(super) fn check(&self, loaded: &Loaded, board: &Limits) -> Result<Checked> {
        let limits = LimitsFile::load(self.limits.as_deref())?;
        check_plan(loaded, &limits, self.before()?.as_ref(), board)
    }

    fn before(&self) -> Result<Option<Doses>> {
        let (Some(path), Some(subject)) = (&self.ledger, &self.subject) else { return Ok(None) };
        Ledger::open(path).map(|ledger| Some(ledger.today(subject)))
    }
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let (loaded, board) = arguments.plan.load()?;
    let checked = arguments.safety.check(&loaded, &board)?;
    if common.json {
        print(&checked.json(&loaded, &board).to_string());
    } else {
        print(&checked.text(&loaded, &board));
    }
    Ok(())
}
