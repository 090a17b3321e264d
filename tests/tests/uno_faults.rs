//! Every fault, injected into the very image that is flashed in the middle of a sweep, with laser,
//! camera and stimulus on: all outputs low in time and for good, with the reason.
//!
//! The image is the one that `cargo xtask firmware` leaves. Each test prints lines
//! `fault | bound | measured`, the worst of several positions against main loop and timers.

use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::fault::{Fault, ResetCause};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{Command, Event, Refusal, Reply, State};
use phasewalk_firmware::plan::{Interlock, Plan, Pulse, Stimulus};
use phasewalk_firmware::rehearsal::rehearse;
use phasewalk_tests::board::{CLOCK, Pin, Reset, Uno};
use phasewalk_tests::session::{MS, SECOND, Session, deviations, image, paper, pin_of, planned};

// ---- bounds, in cycles ---------------------------------------------------------------------

/// What the main loop finds: a pass of it is at most this long.
const PASS: u64 = Limits::UNO.pass as u64;

/// What an interrupt finds: no interrupt waits and works longer, which is what the timing of the
/// edges is built on.
const INTERRUPT: u64 = Limits::UNO.interrupt as u64;

/// A request: a byte that has just missed its pass is taken in the next, and served there.
const REQUEST: u64 = 2 * PASS;

/// The interrupt of the clock is missed after 8 passes, and found in the pass after.
const CLOCK_LOST: u64 = 9 * PASS;

/// The safety loop is pulsed every 100 passes' worth of ticks, in a pass.
const LOOP_TEST: u64 = 101 * PASS;

/// An edge whose interrupt is missing is taken for one just made for so long, and missed in a pass.
const MATCH_LOST: u64 = 0x1_0000 - Limits::UNO.reach as u64 + PASS;

/// A sweep is looked at so long before it starts: the plan in one pass, READY in the next.
const NEAR: u64 = Limits::UNO.reach as u64 + 3 * PASS;

/// Periods of the watchdog's oscillator, of nominally 128 kHz, until it resets.
const WATCHDOG_PERIODS: u64 = 16_384;
const WATCHDOG_HZ: u64 = 128_000;

/// How long the watchdog takes at so many per mille of its nominal clock.
const fn watchdog(per_mille: u64) -> u64 {
    WATCHDOG_PERIODS * CLOCK * 1000 / (WATCHDOG_HZ * per_mille)
}

/// The slowest oscillator of the data sheet, 10 % below.
const WATCHDOG: u64 = watchdog(900);

/// From a reset until the outputs are driven low, not only pulled: the first instructions.
const DRIVEN: u64 = 30;

// ---- plans ---------------------------------------------------------------------------------

/// From the start of a sweep to its middle: all outputs on.
const MIDDLE: u64 = 20_000;
const LED_PULSE: u64 = 80_000;
const CAMERA_PULSE: u64 = 100_000;
const LASER_PULSE: u64 = 136_533;
const LASER_CAP: u64 = 160_000;
const INTERVAL: u64 = 40 * MS;

/// A hundred sweeps of the paper's length; the camera's trigger is long, so that all outputs can be
/// met on, and the stimulus stays on.
fn steady() -> Plan {
    let mut plan = paper();
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

// ---- injection -----------------------------------------------------------------------------

/// Positions of the injection, and the cycles from one to the next: prime, so that main loop and
/// timers are met at different places, and in all less than the rest of the camera's pulse.
const POSITIONS: u64 = 8;
const STEP: u64 = 1_009;

/// The interlock acts by interrupt, wherever the main loop is: positions all over a pass of it, some
/// in each of its steps.
const FINE_POSITIONS: u64 = 200;
const FINE_STEP: u64 = 97;

/// How long the outputs are watched after a fault, at the first position and at the others: the plans
/// go on for longer.
const AFTER: u64 = 2 * SECOND;
const SHORTLY_AFTER: u64 = 3 * INTERVAL;

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
    /// Cycles until all outputs are low.
    bound: u64,
    /// Cycles until the dynamic enable rests.
    rest: u64,
    /// An output that the fault itself holds high.
    stuck: Option<Pin>,
    /// How long it is watched after it.
    after: u64,
}

impl Case {
    /// The main loop takes the enable back, at most a pass after the outputs.
    fn fault(name: &'static str, fault: Fault, bound: u64) -> Self {
        Self { name, end: End::Fault(fault), bound, rest: bound + PASS, stuck: None, after: AFTER }
    }

