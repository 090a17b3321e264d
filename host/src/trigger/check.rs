//! Everything that is asked of a plan before it may run: rules, exposure, timing.

use super::budget::{Budget, OnTimes, Row, Use};
use super::certificate::{Certificate, certify};
use super::ledger::Doses;
use super::limits::{Emission, LimitsFile, Source};
use super::plan_file::Loaded;
use super::units::{exact, figures, milliseconds, seconds};
use crate::error::{Error, Result};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::check::{Rule, Violation, check};
use phasewalk_firmware::compiled::{Compiled, MAX_BYTES};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::plan::Plan;

/// A longer run is refused: rehearsing every pass of it would take minutes. A week at 16 MHz.
const LONGEST_S: f64 = 7.0 * 24.0 * 3600.0;

/// Why a board without one refuses a plan with a frame clock.
pub const NO_FRAME_CLOCK: &str = "the board makes no frame clock: take one that does (STM32F405, \
                                  --board f405), or camera.frame_clock = \"camera\"";

/// A plan that has passed every check, ready to be sent.
#[derive(Debug, Clone)]
pub struct Checked {
    /// The plan with the caps that the board gets.
    pub plan: Plan,
    /// The bytes to send.
    pub compiled: Compiled,
    /// Time left for every edge.
    pub certificate: Certificate,
    /// On-times and exposures against their limits.
    pub budget: Budget,
    /// What is worth a word: shown, and kept in the run log.
    pub warnings: Vec<String>,
    /// File and name of the limits.
    pub limits: String,
}

/// Check a plan against the board's rules and the laboratory's limits, and rehearse all its edges.
///
/// `before` is what the subject has got in the last 24 hours ([`Ledger::today`]), where a ledger is
/// kept; `board` is what the board says in its hello, or [`Limits::UNO`].
///
/// [`Ledger::today`]: super::ledger::Ledger::today
///
/// # Errors
/// The first rule or limit that is broken, with its figures.
pub fn check_plan(
    loaded: &Loaded,
    limits: &LimitsFile,
    before: Option<&Doses>,
    board: &Limits,
) -> Result<Checked> {
    let about = |what: String| Error::failed(format!("{}: {what}", loaded.source));
    let mut plan = loaded.plan;
    plan.caps = limits.caps(&plan, board);
    check(&plan, board).map_err(|violation| about(broken(&violation, limits, board)))?;
    short_enough(&plan, board).map_err(about)?;
    let compiled = compile(&plan, board).map_err(about)?;
    let per_second = f64::from(board.ticks_per_second);
    let window = (limits.laser.duty_window_s * per_second).round().max(1.0);
    let certificate =
        certify(&compiled, window as u64, board).map_err(|error| about(error.to_string()))?;
    let budget = Budget::new(&used(&plan, &certificate, window, board), limits, before);
    if let Some(row) = budget.exceeded() {
        return Err(about(above(row, limits)));
    }
    let mut warnings = loaded.warnings.clone();
    warnings.extend(doubts(&plan, limits, &certificate, board));
    let limits = format!("{} ({})", limits.source, limits.name);
    Ok(Checked { plan, compiled, certificate, budget, warnings, limits })
}

/// The bytes of a plan, if the board holds as many.
///
/// # Errors
/// When they are too many, with the figures.
pub fn compile(plan: &Plan, board: &Limits) -> std::result::Result<Compiled, String> {
    let most = board.plan_bytes();
    let compiled = Compiled::new(plan);
    let bytes = compiled.as_ref().map(|compiled| compiled.bytes().len());
    if let Some(compiled) = compiled.filter(|compiled| compiled.bytes().len() <= most) {
        return Ok(compiled);
    }
    let bytes = bytes.map_or_else(|| format!("more than {MAX_BYTES}"), |bytes| bytes.to_string());
    Err(format!(
        "the compiled plan takes {bytes} bytes; at most {most} fit the board: take round times, or \
         leave a table out"
    ))
}

/// A broken rule in one line, times in milliseconds and ticks.
#[must_use]
pub fn broken(violation: &Violation, limits: &LimitsFile, board: &Limits) -> String {
    if let Some(words) = extended(violation, board) {
        return words;
    }
    let Violation { rule, value, limit } = violation;
    let least = if rule.is_minimum() { "at least" } else { "at most" };
    let amount = |ticks: u64| {
        if rule.in_ticks() {
            format!("{} ms ({ticks} ticks)", milliseconds(ticks, board.ticks_per_second))
        } else {
            ticks.to_string()
        }
    };
    let whose = match rule {
        Rule::LaserPulse | Rule::LaserTotal | Rule::StimulusPulse | Rule::StimulusTotal => {
            format!(" by {} or the board", limits.source)
        }
        Rule::CameraMemory => " by the camera's memory".to_owned(),
        _ => String::new(),
    };
    format!("{} is {}; {least} {} allowed{whose}", rule.subject(), amount(*value), amount(*limit))
}

