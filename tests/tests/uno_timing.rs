//! Edges of the very image that is flashed, executed cycle by cycle: on plan, to the cycle.
//!
//! The image is the one that `cargo xtask firmware` leaves.

use phasewalk_firmware::message::State;
use phasewalk_firmware::plan::{Plan, Pulse, Stimulus};
use phasewalk_tests::board::{Pin, Uno};
use phasewalk_tests::random::Random;
use phasewalk_tests::session::{MS, SECOND, Session, deviations, image, paper, planned};

/// The paper's sequence at this many positions of the start against timers and main loop.
const START_PHASES: u64 = 16;

/// From one of them to the next, in cycles: prime, and more than the 256 of Timer0, the 2048 of
/// Timer2's wrap and a pass of the main loop, so that all of them are met at different positions.
const PHASE_STEP: u64 = 9_973;

fn switched_on() -> Session<Uno> {
    let mut session = Session::new(Uno::load(&image()).expect("the image can be loaded"));
    let hello = session.hello();
    println!("image {:08x}, {} bytes", hello.image, hello.image_bytes);
    session.board.forget_latency();
    session
}

/// Every edge on the pins is on plan.
fn assert_pins_on_plan(session: &Session<Uno>, plan: &Plan) {
    let deviations = deviations(session.board.edges(), plan);
    assert!(deviations.iter().all(|&cycles| cycles == 0), "beside the plan: {deviations:?}");
}

/// And the board has told of every one at its tick.
fn assert_on_plan(session: &Session<Uno>, plan: &Plan) {
    assert_pins_on_plan(session, plan);
    let start = session.started();
    let mut told = session.made();
    told.iter_mut().for_each(|edge| edge.tick -= start);
    told.sort_by_key(|edge| (edge.channel, edge.tick));
    assert_eq!(told, planned(plan));
    assert_eq!(session.lost(), 0);
}

/// Arm, let `phase` cycles pass, start, flood the line for the run's length, and check.
fn run_flooded(session: &mut Session<Uno>, plan: &Plan, phase: u64, random: &mut Random) {
    session.arm(plan);
    session.run_for(phase);
    session.begin();
    session.run_flooded(plan.length() + 30 * MS, random);
    let status = session.finish(SECOND);
    assert_eq!(status.state, State::Finished);
    assert_on_plan(session, plan);
    assert_eq!(session.garbled, 0);
    assert!(
        status.longest_pass <= session.limits.pass,
        "a pass of {} ticks; the certificate rests on {}",
        status.longest_pass,
        session.limits.pass
    );
}

#[test]
fn the_papers_sequence_under_a_flooded_line_at_sixteen_start_phases() {
    let plan = paper();
    let worst: Vec<(u32, u64, u16)> = std::thread::scope(|scope| {
        let run = |phase: u64| {
            let mut session = switched_on();
            let mut random = Random::new(phase);
            run_flooded(&mut session, &plan, phase * PHASE_STEP, &mut random);
            let pass = session.status().longest_pass;
            let latency = session.board.max_interrupt_latency();
            let latency = latency.iter().map(|latency| latency.worst).max().unwrap_or(0);
            (pass, latency, session.board.stack_low_water())
        };
        let half = |which: u64| (0..START_PHASES).filter(move |phase| phase % 2 == which);
        let other = scope.spawn(move || half(1).map(run).collect::<Vec<_>>());
        let mut worst: Vec<_> = half(0).map(run).collect();
        worst.extend(other.join().expect("the other half has run"));
        worst
    });
    println!(
        "{START_PHASES} start phases: 0 cycles beside the plan; longest pass {} cycles, worst \
         interrupt latency {} cycles, stack down to {:#x}",
        worst.iter().map(|w| w.0).max().unwrap_or(0),
        worst.iter().map(|w| w.1).max().unwrap_or(0),
        worst.iter().map(|w| w.2).min().unwrap_or(0),
    );
}

#[test]
fn each_interrupt_is_served_in_time() {
    let mut session = switched_on();
    let mut plan = paper();
    plan.bursts = 12;
    flicker(&mut plan, 20, 40 * MS as u32, 20 * MS);
    run_flooded(&mut session, &plan, 0, &mut Random::new(7));
    for latency in session.board.max_interrupt_latency() {
        println!("{:?}: {} cycles at most, of {}", latency.vector, latency.worst, latency.served);
        assert!(latency.worst <= u64::from(session.limits.interrupt), "{latency:?}");
    }
}

fn flicker(plan: &mut Plan, pulses: u32, period: u32, on: u64) {
    plan.stimulus =
        Some(Stimulus { burst: 1, sweep: 0, delay: 333, on, pulses, period, sham: false });
}

