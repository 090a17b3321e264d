//! What may be known of the phase beforehand: how strongly its velocity can change.

use crate::scalar::Real;
use crate::square::{Square, dot};

/// Precision matrix P = D^T D of independent accelerations. Row i of D gives the second divided
/// difference of phi_i, phi_{i+1}, phi_{i+2}, over its standard deviation sigma sqrt(m (a + b) / 2), rad per unit of
/// time, with the intervals a and b and their mean m over the series: accelerations of sigma rad per (unit of time)^2,
/// independent from one mean interval to the next, change the velocity by so much over the mean of both.
pub(crate) fn acceleration_prior<T: Real>(times: &[f64], sigma: f64, out: &mut Square<'_, T>) {
    out.fill_with(|_, _| T::zero());
    let whole = times.last().zip(times.first()).map_or(1.0, |(last, first)| last - first);
    let mean = whole / times.len().saturating_sub(1).max(1) as f64;
    for (first, window) in times.windows(3).enumerate() {
        let &[x, y, z] = window else { break };
        let (a, b) = (y - x, z - y);
        let spread = sigma * libm::sqrt(mean * (a + b) / 2.0);
        let row = [1.0 / a, -1.0 / a - 1.0 / b, 1.0 / b].map(|d| d / spread);
        for (i, &p) in row.iter().enumerate() {
            for (j, &q) in row.iter().enumerate() {
                let value = out.at(first + i, first + j) + T::from_f64(p * q);
                out.set(first + i, first + j, value);
            }
        }
    }
}

/// F <- F + P.
pub(crate) fn add_prior<T: Real>(information: &mut Square<'_, T>, prior: &Square<'_, T>) {
    for i in 0..information.order() {
        for (place, &p) in information.row_mut(i).iter_mut().zip(prior.row(i)) {
            *place += p;
        }
    }
}

/// g <- g - P phi.
pub(crate) fn pull_of<T: Real>(prior: &Square<'_, T>, phases: &[T], score: &mut [T]) {
    for (i, place) in score.iter_mut().enumerate() {
        *place = *place - dot(prior.row(i), phases);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_costs_nothing_and_a_bend_its_square() {
        let times = [0.0, 1.0, 3.0, 4.0, 8.0];
        let mut data = [0.0; 25];
        let mut prior = Square::new(&mut data, 5);
        acceleration_prior(&times, 0.5, &mut prior);
        let mut pull = [0.0; 5];
        pull_of(&prior, &times.map(|t| 3.0 - 0.7 * t), &mut pull);
        assert!(pull.iter().all(|p: &f64| p.abs() < 1e-13), "{pull:?}");
        // Velocity 0, then 1 from t = 1 on, mean interval 2: (1 / (0.5 sqrt(2 * 1.5)))^2 = 1 / 0.75.
        let bend = [0.0, 0.0, 2.0, 3.0, 7.0];
        let mut pull = [0.0; 5];
        pull_of(&prior, &bend, &mut pull);
        assert!((dot(&bend, &pull) + 1.0 / 0.75).abs() < 1e-12);
    }

    /// The same motion in another unit of time.
    #[test]
    fn the_unit_of_time_does_not_matter() {
        let cost = |unit: f64| {
            let times = [0.0, 1.0, 3.0, 4.0].map(|t| t * unit);
            let mut data = [0.0; 16];
            let mut prior = Square::new(&mut data, 4);
            acceleration_prior(&times, 0.5 / (unit * unit), &mut prior);
            let mut pull = [0.0; 4];
            let phases = [0.0, 0.3, 0.2, 0.9];
            pull_of(&prior, &phases, &mut pull);
            dot(&phases, &pull)
        };
        let ratio: f64 = cost(0.01) / cost(1.0);
        assert!((ratio - 1.0).abs() < 1e-12, "{ratio}");
    }
}
