//! The stages beside their roofs, as Markdown.

use crate::costs::{Part, costs};
use crate::machine::Machine;
use crate::roof::Roof;
use crate::scene::Run;
use phasewalk::image::stages::{Stage, Timed};
use phasewalk::method::Method;
use std::ops::AddAssign;

/// Of its roof, what the filter and each of its steps should reach.
const WANTED: f64 = 0.5;

/// The steps of the filter, and what is done with the means, as the program mixes them.
const IN_TURNS: &str = "these in turns, as in the program";

/// Seconds for one vector and pair.
#[derive(Clone, Copy, Default)]
struct Time {
    best: f64,
    median: f64,
}

impl AddAssign for Time {
    fn add_assign(&mut self, other: Self) {
        self.best += other.best;
        self.median += other.median;
    }
}

/// A row's roof.
#[derive(Clone, Copy, Default)]
struct Least {
    arithmetic_s: f64,
    bytes_s: f64,
    /// The greater of both; of several stages the sum.
    seconds: f64,
    flops: f64,
}

/// The table of one method.
pub fn print(machine: &Machine, method: Method, run: &Run) {
    let table = Table::new(machine, run);
    table.head(method);
    let (mut filter, mut sum) = (Least::default(), Time::default());
    let (mut slow, mut rest) = (Vec::new(), Vec::new());
    for cost in costs(method, &run.timed, run.frames) {
        if cost.part == Part::Rest {
            rest.push(cost);
            continue;
        }
        let (time, least, by) = table.stage(&cost);
        table.row(cost.name, time, Some((least, by)));
        filter += least;
        if cost.part == Part::Filter && least.seconds < WANTED * time.best {
            slow.push(cost.name);
        }
    }
    let in_place = table.time(Stage::Filter);
    table.row(IN_TURNS, in_place, Some((filter, "sum of these")));
    if filter.seconds < WANTED * in_place.best {
        slow.push(IN_TURNS);
    }
    sum += in_place;
    for cost in &rest {
        let (time, least, by) = table.stage(cost);
        table.row(cost.name, time, Some((least, by)));
        sum += time;
    }
    for (name, stage) in [("load the strip", Stage::Load), ("report", Stage::Report)] {
        let time = table.time(stage);
        table.row(name, time, None);
        sum += time;
    }
    table.row("sum of the last rows, from *in turns* on", sum, None);
    table.foot(&slow);
}

impl AddAssign for Least {
    fn add_assign(&mut self, other: Self) {
        self.arithmetic_s += other.arithmetic_s;
        self.bytes_s += other.bytes_s;
        self.seconds += other.seconds;
        self.flops += other.flops;
    }
}

struct Table<'a> {
    machine: &'a Machine,
    run: &'a Run,
    /// Vectors times pairs of a strip.
    units: f64,
}

impl<'a> Table<'a> {
    fn new(machine: &'a Machine, run: &'a Run) -> Self {
        let pairs = (run.frames * (run.frames - 1) / 2) as f64;
        Self { machine, run, units: (run.timed.rows * run.timed.blocks) as f64 * pairs }
    }

    fn head(&self, method: Method) {
        let Timed { rows, blocks, lanes, halo, .. } = self.run.timed;
        let name = if method == Method::Linked { "linked" } else { "paper" };
        println!(
            "## `--method {name}`: strips of {rows} rows, {blocks} vectors of {lanes} pixels a row, R = {halo}\n"
        );
        println!("Of one vector and pair, in cycles but for ns:\n");
        println!(
            "| stage | ns | best | median | arithmetic | bytes | roof | share of it | of the peak | of the run |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|");
    }

    /// Time and roof of a stage, and what makes the roof.
    fn stage(&self, cost: &crate::costs::Cost) -> (Time, Least, &'static str) {
        let vector = self.run.timed.lanes * size_of::<f32>();
        let roof = Roof::of(cost, self.machine, vector);
        let Roof { arithmetic_s, bytes_s, flops, by } = roof;
        let seconds = roof.seconds();
        (self.time(cost.stage), Least { arithmetic_s, bytes_s, seconds, flops }, by)
    }

    fn row(&self, name: &str, time: Time, roof: Option<(Least, &str)>) {
        let cycles = |seconds: f64| format!("{:.1}", seconds * self.machine.hertz);
        let [arithmetic, bytes, by, share, peak] = match roof {
            None => [const { String::new() }; 5],
            Some((roof, by)) => [
                cycles(roof.arithmetic_s),
                cycles(roof.bytes_s),
                by.to_owned(),
                percent(roof.seconds / time.best),
                percent(roof.flops * self.run.timed.lanes as f64 / time.best / self.machine.peak()),
            ],
        };
        println!(
            "| {name} | {:.1} | {} | {} | {arithmetic} | {bytes} | {by} | {share} | {peak} | {} |",
            time.best * 1e9,
            cycles(time.best),
            cycles(time.median),
            percent(time.best * self.units * self.run.strips / self.run.cpu_s)
        );
    }

    fn foot(&self, slow: &[&str]) {
        let Run { strips, cpu_s, tiles_s, .. } = self.run;
        println!(
            "\nThe whole run on one thread: {cpu_s:.2} s of CPU, {:.1} cycles for each vector and pair; \
             the tiles before it: {tiles_s:.2} s.",
            cpu_s / (self.units * strips) * self.machine.hertz
        );
        let verdict = if slow.is_empty() { "none".to_owned() } else { slow.join(", ") };
        println!("Of the filter below {} of its roof: {verdict}.\n", percent(WANTED));
    }

    /// Sum over the laps of the shortest, and of the middle, of their times.
    fn time(&self, stage: Stage) -> Time {
        let laps = &self.run.timed.laps;
        let count = laps.first().map_or(0, |laps| laps.of(stage).len());
        let mut sum = Time::default();
        for lap in 0..count {
            let mut all: Vec<f64> = laps.iter().map(|laps| laps.of(stage)[lap]).collect();
            all.sort_by(f64::total_cmp);
            sum += Time { best: all[0] / self.units, median: all[all.len() / 2] / self.units };
        }
        sum
    }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}