    fn reset(name: &'static str, cause: ResetCause, bound: u64) -> Self {
        Self { name, end: End::Reset(cause), bound, rest: bound, stuck: None, after: AFTER }
    }

    /// At one of several positions.
    fn at(self, position: u64) -> Self {
        Self { after: if position == 0 { AFTER } else { SHORTLY_AFTER }, ..self }
    }
}

/// What came of an injection, in cycles.
#[derive(Clone, Copy)]
struct Outcome {
    /// Until all outputs were low.
    dark: u64,
    /// Until the dynamic enable rested.
    rest: u64,
}

fn switched_on() -> Session<Uno> {
    let mut session = Session::new(Uno::load(&image()).expect("the image can be loaded"));
    session.hello();
    session
}

/// Start a plan and run to so many cycles after the start of its third sweep.
fn third_sweep(mut session: Session<Uno>, plan: &Plan, after: u64) -> Session<Uno> {
    session.start(plan);
    session.board.forget_edges();
    while session.board.edges_of(Pin::D9).filter(|edge| edge.level).count() < 3 {
        session.run_for(1_000);
    }
    let until = rise(&session, Pin::D9) + after;
    session.run_for(until - session.board.cycle());
    session
}

/// The last rising edge of a pin.
fn rise(session: &Session<Uno>, pin: Pin) -> u64 {
    session.board.edges_of(pin).filter(|edge| edge.level).last().expect("an edge").cycle
}

fn outputs() -> [Pin; 3] {
    Channel::ALL.map(pin_of)
}

fn are_on(session: &Session<Uno>, pins: &[Pin]) -> bool {
    pins.iter().all(|&pin| session.board.level(pin))
}

/// The fault was injected and counts from `since`: run on, and hold the board to its promise.
fn watch(session: &mut Session<Uno>, case: &Case, since: u64) -> Outcome {
    let resets = session.board.resets();
    session.run_for((since + case.bound + PASS).saturating_sub(session.board.cycle()));
    match case.end {
        End::Fault(fault) => assert_stopped(session, fault),
        End::Reset(cause) => assert_disarmed(session, cause),
    }
    let during = session.board.resets() - resets;
    session.run_for(case.after);
    if let End::Fault(_) = case.end {
        assert_eq!(during, 0, "{}: a stop needs no reset", case.name);
    }
    assert_dark(session, case);
    let last = |pins: &[Pin]| {
        let edges = session.board.edges().iter().filter(|edge| pins.contains(&edge.pin));
        edges.map(|edge| edge.cycle).max().unwrap_or(0).saturating_sub(since)
    };
    let free: Vec<Pin> = outputs().into_iter().filter(|&pin| Some(pin) != case.stuck).collect();
    let outcome = Outcome { dark: last(&free), rest: last(&[Pin::D7]) };
    let Case { name, bound, rest, .. } = *case;
    assert!(outcome.dark <= bound, "{name}: dark after {} of {bound} cycles", outcome.dark);
    assert!(outcome.rest <= rest, "{name}: enable rests after {} of {rest}", outcome.rest);
    outcome
}

fn assert_stopped(session: &mut Session<Uno>, fault: Fault) {
    assert_eq!(session.status().state, State::Faulted(fault));
    // What waits to be told.
    session.run_for(20 * MS);
    let stops = session.events.iter().filter_map(|(_, event)| match event {
        Event::Stopped { fault, .. } => Some(*fault),
        _ => None,
    });
    assert_eq!(stops.collect::<Vec<_>>(), [fault], "told once, with its reason");
}

/// The board has started anew, says why, and does nothing.
fn assert_disarmed(session: &mut Session<Uno>, cause: ResetCause) {
    assert_eq!(session.hello().reset, cause);
    let status = session.status();
    assert_eq!((status.state, status.plan), (State::Idle, 0));
    let refused = Reply::Refused(Refusal::State(State::Idle));
    assert_eq!(session.ask(Command::Start), refused);
}

fn assert_dark(session: &Session<Uno>, case: &Case) {
    for pin in outputs().into_iter().chain([Pin::D7]) {
        let expected = Some(pin) == case.stuck;
        assert_eq!(session.board.level(pin), expected, "{}: {pin}", case.name);
    }
}

