//! Every fault, injected into the very image that is flashed to the STM32F405 in the middle of a sweep,
//! with laser, camera and stimulus on: all outputs low in time and for good, with the reason.
//!
//! The image is the one that `cargo xtask firmware` leaves. Each test prints lines
//! `fault | bound | measured`, the worst of several positions against passes and bytes.

use num_complex::Complex;
use phasewalk_core::online::{LAGS, SPECKLES};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::fault::{Fault, ResetCause};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{
    Command, Event, Model, Refusal, Reply, SPECKLES_PER_REQUEST, State,
};
use phasewalk_firmware::plan::{Action, Interlock, PhaseLimit, Plan, Pulse, Stimulus};
use phasewalk_firmware::rehearsal::rehearse;
use phasewalk_tests::f405::{F405, Hang, IDENTITY, Pin, Reset};
use phasewalk_tests::session::{
    Session, f405_deviations, f405_image, f405_paper, f405_pin_of, planned_on,
};

type Board = Session<F405>;

// ---- bounds, in ticks ----------------------------------------------------------------------

const MS: u64 = Board::MS;
const LIMITS: Limits = Limits::F405;

/// What a pass finds: it is at most this long, and they come more often.
const PASS: u64 = LIMITS.pass as u64;

/// What an interrupt finds: no interrupt waits and works longer, which is what the timing of the
/// edges is built on.
const INTERRUPT: u64 = LIMITS.interrupt as u64;

/// A request: a byte that has just missed its pass is taken in the next, and served there.
const REQUEST: u64 = 2 * PASS;

/// The safety loop is pulsed every 100 passes' worth of ticks, in a pass.
const LOOP_TEST: u64 = 101 * PASS;

/// A clock that stands still is noticed in the 101st pass, of 100 us.
const CLOCK_STANDS: u64 = 102 * MS / 10;

/// A sweep is looked at so long before it starts: the plan in one pass, READY in the next.
const NEAR: u64 = LIMITS.reach as u64 + 3 * PASS;

/// Periods of the watchdog's oscillator, of nominally 32 kHz, until it resets.
const WATCHDOG_PERIODS: u64 = 201 * 4;
const WATCHDOG_HZ: u64 = 32_000;

/// How long the watchdog takes at so many per mille of its nominal clock.
const fn watchdog(per_mille: u64) -> u64 {
    WATCHDOG_PERIODS * 1000 * MS * 1000 / (WATCHDOG_HZ * per_mille)
}

/// The slowest oscillator of the data sheet, 17 kHz: 47 ms.
const WATCHDOG: u64 = watchdog(530);

/// From a reset until the outputs are driven low, not only pulled: the first instructions.
const DRIVEN: u64 = 30;

// ---- plans ---------------------------------------------------------------------------------

/// From the start of a sweep to its middle: all outputs on.
const MIDDLE: u64 = 105_000;
const LED_PULSE: u64 = 420_000;
const CAMERA_PULSE: u64 = 525_000;
const LASER_PULSE: u64 = 716_800;
const INTERVAL: u64 = 40 * MS;

/// Dynamic enable, phase line.
const ENABLE: Pin = Pin::new(2, 4);
const PHASE: Pin = Pin::new(2, 5);

/// A hundred sweeps of the paper's length; the camera's trigger is long, so that all outputs can be
/// met on, and the stimulus stays on.
fn steady() -> Plan {
    let mut plan = f405_paper();
    (plan.bursts, plan.interval) = (100, INTERVAL);
    plan.camera = Pulse { delay: 0, width: CAMERA_PULSE as u32 };
    plan.stimulus = Some(Stimulus {
        burst: 0,
        sweep: 0,
        delay: 0,
        on: 100 * INTERVAL,
        pulses: 1,
        period: 0,
        sham: false,
    });
    plan.caps.camera_images = 100 * 512;
    plan
}

/// The same with a pulse of light in each sweep, which ends before the laser's.
fn flicker(on: u64) -> Plan {
    let mut plan = steady();
    if let Some(light) = &mut plan.stimulus {
        (light.on, light.pulses, light.period) = (on, 100, INTERVAL as u32);
    }
    plan
}

/// So many sweeps of it.
fn short(mut plan: Plan, sweeps: u16) -> Plan {
    plan.bursts = sweeps;
    if let Some(light) = &mut plan.stimulus {
        if light.pulses > 1 {
            light.pulses = sweeps.into();
        } else {
            light.on = u64::from(sweeps) * INTERVAL;
        }
    }
    plan
}

// ---- injection -----------------------------------------------------------------------------

/// Positions of the injection, and the ticks from one to the next: prime, so that passes are met at
/// different places, and in all less than the rest of the camera's pulse.
const POSITIONS: u64 = 8;
const STEP: u64 = 5_003;

/// The interlock acts by interrupt, whatever a pass does: positions all over one.
const FINE_POSITIONS: u64 = 24;
const FINE_STEP: u64 = 787;

/// How long the outputs are watched after a fault, at the first position and at the others: the plans
/// go on for longer.
const AFTER: u64 = 1000 * MS;
const SHORTLY_AFTER: u64 = 2 * INTERVAL;

/// How a run ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    /// Stopped, with this reason.
    Fault(Fault),
    /// By a reset.
    Reset(ResetCause),
}

/// A fault, and what is promised of it.
#[derive(Clone, Copy)]
struct Case {
    name: &'static str,
    end: End,
    /// Ticks until all outputs are low.
    bound: u64,
    /// Ticks until the dynamic enable rests.
    rest: u64,
    /// An output that the fault itself holds high.
    stuck: Option<Pin>,
    /// How long it is watched after it.
    after: u64,
}

impl Case {
    /// A pass takes the enable back, at most one after the outputs.
    fn fault(name: &'static str, fault: Fault, bound: u64) -> Self {
        Self { name, end: End::Fault(fault), bound, rest: bound + PASS, stuck: None, after: AFTER }
    }

