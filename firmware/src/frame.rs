//! Frames: `COBS( postcard(message) ‖ CRC-16 little-endian ) ‖ 0`.
//!
//! A zero byte ends a frame and occurs nowhere else, so a receiver that has lost its place finds
//! it again at the next frame. The CRC is CRC-16/IBM-SDLC ("X.25").

use crate::crc::crc16;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Bytes of a message with its CRC at most.
pub const MAX_MESSAGE: usize = 88;

/// Bytes of a frame at most, with its zero: COBS adds one byte per 254, and one.
pub const MAX_FRAME: usize = MAX_MESSAGE + 2;

const CRC_BYTES: usize = 2;

/// The bytes of a frame.
pub type Frame = Vec<u8, MAX_FRAME>;

/// A message as a frame; `None` when it is longer than [`MAX_MESSAGE`].
#[must_use]
pub fn encode<M: Serialize>(message: &M) -> Option<Frame> {
    let mut frame = Frame::new();
    encode_into(message, &mut frame)?;
    Some(frame)
}

/// The same, in place of what `frame` held; when the message is too long, nothing.
#[inline(never)]
pub(crate) fn encode_into<M: Serialize>(message: &M, frame: &mut Frame) -> Option<()> {
    frame.clear();
    let mut buffer = [0; MAX_MESSAGE];
    let length = postcard::to_slice(message, &mut buffer).ok()?.len();
    let crc = crc16(buffer.get(..length)?);
    let end = length + CRC_BYTES;
    buffer.get_mut(length..end)?.copy_from_slice(&crc.to_le_bytes());

    frame.resize_default(MAX_FRAME).ok()?;
    let used = cobs::try_encode(buffer.get(..end)?, frame).unwrap_or(0);
    frame.truncate(used);
    frame.push(0).ok()
}

/// The bytes between two zeros, turned back into a message; `None` when they are not one.
#[inline(never)]
fn decode<'a, M: Deserialize<'a>>(bytes: &'a mut [u8]) -> Option<M> {
    let length = cobs::decode_in_place(bytes).ok()?;
    let (message, crc) = bytes.get(..length)?.split_last_chunk::<CRC_BYTES>()?;
    if crc16(message) != u16::from_le_bytes(*crc) {
        return None;
    }
    let (message, rest) = postcard::take_from_bytes(message).ok()?;
    rest.is_empty().then_some(message)
}

/// What a byte brought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received<M> {
    /// Nothing yet.
    Nothing,
    /// The end of a frame that cannot be understood.
    Garbled,
    /// A message.
    Message(M),
}

/// Puts bytes together to frames.
#[derive(Debug, Clone, Default)]
pub struct Receiver {
    bytes: Vec<u8, MAX_FRAME>,
    /// The frame has become too long to be one; skip to its end.
    overlong: bool,
    /// The frame has been handed out; the next byte begins another.
    complete: bool,
}

impl Receiver {
    /// Take the next byte of the line. A message may borrow from the receiver.
    #[inline(never)]
    pub fn take<'a, M: Deserialize<'a>>(&'a mut self, byte: u8) -> Received<M> {
        if core::mem::take(&mut self.complete) {
            self.bytes.clear();
        }
        if byte != 0 {
            self.overlong |= self.bytes.push(byte).is_err();
            return Received::Nothing;
        }
        let overlong = core::mem::take(&mut self.overlong);
        // Zeros may fill the pauses.
        if self.bytes.is_empty() {
            return Received::Nothing;
        }
        self.complete = true;
        let message = if overlong { None } else { decode(&mut self.bytes) };
        message.map_or(Received::Garbled, Received::Message)
    }
}