#[test]
fn pairs_and_triples_at_the_shortest_spacing() {
    for sweeps in [2, 3] {
        let mut plan = paper();
        (plan.bursts, plan.interval, plan.sweeps) = (12, 100 * MS, sweeps);
        // The next sweep starts as soon as the shortest gap after this one allows.
        plan.spacing = [137_333; 2];
        flicker(&mut plan, 8, 30 * MS as u32, 15 * MS + 1);
        let mut session = switched_on();
        run_flooded(&mut session, &plan, 0, &mut Random::new(u64::from(sweeps)));
    }
}

/// 733 edges per second and a flooded line are more than the board can tell of: the edges are on
/// plan all the same, and what was lost is counted.
#[test]
fn the_shortest_pulses_and_gaps() {
    let mut plan = paper();
    (plan.bursts, plan.interval) = (20, 40 * MS);
    plan.laser = Pulse { delay: 0, width: 800 };
    plan.camera = Pulse { delay: 0, width: 800 };
    flicker(&mut plan, 200, 3 * MS as u32, 800);
    let mut session = switched_on();
    session.arm(&plan);
    session.begin();
    session.run_flooded(plan.length() + 30 * MS, &mut Random::new(99));
    let status = session.finish(SECOND);
    assert_eq!(status.state, State::Finished);
    assert_pins_on_plan(&session, &plan);
    let untold = planned(&plan).len() - session.made().len();
    assert_eq!((usize::from(status.lost), session.lost()), (untold, untold));
    println!("{untold} of {} edges not told", planned(&plan).len());
}

#[test]
fn edges_of_all_channels_in_the_same_and_in_neighbouring_cycles() {
    // The stimulus against laser and camera at every distance that could trip the arming.
    for delay in (0..600).step_by(23).chain([255, 256, 257, 511, 512]) {
        let mut plan = paper();
        (plan.bursts, plan.interval) = (4, 20 * MS);
        plan.camera.delay = 7;
        flicker(&mut plan, 3, 20 * MS as u32, 10 * MS);
        if let Some(stimulus) = &mut plan.stimulus {
            (stimulus.burst, stimulus.delay) = (0, delay);
        }
        let mut session = switched_on();
        session.start(&plan);
        let state = session.finish(SECOND).state;
        assert_eq!(state, State::Finished, "{delay}: {:?}", session.board.max_interrupt_latency());
        assert_on_plan(&session, &plan);
    }
}

/// Edges that are 300 s apart, and a plan of two hours: what lies between is skipped by adding
/// 2³² ticks (268 s) to the board's clock, which its low 32 bits do not show.
#[test]
fn hours_between_volumes() {
    const SKIP: u64 = 1 << 32;
    let mut session = switched_on();
    for (volumes, interval) in [(3, 300 * SECOND), (9, 3 * SKIP + SECOND)] {
        session.board.forget_edges();
        session.events.clear();
        let mut plan = paper();
        (plan.bursts, plan.interval, plan.stimulus) = (volumes, interval, None);
        session.start(&plan);
        session.run_for(50 * MS);
        let mut skipped = Vec::new();
        for _ in 1..volumes {
            let skips = (interval - 50 * MS) / SKIP;
            let asked = session.board.cycle();
            skip(&mut session, skips);
            let asked = session.board.cycle() - asked;
            skipped.push(skips * SKIP);
            session.run_for(interval - skips * SKIP - asked);
        }
        assert_eq!(session.finish(SECOND).state, State::Finished);

        // As if the time had passed.
        let mut edges = session.board.edges().to_vec();
        let first = edges.iter().find(|edge| edge.pin == Pin::D9).expect("an edge").cycle;
        for edge in &mut edges {
            let volume = (edge.cycle - first.min(edge.cycle) + MS) / (interval % SKIP);
            edge.cycle += skipped.iter().take(volume as usize).sum::<u64>();
        }
        let deviations = deviations(&edges, &plan);
        assert!(deviations.iter().all(|&cycles| cycles == 0), "beside the plan: {deviations:?}");
        let start = session.started();
        let mut told = session.made();
        told.iter_mut().for_each(|edge| edge.tick -= start);
        told.sort_by_key(|edge| (edge.channel, edge.tick));
        assert_eq!(told, planned(&plan));
    }
}

