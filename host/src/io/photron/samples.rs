//! Counts to bytes and back.
//!
//! Packed counts follow each other most significant bit first, without a gap between rows or
//! images: 12 bits, `b0 b1 b2` hold `b0 << 4 | b1 >> 4` and `(b1 & 15) << 8 | b2`; 10 bits, four
//! counts in five bytes. 16 bits are little-endian. The loops over whole groups are written so
//! that the compiler turns them into vector instructions.

/// How a count lies in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Packing {
    /// One byte a count.
    Bits8,
    /// Five bytes for four counts.
    Bits10,
    /// Three bytes for two counts.
    Bits12,
    /// Two bytes a count, little-endian.
    Bits16,
}

/// Most counts in a [group](Packing::group).
const LARGEST_GROUP: usize = 4;

impl Packing {
    /// The packing of so many bits a count, where there is one.
    #[must_use]
    pub fn of_bits(bits: u32) -> Option<Self> {
        [Self::Bits8, Self::Bits10, Self::Bits12, Self::Bits16]
            .into_iter()
            .find(|packing| packing.bits() == bits)
    }

    /// Bits a count takes in the file.
    #[must_use]
    pub fn bits(self) -> u32 {
        match self {
            Self::Bits8 => 8,
            Self::Bits10 => 10,
            Self::Bits12 => 12,
            Self::Bits16 => 16,
        }
    }

    /// The fewest counts that fill whole bytes, and these bytes.
    pub(super) fn group(self) -> (usize, usize) {
        match self {
            Self::Bits8 => (1, 1),
            Self::Bits10 => (4, 5),
            Self::Bits12 => (2, 3),
            Self::Bits16 => (1, 2),
        }
    }

    /// Bytes of whole groups.
    pub(super) fn bytes_of(self, counts: usize) -> usize {
        let (group, bytes) = self.group();
        counts.div_ceil(group) * bytes
    }

    /// Unpack the counts of whole groups, less the first `skip`, each shifted down by `shift` bits.
    ///
    /// `skip` is less than a group, and `bytes` are those of all groups that `out` touches.
    pub(super) fn unpack(self, bytes: &[u8], skip: usize, shift: u32, out: &mut [u16]) {
        let (group, group_bytes) = self.group();
        if skip == 0 {
            return self.unpack_aligned(bytes, shift, out);
        }
        let (first, rest) = bytes.split_at(group_bytes.min(bytes.len()));
        let mut counts = [0; LARGEST_GROUP];
        self.unpack_aligned(first, shift, &mut counts[..group]);
        let (head, tail) = out.split_at_mut((group - skip).min(out.len()));
        head.copy_from_slice(&counts[skip..skip + head.len()]);
        self.unpack_aligned(rest, shift, tail);
    }

    /// Unpack from the beginning of a group; the last group may be wanted in part only.
    fn unpack_aligned(self, bytes: &[u8], shift: u32, out: &mut [u16]) {
        match self {
            Self::Bits8 => unpack_8(bytes, shift, out),
            Self::Bits10 => unpack_packed::<10>(bytes, shift, out),
            Self::Bits12 => unpack_packed::<12>(bytes, shift, out),
            Self::Bits16 => unpack_16(bytes, shift, out),
        }
    }

    /// Pack counts, shifted up by `shift` bits, into the bytes of as many whole groups.
    pub(super) fn pack(self, counts: &[u16], shift: u32, bytes: &mut [u8]) {
        match self {
            Self::Bits8 => {
                for (byte, &count) in bytes.iter_mut().zip(counts) {
                    *byte = (count << shift) as u8;
                }
            }
            Self::Bits10 => pack_groups(counts, shift, bytes, pack_10),
            Self::Bits12 => pack_groups(counts, shift, bytes, pack_12),
            Self::Bits16 => pack_groups(counts, shift, bytes, |[count]| count.to_le_bytes()),
        }
    }
}

fn unpack_8(bytes: &[u8], shift: u32, out: &mut [u16]) {
    for (count, &byte) in out.iter_mut().zip(bytes) {
        *count = u16::from(byte) >> shift;
    }
}

fn unpack_16(bytes: &[u8], shift: u32, out: &mut [u16]) {
    let (pairs, _) = bytes.as_chunks();
    for (count, &pair) in out.iter_mut().zip(pairs) {
        *count = u16::from_le_bytes(pair) >> shift;
    }
}

/// Eight counts of `BITS` bits at a time, which are `BITS` bytes.
fn unpack_packed<const BITS: usize>(bytes: &[u8], shift: u32, out: &mut [u16]) {
    let (blocks, rest) = bytes.as_chunks::<BITS>();
    let (wholes, tail) = out.as_chunks_mut::<8>();
    let used = blocks.len().min(wholes.len());
    for (block, counts) in blocks.iter().zip(wholes) {
        *counts = eight_counts::<BITS>(block, shift);
    }
    if !tail.is_empty() {
        let mut block = [0; BITS];
        let left = blocks.get(used).map_or(rest, |whole| whole.as_slice());
        block[..left.len()].copy_from_slice(left);
        tail.copy_from_slice(&eight_counts::<BITS>(&block, shift)[..tail.len()]);
    }
}

/// Four counts in the upper, four in the lower half of the block's bits.
#[inline(always)]
fn eight_counts<const BITS: usize>(block: &[u8; BITS], shift: u32) -> [u16; 8] {
    let mut ends = [[0; 8]; 2];
    ends[0].copy_from_slice(&block[..8]);
    ends[1].copy_from_slice(&block[BITS - 8..]);
    let upper = u64::from_be_bytes(ends[0]) >> (64 - 4 * BITS);
    let lower = u64::from_be_bytes(ends[1]) & ((1 << (4 * BITS)) - 1);
    let [a, b, c, d] = four_counts::<BITS>(upper, shift);
    let [e, f, g, h] = four_counts::<BITS>(lower, shift);
    [a, b, c, d, e, f, g, h]
}

/// Four counts, the first in the most significant bits, spread to 16 bits each.
#[inline(always)]
fn four_counts<const BITS: usize>(packed: u64, shift: u32) -> [u16; 4] {
    let halves = (packed >> (2 * BITS)) | ((packed & ((1 << (2 * BITS)) - 1)) << 32);
    let mask = ((1_u64 << BITS) - 1) * 0x1_0000_0001;
    let spread = ((halves >> BITS) & mask) | ((halves & mask) << 16);
    [0, 16, 32, 48].map(|position| (spread >> position) as u16 >> shift)
}

fn pack_groups<const COUNTS: usize, const BYTES: usize>(
    counts: &[u16],
    shift: u32,
    bytes: &mut [u8],
    pack: impl Fn([u16; COUNTS]) -> [u8; BYTES],
) {
    let (groups, _) = counts.as_chunks::<COUNTS>();
    let (packed, _) = bytes.as_chunks_mut::<BYTES>();
    for (packed, group) in packed.iter_mut().zip(groups) {
        *packed = pack(group.map(|count| count << shift));
    }
}

fn pack_10([a, b, c, d]: [u16; 4]) -> [u8; 5] {
    let bits = [a, b, c, d].iter().fold(0, |bits, &count| bits << 10 | u64::from(count));
    let [_, _, _, packed @ ..] = bits.to_be_bytes();
    packed
}

fn pack_12([a, b]: [u16; 2]) -> [u8; 3] {
    [(a >> 4) as u8, ((a << 4) | (b >> 8)) as u8, b as u8]
}
