//! Quantities as people write them: `225ms`, `60 kHz`, and ticks of the board in words.

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// In seconds.
    Time,
    /// In hertz.
    Frequency,
}

/// A unit: its name in values, its name at the end of keys, and its size in seconds or hertz.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// As in `225ms`.
    pub name: &'static str,
    /// As in `interval_ms`.
    pub suffix: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    numerator: f64,
    denominator: f64,
}

impl Unit {
    const fn new(
        name: &'static str,
        suffix: &'static str,
        dimension: Dimension,
        numerator: f64,
        denominator: f64,
    ) -> Self {
        Self { name, suffix, dimension, numerator, denominator }
    }

    /// So many of this unit in seconds or hertz.
    #[must_use]
    pub fn to_base(self, number: f64) -> f64 {
        number * self.numerator / self.denominator
    }
}

/// All units; the two spellings of micro and `us` are one.
pub const UNITS: [Unit; 11] = [
    Unit::new("ns", "ns", Dimension::Time, 1.0, 1e9),
    Unit::new("us", "us", Dimension::Time, 1.0, 1e6),
    Unit::new("\u{b5}s", "us", Dimension::Time, 1.0, 1e6),
    Unit::new("\u{3bc}s", "us", Dimension::Time, 1.0, 1e6),
    Unit::new("ms", "ms", Dimension::Time, 1.0, 1e3),
    Unit::new("s", "s", Dimension::Time, 1.0, 1.0),
    Unit::new("min", "min", Dimension::Time, 60.0, 1.0),
    Unit::new("h", "h", Dimension::Time, 3600.0, 1.0),
    Unit::new("Hz", "hz", Dimension::Frequency, 1.0, 1.0),
    Unit::new("kHz", "khz", Dimension::Frequency, 1e3, 1.0),
    Unit::new("MHz", "mhz", Dimension::Frequency, 1e6, 1.0),
];

/// The unit at the end of a key (`ms` of `interval_ms`).
#[must_use]
pub fn unit_of_key(suffix: &str) -> Option<Unit> {
    UNITS.into_iter().find(|unit| unit.suffix == suffix)
}

/// The units that a value of this dimension may have, for messages.
#[must_use]
pub const fn names(dimension: Dimension) -> &'static str {
    match dimension {
        Dimension::Time => "ns, us, ms, s, min or h",
        Dimension::Frequency => "Hz, kHz or MHz",
    }
}

/// A number with its unit, such as `8.533ms`, in seconds or hertz.
///
/// # Errors
/// A sentence about what is missing or wrong.
pub fn parse(text: &str, dimension: Dimension) -> Result<f64, String> {
    let text = text.trim();
    let end = text.find(|c: char| c.is_alphabetic()).unwrap_or(text.len());
    // An exponent is part of the number: 1e-3s.
    let end = exponent_end(text, end);
    let (number, unit) = text.split_at(end);
    let value: f64 = number
        .trim()
        .parse()
        .map_err(|_| format!("'{text}' is no number with a unit, such as 225ms or 60kHz"))?;
    let name = unit.trim();
    let unit = UNITS.into_iter().find(|unit| unit.name == name && unit.dimension == dimension);
    let Some(unit) = unit else {
        let what =
            if name.is_empty() { "has no unit".to_owned() } else { format!("is in '{name}'") };
        return Err(format!("'{text}' {what}: give {}", names(dimension)));
    };
    Ok(unit.to_base(value))
}

/// Where the number ends that seems to end at `end`, the first letter.
fn exponent_end(text: &str, end: usize) -> usize {
    let rest = text.get(end..).unwrap_or_default();
    let Some(exponent) = rest.strip_prefix(['e', 'E']) else { return end };
    let digits = exponent.strip_prefix(['-', '+']).unwrap_or(exponent);
    let count = digits.chars().take_while(char::is_ascii_digit).count();
    if count == 0 { end } else { end + rest.len() - digits.len() + count }
}

/// Ticks in words, exactly where the clock allows it: `8.5333125 ms`.
#[must_use]
pub fn exact(ticks: u64, ticks_per_second: u32) -> String {
    let picoseconds = picoseconds(ticks, ticks_per_second);
    let (unit, size) = match picoseconds {
        0 => return "0 s".to_owned(),
        1..1_000_000 => ("ns", 1_000),
        1_000_000..1_000_000_000 => ("us", 1_000_000),
        1_000_000_000..1_000_000_000_000 => ("ms", 1_000_000_000),
        _ => ("s", 1_000_000_000_000_u128),
    };
    format!("{} {unit}", decimal(picoseconds, size))
}

