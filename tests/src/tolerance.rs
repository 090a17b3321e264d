//! Every tolerance of the tests, with its reason. There is no other.

macro_rules! tolerances {
    ($($name:ident = $value:expr, $reason:literal;)+) => {
        $(#[doc = $reason] pub const $name: f64 = $value;)+

        /// Name, value and reason of all of them.
        pub const TABLE: &[(&str, f64, &str)] = &[$((stringify!($name), $value, $reason)),+];
    };
}

tolerances! {
    ORACLE_RAD = 1e-3, "rad: what the project promises against the paper's mathematics. \
        It is a hundredth of the noise of the best measurements and far above the rounding of f32.";
    DOUBLE_RAD = 1e-7, "rad: f64 against the oracle or against another order of the same sums. \
        Phases of up to 1e2 rad carry 1e-14; Gamma_2 links of 1e-6 beside weights of 1 magnify \
        that a millionfold at the worst.";
    BRIDGED_DOUBLE_RAD = 1e-5, "rad: f64 where Gamma_2 alone, of conductance 1e-6, joins frames: the \
        1e-12 that is lost in currents of 1e4 (Fisher weights squared) shows as 1e-6 rad.";
    SINGLE_STORED_RAD = 1e-5, "rad: f64 results that an image stores as f32: half a unit in the last \
        place of 128 rad is 4e-6.";
    SINGLE_RAD = 1e-3, "rad: f32 against f64 through the whole solution: 1e-6 rad in each of hundreds \
        of pairs, magnified where few pairs hold a frame; equal to the promise.";
    LANE_RAD = 1e-4, "rad: f32 lanes against f32 scalars, which round differently: lanes fuse the \
        multiply-add.";
    SIGMA_RELATIVE = 1e-6, "relative: standard deviations in f64 by two formulas; the streaming one \
        subtracts covariances of similar size and loses up to ten digits of sixteen.";
    SIGMA_IMAGE_RELATIVE = 5e-3, "relative: standard deviations in f32, where 1 - |gamma|^2 loses the \
        digits that the coherence has in common with 1.";
    CLOSURE_P = 2e-3, "probability: sums of 2e3 residuals in f32, which phases in f32 turn by 1e-4 rad.";
    LINKED_SINGLE_RAD = 1e-3, "rad: linked phases in f32 against f64: one step of scoring multiplies the \
        residuals' rounding (1e-7) by at most the number of frames; equal to the promise.";
    TIE_RAD = 1e-3, "rad: two sums of the unwrapping that differ by less are a near-tie \
        (docs/mathematics.md): either branch is the paper's, and phases may differ by turns.";
    EXACT_TIE_RAD = 1e-9, "rad: the same in f64, whose sums of ten phases below 1e3 rad are good to 1e-12.";
    THRESHOLD_TIE = 1e-5, "coherence: the Fisher weight jumps at its threshold; f32 coherences are \
        good to 1e-6.";
    TIE_SHARE = 1e-4, "share of pixels times frames: f32 may fall to the other side of a near-tie in \
        one of 10,000.";
    BRIDGE_RAD = 1e-3, "rad: Gamma_2 puts a frame without weights midway between its neighbours; its \
        pull on the neighbours is mu_2^2 = 1e-6 of their own weights.";
    BRIDGE_SIGMA_RAD = 1.0, "rad: two links of variance 1/mu_2^2 in parallel give 707.1 rad; the \
        neighbours' own uncertainty is far below 1 rad.";
    RMS_FACTOR = 2.2, "factor: an rms over 8 runs scatters by 1/sqrt(16) = 25 %, the reference's over 6 by \
        29 %: together 38 %, and exp(2 * 0.38) = 2.2 is two standard deviations either way; the \
        seeds are fixed.";
    AUTOCORRELATION = 0.025, "amplitude: the reference is rounded to 0.01 and its scene has about 800 \
        independent speckles per frame, which leaves 0.02 at long lags.";
    STANDARD_SCORE = 4.0, "standard deviations: with fixed seeds a chance of 1 in 16,000 for a number \
        that is right.";
    SIGMA_RATIO = 0.05, "relative: standard deviations of three recordings against one; each comes from a \
        coherence fitted to the frames of a region of 100 to 150 looks, and 36 of them leave 2 %.";
    STANDARD_SCORES = 0.2, "relative: rms of error over sigma; 36 regions or places, of which each random walk \
        has about two independent errors, leave 1/sqrt(144) = 8 %.";
    STANDARD_SCORES_OF_LAYERS = 0.25, "relative: the same of two layers, whose sigma is up to a tenth \
        too large (docs/mathematics.md takes the product for Gaussian).";
    DISK_SLOPE_X = 0.3, "rad/mm: the law of the measured disk, -8.1 rad/mm over 31 shots, is itself a fit \
        to the whole image; two windows of the disk differ by 0.1.";
    DISK_SLOPE_Z = 0.3, "rad/mm: a rigid rotation has none; a tilt of the disk by 2 degrees would show as \
        this.";
    DISK_RANDOM_RAD = 0.1, "rad: a uniformly random phase has an rms of pi / sqrt(3) = 1.81 rad; about 100 \
        independent places leave 0.05.";
    LEAK_RAD = 2e-3, "rad per frame: the aperture's side lobes bring about one per cent of the light \
        of the moving x (0.03 rad per frame) to its surroundings.";
}

#[cfg(test)]
mod tests {
    use super::TABLE;

    #[test]
    fn every_tolerance_has_a_reason() {
        for (name, value, reason) in TABLE {
            assert!(*value > 0.0 && reason.contains(':') && reason.len() > 40, "{name}");
        }
    }
}
