//! The on-line solver of the STM32F405 in QEMU: the same bits as on the desktop, what it costs, beside
//! libm's root and micromath, and the limit that it keeps during a run.

use num_complex::Complex32;
use phasewalk::io::Shape;
use phasewalk::trigger::link::BOOT_PATIENCE;
use phasewalk::trigger::log::RunLog;
use phasewalk::trigger::port::{self, BAUD};
use phasewalk::trigger::solve::comparison::{Comparison, Row};
use phasewalk::trigger::solve::twin::Twin;
use phasewalk::trigger::solve::{begin, solve};
use phasewalk::trigger::speckles::{Choice, Speckles};
use phasewalk_core::online::{LAGS, SPECKLES};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::limits::Limits;
use phasewalk_tests::program::Bench;
use phasewalk_tests::qemu::{INSTRUCTIONS_PER_TICK, Machine, image, size_of};
use phasewalk_tests::recording::Recording;
use std::path::Path;

const VOLUMES: usize = 70;

/// The processor's clock in Hz: one instruction per cycle is the best it can do.
const PROCESSOR_HZ: f64 = 168e6;

/// Bytes of the stack that memory.x gives.
const STACK: usize = 40 * 1024;

/// Phase of volume t in radians: it grows, and trembles.
fn phase(t: usize) -> f64 {
    let t = t as f64;
    0.08 * t + 0.4 * (0.3 * t).sin()
}

/// Correlation from volume to volume.
const RHO: f64 = 0.9;

/// 70 volumes of 64 speckles.
fn recording() -> Recording {
    let shape = Shape { frames: VOLUMES, depth: 1, height: 8, width: 8 };
    Recording::decorrelating(shape, RHO, 405, |t, _| phase(t))
}

/// Volume from which the pattern is another one.
const LOST: usize = 45;

/// The same with two dark volumes, one half of which is chance, and a pattern that is lost for good.
fn troubled() -> Recording {
    let mut recording = recording();
    let mut other = Recording::decorrelating(recording.shape, RHO, 406, |t, _| phase(t));
    for dark in [20, 21] {
        recording.image_mut(dark, 0).fill(Complex32::default());
    }
    recording.image_mut(30, 0)[..SPECKLES / 2]
        .copy_from_slice(&other.image_mut(60, 0)[..SPECKLES / 2]);
    for lost in LOST..VOLUMES {
        recording.image_mut(lost, 0).copy_from_slice(other.image_mut(lost, 0));
    }
    recording
}

/// What an image says of the series, and what it took.
struct Solved {
    rows: Vec<Row>,
    /// Root mean square of its phases' errors against the truth, radians.
    error_rad: f64,
    /// Instructions of each volume.
    instructions: Vec<f64>,
    stack: usize,
    /// Flash and variables in bytes.
    size: (u64, u64),
}

impl Solved {
    /// Mean instructions of a volume that finds a full window.
    fn mean(&self) -> f64 {
        let full = &self.instructions[LAGS..];
        full.iter().sum::<f64>() / full.len() as f64
    }

    /// Most instructions of a volume.
    fn most(&self) -> f64 {
        self.instructions.iter().copied().fold(0.0, f64::max)
    }
}

fn solved(name: &str, file: &Path) -> Solved {
    let choice = Choice { mask: None, pick: None, depth: None, looks: None };
    let speckles = Speckles::read(file, &choice, SPECKLES, None).expect("the series can be read");
    assert_eq!((speckles.volumes(), speckles.count()), (VOLUMES, SPECKLES));
    let mut machine = Machine::start(&image(name));
    let mut link = port::open(&machine.port, BAUD).expect("the line opens");
    link.hello(BOOT_PATIENCE).expect("the board answers");
    begin(&mut link, &speckles).expect("the solver begins");
    let mut twin = Twin::new(&speckles).expect("the desktop can solve it too");
    let mut rows = Vec::new();
    for number in 0..VOLUMES {
        let volume = speckles.volume(number).expect("it is there");
        let estimate = solve(&mut link, volume, number as u32).expect("the board solves it");
        rows.push(Row::new(&estimate, &twin.push(volume), Limits::F405.ticks_per_second));
    }
    // From microseconds of the nominal clock to ticks.
    let ticks = |row: &Row| row.took_us * f64::from(Limits::F405.ticks_per_second) / 1e6;
    let instructions = rows.iter().map(|row| ticks(row) * INSTRUCTIONS_PER_TICK);
    Solved {
        error_rad: rms(rows.iter().map(error)),
        instructions: instructions.collect(),
        stack: machine.stack_used(),
        size: size_of(&image(name)),
        rows,
    }
}

