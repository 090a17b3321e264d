//! Whatever comes over the line, the very image that is flashed stays sane: it does nothing that it
//! was not told to do, goes on listening, and makes every edge on plan.
//!
//! The image is the one that `cargo xtask firmware` leaves. Seeds are recorded; each test prints a
//! line `frames | bound | measured`.

use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::frame::{self, Received, Receiver};
use phasewalk_firmware::message::{Answer, Command, Event, Reply, Request, State, Status};
use phasewalk_firmware::plan::Plan;
use phasewalk_tests::board::{Pin, Uno};
use phasewalk_tests::random::Random;
use phasewalk_tests::session::{CYCLES_PER_BYTE, MS, Session, deviations, image, paper};

/// Frames of each test on a board at rest.
const FRAMES: usize = 20_000;

/// What is found after them.
const UNTOUCHED: &str = "never armed, plan unchanged, still answers";

/// After so many the board is asked how it is.
const LOOK: usize = 250;

/// So many bytes wait on the line at most, but for the last frame.
const AHEAD: usize = 16;

// ---- plans ---------------------------------------------------------------------------------

/// A hundred sweeps of the paper's length in four seconds, a flicker with them.
fn sequence() -> Plan {
    let mut plan = paper();
    (plan.bursts, plan.interval) = (100, 40 * MS);
    if let Some(light) = &mut plan.stimulus {
        (light.burst, light.delay, light.on) = (0, 777, 11 * MS);
        (light.pulses, light.period) = (300, 13 * MS as u32);
    }
    plan.caps.camera_images = 100 * 512;
    plan
}

/// Another one, which nobody commits.
fn other() -> Plan {
    Plan { bursts: 7, ..sequence() }
}

fn hash_of(plan: &Plan) -> u32 {
    Compiled::new(plan).expect("the plan fits").hash()
}

// ---- frames --------------------------------------------------------------------------------

/// Makes frames, from a recorded seed.
struct Frames {
    random: Random,
    hash: u32,
    /// A nonce that has been used.
    stale: u32,
    /// Number of the next request, as a host would count.
    number: u8,
}

impl Frames {
    fn below(&mut self, end: usize) -> usize {
        (self.random.bits() % end as u64) as usize
    }

    fn byte(&mut self) -> u8 {
        self.random.bits() as u8
    }

    /// A request that does something if it is taken, but does not start a run by itself: for that
    /// takes the nonce that the board has said last.
    fn request(&mut self) -> Vec<u8> {
        let (plan, other) = (Compiled::new(&sequence()), Compiled::new(&other()));
        let (plan, other) = (plan.expect("it fits"), other.expect("it fits"));
        let (hash, guess, stale) = (self.hash, self.random.bits() as u32, self.stale);
        let commands = [
            Command::Start,
            Command::Arm(hash),
            Command::Confirm { hash, nonce: guess },
            Command::Confirm { hash, nonce: stale },
            Command::Commit(hash),
            Command::Upload(plan.bytes()),
            Command::Upload(other.bytes()),
            Command::Status,
            Command::Clear,
        ];
        let command = commands[self.below(commands.len())];
        // In order more often than not; around it; anywhere.
        let number = match self.below(8) {
            0..5 => self.number,
            5 | 6 => self.number.wrapping_add(self.byte() % 3).wrapping_sub(1),
            _ => self.byte(),
        };
        self.number = number.wrapping_add(1);
        frame::encode(&Request { number, command }).expect("requests fit a frame").to_vec()
    }

    /// Corrupt, truncated, swapped, or random bytes; ended by a zero so that the next frame counts.
    fn damaged(&mut self) -> Vec<u8> {
        let mut bytes = self.request();
        let last = bytes.len() - 1;
        match self.below(4) {
            0 => {
                let bit = self.below(8 * last);
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            1 => bytes.truncate(self.below(last)),
            2 => bytes = (0..self.below(120)).map(|_| self.byte()).collect(),
            _ => {
                let at = self.below(last - 1);
                bytes.swap(at, at + 1);
            }
        }
        bytes.push(0);
        bytes
    }

    /// A few whole requests, in any order, some of them twice.
    fn shuffled(&mut self) -> Vec<Vec<u8>> {
        let mut requests: Vec<_> = (0..6).map(|_| self.request()).collect();
        requests.push(requests[self.below(6)].clone());
        requests.push(requests[self.below(6)].clone());
        for end in (2..=requests.len()).rev() {
            let at = self.below(end);
            requests.swap(at, end - 1);
        }
        requests
    }
}

// ---- the board -----------------------------------------------------------------------------

/// A board that holds the plan, was armed once, and is at rest again: so there is a used nonce.
fn at_rest(seed: u64) -> (Session<Uno>, Frames) {
    let mut session = Session::new(Uno::load(&image()).expect("the image can be loaded"));
    session.hello();
    session.arm(&sequence());
    let hash = hash_of(&sequence());
    assert_eq!(session.ask(Command::Abort), Reply::Done);
    assert_eq!(session.ask(Command::Clear), Reply::Done);
    let Reply::Nonce(stale) = session.ask(Command::Arm(hash)) else { panic!("it can be armed") };
    assert_eq!(session.ask(Command::Confirm { hash, nonce: stale }), Reply::Done);
    assert_eq!(session.ask(Command::Abort), Reply::Done);
    assert_eq!(session.ask(Command::Clear), Reply::Done);
    session.board.forget_edges();
    let frames = Frames { random: Random::new(seed), hash, stale, number: session.number };
    (session, frames)
}

/// The line of a board; what the board answers is heard, but nobody waits for it.
struct Line {
    session: Session<Uno>,
    receiver: Receiver,
    replies: usize,
    events: Vec<Event>,
}

impl Line {
    fn new(session: Session<Uno>) -> Self {
        Self { session, receiver: Receiver::default(), replies: 0, events: Vec::new() }
    }

