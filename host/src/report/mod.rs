//! The report: one HTML page that holds everything it shows and opens from the file system.

mod chart;
pub mod html;
pub mod reconstruction;
pub mod stack;

pub use chart::{Role, SceneCurve};
pub use html::{Page, Scene, Still, Table};
pub use reconstruction::{Reconstruction, Step};
pub use stack::Stack;
