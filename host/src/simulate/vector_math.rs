//! The few functions the scatterers need, written so that a loop over them becomes vector code.
//!
//! No branch, no table, no call, no fused multiply-add: every instruction set rounds alike and gives
//! the same bits. Angles are *turns* in 32-bit fixed point (2³² is one full turn), so that they wrap
//! by themselves and reduce to a quadrant without error. The polynomials are those of Moshier's
//! Cephes library (`logf`, `sinf`, `cosf`).

use std::f32::consts::TAU;

/// 2³², one turn in fixed point.
pub const TURN: f32 = 4_294_967_296.0;

/// [`fixed`] is exact to its last bit below this.
pub const FIXED_LIMIT: f32 = 1024.0;

/// No [`rayleigh`] length or normal number is longer: √(2 · 31 ln 2) = 6.56.
pub const MAX_NORMAL: f32 = 6.6;

/// ln x for a normal x > 0. Error below 2e-7 · max(1, |ln x|), and relative near x = 1.
///
/// x = 2ᵉ·m with m in [√½, √2), then ln x = e·ln 2 + ln m. ln 2 comes in two parts, the first so
/// short that its product with e is exact.
#[inline(always)]
pub fn ln(x: f32) -> f32 {
    const SQRT_HALF: u32 = 0x3F35_04F3;
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    let exponent = x.to_bits().wrapping_sub(SQRT_HALF) as i32 >> 23;
    let m = f32::from_bits(x.to_bits().wrapping_sub((exponent << 23) as u32)) - 1.0;
    let e = exponent as f32;
    let mut p = 7.037_683_6e-2;
    p = p * m - 1.151_461e-1;
    p = p * m + 1.167_699_9e-1;
    p = p * m - 1.242_014_1e-1;
    p = p * m + 1.424_932_3e-1;
    p = p * m - 1.666_805_8e-1;
    p = p * m + 2.000_071_5e-1;
    p = p * m - 2.499_999_4e-1;
    p = p * m + 3.333_333e-1;
    let m2 = m * m;
    e * LN2_HIGH + (m + (e * LN2_LOW + (p * m * m2 - 0.5 * m2)))
}

/// Sine and cosine of an angle in turns. Absolute error below 2e-7.
#[inline(always)]
pub fn sin_cos_turns(angle: u32) -> (f32, f32) {
    let quadrant = angle.wrapping_add(1 << 29) >> 30;
    let r = angle.wrapping_sub(quadrant << 30) as i32 as f32 * (TAU / TURN);
    let z = r * r;
    let s = r + r * z * (-1.666_665_5e-1 + z * (8.332_161e-3 - z * 1.951_529_6e-4));
    let c = 1.0 - 0.5 * z + z * z * (4.166_664_6e-2 + z * (-1.388_731_6e-3 + z * 2.443_315_7e-5));
    let (sine, cosine) = if quadrant & 1 == 0 { (s, c) } else { (c, s) };
    (flip(sine, quadrant), flip(cosine, quadrant + 1))
}

/// −x where bit 1 of `quadrant` is set.
#[inline(always)]
fn flip(x: f32, quadrant: u32) -> f32 {
    f32::from_bits(x.to_bits() ^ (quadrant & 2) << 30)
}

/// x as 32-bit fixed point, unit 2⁻³², |x| < [`FIXED_LIMIT`]. Whole turns drop out by wrapping.
///
/// A float plus 1.5·2²³ units is rounded to whole units and shows their number in its last bits:
/// first in units of 2⁻¹², then the rest in units of 2⁻³². (The language's own conversion saturates
/// and does not become vector code.)
#[inline(always)]
pub fn fixed(x: f32) -> u32 {
    const FINE: f32 = 12_582_912.0;
    const COARSE: f32 = FINE / 4096.0;
    let coarse = x + COARSE;
    let fine = (x - (coarse - COARSE)) * TURN + FINE;
    let units = |shown: f32, zero: f32| shown.to_bits().wrapping_sub(zero.to_bits());
    (units(coarse, COARSE) << 20).wrapping_add(units(fine, FINE))
}

/// Length of a pair of independent standard normals, √(−2 ln u), from one random word.
///
/// u = (word/2 | 1)/2³¹ is never zero, so the length is at most [`MAX_NORMAL`].
#[inline(always)]
pub fn rayleigh(word: u32) -> f32 {
    let u = (word >> 1 | 1) as i32 as f32 * (2.0 / TURN);
    (-2.0 * ln(u)).sqrt()
}

