//! A checked plan in words and figures, and as JSON.

use super::certificate::{Least, Rehearsals};
use super::check::Checked;
use super::plan_file::Loaded;
use super::units::{exact, figures, microseconds, rounded, seconds};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::plan::{Action, Interlock, PhaseLimit, Plan, Start, Stimulus};
use serde_json::{Value, json};
use std::fmt::Write;

/// The name of an output.
#[must_use]
pub const fn channel_name(channel: Channel) -> &'static str {
    match channel {
        Channel::Laser => "laser",
        Channel::Camera => "camera",
        Channel::Stimulus => "stimulus",
    }
}

/// What a plan does, one fact per line: title and text.
#[must_use]
pub fn facts(loaded: &Loaded, plan: &Plan, board: &Limits) -> Vec<(&'static str, String)> {
    let time = |ticks: u64| exact(ticks, board.ticks_per_second);
    let mut facts = vec![
        ("volumes", volumes(plan, board)),
        ("sweep", sweep(loaded, plan, board)),
        ("run", format!("{}{}", time(plan.length()), long(plan.length(), board))),
    ];
    if plan.repeats > 1 {
        let period = time(plan.repeat_period);
        facts.push((
            "repeats",
            format!("{} of all this, {period} from start to start", plan.repeats),
        ));
    }
    facts.push(("stimulus", stimulus(plan, board)));
    facts.push(("camera", camera(loaded, plan)));
    if plan.frame > 0 {
        facts.push(("frames", frames(plan, board)));
    }
    if let Some(limit) = &plan.phase_limit {
        facts.push(("phase", phase(limit, board)));
    }
    facts.push(("inputs", inputs(plan, board)));
    facts
}

fn volumes(plan: &Plan, board: &Limits) -> String {
    let time = |ticks: u64| exact(ticks, board.ticks_per_second);
    let bursts = match (plan.bursts, plan.sweeps) {
        (1, 1) => "1 sweep".to_owned(),
        (1, sweeps) => format!("1 burst of {sweeps} sweeps"),
        (bursts, 1) => format!("{bursts} sweeps, one every {}", time(plan.interval)),
        (bursts, sweeps) => {
            format!("{bursts} bursts of {sweeps} sweeps, one every {}", time(plan.interval))
        }
    };
    let gaps: Vec<String> = plan
        .spacing
        .iter()
        .take(usize::from(plan.sweeps - 1))
        .map(|&ticks| time(ticks.into()))
        .collect();
    let within = if gaps.is_empty() {
        String::new()
    } else {
        format!("; within a burst {}", gaps.join(", "))
    };
    format!("{}: {bursts}{within} (start to start)", plan.volumes())
}

fn sweep(loaded: &Loaded, plan: &Plan, board: &Limits) -> String {
    let pulse = exact(plan.laser.width.into(), board.ticks_per_second);
    let images = plan.caps.images_per_sweep;
    let rate = figures(loaded.frame_rate_hz);
    format!("laser {pulse} ({} ticks); {images} images at {rate} Hz", plan.laser.width)
}

/// Long times in words, too.
fn long(ticks: u64, board: &Limits) -> String {
    let seconds = seconds(ticks, board.ticks_per_second).round() as u64;
    if seconds < 120 {
        return String::new();
    }
    let words = humantime::format_duration(std::time::Duration::from_secs(seconds));
    format!(" (about {words})")
}

fn stimulus(plan: &Plan, board: &Limits) -> String {
    let time = |ticks: u64| exact(ticks, board.ticks_per_second);
    let Some(stimulus) = &plan.stimulus else { return "none".to_owned() };
    let volume = u32::from(stimulus.burst) * u32::from(plan.sweeps) + u32::from(stimulus.sweep);
    let Stimulus { delay, on, pulses, period, sham, .. } = *stimulus;
    let delay = if delay > 0 { format!(" + {}", time(delay)) } else { String::new() };
    let light = match pulses {
        1 => format!("on for {}", time(on)),
        _ => format!(
            "{pulses} pulses of {}, one every {}, {} in all",
            time(on),
            time(period.into()),
            time(stimulus.duration())
        ),
    };
    let sham = if sham { "; sham: no light" } else { "" };
    let start = time(plan.stimulus_start(stimulus));
    format!("with volume {volume} (counted from 0){delay}, at {start}: {light}{sham}")
}

