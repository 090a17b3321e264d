//! Counts to bytes and back.

use super::*;

#[test]
fn packed_counts_bit_by_bit() {
    let unpacked = |packing: Packing, bytes: &[u8], number: usize| {
        let mut out = vec![0; number];
        packing.unpack(bytes, 0, 0, &mut out);
        out
    };
    assert_eq!(unpacked(Packing::Bits12, &[0xab, 0xc1, 0x23], 2), [0xabc, 0x123]);
    assert_eq!(unpacked(Packing::Bits16, &[0x34, 0x12, 0xff, 0x0f], 2), [0x1234, 0x0fff]);
    assert_eq!(unpacked(Packing::Bits8, &[7, 255], 2), [7, 255]);
    // 1111111111 0000000001 1000000000 0101010101
    let bytes = [0b1111_1111, 0b1100_0000, 0b0001_1000, 0b0000_0001, 0b0101_0101];
    assert_eq!(unpacked(Packing::Bits10, &bytes, 4), [1023, 1, 512, 0b01_0101_0101]);
}

#[test]
fn packing_and_back_from_any_count_on() {
    for packing in PACKINGS {
        let all = counts(64, packing.bits());
        let mut bytes = vec![0; packing.bytes_of(all.len())];
        packing.pack(&all, 0, &mut bytes);
        let (group, group_bytes) = packing.group();
        for first in 0..40 {
            for number in 0..24 {
                let (before, skip) = (first / group * group_bytes, first % group);
                let window = &bytes[before..before + packing.bytes_of(skip + number)];
                let mut out = vec![0; number];
                packing.unpack(window, skip, 0, &mut out);
                assert_eq!(out, all[first..first + number], "{packing:?} {first} {number}");
            }
        }
    }
}
