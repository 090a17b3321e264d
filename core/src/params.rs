//! Every parameter of the method, with its default and where the paper states it.

use crate::error::Error;

/// D: how many preceding phases an unwrapped phase is compared with (paper line 842).
pub const UNWRAP_NEIGHBOURS: usize = 10;

/// mu_1: strength of the gauge term Gamma_1 (line 936).
///
/// The normal equations sum to mu_1^2 phi_g = 0, so every mu_1 > 0 gives phi_g = 0 and the same
/// differences: the solver sets phi_g = 0 exactly and needs no number, which costs no digits in
/// `f32`. The constant serves those who write the equation out, as the test oracle does.
pub const GAUGE_STRENGTH: f64 = 0.02;

/// mu_2: strength of the difference term Gamma_2 (line 936).
pub const DIFFERENCE_STRENGTH: f64 = 0.001;

/// g: the frame that Gamma_1 holds at zero, the fifth (lines 922-927).
pub const GAUGE_FRAME: usize = 4;

/// N_0: the first frames, without deliberate change, whose mean is subtracted (lines 945-948).
pub const REFERENCE_FRAMES: usize = 5;

/// t_0: the frame to which the direct phase difference compares (line 526: the fifth).
pub const DIRECT_FRAME: usize = 4;

/// P_0: probability that random phases stay below the threshold b (line 806).
pub const RANDOM_PROBABILITY: f64 = 0.999_99;

/// Which finite difference Gamma_2 keeps small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difference {
    /// phi_i - phi_{i-1}, as the paper has it (lines 929-935): a gap is bridged by a level line.
    First,
    /// The second divided difference: a gap is bridged by a straight line.
    Second,
}

impl Difference {
    /// How many frames back the difference reaches.
    #[must_use]
    pub const fn reach(self) -> usize {
        match self {
            Self::First => 1,
            Self::Second => 2,
        }
    }
}

/// Parameters of the least-squares solution; one value serves every pixel and every frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// L: pairs (t, t + dt) are used for dt = 1..=L. L = N - 1 uses all pairs, as the paper does.
    pub max_lag: usize,
    /// mu_2, see [`DIFFERENCE_STRENGTH`]; 1e-9 ..= 1e3, so that `f32` holds its square.
    pub difference_strength: f64,
    /// Which difference mu_2 weighs.
    pub difference: Difference,
    /// g, see [`GAUGE_FRAME`]; in a shorter series the last frame.
    pub gauge_frame: usize,
    /// N_0, see [`REFERENCE_FRAMES`]; in a shorter series all frames.
    pub reference_frames: usize,
}

impl Params {
    /// The paper's parameters with the given largest lag.
    #[must_use]
    pub const fn paper(max_lag: usize) -> Self {
        Self {
            max_lag,
            difference_strength: DIFFERENCE_STRENGTH,
            difference: Difference::First,
            gauge_frame: GAUGE_FRAME,
            reference_frames: REFERENCE_FRAMES,
        }
    }

    /// Check the parameters for a series of `frames` frames.
    ///
    /// # Errors
    /// Names the first parameter that is out of its range.
    pub fn validate(&self, frames: usize) -> Result<(), Error> {
        let fail = |parameter, value, allowed| Err(Error { parameter, value, allowed });
        if frames < 2 {
            return fail("number of frames", frames as f64, "at least 2");
        }
        if self.max_lag == 0 || self.max_lag >= frames {
            let allowed = "at least 1 and below the number of frames";
            return fail("max lag", self.max_lag as f64, allowed);
        }
        if self.max_lag < self.difference.reach() {
            return fail("max lag", self.max_lag as f64, "at least 2 for second differences");
        }
        if !(1e-9..=1e3).contains(&self.difference_strength) {
            return fail("difference strength", self.difference_strength, "1e-9 ..= 1e3");
        }
        if self.reference_frames == 0 {
            return fail("number of reference frames", 0.0, "at least 1");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_checked_and_named() {
        assert!(Params::paper(69).validate(70).is_ok());
        let refused = |params: Params, frames, name| {
            assert_eq!(params.validate(frames).unwrap_err().parameter, name);
        };
        refused(Params::paper(1), 1, "number of frames");
        refused(Params::paper(0), 70, "max lag");
        refused(Params::paper(70), 70, "max lag");
        refused(Params { difference: Difference::Second, ..Params::paper(1) }, 70, "max lag");
        refused(Params { difference_strength: 0.0, ..Params::paper(9) }, 70, "difference strength");
        refused(
            Params { difference_strength: f64::NAN, ..Params::paper(9) },
            70,
            "difference strength",
        );
        refused(
            Params { reference_frames: 0, ..Params::paper(9) },
            70,
            "number of reference frames",
        );
    }
}