/// The phase's error: the truth is against the mean of the first five volumes, of those that there are.
fn error(row: &Row) -> f64 {
    let volume = row.volume as usize;
    let references = 5.min(volume + 1);
    let reference = (0..references).map(phase).sum::<f64>() / references as f64;
    f64::from(row.phase_rad) - (phase(volume) - reference)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (count, squares) = values.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x * x));
    f64::sqrt(squares / count)
}

/// The image that is flashed (square root by the processor), libm's and micromath's.
const IMAGES: [&str; 3] = ["f405.elf", "f405-libm.elf", "f405-micromath.elf"];

fn print_table(solved: &[Solved; 3]) {
    println!(
        "{VOLUMES} volumes of {SPECKLES} speckles, a window of {LAGS}; QEMU's instruction counts"
    );
    println!("volumes/s: estimate, {PROCESSOR_HZ:.0} instructions per second at the best");
    println!("| | processor's root | libm | micromath |\n|---|---|---|---|");
    let row = |what: &str, of: &dyn Fn(&Solved) -> String| {
        let cells: Vec<String> = solved.iter().map(of).collect();
        println!("| {what} | {} |", cells.join(" | "));
    };
    let compared = |s: &Solved| Comparison::of(&s.rows);
    row("same bits as the desktop's libm", &|s| format!("{} of {VOLUMES}", compared(s).same_bits));
    row("largest difference to f64, rad", &|s| format!("{:.1e}", compared(s).largest_rad));
    row("rms difference to f64, rad", &|s| format!("{:.1e}", compared(s).rms_rad));
    row("rms error against the truth, rad", &|s| format!("{:.4}", s.error_rad));
    row("instructions per volume, mean", &|s| format!("{:.0}", s.mean()));
    row("instructions per volume, most", &|s| format!("{:.0}", s.most()));
    row("volumes per second", &|s| format!("{:.0}", PROCESSOR_HZ / s.most()));
    row("stack used, bytes", &|s| s.stack.to_string());
    row("flash, bytes", &|s| s.size.0.to_string());
    row("variables, bytes", &|s| s.size.1.to_string());
}

#[test]
fn the_board_finds_the_desktops_bits_and_each_root_and_arc_tangent_has_its_price() {
    let bench = Bench::new();
    let file = bench.path("F.npy");
    recording().save(&file);
    let solved = IMAGES.map(|name| solved(name, &file));
    print_table(&solved);
    // Each volume adds the variance of one step, so much at the least (Cramer-Rao), to all later ones.
    let step = (1.0 - RHO * RHO) / (2.0 * RHO * RHO * SPECKLES as f64);
    let bound = rms((0..VOLUMES).map(|t| (t as f64 * step).sqrt()));
    println!("the bound of this series: {bound:.4} rad rms over its volumes");

    let [flashed, libm, micromath] = solved;
    for exact in [&flashed, &libm] {
        let compared = Comparison::of(&exact.rows);
        assert_eq!(compared.same_bits, VOLUMES);
        // f32 has 24 bits; 64 speckles, 17 nodes and the fit of the coherence lose some of them.
        assert!(compared.largest_rad < 1e-4, "{}", compared.largest_rad);
        assert!(exact.error_rad < 1.5 * bound, "{} of {bound}", exact.error_rad);
        // A third of it is kept for what this test does not meet.
        assert!(exact.stack > 1024 && exact.stack < STACK * 2 / 3, "{}", exact.stack);
    }
    // micromath's arc tangent is good to 2.8e-3 rad; a phase only begins there, and scoring makes that up.
    let compared = Comparison::of(&micromath.rows);
    assert!(compared.largest_rad < 1e-3, "{}", compared.largest_rad);
    assert_eq!(
        compared.first_other,
        Some(1),
        "this is another arithmetic; the first phase is 0 in all"
    );
    assert!(flashed.mean() < libm.mean() && micromath.mean() < libm.mean());
}

