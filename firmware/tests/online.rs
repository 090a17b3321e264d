//! The phase of the on-line solver: told, and its limit kept. It only ever takes light away.

mod desk;

use desk::{Desk, MS, PASS, small};
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::check::{Rule, Violation, check};
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::frame;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{
    Command, Estimate, Event, Refusal, Reply, Request, SPECKLE_BYTES, SPECKLES_PER_REQUEST, State,
};
use phasewalk_firmware::plan::{Action, PhaseLimit, Plan};
use phasewalk_firmware::rehearsal::AsF405;

const LOOKS: u32 = 64.0_f32.to_bits();

fn estimate(volume: u32, phase: f32) -> Estimate {
    Estimate { volume, phase: phase.to_bits(), sigma: 0.01_f32.to_bits(), took: 5 }
}

/// The small plan, with a limit of 2 rad.
fn limited(action: Action, silence: u32) -> Plan {
    Plan { phase_limit: Some(PhaseLimit { milliradians: 2_000, silence, action }), ..small() }
}

/// A run in its third sweep, with light.
fn running(plan: &Plan) -> Desk<AsF405> {
    let mut desk = Desk::with_solver();
    desk.start(plan);
    desk.run_to_third_sweep();
    desk
}

fn solve(desk: &mut Desk<AsF405>, volume: u32, phase: f32) {
    desk.device.board().estimate = Some(estimate(volume, phase));
    desk.run(2 * MS);
}

fn crossings(desk: &Desk<AsF405>) -> usize {
    desk.events.iter().filter(|(_, event)| matches!(event, Event::Crossed { .. })).count()
}

#[test]
fn every_volume_is_told_with_or_without_a_limit() {
    for plan in [small(), limited(Action::Stop, 0)] {
        let mut desk = running(&plan);
        solve(&mut desk, 7, -1.999);
        assert!(desk.events.iter().any(|(_, e)| *e == Event::Solved(estimate(7, -1.999))));
        assert_eq!((desk.device.state(), crossings(&desk)), (State::Running, 0));
        assert!(!desk.device.board().phase_line);
    }
}

#[test]
fn beyond_the_limit_the_run_ends() {
    for phase in [2.001, -2.001, f32::NAN, f32::INFINITY] {
        let mut desk = running(&limited(Action::Stop, 0));
        solve(&mut desk, 3, phase);
        assert_eq!(desk.device.state(), State::Faulted(Fault::Phase), "{phase}");
        assert!(desk.is_dark() && desk.device.board().phase_line);
    }
}

#[test]
fn beyond_the_limit_the_stimulus_ends_and_volumes_go_on() {
    let mut desk = running(&limited(Action::Stimulus, 0));
    solve(&mut desk, 3, 2.5);
    let lit = desk.device.board().level(Channel::Stimulus);
    assert!(!lit && desk.device.board().phase_line);
    // Back within the bounds it stays off, and is told once.
    for volume in 4..8 {
        solve(&mut desk, volume, if volume % 2 == 0 { 0.1 } else { 3.0 });
    }
    desk.run(60 * MS);
    assert_eq!((desk.device.state(), crossings(&desk)), (State::Finished, 1));
    let light: Vec<Edge> =
        desk.made().into_iter().filter(|edge| edge.channel == Channel::Stimulus).collect();
    assert_eq!(light.iter().map(|edge| edge.high).collect::<Vec<_>>(), [true, false]);
    assert!(light[1].tick - light[0].tick < u64::from(2 * MS), "{light:?}");
    let volumes = desk.made().iter().filter(|e| e.channel == Channel::Laser && e.high).count();
    assert_eq!(volumes, 5);
}

#[test]
fn before_its_time_the_stimulus_is_ended_too() {
    let mut desk = Desk::with_solver();
    desk.start(&limited(Action::Stimulus, 0));
    solve(&mut desk, 0, 9.0);
    desk.run(80 * MS);
    assert_eq!(desk.device.state(), State::Finished);
    assert!(desk.made().iter().all(|edge| edge.channel != Channel::Stimulus));
}

#[test]
fn beyond_the_limit_the_line_is_raised_and_nothing_else_changes() {
    let mut desk = running(&limited(Action::Line, 0));
    solve(&mut desk, 3, -2.5);
    assert!(desk.device.board().phase_line);
    desk.run(60 * MS);
    assert_eq!((desk.device.state(), crossings(&desk)), (State::Finished, 1));
    // The next run begins with the line low.
    desk.start(&limited(Action::Line, 0));
    assert!(!desk.device.board().phase_line);
}

