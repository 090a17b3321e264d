//! How exactly the phase between two layers is known.
//!
//! The product of two layers' cross-spectra is not Gaussian, so the bound of one layer of coherence
//! Gamma = Gamma_1 o Gamma_2 is not its error. How the decorrelation divides between the layers is seen in neighbouring
//! frames, blind to the phases (which the motion of the whole sample makes different in every sub-window); then both
//! noises are followed through the estimate ([`layered_sandwich`]).

use super::region::{Region, WindowedPair};
use crate::looks::Block;
use crate::method::Plan;
use phasewalk_core::bound::{layered_sandwich, reported_variance, share_of_layers};
use phasewalk_core::model::debias_blocks;
use phasewalk_core::reference::reference_span;
use phasewalk_core::square::Square;

/// Of both layers: sums of |C_w|^2 and of P_w(t) P_w(t + 1) over sub-windows and neighbouring frames.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Neighbours {
    squares: [f64; 2],
    powers: [f64; 2],
}

impl Neighbours {
    /// Take the pair of frames (t + 1, t) in.
    pub fn add(&mut self, region: &Region, t: usize, pair: &WindowedPair) {
        for layer in 0..2 {
            let [now, next] = [t, t + 1].map(|frame| region.window_powers(frame, layer));
            self.squares[layer] += pair.squares[layer];
            self.powers[layer] += now.iter().zip(&next).map(|(p, q)| p * q).sum::<f64>();
        }
    }

    /// Share of the first layer in the decay of the product.
    fn share(&self, window: Block) -> f64 {
        let mean = |layer: usize| self.squares[layer] / self.powers[layer].max(f64::MIN_POSITIVE);
        share_of_layers([0, 1].map(|layer| debias_blocks(mean(layer), window.looks)))
    }

    /// Standard deviations of phases linked with `gamma`, N x N; those that are infinite in `sigmas` stay so.
    pub fn sigmas(
        &self,
        window: Block,
        plan: &Plan,
        looks: f64,
        gamma: &mut [f64],
        sigmas: &[f64],
    ) -> Vec<f64> {
        let n = plan.frames();
        let mut matrices: [Vec<f64>; 6] = [0; 6].map(|_| vec![0.0; n * n]);
        let [mut precision, mut out, mut a, mut b, mut seen, mut own] =
            matrices.each_mut().map(|data| Square::new(data, n));
        let gamma = Square::new(gamma, n);
        precision.copy_from(&gamma);
        precision.invert();
        let scratch = [&mut a, &mut b, &mut seen, &mut own];
        let looks = [looks, window.looks];
        layered_sandwich(&precision, &gamma, self.share(window), looks, &mut out, scratch);
        let usable: Vec<f64> = sigmas.iter().map(|s| f64::from(u8::from(s.is_finite()))).collect();
        let references = reference_span(&usable, plan.params.reference_frames);
        let sigma = |(frame, &sigma): (usize, &f64)| {
            let known = reported_variance(&out, &usable, references, frame).sqrt();
            if sigma.is_finite() { known } else { sigma }
        };
        sigmas.iter().enumerate().map(sigma).collect()
    }
}