    /// Send a frame behind the others, never far ahead.
    fn send(&mut self, bytes: &[u8]) {
        self.session.board.send(bytes);
        while self.session.board.unsent() > AHEAD {
            self.run_for(AHEAD as u64 / 2 * CYCLES_PER_BYTE);
        }
    }

    fn run_for(&mut self, cycles: u64) {
        self.session.board.run_for(cycles);
        for byte in self.session.board.received() {
            match self.receiver.take::<Answer>(byte) {
                Received::Nothing => {}
                Received::Garbled => panic!("the board has sent what is no frame"),
                Received::Message(Answer::Reply { .. }) => self.replies += 1,
                Received::Message(Answer::Event { event, .. }) => self.events.push(event),
            }
        }
    }

    /// Let the line drain, and ask how the board is, whatever numbers it has heard.
    fn look(&mut self) -> Status {
        self.run_for(self.session.board.unsent() as u64 * CYCLES_PER_BYTE + 20 * MS);
        self.session.hello();
        let status = self.session.status();
        assert_eq!(self.session.board.resets(), 0, "the watchdog is fed");
        assert_eq!(status.plan, hash_of(&sequence()), "the plan is the same");
        status
    }

    /// No output and no enable has moved: it has neither armed nor run, not for a moment.
    fn assert_untouched(&mut self, sent: usize) {
        let state = self.look().state;
        assert!(matches!(state, State::Idle | State::Asked), "{state:?} after {sent} frames");
        assert_eq!(self.events, [], "nothing has happened");
        for pin in [Pin::D6, Pin::D7, Pin::D9, Pin::D10] {
            assert_eq!(self.session.board.edges_of(pin).count(), 0, "{pin} after {sent} frames");
        }
    }

    fn tell(&mut self, frames: &str, measured: &str) {
        let status = self.look();
        println!(
            "{frames} | {measured} | {} answered, {} garbled, {} bytes overrun",
            self.replies, status.garbled, status.overrun
        );
    }
}

// ---- tests ---------------------------------------------------------------------------------

#[test]
fn damaged_frames_do_nothing() {
    let (session, mut frames) = at_rest(20_190_811);
    let mut line = Line::new(session);
    for sent in 1..=FRAMES {
        line.send(&frames.damaged());
        if sent % LOOK == 0 {
            line.assert_untouched(sent);
            frames.number = line.session.number;
        }
    }
    line.tell(&format!("{FRAMES} damaged frames at rest"), UNTOUCHED);
}

#[test]
fn duplicated_and_reordered_frames_start_nothing() {
    let (session, mut frames) = at_rest(11_748);
    let mut line = Line::new(session);
    let mut sent = 0;
    while sent < FRAMES {
        let requests = frames.shuffled();
        for bytes in &requests {
            line.send(bytes);
            // Some come while others are served, some do not.
            line.run_for(frames.below(4) as u64 * MS);
        }
        sent += requests.len();
        if sent % LOOK < requests.len() {
            line.assert_untouched(sent);
            frames.number = line.session.number;
        }
    }
    line.tell(&format!("{sent} whole frames at rest, duplicated and reordered"), UNTOUCHED);
}

/// Four seconds of run under frames of some kind, now without a gap, now with time to be served.
fn run_under(seed: u64, name: &str, mut next: impl FnMut(&mut Frames) -> Vec<Vec<u8>>) {
    let (mut session, mut frames) = at_rest(seed);
    let plan = sequence();
    session.start(&plan);
    // The line changes hands between two frames: that it has started is told, and no edge is made yet.
    while !session.events.iter().any(|(_, event)| matches!(event, Event::Started { .. })) {
        session.run_for(1_000);
    }
    assert_eq!(session.board.edges_of(Pin::D9).count(), 0);
    let end = session.board.cycle() + plan.length() + 20 * MS;
    let mut line = Line::new(session);
    let mut sent = 0;
    while line.session.board.cycle() < end {
        let some = next(&mut frames);
        for bytes in &some {
            line.send(bytes);
            line.run_for(frames.below(3) as u64 * MS);
        }
        sent += some.len();
    }
    let status = line.look();
    // Finished, and then perhaps cleared or asked by a frame.
    assert!(matches!(status.state, State::Finished | State::Idle | State::Asked), "{status:?}");
    let deviations = deviations(line.session.board.edges(), &plan);
    let worst = deviations.iter().map(|cycles| cycles.abs()).max().unwrap_or(0);
    assert_eq!(worst, 0, "cycles beside the plan");
    let (pass, most) = (status.longest_pass, line.session.limits.pass);
    let edges = deviations.len();
    let measured = format!("{edges} edges on plan to the cycle, longest pass {pass} of {most}");
    line.tell(&format!("{sent} {name}"), &measured);
    assert!(pass <= most, "a pass of {pass} cycles; the certificate rests on {most}");
    assert!(sent > 1_000, "{sent} frames only");
}

#[test]
fn a_run_goes_on_under_damaged_frames() {
    run_under(641, "damaged frames during a run", |frames| vec![frames.damaged()]);
}

#[test]
fn a_run_goes_on_under_duplicated_and_reordered_frames() {
    let name = "whole frames during a run, duplicated and reordered";
    run_under(60_000, name, Frames::shuffled);
}
