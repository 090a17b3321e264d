//! Frames: `COBS( postcard(message) ‖ CRC-16 little-endian ) ‖ 0`.
//!
//! A zero byte ends a frame and occurs nowhere else, so a receiver that has lost its place finds
//! it again at the next frame. The CRC is CRC-16/IBM-SDLC ("X.25").

use crate::crc::{CRC_16_RESIDUE, crc16, crc16_byte};
use cobs::{DecodeResult, DecoderState};
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Bytes of a message with its CRC at most: those of a plan, or of some speckles.
pub const MAX_MESSAGE: usize = if cfg!(feature = "extended") { 144 } else { 88 };

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

/// Puts bytes together to frames. Every byte is dealt with as it comes, so that the end of a frame
/// takes no longer than the others.
#[derive(Debug)]
pub struct Receiver {
    decoder: DecoderState,
    /// Message and CRC so far.
    bytes: Vec<u8, MAX_MESSAGE>,
    crc: u16,
    place: Place,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// Before the first byte of a frame.
    Before,
    /// Within one.
    Within,
    /// Within what cannot be one: skip to its end.
    Lost,
}

impl Default for Receiver {
    fn default() -> Self {
        Self { decoder: DecoderState::Idle, bytes: Vec::new(), crc: u16::MAX, place: Place::Before }
    }
}

impl Receiver {
    /// Take the next byte of the line. A message may borrow from the receiver.
    #[inline(never)]
    pub fn take<'a, M: Deserialize<'a>>(&'a mut self, byte: u8) -> Received<M> {
        if self.place == Place::Before {
            // Zeros may fill the pauses.
            if byte == 0 {
                return Received::Nothing;
            }
            self.decoder = DecoderState::Idle;
            self.bytes.clear();
            self.crc = u16::MAX;
            self.place = Place::Within;
        }
        let fed = if self.place == Place::Lost { None } else { self.decoder.feed(byte).ok() };
        match fed {
            Some(DecodeResult::DataContinue(data)) => self.put(data),
            Some(DecodeResult::NoData | DecodeResult::DataStart | DecodeResult::DataComplete) => {}
            None => self.place = Place::Lost,
        }
        if byte != 0 {
            return Received::Nothing;
        }
        let whole = self.place == Place::Within && self.crc == CRC_16_RESIDUE;
        self.place = Place::Before;
        let message = if whole { self.message() } else { None };
        message.map_or(Received::Garbled, Received::Message)
    }

    fn put(&mut self, data: u8) {
        self.crc = crc16_byte(self.crc, data);
        if self.bytes.push(data).is_err() {
            self.place = Place::Lost;
        }
    }

    fn message<'a, M: Deserialize<'a>>(&'a self) -> Option<M> {
        let (message, _) = self.bytes.split_last_chunk::<CRC_BYTES>()?;
        let (message, rest) = postcard::take_from_bytes(message).ok()?;
        rest.is_empty().then_some(message)
    }
}