    /// The enable's pin floats after the reset; its level before means nothing, the outputs it is for
    /// need a square wave.
    fn reset(name: &'static str, cause: ResetCause, bound: u64) -> Self {
        let rest = bound.max(WATCHDOG);
        Self { name, end: End::Reset(cause), bound, rest, stuck: None, after: AFTER }
    }

    /// At one of several positions.
    fn at(self, position: u64) -> Self {
        Self { after: if position == 0 { AFTER } else { SHORTLY_AFTER }, ..self }
    }
}

fn switched_on() -> Board {
    let mut session = Session::new(F405::load(&f405_image()).expect("the image can be loaded"));
    session.hello();
    session
}

/// Start a plan and run to so many ticks after the start of its third sweep.
fn third_sweep(mut session: Board, plan: &Plan, after: u64) -> Board {
    session.board.forget_edges();
    session.start(plan);
    let limit = session.board.tick() + 3 * plan.interval;
    while session.board.edges_of(Pin::LASER).filter(|edge| edge.high).count() < 3 {
        session.run_for(5_000);
        assert!(session.board.tick() < limit, "{:?}", session.status());
    }
    let until = rise(&session, Pin::LASER) + after;
    session.run_for(until - session.board.tick());
    session
}

/// The last rising edge of a pin.
fn rise(session: &Board, pin: Pin) -> u64 {
    session.board.edges_of(pin).filter(|edge| edge.high).last().expect("an edge").tick
}

fn outputs() -> [Pin; 3] {
    Channel::ALL.map(f405_pin_of)
}

fn are_on(session: &Board, pins: &[Pin]) -> bool {
    pins.iter().all(|&pin| session.board.level(pin))
}

/// The fault was injected and counts from `since`: run on, and hold the board to its promise. Says how
/// long it took until all outputs were low.
fn watch(session: &mut Board, case: &Case, since: u64) -> u64 {
    let resets = session.board.resets().len();
    session.run_for((since + case.bound + PASS).saturating_sub(session.board.tick()));
    match case.end {
        End::Fault(fault) => assert_stopped(session, case.name, fault),
        End::Reset(cause) => {
            session.run_for((since + case.rest + PASS).saturating_sub(session.board.tick()));
            assert_disarmed(session, cause);
        }
    }
    if let End::Fault(_) = case.end {
        assert_eq!(session.board.resets().len(), resets, "{}: a stop needs no reset", case.name);
    }
    session.run_for(case.after);
    assert_dark(session, case);
    let last = |pins: &[Pin]| {
        let edges = session.board.edges().iter().filter(|edge| pins.contains(&edge.pin));
        edges.map(|edge| edge.tick).max().unwrap_or(0).saturating_sub(since)
    };
    let free: Vec<Pin> = outputs().into_iter().filter(|&pin| Some(pin) != case.stuck).collect();
    let (dark, rests) = (last(&free), last(&[ENABLE]));
    let Case { name, bound, rest, .. } = *case;
    assert!(dark <= bound, "{name}: dark after {dark} of {bound} ticks");
    assert!(rests <= rest, "{name}: enable rests after {rests} of {rest}");
    dark
}

fn assert_stopped(session: &mut Board, name: &str, fault: Fault) {
    assert_eq!(session.status().state, State::Faulted(fault), "{name}");
    // What waits to be told.
    session.run_for(20 * MS);
    let stops = session.events.iter().filter_map(|(_, event)| match event {
        Event::Stopped { fault, .. } => Some(*fault),
        _ => None,
    });
    assert_eq!(stops.collect::<Vec<_>>(), [fault], "{name}: told once, with its reason");
}

/// The board has started anew, says why, and does nothing.
fn assert_disarmed(session: &mut Board, cause: ResetCause) {
    assert_eq!(session.hello().reset, cause);
    let status = session.status();
    assert_eq!((status.state, status.plan), (State::Idle, 0));
    let refused = Reply::Refused(Refusal::State(State::Idle));
    assert_eq!(session.ask(Command::Start), refused);
}

fn assert_dark(session: &Board, case: &Case) {
    for pin in outputs().into_iter().chain([Pin::FRAMES, ENABLE]) {
        let expected = Some(pin) == case.stuck;
        assert_eq!(session.board.level(pin), expected, "{}: {pin}", case.name);
    }
}

/// Inject a fault at several positions in the middle of a sweep. `change` says from which tick on the
/// time counts. The answer is the worst.
fn inject(plan: &Plan, case: Case, change: impl Fn(&mut Board) -> u64) -> u64 {
    inject_at(plan, case, MIDDLE, &outputs(), change)
}

/// The same elsewhere, where these outputs are on.
fn inject_at(
    plan: &Plan,
    case: Case,
    after: u64,
    on: &[Pin],
    change: impl Fn(&mut Board) -> u64,
) -> u64 {
    let outcomes = (0..POSITIONS).map(|position| {
        let case = case.at(position);
        let mut session = third_sweep(switched_on(), plan, after + position * STEP);
        assert!(are_on(&session, on), "{}: it is injected with light on", case.name);
        let since = change(&mut session);
        watch(&mut session, &case, since)
    });
    worst(&case, outcomes)
}

/// The worst of several, told.
fn worst(case: &Case, outcomes: impl Iterator<Item = u64>) -> u64 {
    let worst = outcomes.max().expect("at least one");
    tell(case.name, case.bound, worst);
    worst
}

fn tell(name: &str, bound: u64, measured: u64) {
    let us = |ticks: u64| ticks as f64 * 1000.0 / MS as f64;
    println!(
        "{name} | {bound} ticks, {:.1} us | {measured} ticks, {:.1} us",
        us(bound),
        us(measured)
    );
}

/// A change that counts from now on.
fn at_once(change: impl Fn(&mut F405)) -> impl Fn(&mut Board) -> u64 {
    move |session| {
        let now = session.board.tick();
        change(&mut session.board);
        now
    }
}

