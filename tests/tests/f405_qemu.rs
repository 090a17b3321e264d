//! The image of the STM32F405 in QEMU: the protocol over its line, the paper's sequence in order, and
//! every fault that can be made there ends safe.

use phasewalk::trigger::link::{BOOT_PATIENCE, Link};
use phasewalk::trigger::log::RunLog;
use phasewalk::trigger::port::{self, BAUD};
use phasewalk::trigger::run::{arm, upload};
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::check::Rule;
use phasewalk_firmware::compiled::{Compiled, hash};
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{Command, Event, Model, PROTOCOL, Refusal, State};
use phasewalk_firmware::plan::{
    Action, Caps, Inputs, Interlock, PhaseLimit, Plan, Pulse, Start, Stimulus,
};
use phasewalk_firmware::rehearsal::rehearse;
use phasewalk_tests::program::Bench;
use phasewalk_tests::qemu::{Logged, Machine, image};
use std::time::{Duration, Instant};

/// Ticks of a millisecond.
const MS: u32 = 84_000;

const IMAGE: &str = "f405.elf";

/// A machine and a line to it, the board greeted.
fn desk() -> (Machine, Link) {
    let machine = Machine::start(&image(IMAGE));
    let link = greeted(&machine);
    (machine, link)
}

fn greeted(machine: &Machine) -> Link {
    let mut link = port::open(&machine.port, BAUD).expect("the line opens");
    link.hello(BOOT_PATIENCE).expect("the board answers");
    link
}

/// Five volumes of 2 ms, 20 ms apart, light with the third until the end. QEMU's pins read low:
/// the loop is closed, the camera never ready.
fn small() -> Plan {
    Plan {
        inputs: Inputs { interlock: Interlock::On, ready: false, start: Start::Command },
        repeats: 1,
        repeat_period: 0,
        bursts: 5,
        interval: u64::from(20 * MS),
        sweeps: 1,
        spacing: [0; 2],
        laser: Pulse { delay: 0, width: 2 * MS },
        camera: Pulse { delay: 10 * 84, width: 100 * 84 },
        frame: 0,
        stimulus: Some(Stimulus {
            burst: 2,
            sweep: 0,
            delay: 0,
            on: u64::from(42 * MS),
            pulses: 1,
            period: 0,
            sham: false,
        }),
        phase_limit: None,
        caps: Caps {
            laser_pulse: 3 * MS,
            laser_total: u64::from(20 * MS),
            stimulus_pulse: u64::from(50 * MS),
            stimulus_total: u64::from(50 * MS),
            images_per_sweep: 512,
            camera_images: 10_000,
            heartbeat: 0,
        },
    }
}

/// The same, endless for a test's purposes.
fn long() -> Plan {
    let mut plan = Plan { bursts: 1_000, stimulus: None, ..small() };
    plan.caps.laser_total = u64::from(3_000 * MS);
    plan.caps.camera_images = 1_000_000;
    plan
}

fn compiled(plan: &Plan) -> Compiled {
    Compiled::new(plan).expect("the plan fits")
}

fn start(link: &mut Link, plan: &Plan) {
    let compiled = compiled(plan);
    upload(link, &compiled).expect("the board takes the plan");
    arm(link, &compiled).expect("the board arms");
    link.order(Command::Start).expect("the board starts");
}

fn state(link: &mut Link) -> State {
    link.status().expect("the board answers").status.state
}

/// Events from the start of the last run until it is over.
fn events(link: &mut Link) -> Vec<Event> {
    let until = Instant::now() + Duration::from_secs(20);
    let mut events = Vec::new();
    while let Some(heard) = link.event(until).expect("the line is there") {
        events.push(heard.event);
        if matches!(heard.event, Event::Started { .. }) {
            events.drain(..events.len() - 1);
        } else if matches!(events.first(), Some(Event::Started { .. }))
            && matches!(heard.event, Event::Finished { .. } | Event::Stopped { .. })
        {
            break;
        }
    }
    events
}

/// A plan's edges channel by channel, in ticks after its start.
fn planned(plan: &Plan) -> Vec<Edge> {
    let mut edges = Vec::new();
    let made = rehearse(&Limits::F405, &compiled(plan), |rehearsed| edges.push(rehearsed.edge));
    made.expect("the plan can be made");
    sorted(edges)
}

fn sorted(mut edges: Vec<Edge>) -> Vec<Edge> {
    edges.sort_by_key(|edge| (edge.channel, edge.tick));
    edges
}

/// `offer CHANNEL HIGH TICK` or `made …`, as the image logs the calls of its board.
fn traced(lines: &[Logged], call: &str) -> Vec<Edge> {
    let edges = lines.iter().filter_map(|line| {
        let mut words = line.words.split(' ');
        if words.next() != Some(call) {
            return None;
        }
        let channel: usize = words.next()?.parse().ok()?;
        let (high, tick) = (words.next()? == "true", words.next()?.parse().ok()?);
        Some(Edge { channel: Channel::ALL[channel], high, tick })
    });
    edges.collect()
}