/// Inject a fault at several positions in the middle of a sweep. `change` says from which cycle on
/// the time counts.
fn inject(plan: &Plan, case: Case, change: impl Fn(&mut Session<Uno>) -> u64) -> Outcome {
    inject_at(plan, case, MIDDLE, &outputs(), change)
}

/// The same elsewhere, where these outputs are on.
fn inject_at(
    plan: &Plan,
    case: Case,
    after: u64,
    on: &[Pin],
    change: impl Fn(&mut Session<Uno>) -> u64,
) -> Outcome {
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
fn worst(case: &Case, outcomes: impl Iterator<Item = Outcome>) -> Outcome {
    let worse =
        |a: Outcome, b: Outcome| Outcome { dark: a.dark.max(b.dark), rest: a.rest.max(b.rest) };
    let worst = outcomes.reduce(worse).expect("at least one");
    tell(case.name, case.bound, worst.dark);
    worst
}

fn tell(name: &str, bound: u64, measured: u64) {
    let ms = |cycles: u64| cycles as f64 / MS as f64;
    println!(
        "{name} | {bound} cycles, {:.3} ms | {measured} cycles, {:.3} ms",
        ms(bound),
        ms(measured)
    );
}

/// A change that counts from now on.
fn at_once(change: impl Fn(&mut Uno)) -> impl Fn(&mut Session<Uno>) -> u64 {
    move |session| {
        let now = session.board.cycle();
        change(&mut session.board);
        now
    }
}

/// Send a request; the cycle at which its last byte has come.
fn last_byte(session: &mut Session<Uno>, command: Command<'_>) -> u64 {
    session.say(command);
    let limit = session.board.cycle() + PASS;
    session.board.run_while(limit, |uno| uno.unsent() > 0);
    assert_eq!(session.board.unsent(), 0, "the request has been sent");
    session.board.cycle()
}

/// Flip bits of a register or of memory, as a disturbance would.
fn flip(uno: &mut Uno, address: u16, bits: u8) {
    let value = uno.peek(address) ^ bits;
    uno.poke(address, value);
}

/// Where these bytes are in memory.
fn find(uno: &mut Uno, bytes: &[u8]) -> Vec<u16> {
    const MEMORY: std::ops::Range<u16> = 0x100..0x900;
    let memory: Vec<u8> = MEMORY.map(|address| uno.peek(address)).collect();
    let places = memory.windows(bytes.len()).zip(MEMORY);
    places.filter(|(window, _)| *window == bytes).map(|(_, address)| address).collect()
}

// Registers, by their data addresses.
const DDRB: u16 = 0x24;
const PORTB: u16 = 0x25;
const DDRD: u16 = 0x2a;
const PORTD: u16 = 0x2b;
const TCCR0A: u16 = 0x44;
const TIMSK1: u16 = 0x6f;
const TIMSK2: u16 = 0x70;
const TCCR1A: u16 = 0x80;

/// D9 and D10 of port B, D6 of port D.
const OUTPUTS_B: u8 = 0b110;
const OUTPUTS_D: u8 = 1 << 6;

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
    let outcome = inject(&plan, case, |session| last_byte(session, Command::Status));
    assert!(outcome.dark > silence, "not before its time");
}

#[test]
fn a_host_that_speaks_is_no_fault() {
    let mut plan = steady();
    (plan.bursts, plan.caps.heartbeat) = (20, 100 * MS as u32);
    if let Some(light) = &mut plan.stimulus {
        light.on = 20 * INTERVAL;
    }
    let mut session = switched_on();
    session.start(&plan);
    while session.status().state == State::Running {
        session.run_for(90 * MS);
    }
    assert_eq!(session.status().state, State::Finished);
    assert!(deviations(session.board.edges(), &plan).iter().all(|&cycles| cycles == 0));
}

// ---- the program hangs ---------------------------------------------------------------------

/// The watchdog at the slowest, the nominal and the fastest clock, the main loop hanging with and
/// without interrupts.
#[test]
fn the_program_hangs() {
    let cases = [
        ("main loop hangs, watchdog -10 %", 900, false),
        ("main loop hangs", 1000, false),
        ("main loop hangs, watchdog +10 %", 1100, false),
        ("all hangs, interrupts off, watchdog -10 %", 900, true),
        ("all hangs, interrupts off", 1000, true),
        ("all hangs, interrupts off, watchdog +10 %", 1100, true),
    ];
    for (name, per_mille, deaf) in cases {
        let case = Case::reset(name, ResetCause::Watchdog, watchdog(per_mille));
        let outcome = inject(&steady(), case, |session| {
            session.board.set_watchdog_hz((WATCHDOG_HZ * per_mille / 1000) as f64);
            hang(session, deaf)
        });
        // It is fed with each wrap of the clock, in a pass.
        assert!(outcome.dark + 0x1_0000 + PASS > case.bound, "{name}: after {}", outcome.dark);
    }
}

