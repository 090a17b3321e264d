//! Support for the tests of Phasewalk.
//!
//! | module | what it holds |
//! |---|---|
//! | [`oracle`] | the paper's estimators written a second time, from the paper alone: dense matrices, direct sums, `f64`; the fast code is compared with it |
//! | [`wide`] | arithmetic in double-double, and the one linear solver the oracle uses |
//! | [`tolerance`] | every tolerance of the tests, with its reason |
//! | [`random`] | seeded random numbers |
//! | [`recording`] | complex series to be evaluated |
//! | [`volumes`] | groups of reconstructed volumes |
//! | [`library`] | the host library's curves and images of a recording |
//! | [`program`] | the `phasewalk` program, driven as a user does |
//! | [`rehearsed_board`] | the trigger board's own program behind a pseudo-terminal |
//! | [`oct`] | a simulated recording from raw images to the curve, against its truth |
//! | [`npy`] | the NumPy files that go in and come out |
//! | `board` | an emulated Arduino Uno (feature `emulated-boards`) |
//! | `avr8js` | the same on a second simulator (feature `emulated-boards`) |
//! | `f405` | a board with an STM32F405 (feature `emulated-boards`) |
//! | `qemu` | the image of the STM32F405 in QEMU (feature `emulated-boards`) |
//! | `session` | a conversation with a simulated board (feature `emulated-boards`) |

#[cfg(feature = "emulated-boards")]
pub mod avr8js;
#[cfg(feature = "emulated-boards")]
pub mod board;
#[cfg(feature = "emulated-boards")]
pub mod f405;
pub mod library;
pub mod npy;
pub mod oct;
pub mod oracle;
pub mod program;
#[cfg(feature = "emulated-boards")]
pub mod qemu;
pub mod random;
pub mod recording;
pub mod rehearsed_board;
#[cfg(feature = "emulated-boards")]
pub mod session;
pub mod tolerance;
pub mod volumes;
pub mod wide;