/// The same edges counted from the tick `start`.
fn after(start: u64, edges: Vec<Edge>) -> Vec<Edge> {
    sorted(edges.into_iter().map(|edge| Edge { tick: edge.tick - start, ..edge }).collect())
}

#[test]
fn the_board_says_who_it_is_and_that_it_has_no_outputs() {
    let machine = Machine::start(&image(IMAGE));
    let mut link = port::open(&machine.port, BAUD).expect("the line opens");
    let hello = link.hello(BOOT_PATIENCE).expect("the board answers");
    assert_eq!((hello.model, hello.protocol), (Model::Rehearsal, PROTOCOL));
    assert_eq!(hello.limits, Limits::F405);
    let flashed = std::fs::read(image("f405.bin")).expect("the image to be flashed is there");
    assert_eq!((hello.image_bytes as usize, hello.image), (flashed.len(), hash(&flashed)));

    let mut log = machine.log();
    let mut machine = machine;
    let lines = log.lines(&mut machine);
    let says = |words: &str| lines.iter().any(|line| line.words.contains(words));
    assert!(says("NOT WITH A SUBJECT") && says("outputs stay disconnected"), "{lines:?}");

    let status = link.status().expect("the board answers").status;
    assert_eq!((status.state, status.plan), (State::Idle, 0));
    // QEMU's pins read low.
    assert_eq!((status.interlock_closed, status.camera_ready), (true, false));
}

#[test]
fn a_small_plan_is_made_to_its_end_and_told() {
    let (mut machine, mut link) = desk();
    let mut log = machine.log();
    start(&mut link, &small());
    let events = events(&mut link);
    let Some(Event::Started { tick: zero }) = events.first().copied() else {
        panic!("{events:?}");
    };
    let told = events.iter().filter_map(|event| match event {
        Event::Made(edge) => Some(*edge),
        _ => None,
    });
    assert_eq!(after(zero, told.collect()), planned(&small()));
    assert!(matches!(events.last(), Some(Event::Finished { .. })), "{events:?}");
    assert_eq!(state(&mut link), State::Finished);

    // Every edge was handed to the timer before it was due, and taken note of after it.
    let lines = log.lines(&mut machine);
    assert_eq!(after(zero, traced(&lines, "offer")), planned(&small()));
    assert_eq!(after(zero, traced(&lines, "made")), planned(&small()));
    for line in &lines {
        for edge in traced(std::slice::from_ref(line), "offer") {
            assert!(line.tick + u64::from(Limits::F405.lead) < edge.tick, "{line:?}");
        }
        for edge in traced(std::slice::from_ref(line), "made") {
            assert!(line.tick > edge.tick, "{line:?}");
        }
    }
}

#[test]
fn the_papers_sequence_runs_to_its_end_by_the_program() {
    let mut machine = Machine::start(&image(IMAGE));
    let mut log = machine.log();
    let bench = Bench::new();
    let line = format!(
        "trigger run paper --set ready=off --port {} --log R.ndjson --yes --json",
        machine.port
    );
    let ran = bench.succeed(&line);
    assert!(ran.stdout.contains("282"), "{ran:?}");
    let run = RunLog::read(&bench.path("R.ndjson")).expect("the log can be read");
    let zero = run.start.expect("the run has started");
    let planned = planned(&run.header.plan);
    assert_eq!(planned.len(), 282, "70 volumes of 4 edges, and the light");

    let mut told: Vec<Edge> = Vec::new();
    for channel in Channel::ALL {
        told.extend(run.ticks(channel, true).into_iter().map(|t| Edge::rise(channel, t)));
        told.extend(run.ticks(channel, false).into_iter().map(|t| Edge::fall(channel, t)));
    }
    assert_eq!(after(zero, told), planned);
    let lines = log.lines(&mut machine);
    assert_eq!(after(zero, traced(&lines, "offer")), planned);
    assert_eq!(after(zero, traced(&lines, "made")), planned);
    let longest = run.summary.expect("the log was closed").longest_pass_ticks;
    println!(
        "longest pass {longest} of {} ticks (QEMU's, no figure of the board's)",
        Limits::F405.pass
    );
}

