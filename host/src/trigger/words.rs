//! The board's figures and reasons as people read them.

use super::units;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{Hello, Model, Refusal, State};

/// A refusal as the rest of a sentence, with what to do.
#[must_use]
pub fn refusal(refusal: &Refusal) -> String {
    match refusal {
        Refusal::Number { .. } => {
            "the numbering of the requests is broken: another program talks to it, or it was reset"
                .to_owned()
        }
        Refusal::State(now) => {
            format!("not while it is {}; `phasewalk trigger abort` brings it to rest", state(now))
        }
        Refusal::Hash { ours } => {
            format!("the plan on the board is another one (hash {})", hex(*ours))
        }
        Refusal::Nonce => "the number for arming is wrong".to_owned(),
        Refusal::NotAPlan => "the bytes that arrived are no plan".to_owned(),
        Refusal::Plan(violation) => violation.to_string(),
        Refusal::Unsafe(fault) => advice(*fault),
        Refusal::Solver => {
            "its solver does not take these speckles: too many, or not those that come next"
                .to_owned()
        }
    }
}

/// A state as the rest of a sentence.
#[must_use]
pub fn state(state: &State) -> String {
    match state {
        State::Idle => "idle, disarmed".to_owned(),
        State::Asked => "about to be armed".to_owned(),
        State::Armed => "armed, waiting for its start".to_owned(),
        State::Running => "running".to_owned(),
        State::Finished => "finished, outputs low".to_owned(),
        State::Faulted(fault) => format!("stopped, outputs low: {fault}"),
    }
}

/// Whether the board makes no light in this state and will make none by itself.
#[must_use]
pub fn is_safe(state: &State) -> bool {
    matches!(state, State::Idle | State::Finished | State::Faulted(_))
}

/// A fault with what the user can do about it.
#[must_use]
pub fn advice(fault: Fault) -> String {
    let what = match fault {
        Fault::Interlock => "close the safety loop (Uno: from D2 to ground, STM32F405: from PC0)",
        Fault::InterlockStuck => "check the safety loop's wiring",
        Fault::NotReady => "arm the camera, or set ready = \"off\" in the plan if it is not wired",
        Fault::ReadBack => "an output is shorted or overloaded: check its wiring",
        Fault::Heartbeat => "the computer was too busy or the line was cut",
        Fault::Stack | Fault::Clock | Fault::PlanMemory | Fault::Late => {
            "write the firmware anew with `phasewalk trigger flash` and report it if it comes again"
        }
        Fault::NoPhase => "stream the volumes while the run goes on, as `--solve` does",
        Fault::Phase | Fault::Abort | Fault::LaserCap | Fault::StimulusCap => {
            return fault.to_string();
        }
    };
    format!("{fault} ({what})")
}

/// The board's name.
#[must_use]
pub fn model(model: Model) -> &'static str {
    match model {
        Model::Uno => "Arduino Uno",
        Model::F405 => "STM32F405",
        Model::Rehearsal => "rehearsal (no hardware)",
    }
}

/// What everyone should know before they use this board.
#[must_use]
pub fn caution(model: Model) -> Option<&'static str> {
    match model {
        Model::F405 => {
            Some("not with a subject: this board's timing was never measured on hardware")
        }
        Model::Uno | Model::Rehearsal => None,
    }
}

/// What a jumper joins so that a board hears its own laser trigger: output and EXPOSE; none: it has no
/// outputs.
#[must_use]
pub fn jumper(hello: &Hello) -> Option<(&'static str, &'static str)> {
    match hello.model {
        Model::F405 => Some(("PA0", "PA3")),
        Model::Rehearsal if hello.limits == Limits::F405 => None,
        Model::Uno | Model::Rehearsal => Some(("D9", "D8")),
    }
}

/// Eight hexadecimal digits.
#[must_use]
pub fn hex(hash: u32) -> String {
    format!("{hash:08x}")
}

/// Major, minor and patch.
#[must_use]
pub fn version(version: [u8; 3]) -> String {
    let [major, minor, patch] = version;
    format!("{major}.{minor}.{patch}")
}

/// Ticks as a time in the unit that people would choose, by the board's nominal clock.
#[must_use]
pub fn ticks(ticks: u64, per_second: u32) -> String {
    units::rounded(units::seconds(ticks, per_second))
}