#[test]
fn dark_volumes_and_a_pattern_that_is_lost_have_the_desktops_bits_too() {
    let bench = Bench::new();
    let file = bench.path("F.npy");
    troubled().save(&file);
    let solved = solved("f405.elf", &file);
    println!("stack used, bytes: {}; instructions, most: {:.0}", solved.stack, solved.most());
    assert_eq!(Comparison::of(&solved.rows).same_bits, VOLUMES);
    assert!(solved.stack < STACK * 2 / 3, "{}", solved.stack);
    let sigma = |volume: usize| solved.rows[volume].sigma_rad;
    assert!(sigma(LOST - 1) < 0.6 && sigma(LOST + 5) > 0.9, "the loss is noticed");
}

#[test]
fn the_program_streams_a_region_and_draws_board_and_host() {
    let bench = Bench::new();
    recording().save(&bench.path("F.npy"));
    let machine = Machine::start(&image("f405.elf"));
    let line =
        format!("trigger solve F.npy --pick 50 --port {} -o S.csv --plot S.png", machine.port);
    let ran = bench.succeed(&line);
    assert!(ran.stdout.contains("same bits: 70 of 70"), "{ran:?}");
    let table = std::fs::read_to_string(bench.path("S.csv")).expect("the table was written");
    assert_eq!(table.lines().count(), VOLUMES + 1);
    assert!(std::fs::metadata(bench.path("S.png")).expect("the plot was written").len() > 10_000);
}

/// `trigger run` of twelve volumes of the paper's sequence with light from the fourth, streaming.
fn limited_run(bench: &Bench, machine: &Machine, action: &str) -> phasewalk_tests::program::Ran {
    let line = format!(
        "trigger run paper --set ready=off --set volumes=12 --set stimulus.volume=3 --set \
         phase_limit.radians=0.5 --set phase_limit.action={action} --solve F.npy --port {} --log \
         {action}.ndjson --yes",
        machine.port
    );
    bench.run(&line)
}

#[test]
fn a_phase_beyond_its_limit_takes_the_light_away_during_a_run() {
    let bench = Bench::new();
    recording().save(&bench.path("F.npy"));
    let machine = Machine::start(&image("f405.elf"));

    let ran = limited_run(&bench, &machine, "stimulus").succeeded();
    assert!(ran.stdout.contains("phase"), "{ran:?}");
    let log = RunLog::read(&bench.path("stimulus.ndjson")).expect("the log can be read");
    let light = (log.ticks(Channel::Stimulus, true), log.ticks(Channel::Stimulus, false));
    assert_eq!((light.0.len(), light.1.len()), (1, 1), "on once, off once");
    let crossed = log.light_ended().expect("the light was ended");
    assert!(light.1[0] >= light.0[0] && light.1[0].abs_diff(crossed) < Limits::F405.pass.into());
    assert_eq!(log.ticks(Channel::Camera, true).len(), 12, "volumes went on");
    assert_eq!(log.phases.len(), 12);

    let ran = limited_run(&bench, &machine, "stop");
    ran.refused(1, &["phase"]);
    let log = RunLog::read(&bench.path("stop.ndjson")).expect("the log can be read");
    assert_eq!(log.fault.map(|(fault, _)| fault), Some(Fault::Phase));
    assert!(log.ticks(Channel::Camera, true).len() < 12, "and no more volumes");
}
