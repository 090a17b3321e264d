//! The tables as text: for the terminal, as Markdown, as CSV.

use super::claims::Claim;
use super::methods::NAMES;
use super::settings::Settings;
use super::statistics::Statistics;
use crate::error::{Error, Result};
use crate::report::Table;
use serde_json::json;
use std::fmt::Write as _;

/// The claims, short enough for a terminal.
#[must_use]
pub fn claims_short(claims: &[Claim]) -> Table {
    let first = |claim: &Claim| format!("{:<4} {:<8} {}", answer(claim), claim.lines, claim.text);
    claims_table(claims, &format!("{:<4} {:<8} claim of the paper", "", "lines"), first)
}

/// The claims with what is measured.
#[must_use]
pub fn claims_long(claims: &[Claim]) -> Table {
    let first = |claim: &Claim| {
        format!("{}: {} (lines {}; {})", answer(claim), claim.text, claim.lines, claim.measure)
    };
    claims_table(claims, "claim of the paper", first)
}

fn claims_table(claims: &[Claim], title: &str, first: impl Fn(&Claim) -> String) -> Table {
    let hold = claims.iter().filter(|claim| claim.holds()).count();
    let cells = |claim: &Claim| {
        let linked = claim.linked.map_or("\u{2013}".to_owned(), significant);
        vec![first(claim), significant(claim.value), claim.limit.to_string(), linked]
    };
    Table {
        caption: format!("{hold} of {} claims of the paper hold", claims.len()),
        header: [title, "ours", "limit", "linked"].map(str::to_owned).to_vec(),
        rows: claims.iter().map(cells).collect(),
    }
}

fn answer(claim: &Claim) -> &'static str {
    if claim.holds() { "yes" } else { "no" }
}

/// Phase − truth in the last frame, by σ and method.
#[must_use]
pub fn ends_table(settings: &Settings, statistics: &[Statistics]) -> Table {
    let (last, truth) = (settings.setup.scene.frames - 1, statistics.first());
    let truth = truth.map_or(f64::NAN, Statistics::last_truth);
    let cells = |of: &Statistics| {
        std::iter::once(of.label.clone()).chain(of.last_words()).collect::<Vec<_>>()
    };
    let over = match settings.runs {
        1 => "one run".to_owned(),
        runs => format!("mean ± standard deviation over {runs} runs"),
    };
    Table {
        caption: format!(
            "Phase \u{2212} truth of the x in frame {last}, {over}, rad; the phase put in is {truth:.2}"
        ),
        header: std::iter::once("").chain(NAMES).map(str::to_owned).collect(),
        rows: statistics.iter().map(cells).collect(),
    }
}

/// `claims.md`: the claims with their limits, and the ends of the curves.
#[must_use]
pub fn claims_markdown(settings: &Settings, claims: &[Claim], ends: &Table) -> String {
    let hold = claims.iter().filter(|claim| claim.holds()).count();
    let mut text = format!(
        "# Claims of the paper\n\n{}.\n\n{hold} of {} hold. Lines are those of the paper's source. \
         The limits are ours, for 100 runs of the paper's size; the column *linked* is the same number of the method that the paper \
         does not have.\n\n\
         | lines | claim | measured | ours | limit | holds | linked |\n|---|---|---|---|---|---|---|\n",
        settings.words(),
        claims.len()
    );
    for claim in claims {
        let Claim { lines, text: says, measure, value, limit, linked } = claim;
        let (value, linked) = (significant(*value), linked.map_or(String::new(), significant));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {lines} | {says} | {measure} | {value} | {limit} | {} | {linked} |",
            answer(claim)
        );
    }
    text + "\n" + &markdown(ends)
}

/// `claims.csv`.
///
/// # Errors
/// Not in practice.
pub fn claims_csv(claims: &[Claim]) -> Result<Vec<u8>> {
    let failed = |error: &dyn std::fmt::Display| Error::failed(format!("claims.csv: {error}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    let header = ["lines", "claim", "measured", "ours", "limit", "holds", "linked"];
    writer.write_record(header).map_err(|error| failed(&error))?;
    for claim in claims {
        let linked = claim.linked.map_or(String::new(), |linked| linked.to_string());
        let (value, limit) = (claim.value.to_string(), claim.limit.to_string());
        let cells =
            [claim.lines, claim.text, claim.measure, &value, &limit, answer(claim), &linked];
        writer.write_record(cells).map_err(|error| failed(&error))?;
    }
    writer.into_inner().map_err(|error| failed(&error))
}

/// The claims for machines.
#[must_use]
pub fn claims_json(claims: &[Claim]) -> serde_json::Value {
    let of = |claim: &Claim| {
        json!({
            "lines": claim.lines,
            "text": claim.text,
            "measure": claim.measure,
            "value": claim.value,
            "limit": claim.limit.to_string(),
            "holds": claim.holds(),
            "linked": claim.linked,
        })
    };
    claims.iter().map(of).collect()
}

/// A table in Markdown, its caption above.
#[must_use]
pub fn markdown(table: &Table) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let rule = format!("|{}\n", "---|".repeat(table.header.len()));
    let rows: String = table.rows.iter().map(|row| line(row)).collect();
    format!("{}:\n\n{}{rule}{rows}", table.caption, line(&table.header))
}

/// A number with about three digits.
fn significant(value: f64) -> String {
    let text = match value.abs() {
        0.0 => "0".to_owned(),
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 10.0 => format!("{value:.1}"),
        size if size >= 1.0 => format!("{value:.2}"),
        size if size >= 1e-3 => format!("{value:.3}"),
        _ => format!("{value:.0e}"),
    };
    text.replacen('-', "\u{2212}", usize::from(value < 0.0))
}

#[cfg(test)]
mod tests {
    use super::super::claims::Limit;
    use super::*;

    fn claim(value: f64) -> Claim {
        Claim {
            lines: "491-493",
            text: "halves early",
            measure: "frames to one half",
            value,
            limit: Limit::AtMost(10.0),
            linked: Some(2.5),
        }
    }

    #[test]
    fn claims_are_judged_in_every_form() {
        let claims = [claim(8.96), claim(12.0)];
        let table = claims_short(&claims);
        assert_eq!(table.caption, "1 of 2 claims of the paper hold");
        assert_eq!(table.rows[0][1..], ["8.96", "≤ 10", "2.50"]);
        assert!(table.rows[1][0].starts_with("no   491-493"));
        let settings = Settings::new([160, 92], 1, 2, 3.0, 1).unwrap();
        let text = claims_markdown(&settings, &claims, &Table::default());
        assert!(text.contains("| halves early | frames to one half | 12.0 | ≤ 10 | no | 2.50 |"));
        let text = String::from_utf8(claims_csv(&claims).unwrap()).unwrap();
        assert!(
            text.ends_with("491-493,halves early,frames to one half,12,≤ 10,no,2.5\n"),
            "{text}"
        );
    }

    #[test]
    fn numbers_have_three_digits() {
        let texts = [123.4, -12.34, 1.234, 0.1234, 2e-5, 0.0, f64::NAN].map(significant);
        assert_eq!(texts, ["123", "\u{2212}12.3", "1.23", "0.123", "2e-5", "0", "NaN"]);
    }
}