/// Ticks in microseconds, exactly: `50`.
#[must_use]
pub fn microseconds(ticks: u64, ticks_per_second: u32) -> String {
    decimal(picoseconds(ticks, ticks_per_second), 1_000_000)
}

/// Ticks in milliseconds, exactly: `0.05`.
#[must_use]
pub fn milliseconds(ticks: u64, ticks_per_second: u32) -> String {
    decimal(picoseconds(ticks, ticks_per_second), 1_000_000_000)
}

/// To the nearest: a tick of 84 MHz is no whole number of them.
fn picoseconds(ticks: u64, ticks_per_second: u32) -> u128 {
    let per_second = u128::from(ticks_per_second.max(1));
    (u128::from(ticks) * 1_000_000_000_000 + per_second / 2) / per_second
}

/// `value / size` without trailing zeros; `size` is a power of ten.
fn decimal(value: u128, size: u128) -> String {
    let digits = size.ilog10() as usize;
    let text = format!("{}.{:0digits$}", value / size, value % size);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Ticks in seconds.
#[must_use]
pub fn seconds(ticks: u64, ticks_per_second: u32) -> f64 {
    ticks as f64 / f64::from(ticks_per_second.max(1))
}

/// Seconds in three or four significant digits and a unit that suits them: `225 ms`.
#[must_use]
pub fn rounded(seconds: f64) -> String {
    let (unit, size) = match seconds.abs() {
        0.0 => return "0 s".to_owned(),
        x if x < 1e-3 => ("us", 1e-6),
        x if x < 1.0 => ("ms", 1e-3),
        x if x < 600.0 => ("s", 1.0),
        x if x < 36_000.0 => ("min", 60.0),
        _ => ("h", 3600.0),
    };
    format!("{} {unit}", figures(seconds / size))
}

/// A number in four significant digits, without trailing zeros.
#[must_use]
pub fn figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = 3 - value.abs().log10().floor() as i32;
    if digits < 0 {
        return format!("{value:.0}");
    }
    if digits > 7 {
        return format!("{value:.2e}");
    }
    let text = format!("{value:.*}", digits.unsigned_abs() as usize);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities() {
        for (text, seconds) in [
            ("225ms", 0.225),
            ("8.533ms", 0.008_533),
            ("300 s", 300.0),
            ("2 min", 120.0),
            ("2h", 7200.0),
            ("50us", 50e-6),
            ("50\u{b5}s", 50e-6),
            ("50\u{3bc}s", 50e-6),
            ("1e-3s", 1e-3),
        ] {
            let parsed = parse(text, Dimension::Time).unwrap();
            assert!((parsed - seconds).abs() <= 1e-15 * seconds, "{text}: {parsed}");
        }
        assert_eq!(parse("60kHz", Dimension::Frequency), Ok(60_000.0));
        for wrong in ["", "225", "ms", "225 m", "60kHz", "1e", "2.2.2ms", "-"] {
            assert!(parse(wrong, Dimension::Time).is_err(), "{wrong}");
        }
    }

    #[test]
    fn ticks_in_words() {
        assert_eq!(exact(136_533, 16_000_000), "8.5333125 ms");
        assert_eq!(exact(3_600_000, 16_000_000), "225 ms");
        assert_eq!(exact(1, 16_000_000), "62.5 ns");
        assert_eq!(exact(800, 16_000_000), "50 us");
        assert_eq!(exact(16_000_000 * 300, 16_000_000), "300 s");
        assert_eq!(exact(1_400, 84_000_000), "16.666667 us");
        assert_eq!(milliseconds(800, 16_000_000), "0.05");
        assert_eq!(microseconds(1, 16_000_000), "0.0625");
    }

    #[test]
    fn four_figures() {
        assert_eq!(figures(0.128_205), "0.1282");
        assert_eq!(figures(12_661.2), "12661");
        assert_eq!(figures(100.0), "100");
        assert_eq!(rounded(0.225), "225 ms");
        assert_eq!(rounded(21_000.0), "350 min");
    }
}
