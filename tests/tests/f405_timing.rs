//! Edges of the very image that is flashed to the STM32F405, executed instruction by instruction: on
//! plan, to the tick.
//!
//! The image is the one that `cargo xtask firmware` leaves. How long an instruction takes on the chip
//! depends on its caches, so most runs are made at several speeds: one instruction per cycle is the
//! best there is, two and three are slower than any measured figure of this core.

use num_complex::Complex;
use phasewalk_core::online::{OnlineTracker, SPECKLES};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{
    Command, Estimate, Event, Model, Reply, SPECKLES_PER_REQUEST, State,
};
use phasewalk_firmware::plan::{Plan, Pulse, Start, Stimulus};
use phasewalk_tests::f405::{CYCLES_PER_TICK, F405, Pin};
use phasewalk_tests::random::Random;
use phasewalk_tests::session::{Session, f405_deviations, f405_image, f405_paper, planned_on};

type Board = Session<F405>;

const MS: u64 = Board::MS;
const SECOND: u64 = 1000 * MS;
const LIMITS: Limits = Limits::F405;

/// Effective looks of the made-up series.
const LOOKS: f32 = 64.0;

/// Starts of a run against passes and bytes.
const START_PHASES: u64 = 8;

/// From one of them to the next, in ticks: prime, and no divisor of a pass's 8400.
const PHASE_STEP: u64 = 1_061;

/// Exception numbers: timer, interlock, start input.
const TIMER: u8 = 16 + 28;
const INTERLOCK: u8 = 16 + 6;
const START: u8 = 16 + 9;

fn switched_on(cycles_per_instruction: u64) -> Board {
    let mut board = F405::load(&f405_image()).expect("the image can be loaded");
    board.set_cycles_per_instruction(cycles_per_instruction);
    let mut session = Session::new(board);
    // It does not listen before it has hashed its image, 40 ms at three cycles per instruction; what is sent
    // then may be lost, and is counted.
    session.run_for(60 * MS);
    let hello = session.hello();
    assert_eq!((hello.model, hello.limits), (Model::F405, LIMITS));
    assert_eq!(session.status().state, State::Idle, "right after a cold start");
    session.board.forget_edges();
    session.board.forget_latency();
    session
}

/// Every edge on the pins is on plan.
fn assert_pins_on_plan(session: &Board, plan: &Plan) {
    let deviations = f405_deviations(session.board.edges(), plan);
    assert!(deviations.iter().all(|&ticks| ticks == 0), "beside the plan: {deviations:?}");
}

/// And the board has told of every one at its tick.
fn assert_on_plan(session: &Board, plan: &Plan) {
    assert_pins_on_plan(session, plan);
    let start = session.started();
    let mut told = session.made();
    told.iter_mut().for_each(|edge| edge.tick -= start);
    told.sort_by_key(|edge| (edge.channel, edge.tick));
    assert_eq!(told, planned_on(&LIMITS, plan));
    assert_eq!(session.lost(), 0);
}

/// What the board's figures must be after any run.
fn assert_within_limits(session: &mut Board) {
    let status = session.status();
    assert!(status.longest_pass <= LIMITS.pass, "a pass of {} ticks", status.longest_pass);
    assert_eq!((status.overrun, session.board.overruns()), (0, 0));
    let unknown: Vec<_> = session.board.unknown_registers().collect();
    assert!(unknown.is_empty(), "not modelled: {unknown:x?}");
    let end = session.board.symbol("_stack_end").expect("the linker says where the stack ends");
    assert!(session.board.stack_low_water() > end + 1024, "some of the stack is left");
    assert_eq!(session.board.resets(), []);
}

/// Arm, let `phase` ticks pass, start, flood the line for the run's length, and check.
fn run_flooded(session: &mut Board, plan: &Plan, phase: u64, random: &mut Random) {
    session.arm(plan);
    session.run_for(phase);
    session.begin();
    session.run_flooded(plan.length() + 30 * MS, random);
    assert_eq!(session.finish(SECOND).state, State::Finished);
    assert_on_plan(session, plan);
    assert_eq!(session.garbled, 0);
    assert_within_limits(session);
}

