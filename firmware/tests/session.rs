//! What the host may ask when.

mod desk;

use desk::{Desk, MS, small};
use phasewalk_firmware::check::Rule;
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::message::{Command, Event, Model, PROTOCOL, Refusal, Reply, State};
use phasewalk_firmware::plan::{Inputs, Start};

fn refused(reply: &Reply) -> Refusal {
    match reply {
        Reply::Refused(refusal) => *refusal,
        other => panic!("{other:?} instead of a refusal"),
    }
}

#[test]
fn the_board_says_who_it_is() {
    let Reply::Hello(hello) = Desk::new().ask(Command::Hello) else { panic!("no hello") };
    assert_eq!((hello.model, hello.protocol), (Model::Rehearsal, PROTOCOL));
    assert_eq!(hello.limits.ticks_per_second, 16_000_000);
}

#[test]
fn a_run_from_upload_to_end() {
    let mut desk = Desk::new();
    desk.start(&small());
    desk.run(80 * MS);
    let status = desk.status();
    assert_eq!((status.state, status.sweeps, status.lost), (State::Finished, 5, 0));
    assert_eq!(desk.made().len(), 5 * 4 + 2);
    assert!(desk.is_dark());
    let numbers: Vec<u16> = desk.events.iter().map(|(number, _)| *number).collect();
    let expected: Vec<u16> = (0..numbers.len() as u16).collect();
    assert_eq!(numbers, expected, "no event is lost, none comes twice");
    assert!(matches!(desk.events.last(), Some((_, Event::Finished { .. }))));
}

#[test]
fn a_second_run_needs_arming_again() {
    let mut desk = Desk::new();
    desk.start(&small());
    desk.run(80 * MS);
    assert_eq!(refused(&desk.ask(Command::Start)), Refusal::State(State::Finished));
    let hash = Compiled::new(&small()).unwrap().hash();
    assert_eq!(desk.arm(hash), Reply::Done);
    assert_eq!(desk.ask(Command::Start), Reply::Done);
    desk.run(80 * MS);
    assert_eq!(desk.status().state, State::Finished);
    let made = |(_, event): &&(u16, Event)| matches!(event, Event::Made(_));
    assert_eq!(desk.events.iter().filter(made).count(), 2 * 22);
}

#[test]
fn arming_takes_two_steps_and_the_right_words() {
    let mut desk = Desk::new();
    let hash = desk.load(&small());
    assert_eq!(refused(&desk.ask(Command::Start)), Refusal::State(State::Idle));
    assert_eq!(refused(&desk.ask(Command::Arm(hash ^ 1))), Refusal::Hash { ours: hash });
    let early = desk.ask(Command::Confirm { hash, nonce: 0 });
    assert_eq!(refused(&early), Refusal::State(State::Idle));

    let Reply::Nonce(nonce) = desk.ask(Command::Arm(hash)) else { panic!("no nonce") };
    let wrong = desk.ask(Command::Confirm { hash, nonce: nonce ^ 1 });
    assert_eq!(refused(&wrong), Refusal::Nonce);
    // One try per nonce.
    let again = desk.ask(Command::Confirm { hash, nonce });
    assert_eq!(refused(&again), Refusal::State(State::Idle));

    let Reply::Nonce(next) = desk.ask(Command::Arm(hash)) else { panic!("no nonce") };
    assert_ne!(next, nonce, "a nonce is not used twice");
    assert_eq!(desk.ask(Command::Confirm { hash, nonce: next }), Reply::Done);
    assert_eq!(desk.status().state, State::Armed);
}

#[test]
fn a_plan_is_committed_as_a_whole_or_not_at_all() {
    let mut desk = Desk::new();
    let hash = desk.load(&small());
    let other = |desk: &mut Desk, bytes: &[u8]| match desk.ask(Command::Upload(bytes)) {
        Reply::Hash(hash) => hash,
        other => panic!("{other:?}"),
    };

    // Set aside, not committed; committed under another hash; not a plan; a plan that breaks a rule.
    let mut plan = small();
    plan.bursts = 4;
    let bytes = Compiled::new(&plan).unwrap().bytes().clone();
    let staged = other(&mut desk, &bytes);
    assert_eq!(refused(&desk.ask(Command::Commit(staged ^ 1))), Refusal::Hash { ours: staged });
    assert_eq!(desk.status().plan, hash);

    let nothing = other(&mut desk, &[0xFF; 40]);
    assert_eq!(refused(&desk.ask(Command::Commit(nothing))), Refusal::NotAPlan);

    plan.laser.width = 799;
    let bytes = Compiled::new(&plan).unwrap().bytes().clone();
    let short = other(&mut desk, &bytes);
    let Refusal::Plan(violation) = refused(&desk.ask(Command::Commit(short))) else {
        panic!("taken")
    };
    assert_eq!((violation.rule, violation.value, violation.limit), (Rule::LaserWidth, 799, 800));

    assert_eq!(desk.status().plan, hash);
    assert_eq!(desk.arm(hash), Reply::Done);
}

