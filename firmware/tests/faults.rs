//! Every fault ends all-low with its reason, in time.

mod desk;

use desk::{Desk, MS, PASS, small};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{Command, Event, Reply, State};
use phasewalk_firmware::plan::{Interlock, Plan};
use phasewalk_firmware::rehearsal::Rehearsal;

/// Run a plan, change something in the middle of its third sweep, and say what came of it: the
/// fault and how many ticks after the change.
fn inject(plan: &Plan, change: impl FnOnce(&mut Rehearsal)) -> (Fault, u64) {
    let mut desk = Desk::new();
    desk.start(plan);
    desk.run_to_third_sweep();
    let changed = desk.device.board().now;
    change(desk.device.board());
    // Long enough for every time limit.
    desk.run(60 * MS);
    assert!(desk.is_dark());
    let State::Faulted(fault) = desk.device.state() else { panic!("{:?}", desk.device.state()) };
    let stopped = desk.events.iter().find_map(|(_, event)| match event {
        Event::Stopped { fault: told, tick } => Some((*told, *tick)),
        _ => None,
    });
    let (told, tick) = stopped.expect("the host is told");
    assert_eq!(told, fault);
    (fault, tick - changed)
}

#[test]
fn faults_end_the_run_within_a_pass() {
    type Change = fn(&mut Rehearsal);
    let cases: [(Change, Fault); 5] = [
        (|board| board.interlock_closed = false, Fault::Interlock),
        (|board| board.stuck = Some((Channel::Camera, true)), Fault::ReadBack),
        (|board| board.stuck = Some((Channel::Laser, false)), Fault::ReadBack),
        (|board| board.stack_overflow = true, Fault::Stack),
        (|board| board.latched = Some(Fault::Late), Fault::Late),
    ];
    for (change, expected) in cases {
        let (fault, after) = inject(&small(), change);
        assert_eq!(fault, expected);
        assert!(after <= u64::from(PASS), "{fault:?} after {after} ticks");
    }
}

#[test]
fn a_camera_that_is_not_ready_ends_the_run_before_its_sweep() {
    let (fault, after) = inject(&small(), |board| board.camera_ready = false);
    // The next sweep is 9 ms away.
    assert_eq!(fault, Fault::NotReady);
    assert!(after < u64::from(9 * MS));
}

#[test]
fn a_clock_without_interrupts_ends_the_run() {
    let (fault, after) = inject(&small(), |board| board.no_interrupts = true);
    assert_eq!(fault, Fault::Clock);
    assert!(after <= u64::from(8 * 20_000 + PASS), "{after}");
}

#[test]
fn a_silent_host_ends_the_run_if_the_plan_asks_for_it() {
    let mut plan = small();
    plan.caps.heartbeat = 5 * MS;
    let mut desk = Desk::new();
    desk.start(&plan);
    desk.run(8 * MS);
    assert_eq!(desk.device.state(), State::Faulted(Fault::Heartbeat));

    let mut desk = Desk::new();
    desk.start(&plan);
    for _ in 0..20 {
        desk.run(3 * MS);
        desk.status();
    }
    assert_eq!(desk.device.state(), State::Finished);
}

#[test]
fn an_interlock_that_is_stuck_is_found_by_its_pulses() {
    let mut plan = small();
    plan.inputs.interlock = Interlock::Pulsed;
    plan.bursts = 50;
    plan.caps.laser_total *= 10;
    plan.caps.camera_images *= 10;
    let mut desk = Desk::new();
    desk.start(&plan);
    desk.run(21 * MS);
    desk.device.board().interlock_stuck = true;
    desk.run(126 * MS);
    assert_eq!(desk.device.state(), State::Faulted(Fault::InterlockStuck));
    assert!(desk.is_dark());

    // And before the run.
    let mut desk = Desk::new();
    desk.device.board().interlock_stuck = true;
    let hash = desk.load(&plan);
    assert!(matches!(desk.arm(hash), Reply::Refused(_)));
}

