//! Pictures of fields, phases and curves: arrays in, PNG bytes or an SVG string out.
//!
//! ```text
//! field -> raster (colour map) -+
//!                               +-> canvas (display list) -> PNG | SVG
//! curve -> axes (scale) --------+
//! ```
//! A figure is a plain structure of borrowed arrays with a `draw` method. Drawing cannot fail and
//! does not panic on odd data: pixels without a value are grey, curves break where they have none.
//! Only encoding can fail; nothing here touches the file system.

pub mod axes;
pub mod bscan;
pub mod canvas;
pub mod colormap;
pub mod cross_spectra;
pub mod curves;
pub mod decibel;
pub mod decorrelation;
mod depth_profile;
pub mod enface;
pub mod geometry;
pub mod grid;
pub mod keys;
pub mod layer;
pub mod measured;
pub mod method;
pub mod motion;
pub mod online;
pub mod phase_curve;
pub mod phase_images;
pub mod raster;
pub mod scale;
pub mod source;
pub mod style;
pub mod verdicts;

pub use bscan::{BScan, BScans, Surface};
pub use canvas::Canvas;
pub use colormap::ColorMap;
pub use cross_spectra::{CrossSpectra, CrossSpectrum};
pub use curves::{Curve, CurveColumn, Curves};
pub use decorrelation::{CoherenceMap, CoherenceMaps};
pub use depth_profile::{DepthProfile, LayerDepths, Peak};
pub use enface::{EnFace, EnFaces};
pub use layer::Layer;
pub use measured::{Measured, Profile};
pub use method::Method;
pub use motion::Motion;
pub use online::Online;
pub use phase_curve::PhaseCurve;
pub use phase_images::{PhaseColumn, PhaseImages, ScaleBar, SpeckleImage};
pub use raster::{Indexed, Rgb8};
pub use source::{Residual, Source};
