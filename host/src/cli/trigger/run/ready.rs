//! A plan that may be sent.

use super::Arguments;
use crate::error::{Error, Result};
use crate::trigger::certificate::certify;
use crate::trigger::check::{broken, check_plan, compile};
use crate::trigger::ledger::Doses;
use crate::trigger::limits::LimitsFile;
use crate::trigger::plan_file::Loaded;
use phasewalk_firmware::check::check;
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::plan::Plan;

/// A plan that may be sent.
pub(super) struct Ready {
    /// With the caps that the board gets.
    pub(super) plan: Plan,
    /// The bytes to send.
    pub(super) compiled: Compiled,
    /// What it brings to the eye, for the ledger.
    pub(super) doses: Doses,
    /// What is worth a word.
    pub(super) warnings: Vec<String>,
    /// All of it, for the person who starts it.
    pub(super) text: String,
}

impl Ready {
    /// Check the plan for a board.
    pub(super) fn check(
        arguments: &Arguments,
        loaded: &Loaded,
        before: Option<Doses>,
        board: &Limits,
    ) -> Result<Self> {
        let limits = LimitsFile::load(arguments.limits.as_deref())?;
        if arguments.force
            && let Some(forced) = Self::forced(loaded, &limits, board)?
        {
            return Ok(forced);
        }
        let checked = check_plan(loaded, &limits, before.as_ref(), board)?;
        let text = checked.text(loaded, board);
        let doses = checked.budget.doses;
        let (plan, compiled, warnings) = (checked.plan, checked.compiled, checked.warnings);
        Ok(Self { plan, compiled, doses, warnings, text })
    }

    /// A plan that keeps all rules but has no timing certificate; none if it has one. The
    /// exposure is not budgeted, since the budget adds up the certificate's edges; the caps hold.
    fn forced(loaded: &Loaded, limits: &LimitsFile, board: &Limits) -> Result<Option<Self>> {
        let refuse = |what: String| Error::failed(format!("{}: {what}", loaded.source));
        let mut plan = loaded.plan;
        plan.caps = limits.caps(&plan, board);
        check(&plan, board).map_err(|violation| refuse(broken(&violation, limits, board)))?;
        let compiled = compile(&plan, board).map_err(refuse)?;
        let Err(error) = certify(&compiled, 1, board) else { return Ok(None) };
        let warning = format!("forced: no timing certificate ({error}), exposure not budgeted");
        let mut warnings = loaded.warnings.clone();
        warnings.push(warning.clone());
        let text = format!("{} ({})\nwarning: {warning}", loaded.name, loaded.source);
        Ok(Some(Self { plan, compiled, doses: Doses::new(), warnings, text }))
    }
}
