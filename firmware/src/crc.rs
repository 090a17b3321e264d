//! The two cyclic redundancy checks, bit by bit.
//!
//! Our own because of flash: the same two from a library take 1.7 KB of the Uno's 32, these 0.2.
//! A test compares them with that library's.

/// CRC-16/IBM-SDLC ("X.25"): of frames.
#[must_use]
pub(crate) fn crc16(bytes: &[u8]) -> u16 {
    let mut crc = u16::MAX;
    for &byte in bytes {
        crc ^= byte as u16;
        for _ in 0..8 {
            crc = (crc >> 1) ^ if crc & 1 == 0 { 0 } else { 0x8408 };
        }
    }
    !crc
}

/// One byte more of CRC-32/ISO-HDLC: of plans, images and the protocol. Starts with all ones and
/// ends by complement.
#[must_use]
#[inline(never)]
pub(crate) const fn crc32_byte(mut crc: u32, byte: u8) -> u32 {
    crc ^= byte as u32;
    let mut bit = 0;
    while bit < 8 {
        crc = (crc >> 1) ^ if crc & 1 == 0 { 0 } else { 0xEDB8_8320 };
        bit += 1;
    }
    crc
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
            let mut hasher = Hasher::new();
            bytes.chunks(7).for_each(|chunk| hasher.update(chunk));
            assert_eq!(hasher.finish(), hash(bytes));
        }
    }
}