/// Send a request; the tick at which its last byte has come.
fn last_byte(session: &mut Board, command: Command<'_>) -> u64 {
    session.say(command);
    let limit = session.board.tick() + 100 * PASS;
    session.board.run_while(limit, |board| board.unsent() > 0);
    assert_eq!(session.board.unsent(), 0, "the request has been sent");
    // The last byte is on the line yet.
    session.board.run_for(Board::BYTE);
    session.board.tick()
}

/// Flip bits of a byte of memory, as a disturbance would.
fn flip(board: &mut F405, address: u32, bits: u8) {
    let value = board.peek(address) ^ bits;
    board.poke(address, value);
}

/// Flip bits of a register.
fn flip_register(board: &mut F405, address: u32, bits: u32) {
    let value = board.register(address) ^ bits;
    board.set_register(address, value);
}

/// Where these bytes are in memory.
fn find(board: &F405, bytes: &[u8]) -> Vec<u32> {
    const MEMORY: std::ops::Range<u32> = 0x2000_a000..0x2002_0000;
    let memory: Vec<u8> = MEMORY.map(|address| board.peek(address)).collect();
    let places = memory.windows(bytes.len()).zip(MEMORY);
    places.filter(|(window, _)| *window == bytes).map(|(_, address)| address).collect()
}

/// Registers of TIM2 and of the core.
const CONTROL: u32 = 0x4000_0000;
const INTERRUPTS: u32 = 0x4000_000c;
const MODES: u32 = 0x4000_0018;
const COUNTER: u32 = 0x4000_0024;
const SYSTICK: u32 = 0xe000_e010;

// ---- the host ------------------------------------------------------------------------------

#[test]
fn aborted() {
    inject(&steady(), Case::fault("abort", Fault::Abort, REQUEST), |session| {
        last_byte(session, Command::Abort)
    });
}

#[test]
fn the_host_falls_silent() {
    let silence = 100 * MS;
    let mut plan = steady();
    plan.caps.heartbeat = silence as u32;
    // The request counts from the pass in which it is taken; its absence is found in a pass.
    let case = Case::fault("heartbeat lost (100 ms)", Fault::Heartbeat, silence + REQUEST);
    let dark = inject(&plan, case, |session| last_byte(session, Command::Status));
    assert!(dark > silence, "not before its time");
}

#[test]
fn a_host_that_speaks_is_no_fault() {
    let mut plan = short(steady(), 12);
    plan.caps.heartbeat = 100 * MS as u32;
    let mut session = switched_on();
    session.start(&plan);
    while session.status().state == State::Running {
        session.run_for(90 * MS);
    }
    assert_eq!(session.status().state, State::Finished);
    assert!(f405_deviations(session.board.edges(), &plan).iter().all(|&ticks| ticks == 0));
}

// ---- the program hangs ---------------------------------------------------------------------

/// The watchdog at the slowest, the nominal and the fastest clock of the data sheet: a pass hangs, the
/// timer's interrupt does, or everything with interrupts off.
#[test]
fn the_program_hangs() {
    const SYSTICK_EXCEPTION: u8 = 15;
    const TIMER_EXCEPTION: u8 = 16 + 28;
    let hangs = [
        ("a pass hangs", Hang::Handler(SYSTICK_EXCEPTION)),
        ("the timer's interrupt hangs", Hang::Handler(TIMER_EXCEPTION)),
        ("all hangs, interrupts off", Hang::Deaf),
    ];
    for per_mille in [530, 1000, 1470] {
        for (name, hang) in hangs {
            let case = Case::reset(name, ResetCause::Watchdog, watchdog(per_mille));
            let outcomes = [0, 1].map(|position| {
                let after = MIDDLE + position * STEP;
                let mut session = switched_on();
                session.board.set_watchdog_tolerance(per_mille as f64 / 1000.0);
                let mut session = third_sweep(session, &steady(), after);
                session.board.hang(hang).expect("the program can be made to hang");
                assert!(session.board.level(Pin::STIMULUS), "{name}: with light on");
                let since = session.board.tick();
                session.run_for(watchdog(per_mille));
                // It restarts meanwhile, and none of its pins moves.
                let changes = session.board.edges_of(ENABLE).filter(|edge| edge.tick > since + 2);
                assert!(changes.count() <= 1, "no leave for light while the program hangs");
                watch(&mut session, &case.at(1), since)
            });
            let dark = worst(&case, outcomes.into_iter());
            // It was fed in a pass.
            assert!(dark + PASS > case.bound, "{name}: after {dark}");
        }
    }
}

#[test]
fn a_solver_that_hangs_moves_no_edge() {
    let plan = short(flicker(LED_PULSE), 10);
    let mut session = third_sweep(switched_on(), &plan, MIDDLE);
    session.board.hang(Hang::Main).expect("the program can be made to hang");
    assert_eq!(session.finish(1000 * MS).state, State::Finished);
    assert_eq!(session.made().len(), planned_on(&LIMITS, &plan).len());
    assert_eq!(session.board.resets(), []);
}

/// No pass is begun any more, and so no enable and no food for the watchdog.
#[test]
fn passes_stop() {
    // The one that is being made comes to its end.
    let case = Case::reset("SysTick stops", ResetCause::Watchdog, watchdog(1000) + PASS);
    inject(&steady(), case, at_once(|board| board.set_register(SYSTICK, 0)));
}

/// An instruction that is none, in the solver's loop and in a pass: the handler of the fault makes the
/// outputs low, the watchdog starts the board anew.
#[test]
fn the_program_runs_astray() {
    /// Erased flash.
    const NOWHERE: u32 = 0x080f_0000;
    for (name, in_pass) in [("the solver runs astray", false), ("a pass runs astray", true)] {
        let case = Case::reset(name, ResetCause::Watchdog, INTERRUPT);
        inject(&steady(), case, |session| {
            let limit = session.board.tick() + PASS;
            let is_there = |board: &F405| (board.core().psr.ipsr() == 15) == in_pass;
            session.board.run_while(limit, |board| !is_there(board));
            at_once(|board| {
                let _ = board.set_pc(NOWHERE);
            })(session)
        });
    }
}