fn camera(loaded: &Loaded, plan: &Plan) -> String {
    let images = plan.images();
    let memory = plan.caps.camera_images;
    let megabytes = loaded.image_bits.map_or_else(String::new, |bits| {
        format!(", {} MB", (images * bits).div_ceil(8 * 1_000_000))
    });
    if memory == u32::MAX {
        return format!("{images} images{megabytes}; the size of its memory is not given");
    }
    let share = 100.0 * images as f64 / f64::from(memory);
    format!("{images} of the {memory} images its memory holds ({share:.1} %){megabytes}")
}

fn frames(plan: &Plan, board: &Limits) -> String {
    let (ticks, images) = (plan.frame, plan.caps.images_per_sweep);
    let period = exact(ticks.into(), board.ticks_per_second);
    let rate = figures(f64::from(board.ticks_per_second) / f64::from(ticks));
    format!(
        "clock by the board, one every {period} ({ticks} ticks, {rate} Hz), {images} while the \
         camera's trigger is high"
    )
}

fn phase(limit: &PhaseLimit, board: &Limits) -> String {
    let radians = f64::from(limit.milliradians) / 1e3;
    let action = match limit.action {
        Action::Line => "the phase line goes high",
        Action::Stimulus => "the phase line goes high and the stimulus ends",
        Action::Stop => "the phase line goes high and the run ends",
    };
    let silence = match limit.silence {
        0 => String::new(),
        ticks => {
            let time = exact(ticks.into(), board.ticks_per_second);
            format!("; no volume solved for {time}: the run ends")
        }
    };
    format!("beyond ±{radians} rad by the on-line solver: {action}{silence}")
}

fn inputs(plan: &Plan, board: &Limits) -> String {
    let interlock = match plan.inputs.interlock {
        Interlock::Off => "off",
        Interlock::On => "on",
        Interlock::Pulsed => "pulsed",
    };
    let ready = if plan.inputs.ready { "on" } else { "off" };
    let start = match plan.inputs.start {
        Start::Command => "command",
        Start::External => "external",
    };
    let heartbeat = match plan.caps.heartbeat {
        0 => "off".to_owned(),
        ticks => exact(ticks.into(), board.ticks_per_second),
    };
    format!("interlock {interlock}, READY {ready}, start {start}, heartbeat {heartbeat}")
}

impl Checked {
    /// For people, several lines.
    #[must_use]
    pub fn text(&self, loaded: &Loaded, board: &Limits) -> String {
        let mut text = format!("{} ({})\n", loaded.name, loaded.source);
        for (title, fact) in facts(loaded, &self.plan, board) {
            let _ = writeln!(text, "  {title:<9} {fact}");
        }
        self.budget_text(&mut text);
        self.certificate_text(&mut text, board);
        let hash = self.compiled.hash();
        let bytes = self.compiled.bytes().len();
        let _ = writeln!(text, "\ncompiled: {bytes} bytes, hash {hash:08x}");
        for warning in &self.warnings {
            let _ = writeln!(text, "warning: {warning}");
        }
        text.push_str("All rules kept.");
        text
    }

    fn budget_text(&self, text: &mut String) {
        let limits = &self.limits;
        let _ = writeln!(text, "\nbudget, limits by {limits}; inputs, not certified");
        let _ = writeln!(text, "  {:<48} {:>10} {:>10}           share", "", "planned", "limit");
        for row in &self.budget.rows {
            let (planned, limit) = (figures(row.planned), figures(row.limit));
            let share = row.share * 100.0;
            let what = &row.what;
            let unit = row.unit;
            let _ =
                writeln!(text, "  {what:<48} {planned:>10} {limit:>10} {unit:<6} {share:>8.2} %");
        }
    }