/// The rules of frame clock and phase limit, with the keys of the plan and what to do.
fn extended(violation: &Violation, board: &Limits) -> Option<String> {
    let per_second = board.ticks_per_second;
    let Violation { rule, value, limit } = *violation;
    let clock = |side: &str, hertz: &str| {
        format!(
            "camera.frame_rate: the period of the frame clock is {} ({value} ticks); at {side} {} \
             ({limit} ticks) allowed: take {hertz} {} Hz",
            exact(value, per_second),
            exact(limit, per_second),
            figures(f64::from(per_second) / limit as f64)
        )
    };
    match rule {
        Rule::FrameLong if limit == 0 => Some(format!("camera.frame_clock: {NO_FRAME_CLOCK}")),
        Rule::FrameLong => Some(clock("most", "at least")),
        Rule::FrameShort => Some(clock("least", "at most")),
        Rule::FramePulse => Some(format!(
            "camera.pulse and the frames of a sweep differ by {} ({value} ticks): with \
             camera.frame_clock = \"board\" leave camera.pulse out",
            exact(value, per_second)
        )),
        Rule::PhaseLimit => Some(
            "[phase_limit]: the board has no on-line solver: take one that has (STM32F405, --board \
             f405), or leave the table out"
                .to_owned(),
        ),
        _ => None,
    }
}

/// A limit of the laboratory that is exceeded, in one line.
fn above(row: &Row, limits: &LimitsFile) -> String {
    let Row { what, planned, limit, unit, .. } = row;
    let (planned, limit) = (figures(*planned), figures(*limit));
    let continuous = limits.laser.emission == Emission::Continuous && what.contains(", laser");
    let hint = if continuous {
        "; the laser counts for the whole run (emission = \"continuous\")"
    } else {
        ""
    };
    let source = &limits.source;
    format!("{what}: {planned} {unit} planned; at most {limit} {unit} allowed by {source}{hint}")
}

fn short_enough(plan: &Plan, board: &Limits) -> std::result::Result<(), String> {
    let length = seconds(plan.length(), board.ticks_per_second);
    if length <= LONGEST_S {
        return Ok(());
    }
    let (hours, most) = (length / 3600.0, LONGEST_S / 3600.0);
    Err(format!("the run takes {hours:.0} h; at most {most:.0} h are rehearsed: split it"))
}

/// What the rehearsed edges add up to.
fn used(plan: &Plan, certificate: &Certificate, window: f64, board: &Limits) -> Use {
    let s = |ticks: u64| seconds(ticks, board.ticks_per_second);
    let (laser, light) = (certificate.of(Channel::Laser), certificate.of(Channel::Stimulus));
    Use {
        on: OnTimes { laser_s: s(laser.high), stimulus_s: s(light.high), run_s: s(plan.length()) },
        laser_pulse_s: s(laser.longest_high),
        laser_duty: certificate.laser_in_window as f64 / window,
        stimulus_pulse_s: s(light.longest_high),
    }
}

