//! The two cyclic redundancy checks, four bits at a time.
//!
//! Our own because of the Uno: a library's bit by bit take 1.7 KB of its 32 KB of flash and 330
//! cycles per byte, its tables of bytes 1.5 KB of the 2 KB of memory. Tables of half bytes take
//! 96 bytes and a quarter of the time. A test compares them with that library's.

/// One byte more of CRC-16/IBM-SDLC ("X.25"): of frames. Starts with all ones and ends by complement.
#[must_use]
#[inline(never)]
pub(crate) fn crc16_byte(mut crc: u16, byte: u8) -> u16 {
    crc ^= byte as u16;
    crc = (crc >> 4) ^ CRC_16[(crc & 15) as usize];
    (crc >> 4) ^ CRC_16[(crc & 15) as usize]
}

/// What the register holds after bytes and their CRC, low byte first.
pub(crate) const CRC_16_RESIDUE: u16 = 0xF0B8;

/// CRC-16 of some bytes.
#[must_use]
pub(crate) fn crc16(bytes: &[u8]) -> u16 {
    !bytes.iter().fold(u16::MAX, |crc, &byte| crc16_byte(crc, byte))
}

/// One byte more of CRC-32/ISO-HDLC: of plans, images and the protocol. Starts with all ones and
/// ends by complement.
#[must_use]
#[inline(never)]
pub(crate) const fn crc32_byte(mut crc: u32, byte: u8) -> u32 {
    crc ^= byte as u32;
    crc = (crc >> 4) ^ CRC_32[(crc & 15) as usize];
    (crc >> 4) ^ CRC_32[(crc & 15) as usize]
}

static CRC_16: [u16; 16] = {
    let mut table = [0; 16];
    let mut half = 0;
    while half < 16 {
        table[half] = shifted(half as u32, 0x8408) as u16;
        half += 1;
    }
    table
};

const CRC_32: &[u32; 16] = &{
    let mut table = [0; 16];
    let mut half = 0;
    while half < 16 {
        table[half] = shifted(half as u32, 0xEDB8_8320);
        half += 1;
    }
    table
};

/// Four bits through a register with this polynomial, low bits first.
const fn shifted(mut bits: u32, polynomial: u32) -> u32 {
    let mut bit = 0;
    while bit < 4 {
        bits = (bits >> 1) ^ if bits & 1 == 0 { 0 } else { polynomial };
        bit += 1;
    }
    bits
}

#[cfg(test)]
mod tests {
    use crate::compiled::{Hasher, hash};

    #[test]
    fn published_check_values() {
        assert_eq!(super::crc16(b"123456789"), 0x906E);
        assert_eq!(hash(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn as_the_library() {
        let sixteen = crc::Crc::<u16>::new(&crc::CRC_16_IBM_SDLC);
        let thirty_two = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
        let bytes: std::vec::Vec<u8> = (0..1000_u32).map(|i| (i * i / 7) as u8).collect();
        for end in 0..bytes.len() {
            let bytes = &bytes[..end];
            assert_eq!(super::crc16(bytes), sixteen.checksum(bytes));
            assert_eq!(hash(bytes), thirty_two.checksum(bytes));
            let sum = super::crc16(bytes).to_le_bytes();
            let all = bytes.iter().chain(&sum);
            let residue = all.fold(u16::MAX, |crc, &byte| super::crc16_byte(crc, byte));
            assert_eq!(residue, super::CRC_16_RESIDUE);
            let mut hasher = Hasher::new();
            bytes.chunks(7).for_each(|chunk| hasher.update(chunk));
            assert_eq!(hasher.finish(), hash(bytes));
        }
    }
}
