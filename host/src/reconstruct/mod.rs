//! Raw sweeps to the phase-carrying layers (paper lines 655–712).

mod quantile;
pub mod segment;
pub mod sweeps;