/// The stack lies at the lower end of memory: below it there is nothing.
#[test]
fn the_stack_overflows() {
    let case = Case::reset("the stack overflows", ResetCause::Watchdog, PASS);
    inject(&steady(), case, |session| {
        let limit = session.board.tick() + PASS;
        // Where the solver runs; the next pass needs more than what is left.
        session.board.run_while(limit, |board| board.core().psr.ipsr() != 0);
        at_once(|board| {
            let end = board.symbol("_stack_end").expect("the linker says where it ends");
            board.set_stack(end + 16);
        })(session)
    });
}

// ---- the interlock -------------------------------------------------------------------------

/// As `inject`, at more positions and two speeds of the processor, with light that flickers.
fn inject_fine(case: Case, change: impl Fn(&mut Board) -> u64) {
    let mut plan = flicker(LED_PULSE);
    if let Some(light) = &mut plan.stimulus {
        (light.on, light.period, light.pulses) = (MS, 2 * MS as u32, 4_000);
    }
    for cycles_per_instruction in 1..=2 {
        let outcomes = (0..FINE_POSITIONS).map(|position| {
            let case = Case { after: if position == 0 { AFTER } else { INTERVAL }, ..case };
            let mut session = switched_on();
            session.board.set_cycles_per_instruction(cycles_per_instruction);
            let mut session = third_sweep(session, &plan, MIDDLE + position * FINE_STEP);
            assert!(are_on(&session, &[Pin::LASER, Pin::CAMERA]));
            let since = change(&mut session);
            watch(&mut session, &case, since)
        });
        worst(&case, outcomes);
    }
}

#[test]
fn the_interlock_opens() {
    let case = Case::fault("interlock opens", Fault::Interlock, INTERRUPT);
    inject_fine(case, at_once(|board| board.drive(Pin::INTERLOCK, true)));
}

#[test]
fn the_interlock_opens_for_a_moment() {
    let case = Case::fault("interlock opens for 10 us", Fault::Interlock, INTERRUPT);
    let change = at_once(|board| {
        let now = board.tick();
        board.drive_at(now, Pin::INTERLOCK, true);
        board.drive_at(now + 840, Pin::INTERLOCK, false);
    });
    inject_fine(case, change);
}

#[test]
fn the_interlock_opens_while_a_pass_hangs() {
    let name = "interlock opens while a pass hangs";
    // The outputs are dark by interrupt; the board comes back by the watchdog.
    let case = Case::reset(name, ResetCause::Watchdog, INTERRUPT);
    inject(&steady(), case, |session| {
        session.board.hang(Hang::Handler(15)).expect("the program can be made to hang");
        session.run_for(5_000);
        at_once(|board| board.drive(Pin::INTERLOCK, true))(session)
    });
}

#[test]
fn the_interlock_opens_while_the_solver_works() {
    let case = Case::fault("interlock opens, solver busy", Fault::Interlock, INTERRUPT);
    let outcomes = (0..POSITIONS).map(|position| {
        let mut session = switched_on();
        begin_series(&mut session);
        let mut session = third_sweep(session, &steady(), MIDDLE);
        for number in 0..3 {
            send_volume(&mut session, 0.02 * f64::from(number));
            session.run_for(10 * MS);
        }
        // A full window takes three milliseconds, three volumes a part of it.
        send_volume(&mut session, 0.0);
        session.run_for(500 * position);
        assert!(session.board.level(Pin::STIMULUS));
        let since = at_once(|board| board.drive(Pin::INTERLOCK, true))(&mut session);
        watch(&mut session, &case.at(position), since)
    });
    worst(&case, outcomes);
}

/// The safety loop runs from PC1 to PC0.
fn pulsed() -> (Plan, Board) {
    let mut plan = steady();
    plan.inputs.interlock = Interlock::Pulsed;
    let mut session = switched_on();
    session.board.release(Pin::INTERLOCK);
    session.board.connect(Pin::LOOP_END, Pin::INTERLOCK);
    (plan, session)
}

fn inject_pulsed(case: Case, change: impl Fn(&mut Board) -> u64) {
    let outcomes = (0..POSITIONS).map(|position| {
        let case = case.at(position);
        let (plan, session) = pulsed();
        // Each in another sweep: the loop is pulsed in every other.
        let after = MIDDLE + position * (INTERVAL + STEP);
        let mut session = third_sweep(session, &plan, after);
        assert!(are_on(&session, &outputs()));
        let since = change(&mut session);
        watch(&mut session, &case, since)
    });
    worst(&case, outcomes);
}

#[test]
fn the_interlock_input_is_stuck_at_closed() {
    let name = "interlock input stuck at closed";
    let case = Case::fault(name, Fault::InterlockStuck, LOOP_TEST);
    inject_pulsed(case, at_once(|board| board.stick(Pin::INTERLOCK, false)));
}

#[test]
fn the_pulsed_interlock_opens() {
    let case = Case::fault("pulsed interlock opens", Fault::Interlock, INTERRUPT);
    inject_pulsed(case, at_once(|board| board.disconnect(Pin::INTERLOCK)));
}

#[test]
fn the_pulses_of_the_interlock_are_no_fault() {
    let (plan, mut session) = pulsed();
    let plan = short(plan, 20);
    session.start(&plan);
    assert_eq!(session.finish(2000 * MS).state, State::Finished);
    assert!(f405_deviations(session.board.edges(), &plan).iter().all(|&ticks| ticks == 0));
    let pulses = session.board.edges_of(Pin::LOOP_END).filter(|edge| edge.high).count();
    assert!(pulses >= 30, "pulsed {pulses} times in 0.8 s");
}