/// Hang: the cycle from which on it does. The enable stands still from then on; its level means
/// nothing, the outputs it is for need a square wave.
fn hang(session: &mut Session<Uno>, deaf: bool) -> u64 {
    session.board.hang(deaf).expect("the program can be made to hang");
    let since = session.board.cycle();
    session.run_for(100 * MS);
    let changes = session.board.edges_of(Pin::D7).filter(|edge| edge.cycle > since).count();
    assert_eq!(changes, 0, "no leave for light while the program hangs");
    since
}

// ---- the interlock -------------------------------------------------------------------------

/// As `inject`, at more positions.
fn inject_fine(plan: &Plan, case: Case, change: impl Fn(&mut Session<Uno>) -> u64) {
    let outcomes = (0..FINE_POSITIONS).map(|position| {
        let case = case.at(position);
        let mut session = third_sweep(switched_on(), plan, MIDDLE + position * FINE_STEP);
        assert!(are_on(&session, &outputs()));
        let since = change(&mut session);
        watch(&mut session, &case, since)
    });
    worst(&case, outcomes);
}

#[test]
fn the_interlock_opens() {
    let case = Case::fault("interlock opens", Fault::Interlock, INTERRUPT);
    inject_fine(&steady(), case, at_once(|uno| uno.drive(Pin::D2, true)));
}

#[test]
fn the_interlock_opens_for_a_moment() {
    let case = Case::fault("interlock opens for 10 us", Fault::Interlock, INTERRUPT);
    let change = at_once(|uno| {
        let now = uno.cycle();
        uno.drive_at(now, Pin::D2, true);
        uno.drive_at(now + 160, Pin::D2, false);
    });
    inject_fine(&steady(), case, change);
}

#[test]
fn the_interlock_opens_while_the_program_hangs() {
    let name = "interlock opens while the main loop hangs";
    // The outputs are dark by interrupt; board and enable come back by the watchdog.
    let case = Case { rest: WATCHDOG, ..Case::reset(name, ResetCause::Watchdog, INTERRUPT) };
    inject(&steady(), case, |session| {
        session.board.hang(false).expect("the program can be made to hang");
        session.run_for(5_000);
        at_once(|uno| uno.drive(Pin::D2, true))(session)
    });
}

/// The safety loop runs from D5 to D2.
fn pulsed() -> (Plan, Session<Uno>) {
    let mut plan = steady();
    plan.inputs.interlock = Interlock::Pulsed;
    let mut session = switched_on();
    session.board.release(Pin::D2);
    session.board.connect(Pin::D5, Pin::D2);
    (plan, session)
}

