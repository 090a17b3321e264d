//! Recordings of Photron cameras: raw images (`.mraw`) with a header beside them.
//!
//! | file | what it holds |
//! |---|---|
//! | `header` | what a header says, whichever file it stands in |
//! | `fields` | from its texts to numbers |
//! | `cih` | headers in lines of text |
//! | `cihx` | headers in XML inside a binary container |
//! | `files` | which files belong together, and whether their sizes agree |
//! | `samples` | counts to bytes and back |
//! | `reader` | images piece by piece |
//! | `describe` | what `phasewalk info` prints |
//! | `writer` | whole recordings |

mod cih;
mod cihx;
mod describe;
mod fields;
mod files;
mod header;
mod reader;
mod samples;
mod writer;

pub(crate) use describe::describe;
pub(crate) use files::is_recording;
pub use header::{CameraHeader, Side};
pub use reader::PhotronImages;
pub use samples::Packing;
pub use writer::PhotronWriter;

#[cfg(test)]
mod tests;