/// Two independent standard normals from two random words (Box and Muller 1958).
#[inline(always)]
pub fn normal_pair(words: [u32; 2]) -> [f32; 2] {
    let radius = rayleigh(words[0]);
    let (sine, cosine) = sin_cos_turns(words[1]);
    [radius * cosine, radius * sine]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::philox::philox4x32;

    /// Words that cover the range evenly, and its corners.
    fn words() -> impl Iterator<Item = u32> {
        let corners = (0..32).flat_map(|b| [1 << b, (1u32 << b) - 1, !(1u32 << b)]);
        (0..2_000_000u32).map(|i| i.wrapping_mul(2_654_435_761)).chain(corners)
    }

    #[test]
    fn ln_agrees_with_f64() {
        for word in words() {
            let x = (word >> 1 | 1) as f32 / (TURN / 2.0);
            let want = f64::from(x).ln();
            let error = (f64::from(ln(x)) - want).abs();
            assert!(error < 2e-7 * want.abs().max(1.0), "ln {x}: {error:e}");
            assert!(error <= 3e-7 * want.abs(), "ln {x}: relative {:e}", error / want.abs());
        }
        assert_eq!(ln(1.0), 0.0);
    }

    #[test]
    fn sine_and_cosine_agree_with_f64() {
        for word in words() {
            let (want_sin, want_cos) =
                (f64::from(word) / 4_294_967_296.0 * std::f64::consts::TAU).sin_cos();
            let (sin, cos) = sin_cos_turns(word);
            assert!((f64::from(sin) - want_sin).abs() < 2e-7, "sin {word}");
            assert!((f64::from(cos) - want_cos).abs() < 2e-7, "cos {word}");
        }
    }

    #[test]
    fn fixed_point_keeps_the_fraction() {
        assert_eq!(fixed(0.0), 0);
        assert_eq!(fixed(0.25), 1 << 30);
        assert_eq!(fixed(-0.25), 3 << 30);
        assert_eq!(fixed(1000.125), 1 << 29);
        assert_eq!(fixed(-7.0), 0);
        assert_eq!(fixed(0.5), 1 << 31);
        assert_eq!(fixed(FIXED_LIMIT - 0.25), 3 << 30);
        assert_eq!(fixed(0.25 - FIXED_LIMIT), 1 << 30);
    }

    #[test]
    fn fixed_point_agrees_with_f64() {
        for word in words() {
            for size in [1e-6, 0.5, 3.0, 1023.9] {
                let x = word as i32 as f32 / (TURN / 2.0) * size;
                let want = (f64::from(x) * 4_294_967_296.0).round_ties_even() as i64 as u32;
                assert_eq!(fixed(x), want, "{x}");
            }
        }
    }

    /// First four moments of 2 · 10⁶ numbers and their correlation, each within five of its
    /// standard deviations (variances 1, 2, 15, 96 and 1 over the count), and the tail beyond 4.
    #[test]
    fn box_muller_moments() {
        let n = 1_000_000u32;
        let mut moment = [0.0f64; 5];
        let mut beyond_4 = 0;
        for i in 0..n {
            let w = philox4x32([i, 0, 0, 9], [3, 4]);
            let pair = normal_pair([w[0], w[1]]).map(f64::from);
            moment[0] += pair[0] * pair[1];
            for g in pair {
                (1..5).for_each(|k| moment[k] += g.powi(k as i32));
                beyond_4 += i32::from(g.abs() > 4.0);
            }
        }
        let count = 2.0 * f64::from(n);
        let [_, mean, square, cube, fourth] = moment.map(|m| m / count);
        assert!(mean.abs() < 5.0 * (1.0 / count).sqrt(), "mean {mean}");
        assert!((square - 1.0).abs() < 5.0 * (2.0 / count).sqrt(), "variance {square}");
        assert!(cube.abs() < 5.0 * (15.0 / count).sqrt(), "third moment {cube}");
        assert!((fourth - 3.0).abs() < 5.0 * (96.0 / count).sqrt(), "fourth moment {fourth}");
        let correlation = moment[0] / f64::from(n);
        assert!(correlation.abs() < 5.0 * (1.0 / f64::from(n)).sqrt(), "x·y {correlation}");
        // 2 · 10⁶ · 6.33e-5 = 127 expected.
        assert!((70..190).contains(&beyond_4), "{beyond_4} beyond 4 sigma");
    }

    #[test]
    fn the_longest_step_is_bounded() {
        assert!((6.5..MAX_NORMAL).contains(&rayleigh(0)));
        assert_eq!(rayleigh(u32::MAX), 0.0);
    }
}