fn inject_pulsed(case: Case, change: impl Fn(&mut Session<Uno>) -> u64) {
    let outcomes = (0..POSITIONS).map(|position| {
        let case = case.at(position);
        let (plan, session) = pulsed();
        // Each in another sweep: the loop is pulsed about every third.
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
    inject_pulsed(case, at_once(|uno| uno.stick(Pin::D2, false)));
}

#[test]
fn the_pulsed_interlock_opens() {
    let case = Case::fault("pulsed interlock opens", Fault::Interlock, INTERRUPT);
    inject_pulsed(case, at_once(|uno| uno.disconnect(Pin::D2)));
}

#[test]
fn the_pulses_of_the_interlock_are_no_fault() {
    let (mut plan, mut session) = pulsed();
    plan.bursts = 20;
    if let Some(light) = &mut plan.stimulus {
        light.on = 20 * INTERVAL;
    }
    session.start(&plan);
    assert_eq!(session.finish(2 * SECOND).state, State::Finished);
    assert!(deviations(session.board.edges(), &plan).iter().all(|&cycles| cycles == 0));
    let pulses = session.board.edges_of(Pin::D5).filter(|edge| edge.level).count();
    assert!(pulses >= 8, "pulsed {pulses} times in 0.8 s");
}

// ---- the camera ----------------------------------------------------------------------------

/// Until the next sweep is looked at: the one that runs goes on as planned.
fn next_looked_at(session: &Session<Uno>) -> u64 {
    rise(session, Pin::D9) + INTERVAL - NEAR
}

#[test]
fn the_camera_is_not_ready() {
    let name = "camera not ready, from the look before the next sweep on";
    let case = Case::fault(name, Fault::NotReady, 2 * PASS);
    inject(&steady(), case, |session| {
        session.board.drive(Pin::D4, false);
        next_looked_at(session)
    });
}

// ---- outputs -------------------------------------------------------------------------------

#[test]
fn an_output_is_stuck_at_low() {
    let cases =
        [("laser stuck low", Pin::D9), ("camera stuck low", Pin::D10), ("LED stuck low", Pin::D6)];
    for (name, pin) in cases {
        let case = Case::fault(name, Fault::ReadBack, PASS);
        inject(&steady(), case, at_once(|uno| uno.stick(pin, false)));
    }
}

/// While it should be low: found by the main loop.
#[test]
fn an_output_is_stuck_at_high() {
    let cases = [
        ("laser stuck high", steady(), Pin::D9, LASER_PULSE, [Pin::D6].as_slice()),
        ("camera stuck high", steady(), Pin::D10, CAMERA_PULSE, &[Pin::D6, Pin::D9]),
        ("LED stuck high", flicker(LED_PULSE), Pin::D6, LED_PULSE, &[Pin::D9, Pin::D10]),
    ];
    for (name, plan, pin, end, on) in cases {
        let case = Case { stuck: Some(pin), ..Case::fault(name, Fault::ReadBack, PASS) };
        // A little after its falling edge.
        inject_at(&plan, case, end + 2_000, on, at_once(|uno| uno.stick(pin, true)));
    }
}

/// While it is high: found by the interrupt of its falling edge.
#[test]
fn an_output_does_not_fall() {
    let cases = [
        ("laser does not fall", steady(), Pin::D9, LASER_PULSE),
        ("camera does not fall", steady(), Pin::D10, CAMERA_PULSE),
        ("LED does not fall", flicker(LED_PULSE), Pin::D6, LED_PULSE),
    ];
    for (name, plan, pin, width) in cases {
        let case = Case { stuck: Some(pin), ..Case::fault(name, Fault::ReadBack, INTERRUPT) };
        inject(&plan, case, |session| {
            session.board.stick(pin, true);
            rise(session, pin) + width
        });
    }
}

/// The compare output sets where it was to clear: one flipped bit of its mode.
#[test]
fn an_output_is_set_where_it_was_to_be_cleared() {
    let case = Case::fault("laser set at its falling edge", Fault::ReadBack, INTERRUPT);
    // When the falling edge is armed.
    inject_at(&steady(), case, LASER_PULSE - 40_000, &[Pin::D6, Pin::D9], |session| {
        flip(&mut session.board, TCCR1A, 1 << 6);
        rise(session, Pin::D9) + LASER_PULSE
    });
}

/// The interrupt that would read back the falling edge, and arm the next, is off.
#[test]
fn the_interrupt_of_an_output_is_lost() {
    for (name, pin, bit, end) in [
        ("laser's interrupt lost", Pin::D9, 1, LASER_PULSE),
        ("camera's interrupt lost", Pin::D10, 2, CAMERA_PULSE),
    ] {
        let mut plan = steady();
        // Else the cap is reached first: for the board the laser is still on.
        plan.caps.laser_pulse *= 2;
        let case = Case::fault(name, Fault::ReadBack, MATCH_LOST);
        inject_at(&plan, case, end - 20_000, &[Pin::D6, pin], |session| {
            flip(&mut session.board, TIMSK1, 1 << bit);
            rise(session, pin) + end
        });
    }
}

// ---- on-time -------------------------------------------------------------------------------

/// The falling edge is turned into a rise, and the interrupt that would read it back is lost: two
/// disturbances, for the read-back finds either alone.
#[test]
fn the_laser_stays_on() {
    let case =
        Case::fault("laser's falling edge lost (cap 10 ms)", Fault::LaserCap, LASER_CAP + PASS);
    inject_at(&steady(), case, LASER_PULSE - 40_000, &[Pin::D6, Pin::D9], |session| {
        flip(&mut session.board, TCCR1A, 1 << 6);
        flip(&mut session.board, TIMSK1, 1 << 1);
        rise(session, Pin::D9)
    });
}

/// The interrupt that would arm the LED's falling edge never comes.
#[test]
fn the_stimulus_stays_on() {
    let (on, cap) = (120_000, 160_000);
    let mut plan = flicker(on);
    plan.caps.stimulus_pulse = cap;
    let case = Case::fault("LED's falling edge lost (cap 10 ms)", Fault::StimulusCap, cap + PASS);
    inject_at(&plan, case, on - 30_000, &[Pin::D6, Pin::D9], |session| {
        flip(&mut session.board, TIMSK2, 1 << 1);
        rise(session, Pin::D6)
    });
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
    inject_at(&plan, case, INTERVAL - MIDDLE, &[Pin::D6], |session| {
        let after = 3 * INTERVAL + u64::from(width);
        make_a_rise(session, session.started() + after);
        rise(session, Pin::D9) + INTERVAL + u64::from(width)
    });
}

/// Make the edge a rise that waits for this tick among the variables shared with interrupts.
fn make_a_rise(session: &mut Session<Uno>, tick: u64) {
    let [low, high, ..] = tick.to_le_bytes();
    let places = find(&mut session.board, &[low, high]);
    let near = symbol(&session.board, "near4NEAR");
    let place = places.into_iter().find(|&place| place > near).expect("the edge waits");
    // Its level lies before or behind its tick, as the compiler likes; what else is there is set.
    let sides = [place - 1, place + 2].into_iter();
    let level: Vec<u16> = sides.filter(|&side| session.board.peek(side) == 0).collect();
    let [level] = level[..] else { panic!("its level is not found at {level:?}") };
    flip(&mut session.board, level, 1);
}

/// Address of the variable whose mangled name holds this.
fn symbol(uno: &Uno, name: &str) -> u16 {
    let mut symbols = uno.image().symbols().filter(|(mangled, _)| mangled.contains(name));
    symbols.next().expect("it is in the image").1 as u16
}

// ---- time ----------------------------------------------------------------------------------

/// Sweeps of 50 us every 106 us: the rehearsal refuses them, and the board, told to go ahead all the
/// same, stops rather than shift an edge.
#[test]
fn a_plan_too_dense() {
    let mut plan = steady();
    (plan.bursts, plan.interval) = (2_000, 1_700);
    (plan.laser.width, plan.camera.width) = (800, 800);
    plan.caps.camera_images = 2_000 * 512;
    assert_eq!(
        rehearse(&Limits::UNO, &Compiled::new(&plan).expect("it fits"), |_| {}),
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
        watch(&mut session, &case, since)
    });
    worst(&case, outcomes);
}

/// The cycle at which the first edge was due that was not made; all before are on plan.
fn first_missing(session: &Session<Uno>, plan: &Plan) -> u64 {
    let zero = session.board.edges_of(Pin::D9).next().expect("an edge").cycle;
    let due = |high: bool, sweep: u64| zero + sweep * plan.interval + if high { 0 } else { 800 };
    let edges = (0..u64::from(plan.bursts)).flat_map(|sweep| [(true, sweep), (false, sweep)]);
    let planned: Vec<(u64, bool)> = edges.map(|(high, sweep)| (due(high, sweep), high)).collect();
    let first_of = |pin: Pin| {
        let made: Vec<_> =
            session.board.edges_of(pin).map(|edge| (edge.cycle, edge.level)).collect();
        let on_plan =
            made.iter().zip(&planned).take_while(|(made, planned)| made == planned).count();
        // The last is that of the stop, if the output was high.
        assert!(on_plan + 1 >= made.len(), "{pin}: {on_plan} of {} edges on plan", made.len());
        planned[on_plan].0
    };
    first_of(Pin::D9).min(first_of(Pin::D10))
}

#[test]
fn the_clocks_interrupt_is_lost() {
    let case = Case::fault("clock's interrupt lost", Fault::Clock, CLOCK_LOST);
    inject(&steady(), case, at_once(|uno| flip(uno, TIMSK1, 1)));
}

/// And the interrupts of laser and camera with it. Whatever is found first, the board is dark in
/// time, and the watchdog restarts it.
#[test]
fn all_interrupts_of_timer1_are_lost() {
    let name = "all interrupts of Timer1 lost";
    let case =
        Case { rest: CLOCK_LOST + PASS, ..Case::reset(name, ResetCause::Watchdog, CLOCK_LOST) };
    inject(&steady(), case, |session| {
        let since = session.board.cycle();
        session.board.poke(TIMSK1, 0);
        session.run_for(CLOCK_LOST + WATCHDOG);
        since
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
        let places = find(&mut session.board, bytes);
        assert!(!places.is_empty(), "the plan is in memory");
        // Another bit at each position.
        let bit = session.board.cycle() as usize % (8 * bytes.len());
        for place in places {
            flip(&mut session.board, place + (bit / 8) as u16, 1 << (bit % 8));
        }
        next_looked_at(session)
    });
}

#[test]
fn the_stack_reaches_the_variables() {
    // The canary's first byte, and the last: which the stack reaches first.
    for (name, offset) in [("stack canary, first byte", 0), ("stack canary, last byte", 7)] {
        let case = Case::fault(name, Fault::Stack, PASS);
        let change = at_once(|uno| {
            let end = uno.symbol("_end").expect("the linker says where the variables end");
            flip(uno, end as u16 + offset, 0xff);
        });
        inject(&steady(), case, change);
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
            let since = session.board.cycle();
            session.board.reset(reset);
            slowest = slowest.max(until_driven(&mut session.board));
            watch(&mut session, &Case::reset(name, cause, 0).at(position), since);
        }
        tell(name, 0, 0);
    }
    tell("outputs driven low after a reset", DRIVEN, slowest);
}

