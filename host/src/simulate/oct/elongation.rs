//! What the stimulus does: the outer segments inside the x grow (paper, lines 633–642).

use crate::simulate::stimulus::{START_FRAME, inside_x, movement_wavelengths};
use std::f64::consts::PI;

/// Frames of the paper's curve.
const PAPER_FRAMES: usize = 70;
/// The measured outer segments grow more than the scene of the paper does.
const GAIN: f64 = 1.5;
/// Pixels between the x and the region that serves as control.
const CONTROL_DISTANCE: usize = 4;

/// True phase of the tips against the inner/outer segment line, radians, one per sweep:
/// 1.5 · 4π/λ · Σ Δz, the paper's curve stretched so that its 70 frames last `sweeps` sweeps.
///
/// The sweeps 0 … 4 come before the stimulus. The last value is 3.07 rad for every number of sweeps.
pub fn phase_rad(sweeps: usize) -> Vec<f64> {
    let curve: Vec<f64> = (0..PAPER_FRAMES)
        .scan(0.0, |z, t| {
            *z += movement_wavelengths(t);
            Some(GAIN * 4.0 * PI * *z)
        })
        .collect();
    let last_before = (START_FRAME - 1) as f64;
    let stretch = (PAPER_FRAMES as f64 - 1.0 - last_before)
        / (sweeps.saturating_sub(1) as f64 - last_before).max(1.0);
    let at = |t: usize| {
        let frame = (last_before + (t as f64 - last_before).max(0.0) * stretch)
            .min(PAPER_FRAMES as f64 - 1.0);
        let before = (frame as usize).min(PAPER_FRAMES - 2);
        curve[before] + (frame - before as f64) * (curve[before + 1] - curve[before])
    };
    (0..sweeps).map(|t| if t < START_FRAME { 0.0 } else { at(t) }).collect()
}

/// Whether a scatterer at (x, y), in pixels of the first sweep, lies inside the x.
pub fn stimulated(position: [f32; 2], size: [usize; 2]) -> bool {
    let pixel = position.map(|p| p.round());
    let inside = pixel.iter().zip(size).all(|(&p, n)| p >= 0.0 && p < n as f32);
    inside && inside_x(pixel.map(|p| p as usize), size)
}

/// The x, shape (y, x).
pub fn mask(width: usize, height: usize) -> Vec<bool> {
    let row = |y| (0..width).map(move |x| inside_x([x, y], [width, height]));
    (0..height).flat_map(row).collect()
}

/// The pixels that are at least four pixels away from the x and from the edges, shape (y, x).
pub fn control(mask: &[bool], width: usize, height: usize) -> Vec<bool> {
    let d = CONTROL_DISTANCE as isize;
    let disc: Vec<[isize; 2]> = (-d..=d)
        .flat_map(|y| (-d..=d).map(move |x| [y, x]))
        .filter(|[y, x]| x * x + y * y < d * d)
        .collect();
    let clear = |y: usize, x: usize| {
        disc.iter().all(|[dy, dx]| {
            let (y, x) = (y.checked_add_signed(*dy), x.checked_add_signed(*dx));
            matches!((y, x), (Some(y), Some(x)) if y < height && x < width && !mask[y * width + x])
        })
    };
    (0..height).flat_map(|y| (0..width).map(move |x| clear(y, x))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_ends_alike_for_every_number_of_sweeps() {
        for sweeps in [6, 24, 40, 70, 200] {
            let phase = phase_rad(sweeps);
            assert_eq!(phase.len(), sweeps);
            assert!(phase[..5].iter().all(|&p| p == 0.0));
            assert!((phase[sweeps - 1] - 1.5 * 2.044).abs() < 1e-3, "{sweeps}");
            assert!(phase.windows(2).all(|pair| pair[0] <= pair[1]));
        }
        assert!(phase_rad(5).iter().all(|&p| p == 0.0));
    }

    #[test]
    fn at_70_sweeps_it_is_the_papers() {
        let phase = phase_rad(70);
        assert!((phase[5] - GAIN * PI / 100.0).abs() < 1e-12);
    }

    #[test]
    fn the_control_keeps_its_distance() {
        let (width, height) = (60, 40);
        let mask = mask(width, height);
        let control = control(&mask, width, height);
        let distance = |a: usize, b: usize| {
            let [dy, dx] = [(a / width).abs_diff(b / width), (a % width).abs_diff(b % width)];
            dy * dy + dx * dx
        };
        let of = |region: &[bool]| (0..region.len()).filter(|&i| region[i]).collect::<Vec<_>>();
        assert!(of(&control).len() > 100);
        for c in of(&control) {
            assert!(of(&mask).into_iter().all(|m| distance(c, m) >= 16));
        }
    }
}
