//! From raw sweeps to the retina's layers (paper, lines 655–712).

pub mod register;
