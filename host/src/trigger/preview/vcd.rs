//! Value change dump (IEEE 1364): what GTKWave, PulseView and other viewers of logic signals read.

use super::Trace;
use crate::trigger::summary::channel_name;
use phasewalk_firmware::channel::Channel;
use std::fmt::Write;

/// Time steps of the format, finest last, in steps per second.
const STEPS: [(&str, u64); 4] = [
    ("1 ns", 1_000_000_000),
    ("100 ps", 10_000_000_000),
    ("10 ps", 100_000_000_000),
    ("1 ps", 1_000_000_000_000),
];

/// The trace as VCD. One tick of 62.5 ns is 625 steps of 100 ps: edges keep their exact time.
#[must_use]
pub fn vcd(trace: &Trace) -> String {
    let (step, per_second) = step(trace.ticks_per_second);
    let time =
        |tick: u64| u128::from(tick) * u128::from(per_second) / u128::from(trace.ticks_per_second);
    let mut text = header(trace, step);
    let mut last = None;
    for edge in &trace.edges {
        if last != Some(edge.tick) {
            let _ = writeln!(text, "#{}", time(edge.tick));
            last = Some(edge.tick);
        }
        let _ = writeln!(text, "{}{}", u8::from(edge.high), id(edge.channel));
    }
    // Room behind the last edge, so that it can be seen.
    let _ = writeln!(text, "#{}", time(trace.end() + trace.plan.sweep_length()));
    text
}

/// The coarsest step of which a tick is a whole number, else the finest.
fn step(ticks_per_second: u32) -> (&'static str, u64) {
    let exact = |(_, steps): &&(&str, u64)| steps.is_multiple_of(u64::from(ticks_per_second));
    *STEPS.iter().find(exact).unwrap_or(&STEPS[STEPS.len() - 1])
}

fn header(trace: &Trace, step: &str) -> String {
    let (name, hash) = (trace.name.replace('$', ""), trace.hash);
    let mut text = format!(
        "$comment plan {name}, hash {hash:08x}: what the trigger board makes of it; time 0 is the \
         start of the run; {} ticks per second $end\n\
         $version phasewalk {} $end\n$timescale {step} $end\n$scope module trigger $end\n",
        trace.ticks_per_second,
        env!("CARGO_PKG_VERSION")
    );
    for channel in Channel::ALL {
        let _ = writeln!(text, "$var wire 1 {} {} $end", id(channel), channel_name(channel));
    }
    text.push_str("$upscope $end\n$enddefinitions $end\n$dumpvars\n");
    for channel in Channel::ALL {
        let _ = writeln!(text, "0{}", id(channel));
    }
    text.push_str("$end\n");
    text
}

const fn id(channel: Channel) -> char {
    match channel {
        Channel::Laser => 'l',
        Channel::Camera => 'c',
        Channel::Stimulus => 's',
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_exact() {
        assert_eq!(step(16_000_000).0, "100 ps");
        assert_eq!(step(1_000_000).0, "1 ns");
        assert_eq!(step(84_000_000).0, "1 ps");
    }
}
