//! Commands to a running board: wires, faults, questions.

use super::pin::Pin;
use super::uno::{Reset, State, Uno};

/// What the commands are, for `--help`.
pub const HELP: &str = "\
Commands on standard input, one per line; each is answered with one line, `ok`, what was asked for,
or `error: ...`:
  reset [external|power-on|brown-out]   reset the board (external: as opening the port does)
  drive PIN 0|1     drive a pin from outside      release PIN      drive it no longer
  stick PIN 0|1     fault: hold a wire at a level unstick PIN      the fault is gone
  connect FROM TO   put a jumper on               disconnect TO    take it off
  hang [deaf]       the main program hangs; deaf: its interrupts too
  level PIN         level of a wire: 0 or 1
  cycle             cycles since power-on, 16,000,000 per second
  resets            resets since power-on
  overruns          bytes which the program fetched too late
  stack             lowest stack pointer so far
  latency           worst latency of each interrupt, in cycles
  state             running, sleeping, or why it crashed
  quit              end, as the end of standard input does
Pins are D0 to D13 and A0 to A5.";

/// Carry out one command; the answer is one line.
///
/// # Errors
/// If the board does not know it.
pub fn command(uno: &mut Uno, line: &str) -> Result<String, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words.as_slice() {
        ["reset"] => uno.reset(Reset::External),
        ["reset", cause] => uno.reset(reset(cause)?),
        ["drive", pin, level] => uno.drive(pin.parse()?, parse_level(level)?),
        ["release", pin] => uno.release(pin.parse()?),
        ["stick", pin, level] => uno.stick(pin.parse()?, parse_level(level)?),
        ["unstick", pin] => uno.unstick(pin.parse()?),
        ["connect", from, to] => uno.connect(from.parse()?, to.parse()?),
        ["disconnect", to] => uno.disconnect(to.parse()?),
        ["hang"] => drop(uno.hang(false)?),
        ["hang", "deaf"] => drop(uno.hang(true)?),
        question => return answer(uno, question),
    }
    Ok("ok".into())
}

fn answer(uno: &Uno, question: &[&str]) -> Result<String, String> {
    Ok(match question {
        ["level", pin] => u8::from(uno.level(pin.parse::<Pin>()?)).to_string(),
        ["cycle"] => uno.cycle().to_string(),
        ["resets"] => uno.resets().to_string(),
        ["overruns"] => uno.overruns().to_string(),
        ["stack"] => format!("{:#06x}", uno.stack_low_water()),
        ["latency"] => latencies(uno),
        ["state"] => match uno.state() {
            State::Running => "running".into(),
            State::Sleeping => "sleeping".into(),
            State::Crashed(reason) => format!("crashed: {reason}"),
        },
        words => return Err(format!("unknown command: {}", words.join(" "))),
    })
}

fn latencies(uno: &Uno) -> String {
    let worst = uno.max_interrupt_latency();
    let words: Vec<String> =
        worst.iter().map(|of| format!("{:?}={}", of.vector, of.worst)).collect();
    words.join(" ")
}

fn reset(cause: &str) -> Result<Reset, String> {
    match cause {
        "external" => Ok(Reset::External),
        "power-on" => Ok(Reset::PowerOn),
        "brown-out" => Ok(Reset::BrownOut),
        _ => Err(format!("no reset is called {cause}")),
    }
}

fn parse_level(level: &str) -> Result<bool, String> {
    match level {
        "0" | "low" => Ok(false),
        "1" | "high" => Ok(true),
        _ => Err(format!("a level is 0 or 1, not {level}")),
    }
}
