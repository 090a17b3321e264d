//! What the demonstration shows: simulated scenes with known truth, evaluated by three methods,
//! and a measured disk whose phase follows a known law.
//!
//! ```text
//! setup ─> recording ─> evaluation ─> scene ─┬─> errors ──┬─> terminal, errors.csv
//!          (simulate)   (curves, images)      │            ├─> page ─> report.html
//!                                             └─> figures ─┘
//! plane ─> rotating_disk
//! ```
//! `setup` holds every number, so the same path draws a small scene in seconds and the paper's
//! scene at full size. Results depend on the setup only, not on the number of threads.

pub mod errors;
pub mod evaluation;
pub mod figures;
pub mod page;
pub mod plane;
pub mod recording;
pub mod rotating_disk;
pub mod scene;
pub mod setup;

pub use errors::{ErrorRow, error_rows};
pub use evaluation::{Evaluation, PhaseCurve, Spectra};
pub use recording::Recording;
pub use scene::{ByMethod, SceneResult};
pub use setup::Setup;
