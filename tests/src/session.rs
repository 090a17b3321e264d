//! A conversation with a simulated board: what the host program does over a serial port, here
//! cycle by cycle and without it.

use crate::board::{Pin, PinEdge, Uno};
use crate::f405::{self, F405};
use crate::random::Random;
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::frame::{self, Received, Receiver};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{Answer, Command, Event, Hello, Reply, Request, State, Status};
use phasewalk_firmware::plan::{Caps, Inputs, Interlock, Plan, Pulse, Start, Stimulus};
use phasewalk_firmware::rehearsal::rehearse;
use std::path::PathBuf;

/// Cycles of a millisecond on the Uno.
pub const MS: u64 = 16_000;

/// Cycles of a second on the Uno.
pub const SECOND: u64 = 1000 * MS;

/// Cycles of a byte at 250,000 baud on the Uno.
pub const CYCLES_PER_BYTE: u64 = 640;

/// An answer takes a few milliseconds; after so many the board does not answer.
const PATIENCE: u64 = 200;

/// Bytes per second on the line: 250,000 baud.
const BYTES_PER_SECOND: u64 = 25_000;

/// A simulated board that one can talk with. Times are in ticks of its own clock.
pub trait Board {
    /// What it can do.
    const LIMITS: Limits;
    /// Ticks since power-on.
    fn time(&self) -> u64;
    /// Run to a tick, and say what the board has sent until then.
    fn run_to(&mut self, until: u64) -> Vec<u8>;
    /// Send bytes to the board, one after the other without a gap.
    fn put(&mut self, bytes: &[u8]);
    /// Safety loop closed, camera ready, nothing else on the inputs.
    fn prepare(&mut self);
}

impl<S: Simulator> Board for S {
    const LIMITS: Limits = Limits::UNO;

    fn time(&self) -> u64 {
        self.cycle()
    }

    fn run_to(&mut self, until: u64) -> Vec<u8> {
        self.run(until)
    }

    fn put(&mut self, bytes: &[u8]) {
        self.send(bytes);
    }

    fn prepare(&mut self) {
        self.drive(Pin::D2, false);
        self.drive(Pin::D3, false);
        self.drive(Pin::D4, true);
        self.drive(Pin::D8, false);
    }
}

impl Board for F405 {
    const LIMITS: Limits = Limits::F405;

    fn time(&self) -> u64 {
        self.tick()
    }

    fn run_to(&mut self, until: u64) -> Vec<u8> {
        self.run_until(until);
        self.received()
    }

    fn put(&mut self, bytes: &[u8]) {
        self.send(bytes);
    }

    fn prepare(&mut self) {
        self.drive(f405::Pin::INTERLOCK, false);
        self.drive(f405::Pin::READY, true);
        self.drive(f405::Pin::START, false);
        self.drive(f405::Pin::EXPOSE, false);
    }
}

/// A simulator of the Uno.
pub trait Simulator {
    /// Cycles since power-on.
    fn cycle(&self) -> u64;
    /// Run to a cycle, and say what the board has sent until then.
    fn run(&mut self, until: u64) -> Vec<u8>;
    /// Send bytes to the board, one after the other without a gap.
    fn send(&mut self, bytes: &[u8]);
    /// Drive an input from now on.
    fn drive(&mut self, pin: Pin, level: bool);
    /// All edges of the outputs so far.
    fn edges(&mut self) -> Vec<PinEdge>;
}

impl Simulator for Uno {
    fn cycle(&self) -> u64 {
        Uno::cycle(self)
    }

    fn run(&mut self, until: u64) -> Vec<u8> {
        self.run_until(until);
        self.received()
    }

    fn send(&mut self, bytes: &[u8]) {
        Uno::send(self, bytes);
    }

    fn drive(&mut self, pin: Pin, level: bool) {
        Uno::drive(self, pin, level);
    }

    fn edges(&mut self) -> Vec<PinEdge> {
        Uno::edges(self).to_vec()
    }
}

/// A conversation.
pub struct Session<S> {
    /// The board.
    pub board: S,
    /// Number of the next request.
    pub number: u8,
    receiver: Receiver,
    /// Events in the order in which they came, with their numbers.
    pub events: Vec<(u16, Event)>,
    replies: Vec<(u8, Reply)>,
    /// Frames of the board that could not be understood.
    pub garbled: usize,
    /// What the board can do, as it said.
    pub limits: Limits,
}

