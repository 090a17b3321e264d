//! Progress bars, and the flag that Ctrl-C raises.
//!
//! Long loops call [`Progress::advance`]: it moves the bar and ends the loop with
//! [`Error::Interrupted`] once the user has asked to stop, so that temporary files are dropped
//! (and with them removed) on the ordinary way out.

use crate::error::{Error, Result};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Make Ctrl-C (SIGINT) and SIGTERM raise the flag that [`check`] reads.
///
/// # Errors
/// When the operating system refuses the handler.
pub fn install_interrupt_handler() -> Result<()> {
    ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed))
        .map_err(|e| Error::failed(format!("cannot install the Ctrl-C handler: {e}")))
}

/// `Err(Interrupted)` once the user has asked to stop.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn check() -> Result<()> {
    if INTERRUPTED.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}

/// A bar with the time left, drawn on standard error when that is a terminal and silent otherwise.
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar of `total` steps.
    #[must_use]
    pub fn new(label: &str, total: u64) -> Self {
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template(
            "{msg:<22} [{bar:32}] {percent:>3} %  {elapsed_precise} gone, {eta_precise} left",
        )
        .unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style.progress_chars("=> "));
        bar.set_message(label.to_owned());
        Self { bar }
    }

    /// No bar (tests, nested work); interruption still works.
    #[must_use]
    pub fn hidden() -> Self {
        Self { bar: ProgressBar::hidden() }
    }

    /// Move on by `steps`.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once the user has asked to stop.
    pub fn advance(&self, steps: u64) -> Result<()> {
        self.bar.inc(steps);
        check()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