// ---- the camera ----------------------------------------------------------------------------

/// Until the next sweep is looked at: the one that runs goes on as planned.
fn next_looked_at(session: &Board) -> u64 {
    rise(session, Pin::LASER) + INTERVAL - NEAR
}

#[test]
fn the_camera_is_not_ready() {
    let name = "camera not ready, from the look before the next sweep on";
    let case = Case::fault(name, Fault::NotReady, 2 * PASS);
    inject(&steady(), case, |session| {
        session.board.drive(Pin::READY, false);
        next_looked_at(session)
    });
}

// ---- outputs -------------------------------------------------------------------------------

#[test]
fn an_output_is_stuck_at_low() {
    let cases = [
        ("laser stuck low", Pin::LASER),
        ("camera stuck low", Pin::CAMERA),
        ("LED stuck low", Pin::STIMULUS),
    ];
    for (name, pin) in cases {
        let case = Case::fault(name, Fault::ReadBack, PASS);
        inject(&steady(), case, at_once(|board| board.stick(pin, false)));
    }
}

/// While it should be low: found by a pass.
#[test]
fn an_output_is_stuck_at_high() {
    let (laser, camera, led) = (Pin::LASER, Pin::CAMERA, Pin::STIMULUS);
    let cases = [
        ("laser stuck high", steady(), laser, LASER_PULSE, vec![led]),
        ("camera stuck high", steady(), camera, CAMERA_PULSE, vec![led, laser]),
        ("LED stuck high", flicker(LED_PULSE), led, LED_PULSE, vec![laser, camera]),
    ];
    for (name, plan, pin, end, on) in cases {
        let case = Case { stuck: Some(pin), ..Case::fault(name, Fault::ReadBack, PASS) };
        // A little after its falling edge.
        inject_at(&plan, case, end + 2_000, &on, at_once(|board| board.stick(pin, true)));
    }
}

/// While it is high: found by the interrupt of its falling edge.
#[test]
fn an_output_does_not_fall() {
    let cases = [
        ("laser does not fall", steady(), Pin::LASER, LASER_PULSE),
        ("camera does not fall", steady(), Pin::CAMERA, CAMERA_PULSE),
        ("LED does not fall", flicker(LED_PULSE), Pin::STIMULUS, LED_PULSE),
    ];
    for (name, plan, pin, width) in cases {
        let case = Case { stuck: Some(pin), ..Case::fault(name, Fault::ReadBack, INTERRUPT) };
        inject(&plan, case, |session| {
            session.board.stick(pin, true);
            rise(session, pin) + width
        });
    }
}

/// The compare output sets where it was to clear: two flipped bits of its mode.
#[test]
fn an_output_is_set_where_it_was_to_be_cleared() {
    let case = Case::fault("laser set at its falling edge", Fault::ReadBack, INTERRUPT);
    // When the falling edge is armed.
    inject_at(&steady(), case, LASER_PULSE - 80_000, &[Pin::STIMULUS, Pin::LASER], |session| {
        flip_register(&mut session.board, MODES, 0b011 << 4);
        rise(session, Pin::LASER) + LASER_PULSE
    });
}

/// And the interrupt that would read it back is off: then a pass finds it.
#[test]
fn an_output_stays_high_and_its_interrupt_is_lost() {
    let case = Case::fault("laser stays on, interrupt lost", Fault::ReadBack, PASS);
    inject_at(&steady(), case, LASER_PULSE - 80_000, &[Pin::STIMULUS, Pin::LASER], |session| {
        flip_register(&mut session.board, MODES, 0b011 << 4);
        session.board.set_register(INTERRUPTS, 0);
        rise(session, Pin::LASER) + LASER_PULSE
    });
}

/// Passes do what the timer's interrupt does, only later: no edge of sweeps this long moves.
#[test]
fn the_timers_interrupts_are_lost() {
    let plan = short(flicker(LED_PULSE), 10);
    let mut session = switched_on();
    session.start(&plan);
    session.run_for(100 * MS);
    session.board.set_register(INTERRUPTS, 0);
    assert_eq!(session.finish(1000 * MS).state, State::Finished);
    assert!(f405_deviations(session.board.edges(), &plan).iter().all(|&ticks| ticks == 0));
}

/// A falling edge that waits to be armed becomes a rising one, by one flipped bit. The pin does what
/// memory says, so that reading it back finds nothing; but edges alternate.
#[test]
fn a_falling_edge_becomes_a_rising_one_in_memory() {
    let width = 30_000;
    let mut plan = steady();
    plan.laser.width = width;
    let name = "laser's falling edge made a rise in memory";
    let case = Case::fault(name, Fault::ReadBack, INTERRUPT);
    // While the edges of the fourth sweep wait.
    inject_at(&plan, case, INTERVAL - 200_000, &[Pin::STIMULUS], |session| {
        let end = 3 * INTERVAL + u64::from(width);
        make_a_rise(session, session.started() + end);
        rise(session, Pin::LASER) + INTERVAL + u64::from(width)
    });
}

/// Make the edge a rise that waits for this tick among the variables shared with interrupts: its level
/// follows its tick.
fn make_a_rise(session: &mut Board, tick: u64) {
    let near = symbol(&session.board, "near4NEAR");
    let mut places = find(&session.board, &(tick as u32).to_le_bytes());
    places.retain(|place| (near..near + 200).contains(place));
    let [place] = places[..] else { panic!("the edge waits at {places:x?}") };
    assert_eq!(session.board.peek(place + 4), 0, "it falls");
    flip(&mut session.board, place + 4, 1);
}

/// Address of the variable whose mangled name holds this.
fn symbol(board: &F405, name: &str) -> u32 {
    let mut symbols = board.image().symbols().filter(|(mangled, _)| mangled.contains(name));
    symbols.next().expect("it is in the image").1
}

// ---- on-time -------------------------------------------------------------------------------