impl<S: Board> Session<S> {
    /// Ticks of a millisecond.
    pub const MS: u64 = S::LIMITS.ticks_per_second as u64 / 1000;

    /// Ticks of a byte at 250,000 baud.
    pub const BYTE: u64 = S::LIMITS.ticks_per_second as u64 / BYTES_PER_SECOND;

    /// A board that has just been switched on, interlock closed and camera ready.
    pub fn new(mut board: S) -> Self {
        board.prepare();
        Self {
            board,
            number: 0,
            receiver: Receiver::default(),
            events: Vec::new(),
            replies: Vec::new(),
            garbled: 0,
            limits: S::LIMITS,
        }
    }

    /// Run for so many ticks.
    pub fn run_for(&mut self, ticks: u64) {
        let until = self.board.time() + ticks;
        let bytes = self.board.run_to(until);
        self.hear(&bytes);
    }

    /// Take what the board has sent.
    pub fn hear(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            match self.receiver.take::<Answer>(byte) {
                Received::Nothing => {}
                Received::Garbled => self.garbled += 1,
                Received::Message(Answer::Reply { number, reply }) => {
                    self.replies.push((number, reply));
                }
                Received::Message(Answer::Event { number, event }) => {
                    self.events.push((number, event));
                }
            }
        }
    }

    /// Send a request without waiting for its answer; says its number.
    ///
    /// # Panics
    /// When a request does not fit a frame: never.
    pub fn say(&mut self, command: Command<'_>) -> u8 {
        let number = self.number;
        self.number = number.wrapping_add(1);
        let frame = frame::encode(&Request { number, command }).expect("requests fit a frame");
        self.board.put(&frame);
        number
    }

    /// The answer to a request; `None` if the board does not answer.
    ///
    /// # Panics
    /// When the simulated processor has stopped.
    pub fn answer(&mut self, number: u8) -> Option<Reply> {
        let end = self.board.time() + PATIENCE * Self::MS;
        loop {
            if let Some(at) = self.replies.iter().position(|(n, _)| *n == number) {
                return Some(self.replies.remove(at).1);
            }
            let before = self.board.time();
            if before >= end {
                return None;
            }
            self.run_for(Self::MS);
            assert!(self.board.time() > before, "the simulated processor has stopped");
        }
    }

    /// Ask and wait.
    ///
    /// # Panics
    /// When the board does not answer.
    pub fn ask(&mut self, command: Command<'_>) -> Reply {
        let shown = format!("{command:?}");
        let number = self.say(command);
        self.answer(number).unwrap_or_else(|| panic!("no answer to {shown}"))
    }

    /// Who the board is.
    ///
    /// # Panics
    /// When it does not say.
    pub fn hello(&mut self) -> Hello {
        // A board that has just started does not listen yet.
        for _ in 0..5 {
            let number = self.say(Command::Hello);
            match self.answer(number) {
                Some(Reply::Hello(hello)) => {
                    self.limits = hello.limits;
                    return hello;
                }
                Some(other) => panic!("{other:?} to hello"),
                None => {}
            }
        }
        panic!("no answer to hello");
    }

    /// How the board is.
    ///
    /// # Panics
    /// When it does not say.
    pub fn status(&mut self) -> Status {
        match self.ask(Command::Status) {
            Reply::Status(status) => status,
            other => panic!("{other:?} to status"),
        }
    }

    /// Upload, commit, arm in two steps.
    ///
    /// # Panics
    /// When the board refuses.
    pub fn arm(&mut self, plan: &Plan) {
        let compiled = Compiled::new(plan).expect("the plan fits");
        let hash = compiled.hash();
        assert_eq!(self.ask(Command::Upload(compiled.bytes())), Reply::Hash(hash));
        assert_eq!(self.ask(Command::Commit(hash)), Reply::Hash(hash));
        let reply = self.ask(Command::Arm(hash));
        let Reply::Nonce(nonce) = reply else { panic!("{reply:?} to arming") };
        assert_eq!(self.ask(Command::Confirm { hash, nonce }), Reply::Done);
    }

    /// Arm and start.
    ///
    /// # Panics
    /// When the board refuses.
    pub fn start(&mut self, plan: &Plan) {
        self.arm(plan);
        self.begin();
    }

    /// Start what is armed.
    ///
    /// # Panics
    /// When the board refuses.
    pub fn begin(&mut self) {
        assert_eq!(self.ask(Command::Start), Reply::Done);
    }

    /// Run for so many ticks with the line to the board never silent: rubbish, and among it a
    /// request for the status every 20 ms. Answers are dropped.
    ///
    /// For a board whose line one can fill beforehand.
    pub fn run_flooded(&mut self, ticks: u64, random: &mut Random) {
        let step = 10 * Self::MS;
        let end = self.board.time() + ticks;
        let mut filled = self.board.time();
        while self.board.time() < end {
            let rubbish = 2 * step / Self::BYTE;
            while filled < self.board.time() + 2 * step {
                let bytes: Vec<u8> = (0..rubbish).map(|_| random.bits() as u8).collect();
                self.board.put(&bytes);
                // Ends the rubbish, so that the request counts.
                self.board.put(&[0]);
                let _ = self.say(Command::Status);
                filled += (rubbish + 8) * Self::BYTE;
            }
            self.run_for(step);
        }
        // Let the line drain; what got lost in the rubbish must not matter.
        self.run_for(filled.saturating_sub(self.board.time()) + 10 * Self::MS);
        self.replies.clear();
        self.hello();
    }

    /// Run until the board says that it is done, asking now and then.
    pub fn finish(&mut self, patience: u64) -> Status {
        let end = self.board.time() + patience;
        loop {
            self.run_for((patience / 100).max(100 * Self::MS));
            let status = self.status();
            if status.state != State::Running || self.board.time() > end {
                // The last events.
                self.run_for(20 * Self::MS);
                return status;
            }
        }
    }

    /// Time zero of the run, in ticks.
    ///
    /// # Panics
    /// When it has not been told.
    pub fn started(&self) -> u64 {
        let started = self.events.iter().rev().find_map(|(_, event)| match event {
            Event::Started { tick } => Some(*tick),
            _ => None,
        });
        started.expect("the board has told that it started")
    }

    /// The edges that the board says it has made.
    pub fn made(&self) -> Vec<Edge> {
        let made = |(_, event): &(u16, Event)| match event {
            Event::Made(edge) => Some(*edge),
            _ => None,
        };
        self.events.iter().filter_map(made).collect()
    }

    /// Events lost on the way, by their numbers.
    pub fn lost(&self) -> usize {
        let gap = |pair: &[(u16, Event)]| usize::from(pair[1].0.wrapping_sub(pair[0].0)) - 1;
        self.events.windows(2).map(gap).sum()
    }
}

