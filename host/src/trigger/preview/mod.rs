//! What the board will do: the compiled plan, run through the board's own sequencer and drawn.
//!
//! | file | what it holds |
//! |---|---|
//! | `trace` | the edges of the rehearsed plan |
//! | `windows` | the parts of a run that are worth a closer look |
//! | `svg`, `panel`, `scale` | a picture to scale |
//! | `vcd` | for GTKWave, PulseView and other viewers of logic signals |
//! | `wavedrom` | WaveJSON of the first bursts |
//! | `ascii` | for the terminal |

mod ascii;
mod panel;
mod scale;
mod svg;
mod trace;
mod vcd;
mod wavedrom;
mod windows;

pub use ascii::ascii;
pub use svg::svg;
pub use trace::Trace;
pub use vcd::vcd;
pub use wavedrom::wavedrom;

use crate::error::{Error, Result};
use std::path::Path;

/// The picture that a file name asks for, as bytes.
///
/// # Errors
/// When its extension is none of `.svg`, `.vcd` and `.json`.
pub fn draw(trace: &Trace, path: &Path) -> Result<Vec<u8>> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("svg") => Ok(svg(trace).into_bytes()),
        Some("vcd") => Ok(vcd(trace).into_bytes()),
        Some("json") => Ok(wavedrom(trace).into_bytes()),
        _ => Err(Error::usage(format!(
            "-o {}: give a name with .svg (picture), .vcd (logic viewers) or .json (WaveDrom)",
            path.display()
        ))),
    }
}
