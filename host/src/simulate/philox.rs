//! Philox4x32-10: random words as a function of a counter and a key.
//!
//! Salmon, Moraes, Dror, Shaw: *Parallel random numbers: as easy as 1, 2, 3*, SC11 (2011). There is
//! no state to carry along: scatterer, frame and purpose are the counter, the seed is the key, and
//! so every thread finds the same numbers without asking the others.

/// Multipliers of the two halves of the counter.
const MULTIPLIERS: [u64; 2] = [0xD251_1F53, 0xCD9E_8D57];
/// What each half of the key grows by from round to round (golden ratio, √3 − 1).
const KEY_STEPS: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
/// Rounds of the recommended, crush-resistant variant.
const ROUNDS: u32 = 10;

/// The key of a seed.
pub const fn key(seed: u64) -> [u32; 2] {
    [seed as u32, (seed >> 32) as u32]
}

/// Four random words of `counter` under `key`.
///
/// The words travel in 64-bit lanes, as the 32 × 32 → 64 bit product of a vector unit wants them.
#[inline(always)]
pub fn philox4x32(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    let mut c = counter.map(u64::from);
    let mut k = key;
    for _ in 0..ROUNDS {
        let product = [MULTIPLIERS[0] * low(c[0]), MULTIPLIERS[1] * low(c[2])];
        c = [
            (product[1] >> 32) ^ c[1] ^ u64::from(k[0]),
            product[1],
            (product[0] >> 32) ^ c[3] ^ u64::from(k[1]),
            product[0],
        ];
        k = [k[0].wrapping_add(KEY_STEPS[0]), k[1].wrapping_add(KEY_STEPS[1])];
    }
    c.map(|word| word as u32)
}

/// The lower half; the upper one may hold what is left of a product.
#[inline(always)]
fn low(word: u64) -> u64 {
    word & 0xFFFF_FFFF
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `kat_vectors` of Random123 1.14, lines "philox4x32 10".
    #[test]
    fn known_answers() {
        assert_eq!(
            philox4x32([0; 4], [0; 2]),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        assert_eq!(
            philox4x32([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox4x32(
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0]
            ),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn both_halves_of_the_seed_count() {
        let words = |seed| philox4x32([1, 2, 3, 4], key(seed));
        assert_ne!(words(1), words(2));
        assert_ne!(words(1), words(1 | 1 << 32));
    }
}