#[test]
fn outputs_are_low_before_they_are_outputs_and_the_enable_rests_after_the_run() {
    let machine = Machine::start_watched(&image(IMAGE));
    let mut link = greeted(&machine);
    start(&mut link, &small());
    let events = events(&mut link);
    assert!(matches!(events.last(), Some(Event::Finished { .. })), "{events:?}");
    let accesses = machine.accesses();
    let gpio: Vec<_> = accesses.iter().filter(|(device, ..)| device.starts_with("GPIO")).collect();
    // BSRR: laser, camera, LED and frame clock low; then MODER: plain outputs. The same for port C.
    let first: Vec<_> =
        gpio.iter().take(4).map(|(d, offset, v)| (d.as_str(), *offset, *v)).collect();
    let expected = [
        ("GPIOA", 0x18, 0x0047_0000),
        ("GPIOA", 0x00, 0x0000_1015),
        ("GPIOC", 0x18, 0x0032_0000),
        ("GPIOC", 0x00, 0x0000_0504),
    ];
    assert_eq!(first, expected);
    // On this chip, which is none, the light outputs never become the timer's.
    let connected = |moder: u32| moder & 0x302A != 0 && moder & 0x0015 == 0;
    assert!(gpio.iter().all(|(d, offset, v)| d != "GPIOA" || *offset != 0 || !connected(*v)));
    // The dynamic enable, PC4: a square wave during the run, low at its end.
    let enable: Vec<bool> = gpio
        .iter()
        .filter(|(device, offset, value)| {
            device == "GPIOC" && *offset == 0x18 && value & 0x0010_0010 != 0
        })
        .map(|(_, _, value)| value & 0x10 != 0)
        .collect();
    let changes = enable.windows(2).filter(|pair| pair[0] != pair[1]).count();
    // 122 ms at one change per 125 us to 250 us.
    assert!((400..1200).contains(&changes), "{changes}");
    assert_eq!(enable.last(), Some(&false));
}

#[test]
fn the_host_ends_a_run_and_so_does_its_silence() {
    let (machine, mut link) = desk();
    start(&mut link, &long());
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(state(&mut link), State::Running);
    link.abort(Duration::from_secs(1)).expect("the board answers");
    assert_eq!(state(&mut link), State::Faulted(Fault::Abort));
    let stopped = events(&mut link).pop();
    assert!(matches!(stopped, Some(Event::Stopped { fault: Fault::Abort, .. })), "{stopped:?}");

    let mut plan = long();
    plan.caps.heartbeat = 300 * MS;
    start(&mut link, &plan);
    let stopped = events(&mut link).pop();
    assert!(matches!(stopped, Some(Event::Stopped { fault: Fault::Heartbeat, .. })), "{stopped:?}");
    assert_eq!(state(&mut link), State::Faulted(Fault::Heartbeat));
    drop(machine);
}

#[test]
fn the_camera_that_is_not_there_is_not_ready() {
    let (_machine, mut link) = desk();
    let mut plan = small();
    plan.inputs.ready = true;
    upload(&mut link, &compiled(&plan)).expect("the plan breaks no rule");
    let refused = arm(&mut link, &compiled(&plan)).unwrap_err();
    assert!(format!("{refused:?}").contains("NotReady"), "{refused:?}");
    assert_eq!(state(&mut link), State::Idle);

    // The loop's pulsed test needs its far end at the board: QEMU's input stays low.
    plan.inputs = Inputs { interlock: Interlock::Pulsed, ready: false, start: Start::Command };
    upload(&mut link, &compiled(&plan)).expect("the plan breaks no rule");
    let refused = arm(&mut link, &compiled(&plan)).unwrap_err();
    assert!(format!("{refused:?}").contains("InterlockStuck"), "{refused:?}");
}

#[test]
fn plans_that_break_a_rule_are_refused_by_the_board_itself() {
    let (_machine, mut link) = desk();
    let mut short = small();
    short.camera.width = Limits::F405.shortest - 1;
    let mut memory = small();
    memory.caps.camera_images = 100;
    let mut frames = small();
    frames.frame = 1_400;
    let cases =
        [(short, Rule::CameraWidth), (memory, Rule::CameraMemory), (frames, Rule::FramePulse)];
    for (plan, rule) in cases {
        let refused = upload(&mut link, &compiled(&plan)).unwrap_err();
        assert!(format!("{refused:?}").contains(&format!("{rule:?}")), "{refused:?}");
    }
}

#[test]
fn a_changed_plan_is_found_before_its_next_sweep() {
    // Of the plan's bytes in the board's memory one is changed: through the debugger of QEMU.
    let (mut machine, mut link) = desk();
    let plan = long();
    start(&mut link, &plan);
    std::thread::sleep(Duration::from_millis(100));
    machine.damage(compiled(&plan).bytes());
    let stopped = events(&mut link).pop();
    assert!(
        matches!(stopped, Some(Event::Stopped { fault: Fault::PlanMemory, .. })),
        "{stopped:?}"
    );
}

#[test]
fn silence_of_the_solver_ends_a_run_that_relies_on_it() {
    let (_machine, mut link) = desk();
    let limit = PhaseLimit { milliradians: 1_000, silence: 200 * MS, action: Action::Line };
    start(&mut link, &Plan { phase_limit: Some(limit), ..long() });
    let stopped = events(&mut link).pop();
    assert!(matches!(stopped, Some(Event::Stopped { fault: Fault::NoPhase, .. })), "{stopped:?}");
    // And no series may begin while a limit is kept.
    start_again(&mut link);
}

fn start_again(link: &mut Link) {
    start(link, &long());
    let looks = 64.0_f32.to_bits();
    let refused = link.order(Command::Series { speckles: 64, looks }).unwrap_err();
    let expected = format!("{:?}", Refusal::State(State::Running));
    assert!(format!("{refused:?}").contains(&expected), "{refused:?}");
    link.abort(Duration::from_secs(1)).expect("the board answers");
}
