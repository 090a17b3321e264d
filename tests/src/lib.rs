//! Support for the tests of Phasewalk.
//!
//! | module | what it holds |
//! |---|---|
//! | [`oracle`] | the paper's estimators written a second time, from the paper alone: dense matrices, direct sums, `f64`; the fast code is compared with it |
//! | [`wide`] | arithmetic in double-double, and the one linear solver the oracle uses |
//! | [`tolerance`] | every tolerance of the tests, with its reason |
//! | [`random`] | seeded random numbers |
//! | [`recording`] | complex series to be evaluated |
//! | [`library`] | the host library's curves and images of a recording |
//! | [`program`] | the `phasewalk` program, driven as a user does |
//! | [`npy`] | the NumPy files that go in and come out |

pub mod library;
pub mod npy;
pub mod oracle;
pub mod program;
pub mod random;
pub mod recording;
pub mod tolerance;
pub mod wide;