/// The image that `cargo xtask firmware` leaves; `PHASEWALK_UNO` names another.
///
/// # Panics
/// When the test cannot find out where it is.
#[must_use]
pub fn image() -> PathBuf {
    std::env::var_os("PHASEWALK_UNO").map_or_else(|| built("uno.elf"), PathBuf::from)
}

/// The same for the STM32F405; `PHASEWALK_F405` names another.
///
/// # Panics
/// When the test cannot find out where it is.
#[must_use]
pub fn f405_image() -> PathBuf {
    std::env::var_os("PHASEWALK_F405").map_or_else(|| built("f405.elf"), PathBuf::from)
}

fn built(name: &str) -> PathBuf {
    let program = std::env::current_exe().expect("a test knows where it is");
    let target = program.ancestors().nth(3).expect("<target>/<profile>/deps/<test>");
    target.join("firmware").join(name)
}

/// The Uno's pin of a channel.
#[must_use]
pub fn pin_of(channel: Channel) -> Pin {
    match channel {
        Channel::Laser => Pin::D9,
        Channel::Camera => Pin::D10,
        Channel::Stimulus => Pin::D6,
    }
}

/// A plan's edges, ticks counted from time zero: (channel, high, tick), channel by channel.
///
/// # Panics
/// When the plan is too dense.
#[must_use]
pub fn planned(plan: &Plan) -> Vec<Edge> {
    planned_on(&Limits::UNO, plan)
}

/// The same on a board with these limits, in its ticks.
///
/// # Panics
/// When the plan is too dense.
#[must_use]
pub fn planned_on(limits: &Limits, plan: &Plan) -> Vec<Edge> {
    let mut edges = Vec::new();
    let compiled = Compiled::new(plan).expect("the plan fits");
    rehearse(limits, &compiled, |rehearsed| edges.push(rehearsed.edge))
        .expect("the plan can be made");
    edges.sort_by_key(|edge| (edge.channel, edge.tick));
    edges
}

