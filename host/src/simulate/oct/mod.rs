//! The digital twin of a full-field swept-source OCT recording of the retina, with its truth.
//!
//! ```text
//! presets, scene ─> schedule ─> motion ─> geometry            what will happen (Plan)
//! retina, elongation ─> tissue ─> field ─> axial ─> camera ─> images   one sweep at a time (record)
//!                        pose, kernel ┘      └ sweep                 └─> folder <─ truth
//! ```
//!
//! Layers of point scatterers follow a curved, tilted surface. Every scatterer keeps its position
//! and its phase 2k₀z; motion of any kind moves the scatterers, or is an exact phase of the
//! spectrum. For each sweep the scatterers are spread over a grid of depth planes and pixels, the
//! aperture is applied plane by plane, and the planes of each pixel are transformed to the
//! wavenumbers of the images (a non-uniform Fourier transform, its error below 10⁻³). The camera adds
//! source, vignetting, fixed fringes and noise, and counts.
//!
//! Detected: I(m, y, x) = S(m) v(y, x) [1 + fixed fringes + Re Σ A exp i(2k₀z + πdκ(q) + a₂q² + a₃q³)]
//! for an up-sweep; a down-sweep shows the conjugate field, −2k₀z.

mod axial;
mod camera;
mod elongation;
mod field;
mod folder;
mod geometry;
mod kernel;
mod motion;
mod pose;
mod presets;
mod random;
mod record;
mod retina;
mod scene;
mod schedule;
mod sweep;
mod tissue;
mod truth;

#[cfg(test)]
mod tests;

pub use folder::{HeaderKind, write_recording};
pub use presets::Preset;
pub use record::Plan;
pub use retina::Layer;
pub use scene::OctScene;
pub use truth::Truth;
