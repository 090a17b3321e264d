//! A line for every frame: plain columns, with a trace beside them on a terminal, or JSON.

use super::Task;
use crate::cli::print;
use crate::image::NewestImage;
use crate::io::{Columns, CurveRow};
use serde_json::json;
use std::io::IsTerminal;

/// Characters of the trace.
const TRACE: usize = 40;

/// How the lines are printed.
#[derive(Clone, Copy, PartialEq)]
enum Style {
    Silent,
    Plain,
    Terminal,
    Json,
}

/// What prints the lines.
pub(super) struct Follow {
    style: Style,
    columns: Columns,
    pixels: usize,
    /// The smallest and the largest phase so far, radians.
    range: [f64; 2],
}

impl Follow {
    /// Lines of a curve with these columns.
    pub(super) fn curve(task: &Task<'_>, nm_per_rad: Option<f64>, quality: bool) -> Self {
        let follow = Self::new(task, Columns { nm_per_rad, quality });
        if matches!(follow.style, Style::Plain | Style::Terminal) {
            let names = ["frame", "time", "phase_rad", "sigma_rad"];
            print(&names.map(|name| format!("{name:>12}")).join(" "));
        }
        follow
    }

    /// Lines of images.
    pub(super) fn images(task: &Task<'_>) -> Self {
        let follow = Self::new(task, Columns { nm_per_rad: None, quality: false });
        if matches!(follow.style, Style::Plain | Style::Terminal) {
            print(&["frame", "time", "measured_%"].map(|name| format!("{name:>12}")).join(" "));
        }
        follow
    }

    fn new(task: &Task<'_>, columns: Columns) -> Self {
        let style = match (task.arguments.follow, task.common.json) {
            (false, _) => Style::Silent,
            (true, true) => Style::Json,
            (true, false) if std::io::stdout().is_terminal() => Style::Terminal,
            (true, false) => Style::Plain,
        };
        let range = [f64::INFINITY, f64::NEG_INFINITY];
        Self { style, columns, pixels: task.format.pixels(), range }
    }

    /// The line of a frame's phase.
    pub(super) fn curve_row(&mut self, row: &CurveRow) {
        match self.style {
            Style::Silent => {}
            Style::Json => print(self.columns.json_line(row).trim_end()),
            Style::Plain => print(&plain(row)),
            Style::Terminal => print(&format!("{} {}", plain(row), self.trace(row.phase_rad))),
        }
    }

    /// The line of a frame's image; none of one that was left out.
    pub(super) fn image(&self, number: usize, time: f64, image: Option<&NewestImage>) {
        let share = |image: &NewestImage| 1.0 - image.unmeasured as f64 / self.pixels as f64;
        let measured = image.map_or(f64::NAN, share);
        match self.style {
            Style::Silent => {}
            Style::Json => {
                let line = json!({ "frame": number, "time_s": time, "measured": measured });
                print(&line.to_string());
            }
            Style::Plain | Style::Terminal => {
                let time = short(time);
                print(&format!("{number:>12} {time:>12} {:>12.2}", 100.0 * measured));
            }
        }
    }

    /// A mark where the phase lies between the smallest and the largest so far.
    fn trace(&mut self, phase: f64) -> String {
        if !phase.is_finite() {
            return "?".to_owned();
        }
        self.range = [self.range[0].min(phase), self.range[1].max(phase)];
        let [low, high] = self.range;
        let share = if high > low { (phase - low) / (high - low) } else { 0.5 };
        let place = (share * (TRACE - 1) as f64).round() as usize;
        format!("|{}*{}|", " ".repeat(place), " ".repeat(TRACE - 1 - place))
    }
}

fn plain(row: &CurveRow) -> String {
    let CurveRow { frame, time_s, phase_rad, sigma_rad, .. } = *row;
    format!("{frame:>12} {:>12} {phase_rad:>12.4} {sigma_rad:>12.4}", short(time_s))
}

/// A time without the digits that only rounding makes.
fn short(time: f64) -> String {
    let text = format!("{time:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