fn tell(name: &str, session: &mut Board) {
    let pass = session.status().longest_pass;
    let latencies = session.board.max_interrupt_latency();
    let timer = latencies.iter().find(|latency| latency.exception == TIMER);
    println!(
        "{name}: 0 ticks beside the plan; longest pass {pass} ticks, timer's interrupt after at \
         most {} cycles, interrupts masked for at most {} cycles, stack down to {:#x}",
        timer.map_or(0, |latency| latency.worst),
        session.board.longest_masked(),
        session.board.stack_low_water()
    );
}

// ---- the paper's sequence ------------------------------------------------------------------

/// All its 70 volumes.
fn papers_sequence(cycles_per_instruction: u64) {
    let mut session = switched_on(cycles_per_instruction);
    run_flooded(&mut session, &f405_paper(), 0, &mut Random::new(cycles_per_instruction));
    tell(&format!("paper, {cycles_per_instruction} cycles per instruction"), &mut session);
}

#[test]
fn the_papers_sequence_under_a_flooded_line() {
    papers_sequence(1);
}

#[test]
fn the_papers_sequence_on_a_slower_processor() {
    papers_sequence(2);
}

#[test]
fn the_papers_sequence_on_a_very_slow_processor() {
    papers_sequence(3);
}

/// Its first volumes, at several positions of the start against passes and bytes.
fn start_phases(cycles_per_instruction: u64) {
    let mut plan = f405_paper();
    (plan.bursts, plan.interval) = (4, 40 * MS);
    flicker(&mut plan, 5, 10 * MS as u32, 3 * MS + 1);
    for phase in 0..START_PHASES {
        let mut session = switched_on(cycles_per_instruction);
        run_flooded(&mut session, &plan, phase * PHASE_STEP, &mut Random::new(phase));
    }
}

#[test]
fn a_run_may_start_anywhere_within_a_pass() {
    start_phases(1);
}

#[test]
fn a_run_may_start_anywhere_within_a_pass_of_a_slower_processor() {
    start_phases(2);
    start_phases(3);
}

// ---- dense plans ---------------------------------------------------------------------------

fn flicker(plan: &mut Plan, pulses: u32, period: u32, on: u64) {
    plan.stimulus =
        Some(Stimulus { burst: 1, sweep: 0, delay: 333, on, pulses, period, sham: false });
}

#[test]
fn pairs_and_triples_at_the_shortest_spacing() {
    for (sweeps, gap) in [(2, 840), (3, 840), (2, 1_680), (3, 1_680)] {
        for cycles_per_instruction in 1..=2 {
            let mut plan = f405_paper();
            (plan.bursts, plan.interval, plan.sweeps) = (5, 100 * MS, sweeps);
            // The next sweep starts so many ticks after this one: 10 us and 20 us.
            plan.spacing = [plan.laser.width + gap; 2];
            plan.spacing[usize::from(sweeps) - 1..].fill(0);
            flicker(&mut plan, 8, 30 * MS as u32, 15 * MS + 1);
            let mut session = switched_on(cycles_per_instruction);
            run_flooded(&mut session, &plan, 0, &mut Random::new(u64::from(sweeps)));
        }
    }
}

/// The shortest pulses on all outputs, and the shortest gaps between those of the light. More edges
/// than the board can tell of: they are on plan all the same, and what was lost is counted.
fn shortest_pulses(cycles_per_instruction: u64) {
    let mut plan = f405_paper();
    (plan.bursts, plan.interval) = (20, 10 * MS);
    plan.laser = Pulse { delay: 0, width: LIMITS.shortest };
    plan.camera = Pulse { delay: 0, width: LIMITS.shortest };
    flicker(&mut plan, 200, MS as u32, LIMITS.shortest.into());
    let mut session = switched_on(cycles_per_instruction);
    session.arm(&plan);
    session.begin();
    session.run_flooded(plan.length() + 30 * MS, &mut Random::new(99));
    let status = session.finish(SECOND);
    assert_eq!(status.state, State::Finished, "{cycles_per_instruction}");
    assert_pins_on_plan(&session, &plan);
    // The edges, the start and the end.
    let all = planned_on(&LIMITS, &plan).len() + 2;
    let untold = all - session.events.len();
    assert_eq!(usize::from(status.lost), untold);
    assert_within_limits(&mut session);
    println!("{untold} of {all} events not told");
    tell(&format!("shortest pulses, {cycles_per_instruction}"), &mut session);
}

#[test]
fn the_shortest_pulses() {
    shortest_pulses(1);
}

#[test]
fn the_shortest_pulses_on_a_slower_processor() {
    shortest_pulses(2);
}