#[test]
fn a_nonce_is_for_the_plan_it_was_given_for() {
    let mut desk = Desk::new();
    let hash = desk.load(&small());
    let Reply::Nonce(nonce) = desk.ask(Command::Arm(hash)) else { panic!("no nonce") };
    let mut plan = small();
    plan.bursts = 4;
    let other = desk.load(&plan);
    let confirmed = desk.ask(Command::Confirm { hash: other, nonce });
    assert_eq!(refused(&confirmed), Refusal::State(State::Idle));
}

#[test]
fn a_running_board_takes_no_plan() {
    let mut desk = Desk::new();
    desk.start(&small());
    let bytes = Compiled::new(&small()).unwrap().bytes().clone();
    let refused_all = [
        Command::Hello,
        Command::Upload(&bytes),
        Command::Commit(0),
        Command::Arm(0),
        Command::Clear,
    ];
    for command in refused_all {
        assert_eq!(refused(&desk.ask(command)), Refusal::State(State::Running));
    }
    desk.run(80 * MS);
    assert_eq!(desk.status().state, State::Finished);
}

#[test]
fn what_is_repeated_is_done_once() {
    let mut desk = Desk::new();
    let hash = desk.load(&small());
    let number = desk.number;
    desk.say(number, Command::Arm(hash));
    let first = desk.answer(number).unwrap();
    desk.say(number, Command::Arm(hash));
    assert_eq!(desk.answer(number), Some(first), "the same nonce, not a second one");
    let Reply::Nonce(nonce) = first else { panic!("{first:?}") };
    desk.number = number.wrapping_add(1);
    assert_eq!(desk.ask(Command::Confirm { hash, nonce }), Reply::Done);
}

#[test]
fn what_comes_out_of_order_is_not_done() {
    let mut desk = Desk::new();
    let hash = desk.load(&small());
    let expected = desk.number;
    for wrong in [expected.wrapping_add(1), expected.wrapping_sub(3), expected.wrapping_add(100)] {
        desk.say(wrong, Command::Arm(hash));
        let reply = desk.answer(wrong).unwrap();
        assert_eq!(refused(&reply), Refusal::Number { expected });
    }
    assert_eq!(desk.status().state, State::Idle);
}

#[test]
fn hello_starts_the_numbering_anew() {
    let mut desk = Desk::new();
    desk.load(&small());
    desk.number = 200;
    assert!(matches!(desk.ask(Command::Hello), Reply::Hello(_)));
    assert!(matches!(desk.ask(Command::Status), Reply::Status(_)));
}

#[test]
fn an_armed_board_waits_for_the_start_input() {
    let mut desk = Desk::new();
    let mut plan = small();
    plan.inputs = Inputs { start: Start::External, ..plan.inputs };
    let hash = desk.load(&plan);
    // An edge from before the arming does not count.
    desk.device.board().start_edge = Some(1);
    assert_eq!(desk.arm(hash), Reply::Done);
    desk.run(50 * MS);
    assert_eq!(desk.device.state(), State::Armed);
    assert_eq!(refused(&desk.ask(Command::Start)), Refusal::State(State::Armed));

    let edge = desk.device.board().now - 77;
    desk.device.board().start_edge = Some(edge);
    desk.run(80 * MS);
    assert_eq!(desk.status().state, State::Finished);
    assert_eq!(desk.started(), edge + 100_000, "a fixed time after the edge");
}

#[test]
fn not_armed_while_something_is_unsafe() {
    type Change = fn(&mut phasewalk_firmware::rehearsal::Rehearsal);
    let cases: [(Change, Fault); 4] = [
        (|board| board.interlock_closed = false, Fault::Interlock),
        (|board| board.camera_ready = false, Fault::NotReady),
        (|board| board.stack_overflow = true, Fault::Stack),
        (
            |board| board.stuck = Some((phasewalk_firmware::channel::Channel::Laser, true)),
            Fault::ReadBack,
        ),
    ];
    for (change, fault) in cases {
        let mut desk = Desk::new();
        let hash = desk.load(&small());
        change(desk.device.board());
        assert_eq!(refused(&desk.arm(hash)), Refusal::Unsafe(fault));
        assert_eq!(desk.device.state(), State::Idle);
    }
}

#[test]
fn a_fault_stays_until_it_is_cleared() {
    let mut desk = Desk::new();
    desk.start(&small());
    desk.run(15 * MS);
    assert_eq!(desk.ask(Command::Abort), Reply::Done);
    let hash = Compiled::new(&small()).unwrap().hash();
    let state = State::Faulted(Fault::Abort);
    assert_eq!(refused(&desk.ask(Command::Arm(hash))), Refusal::State(state));
    assert_eq!(desk.ask(Command::Clear), Reply::Done);
    assert_eq!(desk.arm(hash), Reply::Done);
}
