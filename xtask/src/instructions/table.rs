//! The recorded numbers, `tests/instructions.toml`, and the verdict on new ones.

use crate::Result;
use std::path::Path;

/// By how many percent a count may differ from the recorded one, either way.
const TOLERANCE: u64 = 5;

const HEAD: &str = "\
# Instructions that the release program executes, counted by callgrind on x86-64. `cargo xtask test` fails
# where a count differs by more than 5 %. Recorded by `cargo xtask instructions --record`.
";

/// Counts by the name of the case, and the compiler that they hold for.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Table {
    pub(super) rustc: String,
    pub(super) counts: Vec<(String, u64)>,
}

impl Table {
    pub(super) fn read(file: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(file)
            .map_err(|e| format!("cannot read {}: {e}", file.display()))?;
        Self::parse(&text).map_err(|line| format!("{}: '{line}' is no count", file.display()))
    }

    pub(super) fn write(&self, file: &Path) -> Result {
        std::fs::write(file, self.text())
            .map_err(|e| format!("cannot write {}: {e}", file.display()))
    }

    /// As it is recorded: TOML, of which lines `"name" = number`, `rustc = "version"` and `[counts]` are all.
    pub(super) fn text(&self) -> String {
        let counts = self.counts.iter().map(|(name, count)| format!("\"{name}\" = {count}\n"));
        format!("{HEAD}rustc = \"{}\"\n\n[counts]\n{}", self.rustc, counts.collect::<String>())
    }

    /// What [`Self::text`] gave; otherwise the first line that is something else.
    fn parse(text: &str) -> std::result::Result<Self, &str> {
        let mut table = Self { rustc: String::new(), counts: Vec::new() };
        for line in text.lines().map(str::trim) {
            if line.is_empty() || line.starts_with('#') || line == "[counts]" {
                continue;
            }
            let (name, value) = line.split_once(" = ").ok_or(line)?;
            if name == "rustc" {
                value.trim_matches('"').clone_into(&mut table.rustc);
            } else {
                let count = value.parse().map_err(|_| line)?;
                table.counts.push((name.trim_matches('"').to_owned(), count));
            }
        }
        Ok(table)
    }

    /// Names that the other table lacks.
    pub(super) fn not_among<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = &'a str> {
        let names = self.counts.iter().map(|(name, _)| name.as_str());
        names.filter(|&name| other.counts.iter().all(|(known, _)| known != name))
    }

    /// One line about a new count: `Err` where it differs too much from the recorded one.
    pub(super) fn judge(&self, name: &str, count: u64, rustc: &str) -> Result<String> {
        let again = "`cargo xtask instructions --record`";
        let recorded = self.counts.iter().find(|(known, _)| known == name);
        let Some(&(_, before)) = recorded else {
            return Err(format!("{name}: {count} instructions, none recorded: {again}"));
        };
        let change = count as f64 / before as f64 - 1.0;
        let line = format!(
            "{name}: {count} instructions, {:+.2} % against the {before} recorded",
            100.0 * change
        );
        if 100 * count.abs_diff(before) <= TOLERANCE * before {
            return Ok(line);
        }
        let advice = if change > 0.0 {
            format!("make it as fast as it was, or, where that is its price, record it: {again}")
        } else {
            format!("record it, so that it stays so: {again}")
        };
        let compiler = if rustc == self.rustc {
            String::new()
        } else {
            format!(" (by {}, this is {rustc}, which may be why)", self.rustc)
        };
        Err(format!("{line}{compiler}; {advice}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let counts = vec![("images, paper".to_owned(), 1000), ("curve".to_owned(), 77)];
        Table { rustc: "rustc 1.95.0".to_owned(), counts }
    }

    #[test]
    fn what_is_recorded_is_read() {
        assert_eq!(Table::parse(&table().text()), Ok(table()));
        assert_eq!(Table::parse("\"curve\" = many"), Err("\"curve\" = many"));
        assert_eq!(Table::parse("curve"), Err("curve"));
    }

    #[test]
    fn what_is_no_longer_counted_is_named() {
        let counted = Table { counts: vec![("curve".to_owned(), 78)], ..table() };
        assert_eq!(table().not_among(&counted).collect::<Vec<_>>(), ["images, paper"]);
        assert_eq!(counted.not_among(&table()).count(), 0);
    }

    #[test]
    fn five_percent_either_way_are_let_pass() {
        for count in [950, 1000, 1050] {
            assert!(table().judge("images, paper", count, "rustc 1.95.0").is_ok(), "{count}");
        }
        let judge = |name, count, rustc| table().judge(name, count, rustc).unwrap_err();
        let slower = judge("images, paper", 1051, "rustc 1.95.0");
        for part in ["1051", "+5.10 %", "1000", "--record", "as fast as"] {
            assert!(slower.contains(part), "{slower}");
        }
        assert!(!slower.contains("rustc"), "{slower}");
        assert!(judge("images, paper", 949, "rustc 1.95.0").contains("stays so"));
        assert!(judge("images, paper", 949, "rustc 1.96.0").contains("1.96.0"));
        assert!(judge("new", 1, "rustc 1.95.0").contains("none recorded"));
    }
}