/// The same, all three at once or nearly: one interrupt reads back and arms all of them.
fn shortest_pulses_together(cycles_per_instruction: u64) {
    for distance in (0..840_u64).step_by(105) {
        let mut plan = f405_paper();
        (plan.bursts, plan.interval) = (20, MS * 5 + 1_061);
        plan.laser = Pulse { delay: 0, width: LIMITS.shortest };
        plan.camera = Pulse { delay: distance as u32 / 2, width: LIMITS.shortest };
        let period = plan.interval as u32;
        flicker(&mut plan, 20, period, LIMITS.shortest.into());
        if let Some(light) = &mut plan.stimulus {
            (light.burst, light.delay) = (0, distance);
        }
        let mut session = switched_on(cycles_per_instruction);
        session.start(&plan);
        session.run_for(plan.length() + 30 * MS);
        let state = session.status().state;
        assert_eq!(state, State::Finished, "{cycles_per_instruction}, {distance}");
        assert_pins_on_plan(&session, &plan);
    }
}

#[test]
fn the_shortest_pulses_of_all_outputs_together() {
    shortest_pulses_together(1);
}

#[test]
fn the_shortest_pulses_of_all_outputs_together_on_a_slower_processor() {
    shortest_pulses_together(2);
}

/// The light against laser and camera at every distance that could trip the arming.
fn neighbouring_edges(cycles_per_instruction: u64) {
    let near = [-2_i64, -1, 0, 1, 2, 3, 5, 8, 20, 419, 420, 421, 839, 840, 841];
    for distance in (-600..600).step_by(71).chain(near) {
        let mut plan = f405_paper();
        (plan.bursts, plan.interval) = (4, 12 * MS);
        plan.laser = Pulse { delay: 1_000, width: 10_000 };
        plan.camera = Pulse { delay: 1_007, width: 9_993 };
        // Rises at the rises of both, and falls at their falls.
        flicker(&mut plan, 3, 12 * MS as u32, 10_000);
        if let Some(light) = &mut plan.stimulus {
            (light.burst, light.delay) = (0, (1_000 + distance) as u64);
        }
        let mut session = switched_on(cycles_per_instruction);
        session.start(&plan);
        let state = session.finish(SECOND / 5).state;
        assert_eq!(state, State::Finished, "{distance}: {:?}", session.events);
        assert_on_plan(&session, &plan);
    }
}

#[test]
fn edges_of_all_channels_in_the_same_and_in_neighbouring_ticks() {
    neighbouring_edges(1);
}

#[test]
fn edges_in_neighbouring_ticks_on_a_slower_processor() {
    neighbouring_edges(2);
}

// ---- the solver beside it ------------------------------------------------------------------

/// A made-up volume: speckles that turn, and change.
fn volume(number: usize, random: &mut Random) -> Vec<Complex<f32>> {
    let turn = 0.07 * number as f64;
    let speckle = |_| {
        let speckle = Complex::from_polar(1.0, turn) + random.speckle() * 0.3;
        Complex { re: speckle.re as f32, im: speckle.im as f32 }
    };
    (0..SPECKLES).map(speckle).collect()
}

fn bytes(speckles: &[Complex<f32>]) -> Vec<u8> {
    speckles.iter().flat_map(|z| [z.re.to_le_bytes(), z.im.to_le_bytes()].concat()).collect()
}

/// Send volumes, with rubbish between them, as fast as the line allows; says what was sent.
fn stream(session: &mut Board, until: u64, random: &mut Random) -> Vec<Vec<Complex<f32>>> {
    let mut sent = Vec::new();
    while session.board.tick() < until {
        let volume = volume(sent.len(), random);
        for (part, speckles) in volume.chunks(SPECKLES_PER_REQUEST).enumerate() {
            let rubbish: Vec<u8> = (0..30).map(|_| random.bits() as u8).collect();
            session.board.send(&rubbish);
            session.board.send(&[0]);
            let first = (part * SPECKLES_PER_REQUEST) as u16;
            let samples = Command::Samples { first, bytes: &bytes(speckles) };
            assert_eq!(session.ask(samples), Reply::Done, "volume {}", sent.len());
        }
        sent.push(volume);
    }
    session.run_for(20 * MS);
    sent
}

fn solved(session: &Board) -> Vec<Estimate> {
    let solved = session.events.iter().filter_map(|(_, event)| match event {
        Event::Solved(estimate) => Some(*estimate),
        _ => None,
    });
    solved.collect()
}

