//! The equations gate: every equation of the paper has code that cites its line, and a test.
//!
//! The table is `tests/equations.toml`; its rows hold, line by line, what `Row` holds.

use phasewalk_tests::program::{names_in, workspace};
use std::fs;
use std::ops::RangeInclusive;
use std::path::Path;

type Lines = RangeInclusive<u32>;

/// One equation.
#[derive(Debug, Default)]
struct Row {
    what: String,
    lines: String,
    /// `file::symbol`.
    code: Vec<String>,
    /// `file::function`.
    tests: Vec<String>,
}

impl Row {
    fn lines(&self) -> Lines {
        range(&self.lines).unwrap_or_else(|| panic!("lines of {self:?}"))
    }
}

/// A file of the core without an equation, or a folder of such files (its name ends with `/`).
#[derive(Debug, Default)]
struct Exempt {
    file: String,
    reason: String,
}

impl Exempt {
    fn covers(&self, file: &str) -> bool {
        self.file == file || (self.file.ends_with('/') && file.starts_with(&self.file))
    }
}

struct Table {
    rows: Vec<Row>,
    /// Lines that hold no equation and are cited all the same.
    passages: Vec<Lines>,
    exempt: Vec<Exempt>,
}

/// The part of TOML that the table needs: `[[name]]`, `key = "text"`, `key = ["text", ...]`.
fn read_table() -> Table {
    let mut table = Table { rows: Vec::new(), passages: Vec::new(), exempt: Vec::new() };
    let mut in_passage = false;
    for line in read("tests/equations.toml").lines().map(str::trim) {
        if line.starts_with("[[") {
            in_passage = line == "[[passage]]";
        }
        match line {
            "[[equation]]" => table.rows.push(Row::default()),
            "[[exempt]]" => table.exempt.push(Exempt::default()),
            "[[passage]]" => {}
            "" => {}
            comment if comment.starts_with('#') => {}
            entry if in_passage => table.set_passage(entry),
            entry => table.set(entry),
        }
    }
    table
}

impl Table {
    fn set_passage(&mut self, entry: &str) {
        if let Some(lines) = entry.strip_prefix("lines = ") {
            let lines = range(lines.trim_matches('"'));
            self.passages.push(lines.unwrap_or_else(|| panic!("not read: {entry}")));
        }
    }

    fn set(&mut self, entry: &str) {
        let (key, value) = entry.split_once(" = ").unwrap_or_else(|| panic!("not read: {entry}"));
        let texts: Vec<String> = value.split('"').skip(1).step_by(2).map(str::to_owned).collect();
        let first = texts.first().unwrap_or_else(|| panic!("no text in {entry}")).clone();
        match (key, self.rows.last_mut(), self.exempt.last_mut()) {
            ("file", _, Some(exempt)) => exempt.file = first,
            ("reason", _, Some(exempt)) => exempt.reason = first,
            ("what", Some(row), _) => row.what = first,
            ("lines", Some(row), _) => row.lines = first,
            ("code", Some(row), _) => row.code = texts,
            ("tests", Some(row), _) => row.tests = texts,
            _ => panic!("not read: {entry}"),
        }
    }
}

