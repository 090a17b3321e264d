//! What waits to be said: answers first, then events, byte by byte.

use crate::board::Line;
use crate::frame::{self, Frame};
use crate::message::{Answer, Event, Refusal};
use heapless::Deque;

/// Events that can wait.
const EVENTS: usize = 8;

/// Bytes of a pass at most: so its length has a bound.
const BYTES: usize = 16;

/// An answer that waits. What is long is put together when it can be said, not before: memory is
/// short.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pending {
    /// Who the board is.
    Hello,
    /// How it is.
    Status,
    /// Done.
    Done,
    /// The hash of a plan.
    Hash(u32),
    /// For arming.
    Nonce(u32),
    /// Not done.
    Refused(Refusal),
}

/// What waits to be said.
#[derive(Debug, Default)]
pub struct Outbox {
    reply: Option<(u8, Pending)>,
    events: Deque<Event, EVENTS>,
    /// Number of the next event to be queued.
    number: u16,
    lost: u16,
    frame: Frame,
    said: usize,
}

impl Outbox {
    /// Answer request `number`. A reply that the host no longer waits for is replaced.
    pub fn reply(&mut self, number: u8, reply: Pending) {
        self.reply = Some((number, reply));
    }

    /// Tell what happened. What finds no room is lost, and counted; how a run ended is not what is lost.
    #[inline(never)]
    pub fn tell(&mut self, event: Event) {
        self.number = self.number.wrapping_add(1);
        if self.events.is_full() {
            self.lost = self.lost.saturating_add(1);
            if matches!(event, Event::Stopped { .. } | Event::Finished { .. }) {
                let _ = self.events.pop_front();
            }
        }
        let _ = self.events.push_back(event);
    }

    /// Events lost since the board started.
    #[must_use]
    pub fn lost(&self) -> u16 {
        self.lost
    }

    /// Nothing is being said: what comes next can be put together.
    #[must_use]
    pub fn is_free(&self) -> bool {
        self.said >= self.frame.len()
    }

    /// The answer that waits.
    pub fn next_reply(&mut self) -> Option<(u8, Pending)> {
        self.reply.take()
    }

    /// The event that waits.
    pub fn next_event(&mut self) -> Option<Answer> {
        let waiting = self.events.len() as u16;
        let event = self.events.pop_front()?;
        // After a loss the numbers jump: the newest waiting event keeps the newest number.
        Some(Answer::Event { number: self.number.wrapping_sub(waiting), event })
    }

    /// Say this next.
    #[inline(never)]
    pub fn say(&mut self, answer: &Answer) {
        self.said = 0;
        // Every answer fits; a test says so.
        let _ = frame::encode_into(answer, &mut self.frame);
    }

    /// Give the line what it takes.
    #[inline(never)]
    pub fn pass<L: Line>(&mut self, line: &mut L) {
        for _ in 0..BYTES {
            let Some(&byte) = self.frame.get(self.said) else { return };
            if !line.write(byte) {
                return;
            }
            self.said += 1;
        }
    }
}
