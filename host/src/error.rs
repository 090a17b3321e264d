//! The one error type of the host: a line that says what, where and what to do.

use std::path::Path;

/// What ended a run, each with its exit status.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command or a parameter is wrong: nothing was computed. Exit status 2.
    #[error("{0}")]
    Usage(String),
    /// An input, an output or the machine failed. Exit status 1.
    #[error("{0}")]
    Failed(String),
    /// Ctrl-C or SIGTERM. Exit status 130.
    #[error("interrupted: stopped at your request")]
    Interrupted,
    /// The same, and what was done is kept: the line says where. Exit status 130.
    #[error("{0}")]
    Kept(String),
}

/// Result of everything in the host that can fail.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Wrong use: the message names the flag and the fix.
    pub fn usage(message: impl Into<String>) -> Self {
        Self::Usage(message.into())
    }

    /// A file that cannot be used: where, what, what to do.
    pub fn file(path: &Path, what: impl std::fmt::Display) -> Self {
        Self::Failed(format!("{}: {what}", path.display()))
    }

    /// The same error with the file it is about, unless it names it already.
    #[must_use]
    pub fn about(self, path: &Path) -> Self {
        match self {
            Self::Failed(_) if self.names(path) => self,
            Self::Failed(message) => Self::file(path, message),
            other => other,
        }
    }

    /// Whether it is about this file or folder.
    #[must_use]
    pub fn names(&self, path: &Path) -> bool {
        matches!(self, Self::Failed(message) if message.starts_with(&path.display().to_string()))
    }

    /// Anything else that failed.
    pub fn failed(message: impl Into<String>) -> Self {
        Self::Failed(message.into())
    }

    /// Exit status of the program.
    #[must_use]
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Failed(_) => 1,
            Self::Usage(_) => 2,
            Self::Interrupted | Self::Kept(_) => 130,
        }
    }
}

impl From<phasewalk_core::Error> for Error {
    fn from(error: phasewalk_core::Error) -> Self {
        Self::Usage(error.to_string())
    }
}