/// Add to the board's clock so many times 2³² ticks: to the upper half of its count of overflows.
fn skip(session: &mut Session<Uno>, times: u64) {
    let wraps = session.status().tick >> 16;
    let board = &mut session.board;
    let near = board.image().symbols().find(|(name, _)| name.ends_with("near4NEAR"));
    let near = near.expect("the image has its symbols").1 as u16;
    // An answer takes less than two wraps.
    let is_count = |count: u64| count >= wraps && count < wraps + 3;
    let found: Vec<u16> =
        (near..near + 120).filter(|&at| is_count(board.peek_u32(at).into())).collect();
    assert_eq!(found.len(), 1, "where the wraps are counted");
    let high = found[0] + 2;
    let count = board.peek_u16(high) + times as u16;
    board.poke(high, count as u8);
    board.poke(high + 1, (count >> 8) as u8);
}

#[test]
fn exposures_are_captured_at_their_cycle() {
    use phasewalk_firmware::message::Event;
    let mut plan = paper();
    (plan.bursts, plan.interval) = (6, 50 * MS);
    plan.stimulus = None;
    let mut session = switched_on();
    // The camera's frame clock runs freely, 60 kHz, from long before to long after.
    let frames = 60_000;
    let begin = session.board.cycle() + 5_000;
    for frame in 0..frames {
        let rise = begin + frame * 800 / 3;
        session.board.drive_at(rise, Pin::D8, true);
        session.board.drive_at(rise + 80, Pin::D8, false);
    }
    session.start(&plan);
    assert_eq!(session.finish(SECOND).state, State::Finished);
    assert_on_plan(&session, &plan);

    // Between ticks of the board and cycles of the simulator lies a constant.
    let first = session.board.edges_of(Pin::D10).next().expect("an edge").cycle;
    let offset = first - session.started();
    let exposed: Vec<u64> = session
        .events
        .iter()
        .filter_map(|(_, event)| match event {
            Event::Exposed { tick } => Some(*tick),
            _ => None,
        })
        .collect();
    let triggers: Vec<u64> =
        session.board.edges_of(Pin::D10).filter(|e| e.level).map(|e| e.cycle).collect();
    assert_eq!(exposed.len(), triggers.len(), "one exposure per sweep");
    for (exposed, trigger) in exposed.iter().zip(&triggers) {
        let expected =
            (0..frames).map(|frame| begin + frame * 800 / 3).find(|rise| rise >= trigger);
        let expected = expected.expect("a frame after the trigger");
        // The pin changes one tick after the tick of an edge; a capture is of the tick itself.
        let measured = exposed + offset;
        assert!(measured.abs_diff(expected) <= 1, "{measured} for {expected}, trigger {trigger}");
    }
}

/// Exposures only during a sweep, the last of them a few milliseconds before the next trigger: the
/// LED's edges, 10 ms apart, over a wire.
#[test]
fn an_exposure_before_the_trigger_is_not_taken_for_the_first_after_it() {
    use phasewalk_firmware::message::Event;
    for delay in [6, 7, 8, 9] {
        let mut plan = paper();
        (plan.bursts, plan.interval) = (30, 20 * MS);
        flicker(&mut plan, 58, 10 * MS as u32, MS);
        if let Some(stimulus) = &mut plan.stimulus {
            (stimulus.burst, stimulus.delay) = (0, delay * MS);
        }
        let mut session = switched_on();
        session.board.release(Pin::D8);
        session.board.connect(Pin::D6, Pin::D8);
        session.start(&plan);
        assert_eq!(session.finish(2 * SECOND).state, State::Finished);
        assert_on_plan(&session, &plan);
        let start = session.started();
        let exposed: Vec<u64> = session
            .events
            .iter()
            .filter_map(|(_, event)| match event {
                Event::Exposed { tick } => Some(tick - start),
                _ => None,
            })
            .collect();
        assert!(exposed.len() >= 29, "{} exposures", exposed.len());
        for (volume, tick) in exposed.iter().enumerate() {
            // The pin changes one tick after the edge's.
            let expected = volume as u64 * 20 * MS + delay * MS + 1;
            assert_eq!(*tick, expected, "volume {volume}, delay {delay} ms");
        }
    }
}

/// Nothing is wired to D3 and it picks up 50 kHz.
#[test]
fn an_open_start_input_disturbs_nothing() {
    let mut plan = paper();
    (plan.bursts, plan.interval) = (8, 30 * MS);
    plan.stimulus = None;
    let mut session = switched_on();
    let begin = session.board.cycle() + 1_000;
    for rise in 0..25_000 {
        session.board.drive_at(begin + rise * 320, Pin::D3, rise % 2 == 0);
    }
    session.start(&plan);
    assert_eq!(session.finish(SECOND).state, State::Finished);
    assert_on_plan(&session, &plan);
}