/// Laser and LED are on for longer than they may: the caps that passes look at are made smaller, for a
/// missing falling edge is found by reading it back.
#[test]
fn an_output_stays_on() {
    const CAP: u64 = 300_000;
    let mut plan = flicker(LED_PULSE);
    (plan.caps.laser_pulse, plan.caps.stimulus_pulse) = (812_345, 623_456);
    let lower = |board: &mut F405, cap: &[u8]| {
        let places = find(board, cap);
        assert!(!places.is_empty(), "the cap is in memory");
        for place in places {
            (0..4).for_each(|at| board.poke(place + at, CAP.to_le_bytes()[at as usize]));
        }
    };
    let case = Case::fault("laser on for longer than its cap", Fault::LaserCap, CAP + PASS);
    inject(&plan, case, |session| {
        lower(&mut session.board, &812_345_u32.to_le_bytes());
        rise(session, Pin::LASER)
    });
    let case = Case::fault("LED on for longer than its cap", Fault::StimulusCap, CAP + PASS);
    inject(&plan, case, |session| {
        lower(&mut session.board, &623_456_u64.to_le_bytes());
        rise(session, Pin::STIMULUS)
    });
}

// ---- time ----------------------------------------------------------------------------------

/// Sweeps of 10 us every 20 us: the rehearsal refuses them, and the board, told to go ahead all the
/// same, stops rather than shift an edge.
#[test]
fn a_plan_too_dense() {
    let mut plan = steady();
    (plan.bursts, plan.interval) = (2_000, 1_700);
    (plan.laser.width, plan.camera.width) = (840, 840);
    plan.stimulus = None;
    plan.caps.camera_images = 2_000 * 512;
    assert_eq!(
        rehearse(&LIMITS, &Compiled::new(&plan).expect("it fits"), |_| {}),
        Err(Fault::Late)
    );
    // From the edge on that could not be made.
    let case = Case::fault("plan too dense", Fault::Late, PASS);
    let outcomes = (0..POSITIONS).map(|position| {
        let mut session = switched_on();
        session.arm(&plan);
        session.run_for(position * STEP);
        session.begin();
        session.run_for(50 * MS);
        let since = first_missing(&session, &plan);
        watch(&mut session, &case.at(position), since)
    });
    worst(&case, outcomes);
}

/// The tick at which the first edge was due that was not made; all before are on plan.
fn first_missing(session: &Board, plan: &Plan) -> u64 {
    let zero = session.board.edges_of(Pin::LASER).next().expect("an edge").tick;
    let due = |high: bool, sweep: u64| zero + sweep * plan.interval + if high { 0 } else { 840 };
    let edges = (0..u64::from(plan.bursts)).flat_map(|sweep| [(true, sweep), (false, sweep)]);
    let planned: Vec<(u64, bool)> = edges.map(|(high, sweep)| (due(high, sweep), high)).collect();
    let first_of = |pin: Pin| {
        let made: Vec<_> = session.board.edges_of(pin).map(|edge| (edge.tick, edge.high)).collect();
        let on_plan =
            made.iter().zip(&planned).take_while(|(made, planned)| made == planned).count();
        // The last is that of the stop, if the output was high.
        assert!(on_plan + 1 >= made.len(), "{pin}: {on_plan} of {} edges on plan", made.len());
        planned[on_plan].0
    };
    first_of(Pin::LASER).min(first_of(Pin::CAMERA))
}

#[test]
fn the_clock_stands_still_or_jumps() {
    let case = Case::fault("clock stands still", Fault::Clock, CLOCK_STANDS);
    inject(&steady(), case, at_once(|board| flip_register(board, CONTROL, 1)));
    let case = Case::fault("clock jumps forwards", Fault::Clock, PASS);
    inject(&short(steady(), 50), case, |session| {
        let now = session.board.tick();
        // Between two edges; what is due is not missed.
        let count = session.board.register(COUNTER);
        session.board.set_register(COUNTER, count + 200_000);
        now
    });
}

// ---- memory --------------------------------------------------------------------------------

#[test]
fn the_plan_in_memory_changes() {
    let plan = steady();
    let compiled = Compiled::new(&plan).expect("it fits");
    let bytes = compiled.bytes();
    let case = Case::fault(
        "plan memory changed, from the look before the next sweep on",
        Fault::PlanMemory,
        PASS,
    );
    inject(&plan, case, |session| {
        let places = find(&session.board, bytes);
        assert!(!places.is_empty(), "the plan is in memory");
        // Another bit at each position.
        let bit = session.board.tick() as usize % (8 * bytes.len());
        for place in places {
            flip(&mut session.board, place + (bit / 8) as u32, 1 << (bit % 8));
        }
        next_looked_at(session)
    });
}

#[test]
fn the_stack_reaches_its_end() {
    // The canary's first byte, and the last: which the stack reaches first.
    for (name, offset) in [("stack canary, first byte", 0), ("stack canary, last byte", 31)] {
        let case = Case::fault(name, Fault::Stack, PASS);
        inject(&steady(), case, at_once(|board| disturb_canary(board, offset)));
    }
}

fn disturb_canary(board: &mut F405, offset: u32) {
    let end = board.symbol("_stack_end").expect("the linker says where the stack ends");
    flip(board, end + offset, 0xff);
}

// ---- the phase -----------------------------------------------------------------------------

fn begin_series(session: &mut Board) {
    let series = Command::Series { speckles: SPECKLES as u16, looks: 64.0_f32.to_bits() };
    assert_eq!(session.ask(series), Reply::Done);
}

