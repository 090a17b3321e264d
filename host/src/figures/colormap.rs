//! Three colour maps, computed in OKLab so that equal steps look equal.
//!
//! The cyclic map for wrapped phase is a tilted ellipse: lightness and red-green vary with the
//! cosine of the phase, blue-yellow with its sine. 0 is light green, ±π dark purple, +π/2 yellow and
//! −π/2 blue. Who cannot tell red from green still sees a closed loop, light - yellow - dark - blue.

use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

use oklab::Oklab;

/// Red, green and blue in sRGB.
pub type Rgb = [u8; 3];

/// Colour of a pixel without a value, in every map.
pub const NO_VALUE: Rgb = [150, 150, 150];

/// Colours in a map; entry 0 of a palette is [`NO_VALUE`], so a palette has one more.
pub const COLORS: usize = 255;

/// What a colour means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorMap {
    /// Wrapped phase, −π..π, cyclic.
    Phase,
    /// Amplitude, black to white.
    Grey,
    /// Uncertainty, dark blue (good) to light yellow (bad).
    Sigma,
}

/// A colour table: [`NO_VALUE`], then the map from its low to its high end.
pub type Palette = [Rgb; COLORS + 1];

static PHASE: LazyLock<Palette> = LazyLock::new(|| tabulate(phase));
static GREY: LazyLock<Palette> = LazyLock::new(|| tabulate(grey));
static SIGMA: LazyLock<Palette> = LazyLock::new(|| tabulate(sigma));

impl ColorMap {
    /// The map as a table, built once.
    #[must_use]
    pub fn palette(self) -> &'static Palette {
        match self {
            Self::Phase => &PHASE,
            Self::Grey => &GREY,
            Self::Sigma => &SIGMA,
        }
    }

    /// Index into the palette of a position in the map, 0 to 1; beyond the ends the end's colour.
    #[must_use]
    pub fn index(self, position: f32) -> u8 {
        if !position.is_finite() {
            return 0;
        }
        let step = (position * COLORS as f32).clamp(0.0, COLORS as f32 - 1.0);
        1 + step as u8
    }

    /// Colour at a position in the map, 0 to 1.
    #[must_use]
    pub fn at(self, position: f32) -> Rgb {
        self.palette()[usize::from(self.index(position))]
    }
}

/// Position of a phase in the cyclic map: −π at 0, 0 in the middle, wrapped.
#[must_use]
pub fn phase_position(phase: f32) -> f32 {
    ((phase + PI) / TAU).rem_euclid(1.0)
}

fn tabulate(map: fn(f32) -> Oklab) -> Palette {
    std::array::from_fn(|entry| match entry {
        0 => NO_VALUE,
        _ => srgb(map((entry as f32 - 0.5) / COLORS as f32)),
    })
}

fn srgb(color: Oklab) -> Rgb {
    let oklab::Rgb { r, g, b } = color.to_srgb();
    match color.a == 0.0 && color.b == 0.0 {
        // Rounding must not tint a grey.
        true => [g; 3],
        false => [r, g, b],
    }
}

fn phase(position: f32) -> Oklab {
    let (sin, cos) = (TAU * (position - 0.5)).sin_cos();
    Oklab { l: 0.66 + 0.22 * cos, a: 0.02 - 0.085 * cos, b: 0.01 + 0.12 * sin }
}

fn grey(position: f32) -> Oklab {
    Oklab { l: position, a: 0.0, b: 0.0 }
}

fn sigma(position: f32) -> Oklab {
    let (sin, cos) = (290.0 - 190.0 * position).to_radians().sin_cos();
    Oklab { l: 0.25 + 0.68 * position, a: 0.105 * cos, b: 0.105 * sin }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn oklab([r, g, b]: Rgb) -> Oklab {
        Oklab::from(oklab::Rgb { r, g, b })
    }

    fn difference(p: Rgb, q: Rgb) -> f32 {
        let (p, q) = (oklab(p), oklab(q));
        ((p.l - q.l).powi(2) + (p.a - q.a).powi(2) + (p.b - q.b).powi(2)).sqrt()
    }

    #[test]
    fn the_phase_map_closes_without_a_visible_step() {
        let colors = &ColorMap::Phase.palette()[1..];
        for (n, &color) in colors.iter().enumerate() {
            let step = difference(color, colors[(n + 1) % COLORS]);
            assert!(step < 0.012, "step {n}: {step}");
        }
    }

    #[test]
    fn zero_and_pi_differ_in_lightness_alone() {
        let zero = oklab(ColorMap::Phase.at(phase_position(0.0)));
        let pi = oklab(ColorMap::Phase.at(phase_position(PI)));
        assert!(zero.l - pi.l > 0.35);
    }

    #[test]
    fn the_quarters_differ_without_red_and_green() {
        let quarter = |phase| {
            let color = oklab(ColorMap::Phase.at(phase_position(phase)));
            (color.l, color.b)
        };
        let quarters = [0.0, PI / 2.0, PI, -PI / 2.0].map(quarter);
        for (n, p) in quarters.iter().enumerate() {
            for q in &quarters[n + 1..] {
                assert!((p.0 - q.0).hypot(p.1 - q.1) > 0.15, "{p:?} {q:?}");
            }
        }
    }

    #[test]
    fn every_colour_lies_inside_srgb() {
        for map in [phase, sigma] {
            for n in 0..COLORS {
                let c = map((n as f32 + 0.5) / COLORS as f32).to_linear_rgb();
                for part in [c.r, c.g, c.b] {
                    assert!((-0.02..=1.02).contains(&part), "{n}: {c:?}");
                }
            }
        }
    }

    #[test]
    fn grey_and_sigma_grow_lighter() {
        for map in [ColorMap::Grey, ColorMap::Sigma] {
            // Every fourth: neighbours may differ by rounding alone.
            let colors = map.palette()[1..].iter().step_by(4);
            let lightness = colors.map(|&color| oklab(color).l);
            assert!(lightness.is_sorted(), "{map:?}");
        }
        let greys = &ColorMap::Grey.palette()[1..];
        assert!(greys.iter().all(|c| c[0] == c[1] && c[1] == c[2]));
    }

    #[test]
    fn phases_wrap_and_missing_values_are_grey() {
        assert_eq!(
            ColorMap::Phase.at(phase_position(0.4)),
            ColorMap::Phase.at(phase_position(0.4 + 3.0 * TAU))
        );
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(ColorMap::Phase.at(phase_position(odd)), NO_VALUE);
        }
    }
}
