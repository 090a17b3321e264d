//! The values of a plan file, changed by settings of the command line, each with its place.

use super::plan_keys::{Key, Kind, allowed_in, find, full_name, is_table, spelled};
use super::units::{Dimension, Unit, names, parse};
use crate::error::{Error, Result};
use std::collections::BTreeMap;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value in seconds, hertz or as a plain number; words stay words.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A text or one of several words.
    Word(String),
    /// Yes or no.
    Flag(bool),
    /// A whole number.
    Count(u64),
    /// Seconds, hertz, radians or a share.
    Number(f64),
    /// Several times in seconds.
    List(Vec<f64>),
}

/// Where a value was given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// A line of a file or preset.
    Line(String, usize),
    /// `--set` with this text.
    Setting(String),
}

impl Place {
    /// What is wrong there.
    pub fn error(&self, what: impl std::fmt::Display) -> Error {
        match self {
            Self::Line(file, line) => Error::failed(format!("{file}: line {line}: {what}")),
            Self::Setting(text) => Error::usage(format!("--set {text}: {what}")),
        }
    }
}

/// A value and its place.
#[derive(Debug, Clone)]
pub struct Entry {
    /// The value.
    pub value: Value,
    /// Where it was given.
    pub place: Place,
}

/// All values, by the path of their key.
#[derive(Debug, Clone, Default)]
pub struct Values {
    entries: BTreeMap<&'static str, Entry>,
}

impl Values {
    /// The values of a plan file's text; `source` is its name in messages.
    ///
    /// # Errors
    /// Text that is no TOML, keys that are not known, values of another kind: with line and key.
    pub fn read(text: &str, source: &str) -> Result<Self> {
        let table = DeTable::parse(text).map_err(|error| toml_error(source, text, &error))?;
        let mut values = Self::default();
        Reader { text, source }.table("", table.get_ref(), &mut values)?;
        Ok(values)
    }

    /// Change one of them: `key=value`, the value with its unit.
    ///
    /// # Errors
    /// A key that is not known, a value of another kind or without unit.
    pub fn set(&mut self, setting: &str) -> Result<()> {
        let place = Place::Setting(setting.to_owned());
        let Some((name, text)) = setting.split_once('=') else {
            return Err(place.error("give KEY=VALUE, such as interval=225ms"));
        };
        let (name, text) = (full_name(name.trim()), text.trim());
        let Some((key, unit)) = find(name) else {
            let table = name.rsplit_once('.').map_or("", |(table, _)| table);
            let table = if is_table(table) { table } else { "" };
            return Err(place.error(format!("no such key; there are {}", allowed_in(table))));
        };
        let value = match unit {
            Some(unit) => plain_number(text).map(|number| Value::Number(unit.to_base(number))),
            None => from_text(key.kind, text),
        };
        let value = value.and_then(|value| checked(key, value));
        let value = value.map_err(|what| place.error(what))?;
        for other in key.instead_of {
            let _ = self.entries.remove(other);
        }
        if key.path == "stimulus" {
            self.entries.retain(|path, _| !path.starts_with("stimulus"));
        } else if key.path.starts_with("stimulus.") {
            let _ = self.entries.remove("stimulus");
        } else if key.path == "camera.frame_clock" && value == Value::Word("board".to_owned()) {
            // The file's pulse was made for the camera's own clock; one of `--set` is meant.
            let of_file = |entry: &Entry| matches!(entry.place, Place::Line(..));
            if self.entries.get("camera.pulse").is_some_and(of_file) {
                let _ = self.entries.remove("camera.pulse");
            }
        }
        let _ = self.entries.insert(key.path, Entry { value, place });
        Ok(())
    }

    /// The value of a key.
    #[must_use]
    pub fn get(&self, path: &str) -> Option<&Entry> {
        self.entries.get(path)
    }

    /// Whether any key of a table is given.
    #[must_use]
    pub fn has_table(&self, table: &str) -> bool {
        let inside = |path: &str| path.strip_prefix(table).is_some_and(|p| p.starts_with('.'));
        self.entries.keys().any(|path| inside(path))
    }

    fn insert(&mut self, key: &'static Key, entry: Entry) -> Result<()> {
        let other = key.instead_of.iter().find(|path| self.entries.contains_key(*path));
        if let Some(other) = other {
            let what = format!("{} and {other} say the same: give one of them", key.path);
            return Err(entry.place.error(what));
        }
        if self.entries.contains_key(key.path) {
            let what = format!("{} is given twice, in different units", key.path);
            return Err(entry.place.error(what));
        }
        let _ = self.entries.insert(key.path, entry);
        Ok(())
    }
}

/// A complaint of the TOML reader in one line.
pub(super) fn toml_error(source: &str, text: &str, error: &toml::de::Error) -> Error {
    let what = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
    match error.span() {
        Some(span) => Place::Line(source.to_owned(), line_of(text, span.start)).error(what),
        None => Error::failed(format!("{source}: {what}")),
    }
}

/// The number of the line in which a byte lies, from 1.
fn line_of(text: &str, position: usize) -> usize {
    1 + text.bytes().take(position).filter(|&byte| byte == b'\n').count()
}

/// Walks the tables of a file.
struct Reader<'a> {
    text: &'a str,
    source: &'a str,
}