/// A volume of this phase; says when its last byte was there.
fn send_volume(session: &mut Board, phase: f64) -> u64 {
    let speckle = |number: usize| Complex::from_polar(1.0, phase + 0.1 * number as f64);
    let volume: Vec<Complex<f64>> = (0..SPECKLES).map(speckle).collect();
    let mut last = 0;
    for (part, speckles) in volume.chunks(SPECKLES_PER_REQUEST).enumerate() {
        let bits = |z: &Complex<f64>| [(z.re as f32).to_le_bytes(), (z.im as f32).to_le_bytes()];
        let bytes: Vec<u8> = speckles.iter().flat_map(|z| bits(z).concat()).collect();
        let first = (part * SPECKLES_PER_REQUEST) as u16;
        last = last_byte(session, Command::Samples { first, bytes: &bytes });
        session.run_for(MS);
    }
    last
}

/// The phase of volume `number`: still, then it runs away.
fn runaway(number: u32) -> f64 {
    if number < 8 { 0.01 * f64::from(number) } else { 0.4 * f64::from(number - 7) }
}

/// Run with a limit of 1 rad; says when the last byte of the volume was there that crossed it.
fn run_away(action: Action) -> (Board, u64) {
    let mut plan = steady();
    plan.phase_limit = Some(PhaseLimit { milliradians: 1_000, silence: 0, action });
    let mut session = switched_on();
    begin_series(&mut session);
    // A full window is what takes the solver longest.
    for _ in 0..LAGS {
        send_volume(&mut session, runaway(0));
        session.run_for(SOLVED);
    }
    let mut session = third_sweep(session, &plan, MIDDLE);
    for number in 0..20 {
        assert!(!session.board.level(PHASE), "not before its time");
        assert!(session.board.level(Pin::STIMULUS));
        let last = send_volume(&mut session, runaway(number));
        session.run_for(SOLVED);
        if runaway(number) > 1.1 {
            return (session, last);
        }
    }
    unreachable!("the phase runs away");
}

/// A volume is solved in three milliseconds of its own, in six at two cycles per instruction; its request and
/// what follows take passes.
const SOLVED: u64 = REQUEST + 10 * MS + PASS;

fn assert_crossed(session: &Board, last: u64) {
    assert!(session.board.level(PHASE));
    let line = rise(session, PHASE) - last;
    tell("phase line", SOLVED, line);
    assert!(line <= SOLVED, "after {line} ticks");
}

fn crossings(session: &Board) -> usize {
    let crossed = |(_, event): &&(u16, Event)| matches!(event, Event::Crossed { .. });
    session.events.iter().filter(crossed).count()
}

#[test]
fn a_phase_beyond_its_limit_ends_the_run() {
    let (mut session, last) = run_away(Action::Stop);
    assert_crossed(&session, last);
    let case = Case::fault("phase beyond its limit", Fault::Phase, SOLVED);
    let dark = watch(&mut session, &case, last);
    tell(case.name, case.bound, dark);
}

#[test]
fn a_phase_beyond_its_limit_takes_the_stimulus_away() {
    let (mut session, last) = run_away(Action::Stimulus);
    assert_crossed(&session, last);
    let fall = session.board.edges_of(Pin::STIMULUS).last().expect("it fell");
    assert!(!fall.high && fall.tick - rise(&session, PHASE) < PASS);
    // Volumes go on, and no light comes back, whatever the phase does.
    send_volume(&mut session, 0.0);
    session.run_for(500 * MS);
    assert!(!session.board.level(Pin::STIMULUS));
    assert_eq!(session.board.edges_of(Pin::STIMULUS).last(), Some(fall));
    assert_eq!((session.status().state, crossings(&session)), (State::Running, 1));
    assert!(rise(&session, Pin::LASER) > session.board.tick() - 2 * INTERVAL);
}

#[test]
fn a_phase_beyond_its_limit_raises_the_line_only() {
    let (mut session, last) = run_away(Action::Line);
    assert_crossed(&session, last);
    session.run_for(500 * MS);
    assert!(are_on(&session, &[PHASE, Pin::STIMULUS]), "all goes on");
    assert_eq!((session.status().state, crossings(&session)), (State::Running, 1));
}

/// Nothing to solve, whether the host sends nothing or the solver hangs.
#[test]
fn the_solver_falls_silent() {
    let silence = 150 * MS;
    let mut plan = steady();
    let action = Action::Line;
    plan.phase_limit = Some(PhaseLimit { milliradians: 1_000, silence: silence as u32, action });
    for hangs in [false, true] {
        let mut session = switched_on();
        begin_series(&mut session);
        let mut session = third_sweep(session, &plan, MIDDLE);
        let last = send_volume(&mut session, 0.0);
        if hangs {
            session.run_for(4 * MS);
            session.board.hang(Hang::Main).expect("the program can be made to hang");
            send_volume(&mut session, 0.0);
        }
        let bound = silence + SOLVED;
        let case = Case::fault("no phase (150 ms)", Fault::NoPhase, bound);
        let dark = watch(&mut session, &case, last);
        tell(case.name, bound, dark);
        assert!(dark > silence, "not before its time");
    }
}

// ---- resets --------------------------------------------------------------------------------

#[test]
fn the_board_is_reset() {
    let cases = [
        ("power-on", Reset::PowerOn, ResetCause::PowerOn),
        ("brown-out", Reset::BrownOut, ResetCause::BrownOut),
        ("external reset", Reset::External, ResetCause::External),
    ];
    let mut slowest = 0;
    for (name, reset, cause) in cases {
        // Pins are inputs from the reset's own cycle on, low by the wiring's pull-downs.
        for position in 0..POSITIONS {
            let mut session = third_sweep(switched_on(), &steady(), MIDDLE + position * STEP);
            assert!(are_on(&session, &outputs()));
            let since = session.board.tick();
            session.board.reset(reset);
            slowest = slowest.max(until_driven(&mut session.board));
            watch(&mut session, &Case::reset(name, cause, 0).at(position), since);
        }
        tell(name, 0, 0);
    }
    tell("outputs driven low after a reset", DRIVEN, slowest);
}

/// Outputs of light, and those of port C.
fn driven() -> [Pin; 7] {
    let [laser, camera, led] = outputs();
    [laser, camera, led, Pin::FRAMES, Pin::LOOP_END, ENABLE, PHASE]
}

