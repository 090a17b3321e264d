//! A large file goes to the disk while it is still being written, so that nobody has to wait for all of it at the end.

use std::fs::File;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Bytes after which the disk is asked for.
const PORTION: u64 = 1 << 23;

/// A thread that sends what has been written of a file to the disk. Dropped, it ends when it has done so.
pub(super) struct Flush {
    /// Bytes written that it has not been told of.
    waiting: AtomicU64,
    wake: SyncSender<()>,
    thread: JoinHandle<io::Result<()>>,
}

impl Flush {
    /// Begin for a file of `bytes` bytes; none where it is small, or the system has no thread to give.
    pub(super) fn begin(file: &File, bytes: u64) -> Option<Box<Self>> {
        if bytes < 2 * PORTION {
            return None;
        }
        let file = file.try_clone().ok()?;
        let (wake, awake) = sync_channel(1);
        let flush = move || awake.into_iter().try_for_each(|()| file.sync_data());
        let thread = std::thread::Builder::new().name("flush".to_owned()).spawn(flush).ok()?;
        Some(Box::new(Self { waiting: AtomicU64::new(0), wake, thread }))
    }

    /// So many bytes have been written.
    pub(super) fn written(&self, bytes: u64) {
        if self.waiting.fetch_add(bytes, Ordering::Relaxed) + bytes >= PORTION {
            self.waiting.store(0, Ordering::Relaxed);
            // If it is still busy, or has met an error that `finish` will tell, this portion goes with the next.
            let _ = self.wake.try_send(());
        }
    }

    /// Wait for what is under way.
    ///
    /// # Errors
    /// What the disk has reported meanwhile: it tells each failure only once.
    pub(super) fn finish(self) -> io::Result<()> {
        drop(self.wake);
        self.thread.join().unwrap_or_else(|_| Err(io::Error::other("the flushing thread failed")))
    }
}
