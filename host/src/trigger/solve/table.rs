//! The volumes as a table.

use super::comparison::Row;
use std::fmt::Write;

/// `volume,phase_rad,sigma_rad,host_phase_rad,difference_rad,took_us`, one line per volume. Numbers
/// read back as the same ones; what is none is `inf` or `nan`.
#[must_use]
pub fn csv(rows: &[Row]) -> String {
    let mut table =
        String::from("volume,phase_rad,sigma_rad,host_phase_rad,difference_rad,took_us\n");
    for row in rows {
        let Row { volume, phase_rad, sigma_rad, host_phase_rad, took_us, .. } = row;
        let difference = row.difference_rad();
        // Writing to a string does not fail.
        let _ = writeln!(
            table,
            "{volume},{phase_rad:?},{sigma_rad:?},{host_phase_rad:?},{difference:?},{took_us:.3}"
        );
    }
    table.replace("NaN", "nan")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_can_be_read_again() {
        let row = Row {
            volume: 3,
            phase_rad: 0.1,
            sigma_rad: f32::INFINITY,
            host_phase_rad: f64::NAN,
            took_us: 12.5,
            same_bits: true,
        };
        let table = csv(&[row]);
        assert_eq!(table.lines().nth(1), Some("3,0.1,inf,nan,nan,12.500"));
    }
}
