//! The planes of a frame that are combined: the depths of one or two layers, of one or several recordings.
//!
//! ⟨C⟩ = mean over recordings r and pixels x of C_r(x), where C_r is the sum of U(t) conj U(t+dt) over the depths
//! of a layer, of two layers the product C_r^{Z1} conj C_r^{Z2}. A phase that one recording has in all its frames, or of
//! two layers any phase common to both, is gone before the mean is taken.

use crate::method::Depths;
use num_complex::Complex;
use phasewalk_core::Scalar;
use phasewalk_core::layers::layer_difference;
use std::ops::Range;

/// The depths of every recording, at least one, in a series whose depths are those of the recordings one after the
/// other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Planes {
    recordings: Vec<Depths>,
    /// Depths of the series that belong to one recording.
    depth: usize,
}

/// Where the layers of one recording lie in the order of [`Planes::all`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layers {
    /// Z1.
    pub first: Range<usize>,
    /// Z2; empty if there is one layer.
    pub second: Range<usize>,
}

impl From<Depths> for Planes {
    fn from(depths: Depths) -> Self {
        Self { recordings: vec![depths], depth: 0 }
    }
}

impl Planes {
    /// Those of recordings with `depth` depths each; all have one layer, or all have two.
    #[must_use]
    pub fn of_recordings(recordings: Vec<Depths>, depth: usize) -> Self {
        Self { recordings, depth }
    }

    /// All depths used, recording after recording and Z1 first; a depth in both layers appears twice.
    #[must_use]
    pub fn all(&self) -> Vec<usize> {
        let of = |(r, depths): (usize, &Depths)| {
            depths.all().into_iter().map(move |z| r * self.depth + z).collect::<Vec<_>>()
        };
        self.recordings.iter().enumerate().flat_map(of).collect()
    }

    /// The layers of every recording.
    #[must_use]
    pub fn layers(&self) -> Vec<Layers> {
        let place = |end: &mut usize, depths: &Depths| {
            let middle = *end + depths.in_first();
            let first = *end..middle;
            *end += depths.all().len();
            Some(Layers { first, second: middle..*end })
        };
        self.recordings.iter().scan(0, place).collect()
    }

    /// Are two layers compared?
    #[must_use]
    pub fn has_two_layers(&self) -> bool {
        self.recordings.iter().all(|depths| depths.second.is_some())
    }

    /// The depths of each layer, Z1 first, in every recording.
    #[must_use]
    pub fn by_layer(&self) -> Vec<Vec<Vec<usize>>> {
        let all = self.all();
        let layer = |of: fn(&Layers) -> &Range<usize>| -> Vec<Vec<usize>> {
            self.layers().iter().map(|layers| all[of(layers).clone()].to_vec()).collect()
        };
        let mut layers = vec![layer(|layers| &layers.first)];
        if self.has_two_layers() {
            layers.push(layer(|layers| &layers.second));
        }
        layers
    }
}

impl std::fmt::Display for Planes {
    /// As `--layers` has them, once if they are the same in every recording.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut texts: Vec<String> = self.recordings.iter().map(Depths::to_string).collect();
        texts.dedup();
        f.write_str(&texts.join("; "))
    }
}

impl Layers {
    /// Z1 and Z2.
    #[inline(always)]
    #[must_use]
    pub fn both(&self) -> [Range<usize>; 2] {
        [self.first.clone(), self.second.clone()]
    }

    /// C of the one layer, or C^{Z1} conj C^{Z2}, from the sums of C over the planes of [`Self::both`].
    #[inline(always)]
    #[must_use]
    pub fn combine<T: Scalar>(&self, [first, second]: [Complex<T>; 2]) -> Complex<T> {
        if self.second.is_empty() { first } else { layer_difference(first, second) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planes(texts: &[&str]) -> Planes {
        Planes::of_recordings(texts.iter().map(|text| text.parse().unwrap()).collect(), 10)
    }

    #[test]
    fn recordings_follow_each_other() {
        let two = planes(&["3..5,8..9", "2..3,7..7"]);
        assert_eq!(two.all(), [3, 4, 5, 8, 9, 12, 13, 17]);
        let layers = two.layers();
        assert_eq!(layers[0], Layers { first: 0..3, second: 3..5 });
        assert_eq!(layers[1], Layers { first: 5..7, second: 7..8 });
        let z1 = vec![vec![3, 4, 5], vec![12, 13]];
        assert_eq!(two.by_layer(), [z1, vec![vec![8, 9], vec![17]]]);
        assert!(two.has_two_layers());
        assert_eq!(two.to_string(), "3..5,8..9; 2..3,7..7");
    }

    #[test]
    fn one_layer_has_no_second() {
        let one = planes(&["0..1", "0..1"]);
        assert_eq!(one.layers()[1], Layers { first: 2..4, second: 4..4 });
        assert_eq!(one.by_layer(), [vec![vec![0, 1], vec![10, 11]]]);
        assert!(!one.has_two_layers());
        assert_eq!(one.to_string(), "0..1");
    }
}