/// Bit for bit what the desktop finds.
fn assert_the_desktops_bits(told: &[Estimate], sent: &[Vec<Complex<f32>>]) {
    let tracker = OnlineTracker::<f32>::new(SPECKLES, LOOKS.into());
    let mut tracker = tracker.expect("the desktop can solve it");
    assert_eq!(told.len(), sent.len(), "every volume was solved, and told");
    for (number, (told, volume)) in told.iter().zip(sent).enumerate() {
        let ours = tracker.push(volume);
        let theirs = (told.volume as usize, told.phase, told.sigma);
        assert_eq!(theirs, (number, ours.phase_rad.to_bits(), ours.sigma_rad.to_bits()));
    }
}

/// A run with light on all channels, volumes streaming.
fn solver_streams(cycles_per_instruction: u64) -> Board {
    let mut plan = f405_paper();
    (plan.bursts, plan.interval) = (10, 100 * MS);
    flicker(&mut plan, 20, 40 * MS as u32, 20 * MS);
    let mut session = switched_on(cycles_per_instruction);
    let series = Command::Series { speckles: SPECKLES as u16, looks: LOOKS.to_bits() };
    assert_eq!(session.ask(series), Reply::Done);
    session.arm(&plan);
    session.board.forget_latency();
    session.begin();
    let until = session.board.tick() + plan.length();
    let sent = stream(&mut session, until, &mut Random::new(405));
    assert_eq!(session.finish(SECOND / 10).state, State::Finished);
    assert_on_plan(&session, &plan);
    assert_within_limits(&mut session);
    let told = solved(&session);
    assert_the_desktops_bits(&told, &sent);
    let took = told.iter().map(|estimate| estimate.took).max().unwrap_or(0);
    println!("{} volumes solved, each in at most {took} ticks", told.len());
    tell(&format!("solver streams, {cycles_per_instruction}"), &mut session);
    session
}

#[test]
fn volumes_are_solved_during_a_run_and_no_edge_moves() {
    solver_streams(1);
    solver_streams(3);
}

#[test]
fn each_interrupt_is_served_in_time_while_the_solver_works() {
    let session = solver_streams(2);
    let allowed = u64::from(LIMITS.interrupt) * CYCLES_PER_TICK;
    for latency in session.board.max_interrupt_latency() {
        println!("{latency:?}");
        if [TIMER, INTERLOCK, START].contains(&latency.exception) {
            assert!(latency.worst <= allowed, "{latency:?}, of {allowed} cycles");
        }
    }
    // What has not met a match here may meet one elsewhere.
    let masked = session.board.longest_masked();
    assert!(masked <= allowed, "interrupts masked for {masked} cycles, of {allowed}");
}

// ---- the frame clock -----------------------------------------------------------------------

#[test]
fn the_frame_clock_makes_the_frames_of_each_sweep() {
    const FRAMES: usize = 512;
    const PERIOD: u64 = 1_400;
    for cycles_per_instruction in 1..=2 {
        let mut plan = f405_paper();
        (plan.bursts, plan.interval, plan.sweeps) = (4, 50 * MS, 2);
        plan.camera = Pulse { delay: 3, width: FRAMES as u32 * PERIOD as u32 };
        plan.spacing = [plan.laser.width + 2_000, 0];
        plan.frame = PERIOD as u32;
        flicker(&mut plan, 10, 10 * MS as u32, 5 * MS);
        let mut session = switched_on(cycles_per_instruction);
        run_flooded(&mut session, &plan, 0, &mut Random::new(512));

        let edges = |pin: Pin, high: bool| {
            session.board.edges_of(pin).filter(move |edge| edge.high == high).map(|edge| edge.tick)
        };
        let frames: Vec<u64> = edges(Pin::FRAMES, true).collect();
        let ends: Vec<u64> = edges(Pin::FRAMES, false).collect();
        assert_eq!(frames.len(), FRAMES * plan.total_sweeps() as usize);
        let sweeps = edges(Pin::CAMERA, true).zip(edges(Pin::CAMERA, false));
        let mut offsets = Vec::new();
        for ((rise, fall), frames) in sweeps.zip(frames.chunks(FRAMES)) {
            offsets.push(frames[0] - rise);
            assert!(frames.windows(2).all(|pair| pair[1] - pair[0] == PERIOD));
            assert!(frames[FRAMES - 1] < fall);
        }
        assert!(offsets.iter().all(|offset| *offset == offsets[0]), "{offsets:?}");
        // Low between the sweeps: each frame ends, the last with its sweep.
        assert!(frames.iter().zip(&ends).all(|(rise, fall)| fall - rise == PERIOD / 2));
        println!("first frame {} ticks after the camera's trigger, in each sweep", offsets[0]);
    }
}

