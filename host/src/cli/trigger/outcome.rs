//! What a run amounts to, in words; shared by `trigger run` and `trigger log`.

use crate::trigger::clock::Fit;
use crate::trigger::log::times::TimedBy;
use crate::trigger::log::{Ending, Header, RunLog, Summary};
use crate::trigger::{units, words};

/// The summary in a few lines.
pub(super) fn words(summary: &Summary, log: &RunLog) -> String {
    let mut lines = vec![summary.words.clone(), edges(summary, log.light_ended().is_some())];
    lines.extend(crossing(log));
    lines.push(volumes(summary));
    lines.extend(longest_pass(summary, &log.header));
    lines.push(clock(summary.clock.as_ref()));
    for (count, what) in [
        (summary.garbled, "frames from the board that could not be understood"),
        (summary.repeated, "requests that had to be repeated"),
    ] {
        if count > 0 {
            lines.push(format!("{what}: {count}"));
        }
    }
    lines.join("\n")
}

fn edges(summary: &Summary, light_ended: bool) -> String {
    let (made, planned) = (summary.edges.made, summary.edges.planned);
    let lost = match summary.events_lost {
        0 => String::new(),
        lost => format!("; events lost: {lost}"),
    };
    match &summary.edges.deviation {
        None if made == 0 => format!("no edge was made{lost}"),
        Some(deviation) => format!("{made} of {planned} edges, not on plan: {deviation}{lost}"),
        None if light_ended => {
            format!("{made} of {planned} edges, on plan but for the end of the stimulus{lost}")
        }
        None if made == planned => format!("{made} edges, all on plan{lost}"),
        None => format!("{made} of {planned} edges, those on plan{lost}"),
    }
}

/// The phase has left its bounds, and what came of it.
pub(super) fn crossing(log: &RunLog) -> Option<String> {
    let tick = log.crossed?;
    let limit = log.header.plan.phase_limit?;
    let since = tick.saturating_sub(log.start.unwrap_or(0));
    let after = words::ticks(since, log.header.ticks_per_second);
    let bound = f64::from(limit.milliradians) / 1e3;
    let then = if log.light_ended().is_some() { "; the stimulus is off from there on" } else { "" };
    Some(format!(
        "the phase left ±{bound} rad {after} after time zero (tick {tick}): the phase line went \
         high{then}"
    ))
}

/// The certificate holds while passes are no longer than the board says.
fn longest_pass(summary: &Summary, header: &Header) -> Option<String> {
    let (pass, allowed) = (summary.longest_pass_ticks, header.board.limits.pass);
    let time = |ticks: u32| words::ticks(ticks.into(), header.ticks_per_second);
    match pass {
        0 => None,
        _ if pass <= allowed => Some(format!(
            "longest pass of the board's main loop: {}, {} allowed",
            time(pass),
            time(allowed)
        )),
        _ => Some(format!(
            "warning: the board's main loop took {} for a pass, the timing certificate rests on \
             {}: edges may be late in another run; report this",
            time(pass),
            time(allowed)
        )),
    }
}

fn volumes(summary: &Summary) -> String {
    let timed = match summary.times.as_ref().map(|times| times.by) {
        Some(TimedBy::Exposed) => "timed by the camera's EXPOSE output",
        Some(TimedBy::Camera) => "timed by the camera's trigger",
        None => "without times",
    };
    let exposures = match summary.exposures {
        0 => String::new(),
        number if number == u64::from(summary.volumes) => String::new(),
        number => format!(" (EXPOSE came {number} times only)"),
    };
    format!("{} of {} volumes, {timed}{exposures}", summary.volumes, summary.planned_volumes)
}

/// The board's clock in words.
pub(super) fn clock(fit: Option<&Fit>) -> String {
    let Some(fit) = fit else {
        return "board's clock: too few comparisons with this computer's".to_owned();
    };
    let side = if fit.is_useful() { "" } else { ": too uncertain, the nominal clock is used" };
    format!(
        "board's clock: {:+.1} ± {:.1} ppm against this computer's ({} of {} comparisons, {} rms){side}",
        fit.ppm,
        fit.ppm_sigma,
        fit.samples,
        fit.taken,
        units::rounded(fit.residual_s),
    )
}

/// What is wrong with a run, for the exit status; none if it is as it should be.
pub(super) fn defect(log: &RunLog) -> Option<String> {
    let Some(summary) = &log.summary else {
        return Some("the log has no end: the program was killed during the run".to_owned());
    };
    if summary.ending != Ending::Finished {
        return Some(summary.words.clone());
    }
    if summary.events_lost > 0 {
        return Some(format!("events lost: {}; not all edges are known", summary.events_lost));
    }
    let deviation = summary.edges.deviation.as_ref();
    deviation.map(|deviation| format!("the run is not on plan: {deviation}"))
}
