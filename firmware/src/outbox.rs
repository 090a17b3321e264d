//! What waits to be said: answers first, then events, byte by byte.

use crate::board::Line;
use crate::frame::{self, MAX_FRAME};
use crate::message::{Answer, Event, Reply};
use heapless::{Deque, Vec};

/// Events that can wait.
const EVENTS: usize = 12;

/// Bytes of a pass at most: so its length has a bound.
const BYTES: usize = 4;

/// What waits to be said.
#[derive(Debug, Default)]
pub struct Outbox {
    reply: Option<(u8, Reply)>,
    events: Deque<Event, EVENTS>,
    /// Number of the next event to be queued.
    number: u16,
    lost: u16,
    frame: Vec<u8, MAX_FRAME>,
    said: usize,
}

impl Outbox {
    /// Answer request `number`. A reply that the host no longer waits for is replaced.
    #[inline(never)]
    pub fn reply(&mut self, number: u8, reply: Reply) {
        self.reply = Some((number, reply));
    }

    /// Tell what happened. What finds no room is lost, and counted.
    #[inline(never)]
    pub fn tell(&mut self, event: Event) {
        self.number = self.number.wrapping_add(1);
        if self.events.push_back(event).is_err() {
            self.lost = self.lost.saturating_add(1);
        }
    }

    /// Events lost since the board started.
    #[must_use]
    pub fn lost(&self) -> u16 {
        self.lost
    }

    /// Give the line what it takes.
    #[inline(never)]
    pub fn pass<L: Line>(&mut self, line: &mut L) {
        if self.said >= self.frame.len() {
            self.said = 0;
            self.frame = self.next_frame();
        }
        for _ in 0..BYTES {
            let Some(&byte) = self.frame.get(self.said) else { return };
            if !line.write(byte) {
                return;
            }
            self.said += 1;
        }
    }

    #[inline(never)]
    fn next_frame(&mut self) -> Vec<u8, MAX_FRAME> {
        let answer = match self.reply.take() {
            Some((number, reply)) => Some(Answer::Reply { number, reply }),
            None => self.next_event(),
        };
        answer.and_then(|answer| frame::encode(&answer)).unwrap_or_default()
    }

    #[inline(never)]
    fn next_event(&mut self) -> Option<Answer> {
        let waiting = self.events.len() as u16;
        let event = self.events.pop_front()?;
        // After a loss the numbers jump: the newest waiting event keeps the newest number.
        Some(Answer::Event { number: self.number.wrapping_sub(waiting), event })
    }
}
