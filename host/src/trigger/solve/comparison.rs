//! What the board said beside what the host found.

use super::twin::Expected;
use phasewalk_firmware::message::Estimate;

/// A volume, solved by both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Number of the volume, from 0.
    pub volume: u32,
    /// The board's phase in radians.
    pub phase_rad: f32,
    /// The board's standard deviation of it, in radians.
    pub sigma_rad: f32,
    /// The host's phase in `f64`, in radians.
    pub host_phase_rad: f64,
    /// How long the board's solver took, in microseconds of its clock.
    pub took_us: f64,
    /// Phase and standard deviation are those of the host's `f32`, bit for bit.
    pub same_bits: bool,
}

impl Row {
    /// From what both say.
    #[must_use]
    pub fn new(board: &Estimate, host: &Expected, ticks_per_second: u32) -> Self {
        let single = &host.single;
        let bits = (single.phase_rad.to_bits(), single.sigma_rad.to_bits());
        Self {
            volume: board.volume,
            phase_rad: f32::from_bits(board.phase),
            sigma_rad: f32::from_bits(board.sigma),
            host_phase_rad: host.double.phase_rad,
            took_us: f64::from(board.took) * 1e6 / f64::from(ticks_per_second.max(1)),
            same_bits: bits == (board.phase, board.sigma),
        }
    }

    /// The board's phase less the host's in `f64`, in radians.
    #[must_use]
    pub fn difference_rad(&self) -> f64 {
        f64::from(self.phase_rad) - self.host_phase_rad
    }
}

/// All volumes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Volumes solved.
    pub volumes: usize,
    /// Those with the same bits as the host's `f32`.
    pub same_bits: usize,
    /// The first without.
    pub first_other: Option<u32>,
    /// Largest difference to `f64`, in radians.
    pub largest_rad: f64,
    /// Root mean square of the differences to `f64`, in radians.
    pub rms_rad: f64,
    /// Mean time of the solver, in microseconds.
    pub mean_us: f64,
    /// Longest time of the solver, in microseconds.
    pub longest_us: f64,
}

impl Comparison {
    /// Of some volumes.
    #[must_use]
    pub fn of(rows: &[Row]) -> Self {
        let count = rows.len().max(1) as f64;
        let squares: f64 = rows.iter().map(|row| row.difference_rad().powi(2)).sum();
        // A NaN must not be lost in a maximum.
        let larger = |a: f64, b: f64| if a >= b || a.is_nan() { a } else { b };
        Self {
            volumes: rows.len(),
            same_bits: rows.iter().filter(|row| row.same_bits).count(),
            first_other: rows.iter().find(|row| !row.same_bits).map(|row| row.volume),
            largest_rad: rows.iter().map(|row| row.difference_rad().abs()).fold(0.0, larger),
            rms_rad: (squares / count).sqrt(),
            mean_us: rows.iter().map(|row| row.took_us).sum::<f64>() / count,
            longest_us: rows.iter().map(|row| row.took_us).fold(0.0, larger),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasewalk_core::tracker;

    #[test]
    fn one_bit_counts() {
        let row = |volume: u32, board: f32| {
            let (sigma_rad, quality) = (f32::INFINITY, 1.0);
            let single = tracker::Estimate { frame: 0, phase_rad: 1.0, sigma_rad, quality };
            let (sigma_rad, quality) = (0.0, 1.0);
            let double = tracker::Estimate { frame: 0, phase_rad: 1.5, sigma_rad, quality };
            let (phase, sigma) = (board.to_bits(), f32::INFINITY.to_bits());
            let board = Estimate { volume, phase, sigma, took: 840 };
            Row::new(&board, &Expected { single, double }, 84_000_000)
        };
        let rows = [row(0, 1.0), row(1, 1.0_f32.next_up()), row(2, 1.0)];
        let comparison = Comparison::of(&rows);
        assert_eq!((comparison.volumes, comparison.same_bits), (3, 2));
        assert_eq!(comparison.first_other, Some(1));
        assert!((comparison.largest_rad - 0.5).abs() < 1e-6);
        assert!((comparison.rms_rad - 0.5).abs() < 1e-6);
        assert_eq!((comparison.mean_us, comparison.longest_us), (10.0, 10.0));
        assert!(Comparison::of(&[row(0, f32::NAN), row(1, 1.0)]).largest_rad.is_nan());
    }
}
