//! Support for the tests of Phasewalk.
//!
//! * [`oracle`]: the paper's estimators written a second time, from the paper alone: dense
//!   matrices, direct sums, `f64`. The fast code is compared with it.
//! * [`wide`]: arithmetic in double-double, and the one linear solver the oracle uses.

pub mod oracle;
pub mod wide;