#[test]
fn silence_of_the_solver_ends_the_run() {
    let silence = 5 * MS;
    let mut desk = Desk::with_solver();
    desk.start(&limited(Action::Line, silence));
    // Into the third sweep.
    for volume in 0..15 {
        solve(&mut desk, volume, 0.0);
        assert_eq!(desk.device.state(), State::Running);
    }
    assert!(desk.device.board().level(Channel::Stimulus));
    let last = desk.device.board().now;
    desk.run(2 * silence);
    assert_eq!(desk.device.state(), State::Faulted(Fault::NoPhase));
    let stopped = desk.events.iter().find_map(|(_, event)| match event {
        Event::Stopped { tick, .. } => Some(*tick),
        _ => None,
    });
    assert!(stopped.expect("told") - last <= u64::from(silence + 2 * PASS));
    assert!(desk.is_dark());
}

#[test]
fn a_series_begins_at_rest_only() {
    let mut desk = Desk::with_solver();
    let series = Command::Series { speckles: 64, looks: LOOKS };
    assert_eq!(desk.ask(series), Reply::Done);
    let none = Command::Series { speckles: 0, looks: LOOKS };
    assert_eq!(desk.ask(none), Reply::Refused(Refusal::Solver));
    let many = Command::Series { speckles: 65, looks: LOOKS };
    assert_eq!(desk.ask(many), Reply::Refused(Refusal::Solver));
    desk.start(&small());
    assert_eq!(desk.ask(series), Reply::Refused(Refusal::State(State::Running)));
    let samples = Command::Samples { first: 0, bytes: &[0; SPECKLE_BYTES] };
    assert_eq!(desk.ask(samples), Reply::Done);
}

#[test]
fn an_uno_solves_nothing() {
    let mut desk = Desk::new();
    let series = Command::Series { speckles: 1, looks: LOOKS };
    assert_eq!(desk.ask(series), Reply::Refused(Refusal::Solver));
    let samples = Command::Samples { first: 0, bytes: &[] };
    assert_eq!(desk.ask(samples), Reply::Refused(Refusal::Solver));
}

#[test]
fn the_speckles_of_a_request_fit_a_frame() {
    let bytes = [0x5A; SPECKLES_PER_REQUEST * SPECKLE_BYTES];
    for first in 0..Limits::F405.speckles {
        let command = Command::Samples { first, bytes: &bytes };
        assert!(frame::encode(&Request { number: 255, command }).is_some(), "{first}");
    }
}

#[test]
fn what_a_board_does_not_have_is_refused() {
    let violation = |plan: &Plan, limits| check(plan, &limits).unwrap_err();
    let limit = limited(Action::Line, 0);
    let expected = Violation { rule: Rule::PhaseLimit, value: 1, limit: 0 };
    assert_eq!(violation(&limit, Limits::UNO), expected);
    assert_eq!(check(&limit, &Limits::F405), Ok(()));

    let clocked = |frame| {
        let mut plan = Plan { frame, ..small() };
        plan.camera.width = 512 * frame;
        (plan.laser.width, plan.caps.laser_pulse) = (512 * frame, 512 * frame);
        (plan.interval, plan.caps.laser_total) = (1 << 40, 1 << 40);
        plan
    };
    assert_eq!(check(&clocked(1_400), &Limits::F405), Ok(()));
    let uno = Violation { rule: Rule::FrameLong, value: 1_400, limit: 0 };
    assert_eq!(violation(&clocked(1_400), Limits::UNO), uno);
    let fast = Violation { rule: Rule::FrameShort, value: 839, limit: 840 };
    assert_eq!(violation(&clocked(839), Limits::F405), fast);
    let mut plan = clocked(1_400);
    plan.camera.width -= 1;
    let pulse = Violation { rule: Rule::FramePulse, value: 1, limit: 0 };
    assert_eq!(violation(&plan, Limits::F405), pulse);
}

#[test]
fn the_frame_clock_runs_during_the_run_only() {
    let mut desk = Desk::with_solver();
    let mut plan = Plan { frame: 1_000, ..small() };
    (plan.camera.width, plan.caps.images_per_sweep) = (20_000, 20);
    desk.start(&plan);
    assert_eq!(desk.device.board().frame, 1_000);
    desk.run(100 * MS);
    assert_eq!((desk.device.state(), desk.device.board().frame), (State::Finished, 0));
}

#[test]
fn plans_with_limit_and_clock_come_back_from_their_bytes() {
    for action in [Action::Line, Action::Stimulus, Action::Stop] {
        let plan = Plan { frame: 1_400, ..limited(action, 84_000_000) };
        assert_eq!(Compiled::new(&plan).expect("it fits").plan(), Some(plan));
    }
}