#[test]
fn no_plan_makes_the_board_keep_light_on_beyond_the_caps() {
    // The falling edges never come: taken by the hardware, and lost there.
    for (channel, expected) in
        [(Channel::Laser, Fault::LaserCap), (Channel::Stimulus, Fault::StimulusCap)]
    {
        let mut plan = small();
        if channel == Channel::Laser {
            plan.stimulus = None;
        }
        // Before the edge is overdue.
        plan.caps.stimulus_pulse = u64::from(23 * MS);
        let mut desk = Desk::new();
        desk.start(&plan);
        while !desk.device.board().level(channel) {
            desk.pass();
        }
        let since = desk.device.board().now;
        desk.device.board().lose_edges_of = Some(channel);
        desk.run(60 * MS);
        assert_eq!(desk.device.state(), State::Faulted(expected));
        assert!(desk.is_dark());
        let stopped = desk.events.iter().find_map(|(_, event)| match event {
            Event::Stopped { tick, .. } => Some(*tick),
            _ => None,
        });
        let cap = match channel {
            Channel::Laser => u64::from(plan.caps.laser_pulse),
            _ => plan.caps.stimulus_pulse,
        };
        let after = stopped.unwrap() - since;
        assert!(after <= cap + u64::from(PASS), "{after} ticks for a cap of {cap}");
    }
}

#[test]
fn an_edge_that_the_hardware_loses_is_missed() {
    for channel in Channel::ALL {
        let mut desk = Desk::new();
        desk.start(&small());
        desk.device.board().lose_edges_of = Some(channel);
        desk.run(60 * MS);
        assert_eq!(desk.device.state(), State::Faulted(Fault::Late), "{channel:?}");
        assert!(desk.is_dark());
    }
}

#[test]
fn aborted_at_once() {
    let mut desk = Desk::new();
    desk.start(&small());
    desk.run_to_third_sweep();
    let before = desk.device.board().now;
    assert_eq!(desk.ask(Command::Abort), Reply::Done);
    assert!(desk.is_dark());
    let stopped = desk.events.iter().find_map(|(_, event)| match event {
        Event::Stopped { fault: Fault::Abort, tick } => Some(*tick),
        _ => None,
    });
    // Its seven bytes take one pass.
    assert!(stopped.unwrap() - before <= u64::from(2 * PASS));
}

#[test]
fn watchdog_and_enable_live_on_interrupts() {
    let mut desk = Desk::new();
    desk.run(100 * MS);
    let (fed, enabled) = (desk.device.board().fed, desk.device.board().enabled);
    assert_eq!(enabled, 0, "no leave for light while disarmed");
    assert!((20..30).contains(&fed), "fed {fed} times in 24 interrupts");

    let hash = desk.load(&small());
    assert_eq!(desk.arm(hash), Reply::Done);
    desk.run(100 * MS);
    let toggled = desk.device.board().enabled;
    assert!(toggled > 150, "the enable is alive while armed: {toggled}");

    desk.device.board().no_interrupts = true;
    desk.run(10 * MS);
    let (fed, toggled) = (desk.device.board().fed, desk.device.board().enabled);
    desk.run(100 * MS);
    assert_eq!(desk.device.state(), State::Faulted(Fault::Clock));
    assert_eq!(desk.device.board().fed, fed);
    assert_eq!(desk.device.board().enabled, toggled);
}

#[test]
fn a_plan_too_dense_is_late_and_never_shifted() {
    // Sweeps of 50 µs every 100 µs: one edge per pass of 1 ms cannot keep up.
    let mut plan = small();
    plan.stimulus = None;
    (plan.bursts, plan.interval) = (200, 1_700);
    (plan.laser.width, plan.camera.width, plan.camera.delay) = (800, 800, 0);
    plan.caps.camera_images = 200_000;
    let compiled = Compiled::new(&plan).unwrap();
    let rehearsed = phasewalk_firmware::rehearsal::rehearse(&Limits::UNO, &compiled, |_| {});
    assert_eq!(rehearsed, Err(Fault::Late));
    let mut desk = Desk::new();
    desk.start(&plan);
    desk.run(100 * MS);
    assert_eq!(desk.device.state(), State::Faulted(Fault::Late));
    // What was made until then is on plan.
    let first = desk.made();
    assert!(first.len() > 4);
    for edge in first {
        let within = edge.tick % 1_700;
        assert!(within == if edge.high { 0 } else { 800 }, "{edge:?}");
    }
}
