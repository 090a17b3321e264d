//! The serial line as a pseudo-terminal.

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::{read, ttyname, write};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};

/// Bytes kept for a program that has the port open and does not read.
const BACKLOG: usize = 1 << 20;

/// A port that other programs open as they open a serial port.
///
/// While nobody has it open, bytes to the outside are lost, as on a wire.
pub struct Port {
    inside: OwnedFd,
    path: PathBuf,
    open: bool,
    backlog: Vec<u8>,
}

impl Port {
    /// A new port, in raw mode.
    ///
    /// # Errors
    /// If the system gives none.
    pub fn new() -> io::Result<Self> {
        let pair = openpty(None, None)?;
        let mut settings = tcgetattr(&pair.slave)?;
        cfmakeraw(&mut settings);
        tcsetattr(&pair.slave, SetArg::TCSANOW, &settings)?;
        let path = ttyname(&pair.slave)?;
        let _ = fcntl(&pair.master, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        Ok(Self { inside: pair.master, path, open: false, backlog: Vec::new() })
    }

    /// The file which other programs open.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Look whether somebody has the port open; true if that began since the last look. Somebody
    /// who closes and opens it again between two looks goes unnoticed.
    ///
    /// # Errors
    /// If the system does not tell.
    pub fn newly_opened(&mut self) -> io::Result<bool> {
        let mut state = [PollFd::new(self.inside.as_fd(), PollFlags::POLLIN)];
        let _ = poll(&mut state, PollTimeout::ZERO)?;
        let hung_up = state[0].revents().is_some_and(|flags| flags.contains(PollFlags::POLLHUP));
        let before = std::mem::replace(&mut self.open, !hung_up);
        if hung_up {
            self.backlog.clear();
        }
        Ok(self.open && !before)
    }

    /// What has come in.
    ///
    /// # Errors
    /// If reading fails for another reason than that nobody is there.
    pub fn read(&mut self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; 4096];
        let count = match read(&self.inside, &mut bytes) {
            Ok(count) => count,
            Err(Errno::EAGAIN | Errno::EIO | Errno::EINTR) => 0,
            Err(error) => return Err(error.into()),
        };
        bytes.truncate(count);
        Ok(bytes)
    }

    /// Send bytes out, or keep them until there is room.
    ///
    /// # Errors
    /// If writing fails for another reason than that nobody is there or reads.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        if !self.open {
            return Ok(());
        }
        self.backlog.extend_from_slice(bytes);
        let written = match self.backlog.as_slice() {
            [] => 0,
            bytes => match write(&self.inside, bytes) {
                Ok(count) => count,
                Err(Errno::EAGAIN | Errno::EIO | Errno::EINTR) => 0,
                Err(error) => return Err(error.into()),
            },
        };
        let surplus = (self.backlog.len() - written).saturating_sub(BACKLOG);
        let _ = self.backlog.drain(..written + surplus);
        Ok(())
    }
}