/// How many cycles each edge of the laser, camera and stimulus pins lies beside the plan, the first
/// of all being 0 by definition.
///
/// # Panics
/// When the number of edges, or what one is, is not as planned.
#[must_use]
pub fn deviations(edges: &[PinEdge], plan: &Plan) -> Vec<i64> {
    let of = |channel| edges.iter().filter(move |edge| edge.pin == pin_of(channel));
    beside(&Limits::UNO, plan, |channel| of(channel).map(|edge| (edge.cycle, edge.level)).collect())
}

/// The STM32F405's pin of a channel.
#[must_use]
pub fn f405_pin_of(channel: Channel) -> f405::Pin {
    match channel {
        Channel::Laser => f405::Pin::LASER,
        Channel::Camera => f405::Pin::CAMERA,
        Channel::Stimulus => f405::Pin::STIMULUS,
    }
}

/// [`deviations`] for the STM32F405, in its ticks.
///
/// # Panics
/// When the number of edges, or what one is, is not as planned.
#[must_use]
pub fn f405_deviations(edges: &[f405::PinEdge], plan: &Plan) -> Vec<i64> {
    let of = |channel| edges.iter().filter(move |edge| edge.pin == f405_pin_of(channel));
    beside(&Limits::F405, plan, |channel| of(channel).map(|edge| (edge.tick, edge.high)).collect())
}

/// How far the edges that were made, (tick, level) of each channel, lie beside the plan.
fn beside(limits: &Limits, plan: &Plan, made: impl Fn(Channel) -> Vec<(u64, bool)>) -> Vec<i64> {
    let mut deviations = Vec::new();
    let planned = planned_on(limits, plan);
    for channel in Channel::ALL {
        let made = made(channel);
        let planned: Vec<&Edge> = planned.iter().filter(|edge| edge.channel == channel).collect();
        assert_eq!(made.len(), planned.len(), "edges of {channel:?}");
        for ((tick, high), planned) in made.into_iter().zip(planned) {
            assert_eq!(high, planned.high, "level of {channel:?} at {tick}");
            deviations.push(tick as i64 - planned.tick as i64);
        }
    }
    let zero = deviations.first().copied().unwrap_or(0);
    deviations.iter().map(|deviation| deviation - zero).collect()
}

/// The paper's sequence (lines 669-683): 70 sweeps of 8.533 ms, 225 ms apart; the stimulus comes on
/// with the sixth and stays.
#[must_use]
pub fn paper() -> Plan {
    let sweep = 136_533;
    let interval = 225 * MS;
    Plan {
        inputs: Inputs { interlock: Interlock::On, ready: true, start: Start::Command },
        repeats: 1,
        repeat_period: 0,
        bursts: 70,
        interval,
        sweeps: 1,
        spacing: [0; 2],
        laser: Pulse { delay: 0, width: sweep },
        camera: Pulse { delay: 0, width: 1_600 },
        frame: 0,
        phase_limit: None,
        stimulus: Some(Stimulus {
            burst: 5,
            sweep: 0,
            delay: 0,
            on: 64 * interval + u64::from(sweep),
            pulses: 1,
            period: 0,
            sham: false,
        }),
        caps: Caps {
            laser_pulse: 160_000,
            laser_total: SECOND,
            stimulus_pulse: 20 * SECOND,
            stimulus_total: 20 * SECOND,
            images_per_sweep: 512,
            camera_images: 40_000,
            heartbeat: 0,
        },
    }
}

/// The same on the STM32F405, in its ticks; a sweep is as long as 512 frames of 1400 ticks.
#[must_use]
pub fn f405_paper() -> Plan {
    let ms = Session::<F405>::MS;
    let (second, interval, sweep) = (1000 * ms, 225 * ms, 512 * 1_400);
    let mut plan = paper();
    plan.interval = interval;
    plan.laser.width = sweep;
    plan.camera.width = 8_400;
    if let Some(light) = &mut plan.stimulus {
        light.on = 64 * interval + u64::from(sweep);
    }
    plan.caps = Caps {
        laser_pulse: 10 * ms as u32,
        laser_total: second,
        stimulus_pulse: 20 * second,
        stimulus_total: 20 * second,
        ..plan.caps
    };
    plan
}
