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
pub mod canvas;
pub mod colormap;
pub mod curves;
pub mod geometry;
pub mod keys;
pub mod measured;
pub mod method;
pub mod online;
pub mod phase_curve;
pub mod phase_images;
pub mod raster;
pub mod scale;
pub mod style;

pub use canvas::Canvas;
pub use colormap::ColorMap;
pub use curves::{Curve, CurveColumn, Curves};
pub use measured::{Measured, Profile};
pub use method::Method;
pub use online::Online;
pub use phase_curve::PhaseCurve;
pub use phase_images::{PhaseColumn, PhaseImages, ScaleBar, SpeckleImage};
pub use raster::{Indexed, Rgb8};