    fn certificate_text(&self, text: &mut String, board: &Limits) {
        let certificate = &self.certificate;
        let per_second = board.ticks_per_second;
        let edges = certificate.edges();
        let _ =
            writeln!(text, "\ntiming certificate: {edges} edges of the compiled plan rehearsed");
        for channel in Channel::ALL {
            let seen = certificate.of(channel);
            let line = slack_text(seen, per_second);
            let _ = writeln!(text, "  {:<9} {:>7} edges{line}", channel_name(channel), seen.edges);
        }
        let Limits { pass, interrupt, lead, .. } = certificate.assumed;
        let us = |ticks: u32| microseconds(ticks.into(), per_second);
        let _ = writeln!(
            text,
            "  holds while a pass of the main loop takes at most {} us and an interrupt at most {} us;\n  \
             an edge is armed at least {} us before it is due; the board measures its longest pass",
            us(pass),
            us(interrupt),
            us(lead)
        );
    }

    /// For programs.
    #[must_use]
    pub fn json(&self, loaded: &Loaded, board: &Limits) -> Value {
        let plan = &self.plan;
        let s = |ticks: u64| seconds(ticks, board.ticks_per_second);
        let hex: String = self.compiled.bytes().iter().map(|byte| format!("{byte:02x}")).collect();
        json!({
            "software": concat!("phasewalk ", env!("CARGO_PKG_VERSION")),
            "plan": loaded.name,
            "source": loaded.source,
            "volumes": plan.volumes(),
            "repeats": plan.repeats,
            "bursts": plan.bursts,
            "sweeps": plan.sweeps,
            "interval_s": s(plan.interval),
            "sweep_s": s(plan.sweep_length()),
            "run_s": s(plan.length()),
            "images": plan.images(),
            "camera_memory_images": plan.caps.camera_images,
            "camera_bytes": loaded.image_bits.map(|bits| (plan.images() * bits).div_ceil(8)),
            "plan_ticks": plan,
            "ticks_per_second": board.ticks_per_second,
            "limits": self.limits,
            "budget": self.budget.rows,
            "doses_j_cm2": self.budget.doses,
            "certificate": self.certificate_json(board),
            "compiled": { "bytes": self.compiled.bytes().len(), "hex": hex,
                          "hash": format!("{:08x}", self.compiled.hash()) },
            "warnings": self.warnings,
        })
    }

    fn certificate_json(&self, board: &Limits) -> Value {
        let channels = Channel::ALL.map(|channel| {
            let seen = self.certificate.of(channel);
            json!({
                "channel": channel_name(channel),
                "edges": seen.edges,
                "least_slack_ticks": seen.least.map(|least| least.slack),
                "least_slack_us": seen.least.map(|l| seconds(l.slack, board.ticks_per_second) * 1e6),
                "at_edge": seen.least.map(|least| least.number),
                "at_tick": seen.least.map(|least| least.edge.tick),
                "high_ticks": seen.high,
                "shortest_ticks": seen.shortest,
            })
        });
        let assumed = &self.certificate.assumed;
        json!({
            "edges": self.certificate.edges(),
            "channels": channels,
            "assumed": { "pass_ticks": assumed.pass, "interrupt_ticks": assumed.interrupt,
                         "lead_ticks": assumed.lead, "reach_ticks": assumed.reach },
        })
    }
}

fn slack_text(seen: &Rehearsals, per_second: u32) -> String {
    let Some(Least { slack, edge, number }) = seen.least else { return String::new() };
    let us = microseconds(slack, per_second);
    let which = if edge.high { "rise" } else { "fall" };
    let at = rounded(seconds(edge.tick, per_second));
    format!(
        ", least slack {us} us ({slack} ticks) at edge {number} (counted from 0), {which} at {at}"
    )
}
