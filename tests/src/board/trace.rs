//! Files of edges.

use super::pin::{Pin, PinEdge};
use std::collections::BTreeSet;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::{fs, io};

/// 62.5 ns in units of 100 ps.
const UNITS_PER_CYCLE: u64 = 625;

/// Write edges as a value change dump for a wave viewer; all pins begin low.
///
/// VCD knows powers of ten only, so a cycle of 62.5 ns is written as 625 units of 100 ps.
///
/// # Errors
/// If the file cannot be written.
pub fn write_vcd(path: &Path, edges: &[PinEdge]) -> io::Result<()> {
    let mut file = BufWriter::new(fs::File::create(path)?);
    let pins: BTreeSet<Pin> = edges.iter().map(|edge| edge.pin).collect();
    writeln!(file, "$timescale 100 ps $end\n$scope module uno $end")?;
    for &pin in &pins {
        writeln!(file, "$var wire 1 {} {pin} $end", code(pin))?;
    }
    writeln!(file, "$upscope $end\n$enddefinitions $end\n#0\n$dumpvars")?;
    for &pin in &pins {
        writeln!(file, "0{}", code(pin))?;
    }
    writeln!(file, "$end")?;
    let mut time = 0;
    for edge in edges {
        if edge.cycle != time {
            time = edge.cycle;
            writeln!(file, "#{}", time * UNITS_PER_CYCLE)?;
        }
        writeln!(file, "{}{}", u8::from(edge.level), code(edge.pin))?;
    }
    file.flush()
}

/// The printable character by which VCD knows a pin.
fn code(pin: Pin) -> char {
    char::from(b'!' + pin as u8)
}

/// Write edges as a table: cycle, pin, level.
///
/// # Errors
/// If the file cannot be written.
pub fn write_csv(path: &Path, edges: &[PinEdge]) -> io::Result<()> {
    let mut file = BufWriter::new(fs::File::create(path)?);
    writeln!(file, "cycle,pin,level")?;
    for edge in edges {
        writeln!(file, "{},{},{}", edge.cycle, edge.pin, u8::from(edge.level))?;
    }
    file.flush()
}
