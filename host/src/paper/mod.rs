//! Every figure and number of the paper that can be computed, with the paper's scene and its truth.
//!
//! ```text
//! settings ─┬─> scene ──────> figure1, figure2 ─┐
//!           ├─> run, store ─> figure3 ──────────┼─> claims ─> documents, page
//!           └─> bound ──────────────────────────┘
//! ```
//! | file | what it holds |
//! |---|---|
//! | `settings` | size, seeds, strengths of motion, numbers of runs and trials |
//! | `methods` | the methods that are compared |
//! | `scene` | one scene for the eye: cross-spectrum and phase images |
//! | `run` | one scene for the statistics: curves and autocorrelation |
//! | `store` | the runs on disk, so that work may be interrupted |
//! | `statistics` | mean, deviation and error over the runs |
//! | `bound` | the estimators against the Cramér–Rao bound |
//! | `measures` | what the eye sees, as numbers |
//! | `claims` | what the paper says, and what comes out here |
//! | `figure1`, `figure2`, `figure3` | the paper's figures |
//! | `documents`, `page` | tables for files, and everything on one page |

pub mod bound;
pub mod claims;
pub mod documents;
pub mod figure1;
pub mod figure2;
pub mod figure3;
pub mod measures;
pub mod methods;
pub mod page;
pub mod run;
pub mod scene;
pub mod settings;
pub mod statistics;
pub mod store;

pub use bound::BoundRow;
pub use claims::{Claim, Evidence, claims};
pub use run::Run;
pub use scene::Scene;
pub use settings::Settings;
pub use statistics::Statistics;
pub use store::{Key, Store};
