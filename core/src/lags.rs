//! The pairs of a series sorted by how far apart they are.

use crate::coherence::Lag;
use crate::scalar::Real;

/// All pairs i < j, grouped by |t_i - t_j|.
///
/// Pairs whose lags round to the same multiple of the shortest interval share a group; a model of the
/// coherence is fitted to the groups' means, so that the scatter of single pairs averages out.
#[derive(Debug)]
pub struct Lags<'a> {
    times: &'a [f64],
    /// Pairs (i, j) as i * frames + j, by ascending lag.
    order: &'a mut [u32],
    /// End of each group in `order`.
    ends: &'a mut [u32],
    groups: usize,
    unit: f64,
}

impl<'a> Lags<'a> {
    /// Whole numbers that `frames` frames need: two for each pair.
    #[must_use]
    pub const fn indices(frames: usize) -> usize {
        frames * frames.saturating_sub(1)
    }

    /// Sort the pairs of frames at `times`, strictly ascending; at most 65,536. `indices` holds
    /// [`Self::indices`] numbers; with fewer the farthest pairs are left out.
    #[must_use]
    pub fn new(times: &'a [f64], indices: &'a mut [u32]) -> Self {
        let frames = times.len();
        let (order, ends) = indices.split_at_mut(indices.len() / 2);
        let pairs = (0..frames).flat_map(|i| (i + 1..frames).map(move |j| i * frames + j));
        let count = (Self::indices(frames) / 2).min(order.len());
        let order = order.get_mut(..count).unwrap_or(&mut []);
        for (place, pair) in order.iter_mut().zip(pairs) {
            *place = u32::try_from(pair).unwrap_or(0);
        }
        let lag = |&pair: &u32| lag_of(times, pair);
        order.sort_unstable_by(|a, b| lag(a).total_cmp(&lag(b)));
        let unit = order.first().map_or(1.0, lag);
        let mut lags = Self { times, order, ends, groups: 0, unit };
        lags.find_groups();
        lags
    }

    fn find_groups(&mut self) {
        let multiple = |pair: u32| libm::round(lag_of(self.times, pair) / self.unit);
        let mut pairs = self.order.iter().enumerate().peekable();
        while let Some((number, &pair)) = pairs.next() {
            let ends_here = pairs.peek().is_none_or(|&(_, &next)| multiple(next) > multiple(pair));
            if ends_here && let Some(end) = self.ends.get_mut(self.groups) {
                *end = u32::try_from(number + 1).unwrap_or(u32::MAX);
                self.groups += 1;
            }
        }
    }

    /// When the frames were taken.
    #[must_use]
    pub const fn times(&self) -> &'a [f64] {
        self.times
    }

    /// Number of frames.
    #[must_use]
    pub const fn frames(&self) -> usize {
        self.times.len()
    }

    /// The shortest interval between frames.
    #[must_use]
    pub const fn unit(&self) -> f64 {
        self.unit
    }

    /// The longest lag.
    #[must_use]
    pub fn longest(&self) -> f64 {
        self.order.last().map_or(self.unit, |&pair| lag_of(self.times, pair))
    }

    /// Number of groups.
    #[must_use]
    pub const fn groups(&self) -> usize {
        self.groups
    }

    /// |t_i - t_j|.
    #[must_use]
    pub fn between(&self, i: usize, j: usize) -> f64 {
        let time = |frame: usize| self.times.get(frame).copied().unwrap_or(0.0);
        (time(i) - time(j)).abs()
    }

    /// The pairs (i, j), i < j, of a group; the nearest ones are group 0.
    pub fn pairs(&self, group: usize) -> impl Iterator<Item = (usize, usize)> + Clone {
        let end = |group: usize| self.ends.get(group).map_or(0, |&end| end as usize);
        let begin = group.checked_sub(1).map_or(0, end);
        let frames = self.frames().max(1);
        let pairs = self.order.get(begin..end(group)).unwrap_or(&[]);
        pairs.iter().map(move |&pair| (pair as usize / frames, pair as usize % frames))
    }

    /// The mean lag of a group.
    #[must_use]
    pub fn tau(&self, group: usize) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (i, j) in self.pairs(group) {
            sum += self.between(i, j);
            count += 1.0;
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// The mean of `value` over a group's pairs with these weights.
    pub fn mean<T: Real>(
        &self,
        group: usize,
        value: impl Fn(usize, usize) -> T,
        weight: impl Fn(usize, usize) -> T,
    ) -> Lag<T> {
        let (mut sum, mut pairs) = (T::zero(), T::zero());
        for (i, j) in self.pairs(group) {
            let w = weight(i, j);
            sum = w.mul_add(value(i, j), sum);
            pairs += w;
        }
        let mean = sum / pairs.max(T::from_f64(1e-12));
        Lag { tau: T::from_f64(self.tau(group)), mean, pairs }
    }
}

fn lag_of(times: &[f64], pair: u32) -> f64 {
    let frames = times.len().max(1);
    let time = |frame: usize| times.get(frame).copied().unwrap_or(0.0);
    time(pair as usize % frames) - time(pair as usize / frames)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bursts_have_the_lags_that_occur() {
        let times = [0.0, 1.0, 10.0, 11.0];
        let mut indices = [0; Lags::indices(4)];
        let lags = Lags::new(&times, &mut indices);
        let all: [f64; 4] = core::array::from_fn(|group| lags.tau(group));
        assert_eq!((lags.groups(), all), (4, [1.0, 9.0, 10.0, 11.0]));
        assert!(lags.pairs(0).eq([(0, 1), (2, 3)]) || lags.pairs(0).eq([(2, 3), (0, 1)]));
        assert_eq!(lags.longest(), 11.0);
        let mean = lags.mean(2, |i, _| i as f64, |_, _| 1.0);
        assert_eq!((mean.tau, mean.mean, mean.pairs), (10.0, 0.5, 2.0));
        assert_eq!(lags.pairs(9).count(), 0);
    }

    #[test]
    fn rounding_and_jitter_of_the_times_do_not_split_a_lag() {
        let times: [f64; 30] = core::array::from_fn(|i| 0.1 * i as f64);
        let mut indices = [0; Lags::indices(30)];
        assert_eq!(Lags::new(&times, &mut indices).groups(), 29);
        let jitter: [f64; 30] = core::array::from_fn(|i| i as f64 + 0.01 * ((i * 7) % 5) as f64);
        let lags = Lags::new(&jitter, &mut indices);
        // The unit is the shortest interval, 0.97: far lags drift by no more than a group.
        assert!((29..=31).contains(&lags.groups()), "{}", lags.groups());
    }
}