// ---- inputs --------------------------------------------------------------------------------

fn exposed(session: &Board) -> Vec<u64> {
    let exposed = session.events.iter().filter_map(|(_, event)| match event {
        Event::Exposed { tick } => Some(*tick),
        _ => None,
    });
    exposed.collect()
}

#[test]
fn exposures_are_captured_at_their_tick() {
    for cycles_per_instruction in 1..=3 {
        let mut plan = f405_paper();
        (plan.bursts, plan.interval, plan.stimulus) = (6, 50 * MS, None);
        let mut session = switched_on(cycles_per_instruction);
        // The camera's frame clock runs freely, 60 kHz, from long before to long after.
        let begin = session.board.tick() + 5_000;
        let rises: Vec<u64> = (0..40_000).map(|frame| begin + frame * 1_400).collect();
        for &rise in &rises {
            session.board.drive_at(rise, Pin::EXPOSE, true);
            session.board.drive_at(rise + 400, Pin::EXPOSE, false);
        }
        session.start(&plan);
        assert_eq!(session.finish(SECOND / 2).state, State::Finished);
        assert_on_plan(&session, &plan);

        // Between ticks of the board's clock and of the emulator lies a constant.
        let triggers: Vec<u64> =
            session.board.edges_of(Pin::CAMERA).filter(|e| e.high).map(|e| e.tick).collect();
        let offset = triggers[0] - session.started();
        let exposed = exposed(&session);
        assert_eq!(exposed.len(), triggers.len(), "one exposure per sweep");
        for (exposed, trigger) in exposed.iter().zip(&triggers) {
            let first = rises.iter().find(|rise| *rise >= trigger).expect("a frame after it");
            assert_eq!(exposed + offset, *first, "trigger {trigger}");
        }
    }
}

/// Exposures only during a sweep, the last of them a few milliseconds before the next trigger: the
/// LED's edges, 10 ms apart, over a wire.
#[test]
fn an_exposure_before_the_trigger_is_not_taken_for_the_first_after_it() {
    for delay in [6, 7, 8, 9] {
        let mut plan = f405_paper();
        (plan.bursts, plan.interval) = (20, 20 * MS);
        flicker(&mut plan, 38, 10 * MS as u32, MS);
        if let Some(stimulus) = &mut plan.stimulus {
            (stimulus.burst, stimulus.delay) = (0, delay * MS);
        }
        let mut session = switched_on(1);
        session.board.release(Pin::EXPOSE);
        session.board.connect(Pin::STIMULUS, Pin::EXPOSE);
        session.start(&plan);
        assert_eq!(session.finish(SECOND).state, State::Finished);
        assert_on_plan(&session, &plan);
        let start = session.started();
        let exposed: Vec<u64> = exposed(&session).iter().map(|tick| tick - start).collect();
        let expected: Vec<u64> = (0..20).map(|volume| (volume * 20 + delay) * MS).collect();
        assert!(exposed.len() >= 19, "{} exposures", exposed.len());
        assert_eq!(exposed, expected[..exposed.len()], "delay {delay} ms");
    }
}

/// Time zero lies a fixed time after the edge, and as much later as its interrupt waits.
#[test]
fn a_run_starts_at_the_edge_of_the_start_input() {
    let mut plan = f405_paper();
    (plan.bursts, plan.interval, plan.stimulus) = (2, 20 * MS, None);
    plan.inputs.start = Start::External;
    for cycles_per_instruction in 1..=2 {
        let mut latencies = Vec::new();
        for position in 0..40 {
            let mut session = switched_on(cycles_per_instruction);
            session.arm(&plan);
            let edge = session.board.tick() + 10_000 + 211 * position;
            session.board.drive_at(edge, Pin::START, true);
            // It bounces.
            session.board.drive_at(edge + 300, Pin::START, false);
            session.board.drive_at(edge + 2_000, Pin::START, true);
            assert_eq!(session.finish(SECOND / 10).state, State::Finished);
            assert_on_plan(&session, &plan);
            let first = session.board.edges_of(Pin::LASER).next().expect("an edge").tick;
            latencies.push(first - edge - 5 * u64::from(LIMITS.pass));
        }
        let (least, most) = (latencies.iter().min(), latencies.iter().max());
        println!("time zero {least:?} to {most:?} ticks late, {cycles_per_instruction}");
        assert!(latencies.iter().all(|&late| late <= LIMITS.interrupt.into()), "{latencies:?}");
    }
}