fn read(file: &str) -> String {
    fs::read_to_string(workspace().join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// `file::name`.
fn split(reference: &str) -> (&str, &str) {
    reference.split_once("::").unwrap_or_else(|| panic!("no symbol in {reference}"))
}

/// `720` or `727-735`, the hyphen of either length.
fn range(text: &str) -> Option<Lines> {
    let number = |text: &str| text.parse().ok();
    match text.split_once(['-', '–']) {
        Some((first, last)) => Some(number(first)?..=number(last)?),
        None => number(text).map(|line| line..=line),
    }
}

fn overlap(a: &Lines, b: &Lines) -> bool {
    a.start() <= b.end() && b.start() <= a.end()
}

/// The paper lines that a source cites: every number or range that follows "line" or "lines",
/// also in lists such as "lines 410, 421 and 975-984".
fn citations(source: &str) -> Vec<Lines> {
    let is_marker = |word: &&str| !matches!(*word, "//" | "///" | "//!" | "//!   |");
    let words: Vec<&str> = source.split_whitespace().filter(is_marker).collect();
    let mut cited = Vec::new();
    for (i, word) in words.iter().enumerate() {
        if !matches!(word.trim_start_matches('('), "line" | "lines") {
            continue;
        }
        for word in words[i + 1..].iter().filter(|word| **word != "and") {
            let Some(lines) = range(number_part(word)) else { break };
            cited.push(lines);
            if word.ends_with([')', '.', ':', ';']) {
                break;
            }
        }
    }
    cited
}

/// `(410,` and `984).` without their punctuation.
fn number_part(word: &str) -> &str {
    word.trim_matches(|c: char| !c.is_ascii_digit())
}

/// The symbol as a whole word, in front of the file's own tests.
fn defines(source: &str, symbol: &str) -> bool {
    let code = source.split("#[cfg(test)]").next().unwrap_or(source);
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.into_iter().any(|line| line.split(|c| !is_part(c)).any(|word| word == symbol))
}

/// `fn name` right below `#[test]` (other attributes may stand between).
fn has_test(source: &str, name: &str) -> bool {
    let head = format!("fn {name}(");
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    lines.iter().enumerate().any(|(i, line)| {
        let above = lines[..i].iter().rev().take_while(|above| above.starts_with("#["));
        line.starts_with(&head) && above.into_iter().any(|above| *above == "#[test]")
    })
}

/// All Rust files below a folder of the workspace.
fn rust_files(folder: &str) -> Vec<String> {
    let mut files = Vec::new();
    for name in names_in(&workspace().join(folder)) {
        let path = format!("{folder}/{name}");
        if workspace().join(&path).is_dir() {
            files.extend(rust_files(&path));
        } else if Path::new(&name).extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

#[track_caller]
fn none(faults: &[String]) {
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn every_equation_has_code_and_a_test() {
    let mut faults = Vec::new();
    for row in read_table().rows {
        if row.what.is_empty() || row.code.is_empty() || row.tests.is_empty() {
            faults.push(format!("incomplete: {row:?}"));
        }
        for code in &row.code {
            let (file, symbol) = split(code);
            if !file.starts_with("core/src/") && !file.starts_with("host/src/") {
                faults.push(format!("{code} is no code of the program"));
            } else if !defines(&read(file), symbol) {
                faults.push(format!("{}: {file} has no {symbol}", row.what));
            }
        }
        for test in &row.tests {
            let (file, function) = split(test);
            if !has_test(&read(file), function) {
                faults.push(format!("{}: {file} has no test {function}", row.what));
            }
        }
    }
    none(&faults);
}

#[test]
fn the_code_of_every_equation_cites_its_line() {
    let mut faults = Vec::new();
    for row in read_table().rows {
        for code in &row.code {
            let (file, _) = split(code);
            let cited = citations(&read(file));
            if !cited.iter().any(|lines| overlap(lines, &row.lines())) {
                faults.push(format!("{}: {file} does not cite line {}", row.what, row.lines));
            }
        }
    }
    none(&faults);
}

/// A citation that leads to no equation of the table is a wrong number, or a row is missing.
#[test]
fn every_citation_leads_to_an_equation() {
    let Table { rows, passages, .. } = read_table();
    let known: Vec<Lines> = rows.iter().map(Row::lines).chain(passages).collect();
    let mut faults = Vec::new();
    for file in [rust_files("core/src"), rust_files("host/src")].concat() {
        for cited in citations(&read(&file)) {
            if !known.iter().any(|lines| overlap(lines, &cited)) {
                faults.push(format!("{file} cites line {cited:?}: no equation is there"));
            }
        }
    }
    none(&faults);
}

#[test]
fn equations_stand_once_and_in_the_order_of_the_paper() {
    let rows = read_table().rows;
    assert!(rows.len() >= 30, "the table has been read: {} rows", rows.len());
    for pair in rows.windows(2) {
        let (before, after) = (pair[0].lines(), pair[1].lines());
        assert!(before.end() < after.start(), "{:?} and {:?}", pair[0], pair[1]);
        assert!(before.start() <= before.end(), "{:?}", pair[0]);
    }
}

#[test]
fn every_file_of_the_core_has_an_equation_or_a_reason() {
    let table = read_table();
    let mut faults = Vec::new();
    for file in rust_files("core/src") {
        let in_rows = table.rows.iter().flat_map(|row| &row.code).any(|code| split(code).0 == file);
        let exempt = table.exempt.iter().find(|exempt| exempt.covers(&file));
        match (in_rows, exempt) {
            (false, None) => faults.push(format!("{file} is in no row and not exempt")),
            (true, Some(_)) => faults.push(format!("{file} is exempt and has an equation")),
            (false, Some(exempt)) if exempt.reason.is_empty() => {
                faults.push(format!("{file} is exempt without a reason"));
            }
            _ => {}
        }
    }
    for Exempt { file, .. } in &table.exempt {
        if !workspace().join(file).exists() {
            faults.push(format!("{file} is exempt but does not exist"));
        }
    }
    none(&faults);
}

// ---- the gate itself -----------------------------------------------------------------------

#[test]
fn citations_are_found_in_every_form() {
    let source = "/// Mean (paper lines 739-745):\n//! is in lines 410, 421,\n//! 975–984), twice 5\n\
                  // (line 8: 50 of them)\n// all lines are\n";
    assert_eq!(citations(source), [739..=745, 410..=410, 421..=421, 975..=984, 8..=8]);
}

#[test]
fn what_is_missing_is_seen() {
    assert!(has_test("#[test]\n    fn works() {", "works"));
    assert!(has_test("#[test]\n#[cfg(unix)]\nfn works() {", "works"));
    for source in
        ["fn works() {", "#[test]\nfn works_not() {", "#[test]\n\nfn other() {}\nfn works() {"]
    {
        assert!(!has_test(source, "works"), "{source}");
    }
    assert!(defines("pub fn solve(x: f32)", "solve"));
    for source in ["pub fn solver()", "// solve", "#[cfg(test)]\nmod tests { fn solve() {} }"] {
        assert!(!defines(source, "solve"), "{source}");
    }
    assert!(overlap(&(1..=5), &(5..=9)) && !overlap(&(1..=4), &(5..=9)));
}
