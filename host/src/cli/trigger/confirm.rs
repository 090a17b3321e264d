//! Asking at the terminal, so that Ctrl-C answers too.

use crate::error::{Error, Result};
use crate::progress;
use std::io::{IsTerminal, Write};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Refuse where nobody can be asked, before anything is touched.
///
/// # Errors
/// When standard input is no terminal.
pub(super) fn check_terminal() -> Result<()> {
    if std::io::stdin().is_terminal() {
        return Ok(());
    }
    Err(Error::usage("--yes: needed here, since there is no terminal at which to ask"))
}

/// Ask `question`; only "yes" is yes.
///
/// # Errors
/// [`Error::Interrupted`] by Ctrl-C; another answer is an error as well, for nothing was done.
pub(super) fn confirm(question: &str) -> Result<()> {
    let _ = write!(std::io::stderr(), "{question} Type yes to go on: ");
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let mut line = String::new();
        let _ = std::io::stdin().read_line(&mut line);
        let _ = sender.send(line);
    });
    loop {
        progress::check()?;
        match receiver.recv_timeout(Duration::from_millis(50)) {
            Ok(line) if ["yes", "y"].contains(&line.trim().to_lowercase().as_str()) => {
                return Ok(());
            }
            Err(RecvTimeoutError::Timeout) => {}
            _ => return Err(Error::usage("not confirmed: nothing was done")),
        }
    }
}
