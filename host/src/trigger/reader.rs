//! The listening thread: takes every byte as it comes, stamps every message with its time.
//!
//! A thread of its own, so that neither a slow disk nor a slow terminal lets the operating
//! system's buffer of the line overflow.

use phasewalk_firmware::frame::{Received, Receiver as Frames};
use phasewalk_firmware::message::Answer;
use std::io::{ErrorKind, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Instant;

/// What came over the line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Arrived {
    /// A message, and when its last byte was read.
    Message(Answer, Instant),
    /// A frame that cannot be understood.
    Garbled,
    /// The line is gone: the last thing that comes.
    Gone(String),
}

/// The thread; dropped, it ends with the next time-out of the line.
#[derive(Debug)]
pub(super) struct Listener {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Listener {
    /// Listen to `line`, whose `read` must return (with `TimedOut`) after some tens of
    /// milliseconds without a byte.
    pub(super) fn start(line: Box<dyn Read + Send>) -> (Self, Receiver<Arrived>) {
        let stop = Arc::new(AtomicBool::new(false));
        let (sender, receiver) = channel();
        let flag = Arc::clone(&stop);
        let thread = std::thread::spawn(move || listen(line, &sender, &flag));
        (Self { stop, thread: Some(thread) }, receiver)
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn listen(mut line: Box<dyn Read + Send>, sender: &Sender<Arrived>, stop: &AtomicBool) {
    let mut frames = Frames::default();
    let mut bytes = [0; 1024];
    while !stop.load(Ordering::Relaxed) {
        let taken = match line.read(&mut bytes) {
            Ok(0) => return gone(sender, "end of file"),
            Ok(taken) => taken,
            Err(error) if is_pause(error.kind()) => continue,
            Err(error) => return gone(sender, &error.to_string()),
        };
        let now = Instant::now();
        for &byte in bytes.iter().take(taken) {
            let arrived = match frames.take(byte) {
                Received::Nothing => continue,
                Received::Garbled => Arrived::Garbled,
                Received::Message(answer) => Arrived::Message(answer, now),
            };
            if sender.send(arrived).is_err() {
                return;
            }
        }
    }
}

fn is_pause(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

fn gone(sender: &Sender<Arrived>, why: &str) {
    // Nobody listens any more: fine.
    let _ = sender.send(Arrived::Gone(why.to_owned()));
}
