//! The compiled plan: the bytes that travel, are held, and are checked by their hash.

use crate::crc::crc32_byte;
use crate::layout;
use crate::plan::Plan;
use heapless::Vec;

/// Bytes of a compiled plan at most: on a board with little memory, and on a larger one.
pub const MAX_BYTES: usize = if cfg!(feature = "extended") { 128 } else { SMALL_BYTES };

/// Bytes of a compiled plan at most on a board with little memory.
pub(crate) const SMALL_BYTES: usize = 80;

/// The bytes of a compiled plan.
pub type Bytes = Vec<u8, MAX_BYTES>;

/// CRC-32 (ISO-HDLC) of some bytes: the hash of plans, images and of the protocol.
#[must_use]
pub const fn hash(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    let mut rest = bytes;
    while let [byte, tail @ ..] = rest {
        crc = crc32_byte(crc, *byte);
        rest = tail;
    }
    !crc
}

/// A hash over bytes that come one after the other.
#[derive(Debug, Clone)]
pub struct Hasher(u32);

impl Hasher {
    /// Nothing hashed yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(u32::MAX)
    }

    /// Go on with `bytes`.
    pub fn update(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = crc32_byte(self.0, byte);
        }
    }

    /// As [`hash`] of all bytes so far.
    #[must_use]
    pub const fn finish(self) -> u32 {
        !self.0
    }
}

impl Default for Hasher {
    fn default() -> Self {
        Self::new()
    }
}

/// A plan as bytes, with their hash.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Compiled {
    bytes: Bytes,
    hash: u32,
}

impl Compiled {
    /// No plan; its hash is 0.
    pub const EMPTY: Self = Self { bytes: Bytes::new(), hash: 0 };

    /// Compile a plan; `None` when it needs more than [`MAX_BYTES`].
    #[must_use]
    pub fn new(plan: &Plan) -> Option<Self> {
        let mut bytes = Bytes::new();
        layout::write(plan, &mut bytes)?;
        let hash = hash(&bytes);
        Some(Self { bytes, hash })
    }

    /// Store bytes as they arrived; false, and nothing is stored, when there are more than
    /// [`MAX_BYTES`].
    #[must_use]
    pub fn store(&mut self, bytes: &[u8]) -> bool {
        self.bytes.clear();
        let stored = self.bytes.extend_from_slice(bytes).is_ok();
        self.hash = if stored { hash(bytes) } else { 0 };
        stored
    }

    /// The bytes.
    #[must_use]
    pub fn bytes(&self) -> &Bytes {
        &self.bytes
    }

    /// Their hash when they were stored.
    #[must_use]
    pub fn hash(&self) -> u32 {
        self.hash
    }

    /// The bytes are still those that were stored.
    #[must_use]
    pub fn is_intact(&self) -> bool {
        hash(&self.bytes) == self.hash
    }

    /// Make `plan` the plan that the bytes mean; false, and `plan` is of no use, if they mean none.
    #[must_use]
    pub fn read(&self, plan: &mut Plan) -> bool {
        layout::read(&self.bytes, plan)
    }

    /// The plan, if the bytes are intact and mean one.
    #[must_use]
    pub fn plan(&self) -> Option<Plan> {
        let mut plan = Plan::EMPTY;
        (self.is_intact() && self.read(&mut plan)).then_some(plan)
    }
}
