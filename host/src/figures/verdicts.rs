//! Sweeps that were left out, as every figure over the sweeps shows them.

use super::axes::Axes;
use super::canvas::{Anchor, Canvas, TextStyle, font};
use super::geometry::{Point, Rect};
use super::style::{self, tint};

/// The verdict on a sweep that is used.
pub const OK: &str = "ok";
/// Narrowest shade that has room for a word.
const WORD: f64 = 11.0;
/// Distance of two lines of the list.
const LINE: f64 = 17.0;
/// Most lines of the list.
const LINES: usize = 4;

/// Whether a sweep was left out; one without a verdict was not.
#[must_use]
pub fn is_bad(verdicts: &[String], sweep: usize) -> bool {
    verdicts.get(sweep).is_some_and(|verdict| verdict != OK)
}

/// Shades the sweeps that were left out, neighbours of one kind together, with their kind.
pub fn shade(canvas: &mut Canvas, axes: &Axes, verdicts: &[String], words: bool) {
    for (first, last, kind) in runs(verdicts, kind) {
        let (low, high) = (first as f64 - 0.5, last as f64 + 0.5);
        let (low, high) = (low.max(axes.x.low), high.min(axes.x.high));
        let (left, right) = (axes.place((low, 0.0)).0, axes.place((high, 0.0)).0);
        let shade = Rect::new(left, axes.area.y, right - left, axes.area.h);
        canvas.fill(shade.corners(), tint(style::INK, 0.13));
        if words && shade.w >= WORD {
            let text = TextStyle::new(style::SMALL, Anchor::End).colored(style::FAINT).upright();
            canvas.label((shade.center().0, shade.y + 6.0), kind, text);
        }
    }
}

/// The sweeps that were left out and why, in lines no wider than `width`.
#[must_use]
pub fn lines(verdicts: &[String], width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut hidden = 0;
    for (first, last, verdict) in runs(verdicts, |verdict| verdict) {
        let item = match first == last {
            true => format!("sweep {first} {verdict}"),
            false => format!("sweeps {first} to {last} {verdict}"),
        };
        let longer = match lines.last() {
            Some(line) => format!("{line} · {item}"),
            None => format!("left out: {item}"),
        };
        let fits = font::width(&longer, style::SMALL, false) <= width;
        if hidden == 0 && (fits || lines.is_empty()) {
            lines.pop();
            lines.push(longer);
        } else if hidden == 0 && lines.len() < LINES {
            lines.push(item);
        } else {
            hidden += last - first + 1;
        }
    }
    lines.extend((hidden > 0).then(|| format!("and {hidden} more")));
    lines
}

/// Height of a list of [`lines`].
#[must_use]
pub fn height(lines: &[String]) -> f64 {
    LINE * lines.len() as f64
}

/// Writes [`lines`] below one another, `at` on the first baseline.
pub fn list(canvas: &mut Canvas, at: Point, lines: &[String]) {
    let text = TextStyle::new(style::SMALL, Anchor::Start).colored(style::FAINT);
    for (n, line) in lines.iter().enumerate() {
        canvas.text((at.0, at.1 + LINE * n as f64), line, text);
    }
}

/// Neighbouring sweeps left out for the same reason: first, last, reason.
fn runs(verdicts: &[String], reason: fn(&str) -> &str) -> Vec<(usize, usize, &str)> {
    let mut next = 0;
    let chunks = verdicts.chunk_by(|a, b| reason(a) == reason(b)).map(|run| {
        let first = next;
        next += run.len();
        (first, next - 1, reason(&run[0]))
    });
    chunks.filter(|run| run.2 != OK).collect()
}

/// A verdict without its details: `short` of `short: 37 of 256 images`.
fn kind(verdict: &str) -> &str {
    verdict.split(':').next().unwrap_or(verdict)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_has_every_bad_sweep_or_says_how_many_more() {
        let mut verdicts = vec![OK.to_owned(); 5];
        assert!(lines(&verdicts, 400.0).is_empty());
        verdicts[3] = "short: 37 of 256 images".to_owned();
        assert_eq!(lines(&verdicts, 400.0), ["left out: sweep 3 short: 37 of 256 images"]);
        assert!(is_bad(&verdicts, 3) && !is_bad(&verdicts, 2) && !is_bad(&verdicts, 9));
        let blink = vec!["blink".to_owned(); 3];
        assert_eq!(lines(&blink, 400.0), ["left out: sweeps 0 to 2 blink"]);
        let all: Vec<_> = (0..100).map(|n| format!("short: {n} of 512 images")).collect();
        let lines = lines(&all, 300.0);
        assert_eq!(lines.len(), LINES + 1);
        assert!(lines[LINES].starts_with("and ") && lines[LINES].ends_with(" more"));
    }
}