/// Nothing is wired to PC3 and it picks up 50 kHz.
#[test]
fn an_open_start_input_disturbs_nothing() {
    let mut plan = f405_paper();
    (plan.bursts, plan.interval, plan.stimulus) = (8, 30 * MS, None);
    let mut session = switched_on(1);
    let begin = session.board.tick() + 1_000;
    for rise in 0..30_000 {
        session.board.drive_at(begin + rise * 840, Pin::START, rise % 2 == 0);
    }
    session.start(&plan);
    assert_eq!(session.finish(SECOND).state, State::Finished);
    assert_on_plan(&session, &plan);
}

// ---- the clock -----------------------------------------------------------------------------

/// The counter's 32 bits wrap every 51 s. They are set so that they do during the run: a jump of the
/// clock, which the board finds first.
#[test]
fn the_counter_wraps_during_a_run() {
    use phasewalk_firmware::fault::Fault;
    const COUNTER: u32 = 0x4000_0024;
    let mut plan = f405_paper();
    (plan.bursts, plan.interval) = (8, 60 * MS);
    flicker(&mut plan, 300, MS as u32, MS / 2);
    for before in [150 * MS, 200 * MS + 77, 250 * MS + 1] {
        let mut session = switched_on(1);
        session.board.set_register(COUNTER, 0_u32.wrapping_sub(before as u32));
        session.run_for(MS);
        assert_eq!(session.status().state, State::Faulted(Fault::Clock));
        assert_eq!(session.ask(Command::Clear), Reply::Done);
        session.events.clear();
        session.start(&plan);
        assert_eq!(session.finish(SECOND).state, State::Finished);
        let start = session.started();
        assert!(start < 1 << 32 && start + plan.length() > 1 << 32, "it wraps within the run");
        assert_pins_on_plan(&session, &plan);
    }
}

/// The emulator runs at its own speed whatever the clocks are set to; so look at what they are set to.
#[test]
fn the_clocks_are_set_to_168_84_and_84_megahertz() {
    let mut session = Session::new(F405::load(&f405_image()).expect("the image loads"));
    session.run_for(20 * Session::<F405>::MS);
    let mut register = |address| u64::from(session.board.register(address));
    let (pll, clocks, flash) =
        (register(0x4002_3804), register(0x4002_3808), register(0x4002_3C00));
    // The chip's own 16 MHz into the PLL: / M * N / P.
    assert_eq!(pll >> 22 & 1, 0, "without a crystal");
    let divided = |bits: u64| 2 * ((bits & 0b11) + 1);
    let system = 16_000_000 / (pll & 0x3F) * (pll >> 6 & 0x1FF) / divided(pll >> 16);
    assert_eq!((clocks & 0b11, clocks >> 4 & 0xF), (0b10, 0), "all from the PLL, undivided");
    // 1xx divides by 2, 4, 8, 16; a timer's clock is twice its bus's if that is divided.
    let bus = |bits: u64| if bits & 0b100 == 0 { system } else { system >> ((bits & 0b11) + 1) };
    let (apb1, apb2) = (bus(clocks >> 10), bus(clocks >> 13));
    assert_eq!((system, 2 * apb1, apb2), (168_000_000, 84_000_000, 84_000_000));
    assert!(flash & 0xF >= 5, "wait states for 168 MHz at 2.7 V and more");
    assert_eq!(apb2 / register(0x4001_1408), 250_000, "baud");
    assert_eq!(register(0x4000_0028), 0, "TIM2 counts every one of its clock's cycles");
    // The supply: watched, below 2.9 V, by an interrupt.
    assert_eq!(register(0x4000_7000) & 0xF0, 0xF0);
    assert_eq!(register(0x4001_3C00) & 1 << 16, 1 << 16);
    assert_eq!(register(0xE000_E100) & 1 << 1, 1 << 1);
}
