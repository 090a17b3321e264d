//! What the scene does on purpose: an x-shaped region moves along z (paper, lines 635–642).

/// Frame t₀ of the first systematic movement (line 642).
pub const START_FRAME: usize = 5;
/// Steady movement per frame, in wavelengths: λ/400 (line 638).
pub const VELOCITY_WAVELENGTHS: f64 = 1.0 / 400.0;
/// Amplitude of the modulation of the movement per frame, in wavelengths: λ/800 (line 638).
pub const MODULATION_WAVELENGTHS: f64 = 1.0 / 800.0;
/// Angular frequency of the modulation, radians per frame (line 638).
pub const MODULATION_RAD_PER_FRAME: f64 = 0.1;

/// Half the width of a bar of the x, and half its length, both over min(width, height).
const HALF_BAR: [f64; 2] = [0.10, 0.456];

/// Δz(t) in wavelengths: the movement into frame t of all scatterers inside the x,
/// λ/400 + λ/800 · sin(0.1 (t − t₀)) for t ≥ t₀, else 0 (lines 637–643).
pub fn movement_wavelengths(t: usize) -> f64 {
    t.checked_sub(START_FRAME).map_or(0.0, |elapsed| {
        VELOCITY_WAVELENGTHS
            + MODULATION_WAVELENGTHS * libm::sin(MODULATION_RAD_PER_FRAME * elapsed as f64)
    })
}

/// z(t) in wavelengths: how far the x has moved at a time t in frames, not below 0; between two whole
/// frames on the straight line.
pub fn displacement_wavelengths(time: f64) -> f64 {
    let whole = time.floor();
    let until: f64 = (0..=whole as usize).map(movement_wavelengths).sum();
    until + (time - whole) * movement_wavelengths(whole as usize + 1)
}

/// Whether the centre of pixel (x, y) lies inside the x: two crossed bars along the diagonals,
///
/// u = (X + Y)/(√2 s), v = (X − Y)/(√2 s), X = x − W/2 + ½, Y = y − H/2 + ½, s = min(W, H):
/// |u| < 0.10 and |v| < 0.456, or |v| < 0.10 and |u| < 0.456.
///
/// The paper shows the mask and gives no formula; this one is ours.
pub fn inside_x([x, y]: [usize; 2], [width, height]: [usize; 2]) -> bool {
    let side = width.min(height) as f64 * std::f64::consts::SQRT_2;
    let centred = |i: usize, len: usize| i as f64 - len as f64 / 2.0 + 0.5;
    let (dx, dy) = (centred(x, width), centred(y, height));
    let (u, v) = (((dx + dy) / side).abs(), ((dx - dy) / side).abs());
    let [narrow, long] = HALF_BAR;
    (u < narrow && v < long) || (v < narrow && u < long)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn movement_starts_at_its_frame() {
        assert_eq!(movement_wavelengths(4), 0.0);
        assert_eq!(movement_wavelengths(5), 1.0 / 400.0);
        let t = 5 + 16; // sin 1.6 is nearly the maximum
        assert!((movement_wavelengths(t) - (1.0 / 400.0 + 0.999_573_6 / 800.0)).abs() < 1e-9);
    }
}