fn doubts(
    plan: &Plan,
    limits: &LimitsFile,
    certificate: &Certificate,
    board: &Limits,
) -> Vec<String> {
    let mut doubts = Vec::new();
    for source in [Source::Laser, Source::Stimulus] {
        let lit = source == Source::Laser || plan.stimulus_on() > 0;
        if lit && !limits.exposure.iter().any(|entry| entry.source == source) {
            let what = format!("{} states no exposure by the {}", limits.source, source.name());
            doubts.push(format!("{what}: not in the budget"));
        }
    }
    if !certificate.covers(board) {
        let what = "the board's bounds are not those of the certificate: its slacks do not hold";
        doubts.push(what.to_owned());
    }
    let close = plan.caps.laser_pulse < plan.laser.width.saturating_add(board.pass);
    if close {
        let what = "the laser pulse is within one pass of its limit: the board may stop the run";
        doubts.push(what.to_owned());
    }
    doubts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trigger::plan_file::load;

    fn checked(plan: &str, settings: &[&str]) -> Result<Checked> {
        checked_by(&LimitsFile::example().unwrap(), plan, settings)
    }

    fn checked_by(limits: &LimitsFile, plan: &str, settings: &[&str]) -> Result<Checked> {
        let settings: Vec<String> = settings.iter().map(|&text| text.to_owned()).collect();
        let loaded = load(plan, &settings, &Limits::UNO)?;
        check_plan(&loaded, limits, None, &Limits::UNO)
    }

    fn refused(settings: &[&str]) -> String {
        checked("paper", settings).unwrap_err().to_string()
    }

    #[test]
    fn presets_pass() {
        for preset in ["paper", "pairs", "triples"] {
            let checked = checked(preset, &[]).unwrap();
            assert_eq!(checked.compiled.plan(), Some(checked.plan), "{preset}");
            assert!(checked.budget.rows.iter().all(|row| row.share <= 1.0));
        }
    }

    #[test]
    fn caps_lie_between_plan_and_limits() {
        let caps = checked("paper", &[]).unwrap().plan.caps;
        assert_eq!(caps.laser_pulse, 136_533 + 2 * Limits::UNO.pass);
        let mut limits = LimitsFile::example().unwrap();
        limits.laser.pulse_ms = 8.6;
        let checked = checked_by(&limits, "paper", &[]).unwrap();
        assert_eq!(checked.plan.caps.laser_pulse, 137_600);
        assert!(checked.warnings.iter().any(|warning| warning.contains("within one pass")));
    }

    #[test]
    fn refusals_have_figures() {
        for (settings, words) in [
            (&["volumes=71"][..], ["36352", "35840"]),
            (&["camera.pulse=10us"], ["0.01 ms (160 ticks)", "0.05 ms (800 ticks)"]),
            (&["laser.pulse=30ms"], ["30 ms", "20 ms"]),
            (&["interval=8.55ms"], ["interval", "at least 8.58"]),
            (&["interval=3s"], ["stimulus on-time without a break", "60000 ms"]),
            (&["interval=3s", "stimulus=off"], ["retina, laser: run", "J/cm2 planned; at most 10"]),
            (&["interval=9000s", "stimulus=off"], ["173 h", "168 h"]),
        ] {
            let message = refused(settings);
            for word in words {
                assert!(message.contains(word), "{settings:?}: {message}");
            }
        }
    }

    #[test]
    fn what_the_board_lacks_is_named_with_what_to_do() {
        let limits = LimitsFile::example().unwrap();
        let words =
            |rule, value, limit| broken(&Violation { rule, value, limit }, &limits, &Limits::F405);
        let on_uno = |settings: &[&str]| refused(settings);
        let limit = ["phase_limit.radians=2", "phase_limit.action=stop"];
        assert!(on_uno(&limit).contains("[phase_limit]: the board has no on-line solver"));
        assert!(words(Rule::FrameLong, 1400, 0).contains("camera.frame_clock = \"camera\""));
        let slow = words(Rule::FrameLong, 84_000, 65_535);
        assert!(slow.contains("1 ms (84000 ticks)") && slow.contains("at least 1282 Hz"), "{slow}");
        let fast = words(Rule::FrameShort, 420, 840);
        assert!(fast.contains("at most 100000 Hz"), "{fast}");
        assert!(words(Rule::FramePulse, 84, 0).contains("camera.pulse"));
    }

    #[test]
    fn a_plan_must_fit_the_board() {
        let odd = |text: &str| format!("{text}=7.1234567ms");
        let settings = ["laser.delay", "camera.delay", "stimulus.delay"].map(odd).to_vec();
        let plan = load("triples", &settings, &Limits::UNO).unwrap().plan;
        let bytes = compile(&plan, &Limits::UNO).unwrap().bytes().len();
        assert!(bytes <= Limits::UNO.plan_bytes(), "{bytes}");
        let mut long = plan;
        (long.repeats, long.repeat_period) = (u16::MAX, u64::MAX);
        (long.interval, long.caps.laser_total, long.caps.stimulus_total) =
            (u64::MAX, u64::MAX, u64::MAX);
        let message = compile(&long, &Limits::UNO).unwrap_err();
        assert!(message.contains("at most 80 fit the board"), "{message}");
        assert!(compile(&long, &Limits::F405).is_ok());
    }

    #[test]
    fn a_sham_brings_no_light() {
        let checked = checked("paper", &["stimulus.sham=true"]).unwrap();
        assert_eq!(checked.certificate.of(Channel::Stimulus).edges, 0);
        assert_eq!(checked.budget.doses["retina, stimulus"], 0.0);
        assert_eq!(checked.plan.caps.stimulus_total, 0);
    }

    #[test]
    fn sources_without_exposure_are_named() {
        let mut limits = LimitsFile::example().unwrap();
        limits.exposure.clear();
        let warnings = checked_by(&limits, "paper", &[]).unwrap().warnings.join("\n");
        assert!(warnings.contains("no exposure by the laser") && warnings.contains("stimulus"));
    }
}
