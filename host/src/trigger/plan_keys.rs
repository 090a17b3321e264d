//! The keys of a plan file, and what each may hold.

use super::units::{Dimension, UNITS, Unit, unit_of_key};

/// What a key holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A text.
    Text,
    /// A whole number.
    Count,
    /// `true` or `false`.
    Flag,
    /// A number between 0 and 1.
    Share,
    /// A number above 0.
    Positive,
    /// One of these words.
    Choice(&'static [&'static str]),
    /// A time or a frequency, its unit at the end of the key.
    Quantity(Dimension),
    /// One time or several, their unit at the end of the key.
    Times,
    /// A time, or `"off"`.
    TimeOrOff,
}

impl Kind {
    /// What the unit at the end of the key measures; none: the key has no unit.
    #[must_use]
    pub const fn dimension(self) -> Option<Dimension> {
        match self {
            Self::Quantity(dimension) => Some(dimension),
            Self::Times | Self::TimeOrOff => Some(Dimension::Time),
            _ => None,
        }
    }
}

/// A key.
#[derive(Debug, Clone, Copy)]
pub struct Key {
    /// Tables and name with dots between, without the unit.
    pub path: &'static str,
    /// What it holds.
    pub kind: Kind,
    /// Other keys that say the same in another way: only one of them may be given.
    pub instead_of: &'static [&'static str],
}

const fn key(path: &'static str, kind: Kind) -> Key {
    Key { path, kind, instead_of: &[] }
}

const fn either(path: &'static str, kind: Kind, instead_of: &'static [&'static str]) -> Key {
    Key { path, kind, instead_of }
}

const TIME: Kind = Kind::Quantity(Dimension::Time);
const FREQUENCY: Kind = Kind::Quantity(Dimension::Frequency);

/// All keys.
pub const KEYS: [Key; 35] = [
    key("name", Kind::Text),
    key("volumes", Kind::Count),
    key("interval", TIME),
    key("repeats", Kind::Count),
    key("repeat_period", TIME),
    key("heartbeat", Kind::TimeOrOff),
    key("burst.sweeps", Kind::Count),
    key("burst.spacing", Kind::Times),
    key("camera.images_per_volume", Kind::Count),
    key("camera.frame_rate", FREQUENCY),
    key("camera.frame_clock", Kind::Choice(&["camera", "board"])),
    key("camera.delay", TIME),
    key("camera.pulse", TIME),
    key("camera.memory_images", Kind::Count),
    key("camera.width_px", Kind::Count),
    key("camera.height_px", Kind::Count),
    key("camera.bits_per_pixel", Kind::Count),
    key("laser.delay", TIME),
    key("laser.pulse", TIME),
    key("stimulus.volume", Kind::Count),
    key("stimulus.delay", TIME),
    either("stimulus.duration", TIME, &["stimulus.until"]),
    either("stimulus.until", Kind::Choice(&["end"]), &["stimulus.duration"]),
    key("stimulus.sham", Kind::Flag),
    either("stimulus.flicker.period", TIME, &["stimulus.flicker.frequency"]),
    either("stimulus.flicker.frequency", FREQUENCY, &["stimulus.flicker.period"]),
    either("stimulus.flicker.on", TIME, &["stimulus.flicker.duty"]),
    either("stimulus.flicker.duty", Kind::Share, &["stimulus.flicker.on"]),
    key("phase_limit.radians", Kind::Positive),
    key("phase_limit.action", Kind::Choice(&["line", "stimulus", "stop"])),
    key("phase_limit.silence", TIME),
    key("inputs.interlock", Kind::Choice(&["on", "pulsed", "off"])),
    key("inputs.ready", Kind::Choice(&["on", "off"])),
    key("inputs.start", Kind::Choice(&["command", "external"])),
    key("stimulus", Kind::Choice(&["off"])),
];

/// Names that `--set` takes for longer ones.
const SHORT: [(&str, &str); 3] =
    [("interlock", "inputs.interlock"), ("ready", "inputs.ready"), ("start", "inputs.start")];

/// The full name of a key of `--set`.
#[must_use]
pub fn full_name(path: &str) -> &str {
    SHORT.iter().find(|(short, _)| *short == path).map_or(path, |(_, full)| full)
}

/// The key of this name, with the unit at its end where it has one.
#[must_use]
pub fn find(path: &str) -> Option<(&'static Key, Option<Unit>)> {
    if let Some(key) = KEYS.iter().find(|key| key.path == path) {
        return Some((key, None));
    }
    let (base, suffix) = path.rsplit_once('_')?;
    let unit = unit_of_key(suffix)?;
    let key = KEYS.iter().find(|key| key.path == base)?;
    (key.kind.dimension() == Some(unit.dimension)).then_some((key, Some(unit)))
}

/// Whether this is the name of a table of keys.
#[must_use]
pub fn is_table(path: &str) -> bool {
    KEYS.iter().any(|key| key.path.strip_prefix(path).is_some_and(|rest| rest.starts_with('.')))
}

/// The keys and tables in a table (`""`: the file itself), for messages.
#[must_use]
pub fn allowed_in(table: &str) -> String {
    let mut names: Vec<String> = Vec::new();
    for key in &KEYS {
        let rest = if table.is_empty() {
            Some(key.path)
        } else {
            key.path.strip_prefix(table).and_then(|rest| rest.strip_prefix('.'))
        };
        let Some(rest) = rest else { continue };
        let name = match rest.split_once('.') {
            Some((table, _)) => format!("[{table}]"),
            None => spelled(rest, key.kind),
        };
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(", ")
}

/// A key as it is written in a file.
#[must_use]
pub fn spelled(name: &str, kind: Kind) -> String {
    match kind.dimension() {
        None => name.to_owned(),
        Some(dimension) => format!("{name}_({})", suffixes(dimension)),
    }
}

/// The ends of keys of this dimension: `ns|us|ms|s|min|h`.
fn suffixes(dimension: Dimension) -> String {
    let mut suffixes: Vec<&str> =
        UNITS.iter().filter(|unit| unit.dimension == dimension).map(|unit| unit.suffix).collect();
    suffixes.dedup();
    suffixes.join("|")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_found_with_their_units() {
        let found = |path| find(path).map(|(key, unit)| (key.path, unit.map(|unit| unit.suffix)));
        assert_eq!(found("interval_ms"), Some(("interval", Some("ms"))));
        assert_eq!(found("camera.frame_rate_hz"), Some(("camera.frame_rate", Some("hz"))));
        assert_eq!(found("camera.memory_images"), Some(("camera.memory_images", None)));
        assert_eq!(found("interval"), Some(("interval", None)));
        for wrong in ["interval_hz", "intervall_ms", "camera.frame_rate_ms", "volumes_ms", ""] {
            assert_eq!(found(wrong), None, "{wrong}");
        }
        assert!(is_table("stimulus") && is_table("stimulus.flicker") && !is_table("interval"));
    }

    #[test]
    fn what_is_allowed_is_spelled_out() {
        assert_eq!(allowed_in("burst"), "sweeps, spacing_(ns|us|ms|s|min|h)");
        assert!(allowed_in("").contains("[camera]"));
    }
}