/// Cycles until the outputs are driven low rather than pulled.
fn until_driven(uno: &mut Uno) -> u64 {
    let reset = uno.cycle();
    uno.run_while(reset + DRIVEN, |uno| {
        uno.peek(DDRB) & OUTPUTS_B != OUTPUTS_B || uno.peek(DDRD) & OUTPUTS_D == 0
    });
    assert_eq!((uno.peek(DDRB) & OUTPUTS_B, uno.peek(DDRD) & OUTPUTS_D), (OUTPUTS_B, OUTPUTS_D));
    assert_eq!((uno.peek(PORTB) & OUTPUTS_B, uno.peek(PORTD) & OUTPUTS_D), (0, 0));
    assert_eq!((uno.peek(TCCR0A), uno.peek(TCCR1A)), (0, 0), "the ports have the pins");
    uno.cycle() - reset
}

// ---- before and after ----------------------------------------------------------------------

/// What would end a run is found before it, and nothing is armed.
#[test]
fn no_run_begins_with_a_fault() {
    type Change = fn(&mut Uno);
    let cases: [(Change, Fault); 8] = [
        (|uno| uno.stick(Pin::D2, false), Fault::InterlockStuck),
        (|uno| uno.disconnect(Pin::D2), Fault::Interlock),
        (|uno| uno.drive(Pin::D4, false), Fault::NotReady),
        (|uno| uno.stick(Pin::D9, true), Fault::ReadBack),
        (|uno| uno.stick(Pin::D10, true), Fault::ReadBack),
        (|uno| uno.stick(Pin::D6, true), Fault::ReadBack),
        (|uno| uno.release(Pin::D4), Fault::NotReady),
        (
            |uno| {
                let end = uno.symbol("_end").expect("the linker says where the variables end");
                flip(uno, end as u16, 1);
            },
            Fault::Stack,
        ),
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
    session.board.drive(Pin::D2, true);
    session.run_for(10 * MS);
    let faulted = State::Faulted(Fault::Interlock);
    let hash = Compiled::new(&steady()).expect("it fits").hash();
    assert_eq!(session.ask(Command::Arm(hash)), Reply::Refused(Refusal::State(faulted)));
    assert_eq!(session.ask(Command::Clear), Reply::Done);
    let open = Reply::Refused(Refusal::Unsafe(Fault::Interlock));
    assert_eq!(session.ask(Command::Arm(hash)), open);

    session.board.drive(Pin::D2, false);
    session.board.forget_edges();
    session.events.clear();
    let mut plan = flicker(LED_PULSE);
    plan.bursts = 10;
    if let Some(light) = &mut plan.stimulus {
        light.pulses = 10;
    }
    session.start(&plan);
    assert_eq!(session.finish(2 * SECOND).state, State::Finished);
    assert!(deviations(session.board.edges(), &plan).iter().all(|&cycles| cycles == 0));
    assert_eq!(session.made().len(), planned(&plan).len());
}
