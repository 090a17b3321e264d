//! The stages beside their roofs, as Markdown.

use crate::costs::{Cost, costs};
use crate::machine::Machine;
use crate::roof::Roof;
use crate::scene::Run;
use phasewalk::image::stages::{Stage, Timed};
use phasewalk::method::Method;

/// Of its roof, what every stage of the filter should reach.
const WANTED: f64 = 0.5;

/// Seconds per vector and pair.
#[derive(Clone, Copy, Default)]
struct Time {
    best: f64,
    median: f64,
}

/// The table of one method.
pub fn print(machine: &Machine, method: Method, run: &Run) {
    let Run { timed, frames, strips, cpu_s, tiles_s } = run;
    let name = if method == Method::Linked { "linked" } else { "paper" };
    let pairs = (frames * (frames - 1) / 2) as f64;
    let units = (timed.rows * timed.blocks) as f64 * pairs;
    let time = |stage| time(timed, stage, units);
    println!(
        "## `--method {name}`, strips of {} rows, {} vectors of {} pixels a row, R = {}\n",
        timed.rows, timed.blocks, timed.lanes, timed.halo
    );
    println!("Of one vector and pair; cycles but for ns:\n");
    println!(
        "| stage | ns | best | median | arithmetic | bytes | roof | share of it | of the f32 peak | of the run |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let whole = |seconds: f64| seconds * units * strips;
    let row = |name: &str, time: Time, roof: Option<&Roof>| {
        let cycles = |seconds: f64| format!("{:.1}", seconds * machine.hertz);
        let [arithmetic, bytes, by, share, peak] = match roof {
            None => [const { String::new() }; 5],
            Some(roof) => [
                cycles(roof.arithmetic_s),
                cycles(roof.bytes_s),
                roof.by.to_owned(),
                percent(roof.seconds() / time.best),
                percent(roof.flops * timed.lanes as f64 / time.best / machine.peak()),
            ],
        };
        println!(
            "| {name} | {:.2} | {} | {} | {arithmetic} | {bytes} | {by} | {share} | {peak} | {} |",
            time.best * 1e9,
            cycles(time.best),
            cycles(time.median),
            percent(whole(time.best) / cpu_s)
        );
    };
    let mut sum = Time::default();
    let mut slow = Vec::new();
    for cost in costs(method, timed, *frames) {
        let (time, roof) = (time(cost.stage), roof(&cost, machine, timed));
        row(cost.name, time, Some(&roof));
        sum = Time { best: sum.best + time.best, median: sum.median + time.median };
        if cost.filter && roof.seconds() < WANTED * time.best {
            slow.push(cost.name);
        }
    }
    let load = time(Stage::Load);
    row("load the strip", load, None);
    sum = Time { best: sum.best + load.best, median: sum.median + load.median };
    row("sum", sum, None);
    row("filter in its place: products to means at work", time(Stage::Filter), None);
    println!(
        "\nThe whole run on one thread: {cpu_s:.2} s of CPU, {:.1} cycles per vector and pair; the tiles before it: {tiles_s:.2} s.",
        cpu_s / (units * strips) * machine.hertz
    );
    let verdict = if slow.is_empty() { "none".to_owned() } else { slow.join(", ") };
    println!("Stages of the filter below {} of their roof: {verdict}.\n", percent(WANTED));
}

fn roof(cost: &Cost, machine: &Machine, timed: &Timed) -> Roof {
    Roof::of(cost, machine, timed.lanes * size_of::<f32>())
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

/// Sum over the laps of the shortest, and of the middle, of their times.
fn time(timed: &Timed, stage: Stage, units: f64) -> Time {
    let count = timed.laps.first().map_or(0, |laps| laps.of(stage).len());
    let mut sum = Time::default();
    for lap in 0..count {
        let mut all: Vec<f64> = timed.laps.iter().map(|laps| laps.of(stage)[lap]).collect();
        all.sort_by(f64::total_cmp);
        sum.best += all[0] / units;
        sum.median += all[all.len() / 2] / units;
    }
    sum
}