impl Reader<'_> {
    fn table(&self, path: &str, table: &DeTable<'_>, values: &mut Values) -> Result<()> {
        let mut keys: Vec<_> = table.iter().collect();
        keys.sort_by_key(|(name, _)| name.span().start);
        for (name, value) in keys {
            let line = line_of(self.text, name.span().start);
            let place = Place::Line(self.source.to_owned(), line);
            let full = match path {
                "" => name.get_ref().to_string(),
                _ => format!("{path}.{}", name.get_ref()),
            };
            if let DeValue::Table(inner) = value.get_ref()
                && is_table(&full)
            {
                self.table(&full, inner, values)?;
                continue;
            }
            let Some((key, unit)) = find(&full) else {
                let whose = if path.is_empty() { String::new() } else { format!(" in [{path}]") };
                let what = format!("unknown key '{full}'; allowed{whose}: {}", allowed_in(path));
                return Err(place.error(what));
            };
            let value = from_toml(key, unit, value).and_then(|value| checked(key, value));
            let value = value.map_err(|what| place.error(format!("{full}: {what}")))?;
            values.insert(key, Entry { value, place })?;
        }
        Ok(())
    }
}

/// A value of a file.
fn from_toml(
    key: &Key,
    unit: Option<Unit>,
    value: &Spanned<DeValue<'_>>,
) -> std::result::Result<Value, String> {
    let value = value.get_ref();
    if let (Kind::TimeOrOff, None, DeValue::String(word)) = (key.kind, unit, value) {
        return from_text(key.kind, word);
    }
    if key.kind.dimension().is_some() && unit.is_none() {
        let name = key.path.rsplit('.').next().unwrap_or(key.path);
        return Err(format!("the key lacks its unit: {}", spelled(name, key.kind)));
    }
    from_toml_of_kind(key.kind, unit, value)
}

fn from_toml_of_kind(
    kind: Kind,
    unit: Option<Unit>,
    value: &DeValue<'_>,
) -> std::result::Result<Value, String> {
    let base = |number: f64| unit.map_or(number, |unit| unit.to_base(number));
    match (kind, value) {
        (Kind::Text | Kind::Choice(_), DeValue::String(text)) => Ok(Value::Word(text.to_string())),
        (Kind::Flag, DeValue::Boolean(flag)) => Ok(Value::Flag(*flag)),
        (Kind::Count, DeValue::Integer(count)) => count
            .as_str()
            .parse()
            .map(Value::Count)
            .map_err(|_| format!("'{count}' is no whole number from 0 on")),
        (Kind::Times, DeValue::Array(list)) => {
            let numbers = list.iter().map(|item| toml_number(item.get_ref()).map(base));
            numbers.collect::<Option<_>>().map(Value::List).ok_or_else(|| expected(kind))
        }
        (Kind::Text | Kind::Choice(_) | Kind::Flag | Kind::Count, _) => Err(expected(kind)),
        (Kind::Times, value) => toml_number(value)
            .map(|number| Value::List(vec![base(number)]))
            .ok_or_else(|| expected(kind)),
        (_, value) => toml_number(value)
            .map(|number| Value::Number(base(number)))
            .ok_or_else(|| expected(kind)),
    }
}

fn toml_number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(number) => number.as_str().parse().ok(),
        DeValue::Float(number) => number.as_str().parse().ok(),
        _ => None,
    }
}

/// A value of the command line.
fn from_text(kind: Kind, text: &str) -> std::result::Result<Value, String> {
    match kind {
        Kind::Text | Kind::Choice(_) => Ok(Value::Word(text.to_owned())),
        Kind::Flag => text.parse().map(Value::Flag).map_err(|_| expected(kind)),
        Kind::Count => text.parse().map(Value::Count).map_err(|_| expected(kind)),
        Kind::Share | Kind::Positive => plain_number(text).map(Value::Number),
        Kind::Quantity(dimension) => parse(text, dimension).map(Value::Number),
        Kind::TimeOrOff if text == "off" => Ok(Value::Number(0.0)),
        Kind::TimeOrOff => parse(text, Dimension::Time).map(Value::Number),
        Kind::Times => {
            let times = text.split(',').map(|time| parse(time, Dimension::Time));
            times.collect::<std::result::Result<_, _>>().map(Value::List)
        }
    }
}

fn plain_number(text: &str) -> std::result::Result<f64, String> {
    text.parse().map_err(|_| format!("'{text}' is no number"))
}

/// What a kind of key holds, for messages.
fn expected(kind: Kind) -> String {
    match kind {
        Kind::Text => "give a text".to_owned(),
        Kind::Count => "give a whole number from 0 on".to_owned(),
        Kind::Flag => "give true or false".to_owned(),
        Kind::Share => "give a number between 0 and 1".to_owned(),
        Kind::Positive => "give a number above 0".to_owned(),
        Kind::Choice(words) => format!("give {}", words.join(" or ")),
        Kind::Quantity(dimension) => format!("give a number of {}", names(dimension)),
        Kind::Times => "give a time, or a list of times".to_owned(),
        Kind::TimeOrOff => "give a time, or off".to_owned(),
    }
}

/// The value, if the key may have it: no negative or endless times, only known words.
fn checked(key: &Key, value: Value) -> std::result::Result<Value, String> {
    let fine = |number: &f64| number.is_finite() && *number >= 0.0;
    let allowed = match (&value, key.kind) {
        (Value::Word(word), Kind::Choice(words)) => words.contains(&word.as_str()),
        (Value::Number(number), Kind::Share) => fine(number) && *number <= 1.0,
        (Value::Number(number), Kind::Positive) => fine(number) && *number > 0.0,
        (Value::Number(number), _) => fine(number),
        (Value::List(list), _) => !list.is_empty() && list.iter().all(fine),
        _ => true,
    };
    if allowed {
        return Ok(value);
    }
    match (&value, key.kind) {
        (Value::Word(word), kind) => Err(format!("'{word}': {}", expected(kind))),
        (Value::Number(_), Kind::Share | Kind::Positive) => Err(expected(key.kind)),
        _ => Err("a time or frequency must be finite and not negative".to_owned()),
    }
}