/// Ticks until all outputs are driven low rather than pulled. Pulled up instead, none is ever driven
/// high.
fn until_driven(board: &mut F405) -> u64 {
    let reset = board.tick();
    board.run_while(reset + DRIVEN, |board| driven().iter().any(|&pin| !board.is_driven(pin)));
    assert!(driven().iter().all(|&pin| board.is_driven(pin) && !board.level(pin)));
    board.tick() - reset
}

#[test]
fn no_wire_moves_at_the_start() {
    let mut board = F405::load(&f405_image()).expect("the image can be loaded");
    until_driven(&mut board);
    board.run_for(50 * MS);
    let moved = |pin: &Pin| board.edges_of(*pin).next().is_some();
    assert!(!driven().iter().any(moved), "{:?}", board.edges());

    // Wires that something else pulls up fall with the first instructions.
    let mut board = F405::load(&f405_image()).expect("the image can be loaded");
    driven().iter().for_each(|&pin| board.drive(pin, true));
    until_driven(&mut board);
    let falls = |pin: &Pin| board.edges_of(*pin).count() == 2 && !board.level(*pin);
    assert!(driven().iter().all(falls), "{:?}", board.edges());
}

/// Wires that something else pulls up stay low from the start on, run or no run.
#[test]
fn the_board_never_lets_go_of_its_outputs() {
    let mut board = F405::load(&f405_image()).expect("the image can be loaded");
    until_driven(&mut board);
    board.run_while(50 * MS, |board| driven().iter().all(|&pin| board.is_driven(pin)));
    let floating: Vec<Pin> = driven().into_iter().filter(|&pin| !board.is_driven(pin)).collect();
    assert!(floating.is_empty(), "{floating:?} from the tick {} on", board.tick());
}

#[test]
fn another_chip_has_no_outputs() {
    let mut board = F405::load(&f405_image()).expect("the image can be loaded");
    board.set_identity(0);
    let mut session = Session::new(board);
    assert_eq!(session.hello().model, Model::Rehearsal);
    let mut plan = short(flicker(LED_PULSE), 4);
    plan.interval = 10 * MS;
    plan.frame = 1_400;
    plan.camera.width = 512 * 1_400;
    if let Some(light) = &mut plan.stimulus {
        light.period = 10 * MS as u32;
    }
    session.start(&plan);
    // Its clock is that of another chip.
    let state = session.finish(2000 * MS).state;
    assert_eq!(state, State::Finished);
    assert_eq!(session.made().len(), planned_on(&LIMITS, &plan).len(), "it rehearses");
    let moved = |pin: &Pin| session.board.edges_of(*pin).next().is_some();
    assert!(![Pin::LASER, Pin::CAMERA, Pin::STIMULUS, Pin::FRAMES].iter().any(moved));

    // The family's first revision says by mistake that it is an STM32F2.
    for (identity, model) in [(IDENTITY, Model::F405), (0x1000_6411, Model::Rehearsal)] {
        let mut board = F405::load(&f405_image()).expect("the image can be loaded");
        board.set_identity(identity);
        assert_eq!(Session::new(board).hello().model, model);
    }
}

// ---- before and after ----------------------------------------------------------------------

/// What would end a run is found before it, and nothing is armed.
#[test]
fn no_run_begins_with_a_fault() {
    type Change = fn(&mut F405);
    let cases: [(Change, Fault); 8] = [
        (|board| board.stick(Pin::INTERLOCK, false), Fault::InterlockStuck),
        (|board| board.disconnect(Pin::INTERLOCK), Fault::Interlock),
        (|board| board.drive(Pin::READY, false), Fault::NotReady),
        (|board| board.release(Pin::READY), Fault::NotReady),
        (|board| board.stick(Pin::LASER, true), Fault::ReadBack),
        (|board| board.stick(Pin::CAMERA, true), Fault::ReadBack),
        (|board| board.stick(Pin::STIMULUS, true), Fault::ReadBack),
        (|board| disturb_canary(board, 0), Fault::Stack),
    ];
    for (change, fault) in cases {
        let (plan, mut session) = pulsed();
        let compiled = Compiled::new(&plan).expect("it fits");
        let hash = compiled.hash();
        assert_eq!(session.ask(Command::Upload(compiled.bytes())), Reply::Hash(hash));
        assert_eq!(session.ask(Command::Commit(hash)), Reply::Hash(hash));
        change(&mut session.board);
        let refused = Reply::Refused(Refusal::Unsafe(fault));
        assert_eq!(session.ask(Command::Arm(hash)), refused, "{fault:?}");
        assert_ne!(session.status().state, State::Armed);
    }
}

/// A fault is to be seen before anything else runs; then the next run is as any.
#[test]
fn after_a_fault_the_next_run_is_as_any() {
    let mut session = third_sweep(switched_on(), &steady(), MIDDLE);
    session.board.drive(Pin::INTERLOCK, true);
    session.run_for(10 * MS);
    let faulted = State::Faulted(Fault::Interlock);
    let hash = Compiled::new(&steady()).expect("it fits").hash();
    assert_eq!(session.ask(Command::Arm(hash)), Reply::Refused(Refusal::State(faulted)));
    assert_eq!(session.ask(Command::Clear), Reply::Done);
    let open = Reply::Refused(Refusal::Unsafe(Fault::Interlock));
    assert_eq!(session.ask(Command::Arm(hash)), open);

    session.board.drive(Pin::INTERLOCK, false);
    session.board.forget_edges();
    session.events.clear();
    let plan = short(flicker(LED_PULSE), 10);
    session.start(&plan);
    assert_eq!(session.finish(2000 * MS).state, State::Finished);
    assert!(f405_deviations(session.board.edges(), &plan).iter().all(|&ticks| ticks == 0));
    assert_eq!(session.made().len(), planned_on(&LIMITS, &plan).len());
}
