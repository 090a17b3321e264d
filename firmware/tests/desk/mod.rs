//! A board without hardware, and a host that talks to it in the same process.

// Each test file uses a part of this.
#![allow(dead_code)]

use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::device::Device;
use phasewalk_firmware::frame::{self, Received, Receiver};
use phasewalk_firmware::message::{Answer, Command, Event, Reply, Request, State, Status};
use phasewalk_firmware::plan::{Caps, Inputs, Interlock, Plan, Pulse, Start, Stimulus};
use phasewalk_firmware::rehearsal::{AsF405, AsUno, Rehearsal, Rehearses};

/// Ticks of a millisecond.
pub const MS: u32 = 16_000;

/// Ticks of a pass of the main loop, as on the Uno.
pub const PASS: u32 = 2_000;

/// Board and host.
pub struct Desk<M = AsUno> {
    pub device: Device<Rehearsal<M>>,
    pub number: u8,
    receiver: Receiver,
    pub replies: Vec<(u8, Reply)>,
    pub events: Vec<(u16, Event)>,
}

impl Desk {
    /// With an Uno.
    pub fn new() -> Self {
        Self::default()
    }
}

impl Desk<AsF405> {
    /// With an STM32F405, whose solver says what the test tells it to.
    pub fn with_solver() -> Self {
        Self::default()
    }
}

impl<M: Rehearses> Default for Desk<M> {
    fn default() -> Self {
        Self {
            device: Device::new(Rehearsal::default()),
            number: 0,
            receiver: Receiver::default(),
            replies: Vec::new(),
            events: Vec::new(),
        }
    }
}

impl<M: Rehearses> Desk<M> {
    /// Run the board's main loop for so long.
    pub fn run(&mut self, ticks: u32) {
        let end = self.device.board().now + u64::from(ticks);
        while self.device.board().now < end {
            self.pass();
        }
    }

    pub fn pass(&mut self) {
        self.device.pass();
        self.device.board().advance(PASS);
        while let Some(byte) = self.device.board().outward.pop_front() {
            match self.receiver.take::<Answer>(byte) {
                Received::Nothing => {}
                Received::Garbled => panic!("the board has sent what is no frame"),
                Received::Message(Answer::Reply { number, reply }) => {
                    self.replies.push((number, reply));
                }
                Received::Message(Answer::Event { number, event }) => {
                    self.events.push((number, event));
                }
            }
        }
    }

    /// Put bytes on the line; the board takes them as it runs.
    pub fn send(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            while self.device.board().inward.push_back(byte).is_err() {
                self.pass();
            }
        }
    }

    /// Send a request with a number of one's choice.
    pub fn say(&mut self, number: u8, command: Command<'_>) {
        let frame = frame::encode(&Request { number, command }).expect("a request fits");
        self.send(&frame);
    }

    /// The answer to request `number`, if there is one within 50 ms.
    pub fn answer(&mut self, number: u8) -> Option<Reply> {
        for _ in 0..50 * MS / PASS {
            self.pass();
            if let Some(at) = self.replies.iter().position(|(n, _)| *n == number) {
                return Some(self.replies.remove(at).1);
            }
        }
        None
    }

    pub fn ask(&mut self, command: Command<'_>) -> Reply {
        // What was answered to an earlier request of this number is not meant.
        self.replies.clear();
        let number = self.number;
        self.number = number.wrapping_add(1);
        self.say(number, command);
        self.answer(number).expect("the board answers")
    }

    pub fn status(&mut self) -> Status {
        match self.ask(Command::Status) {
            Reply::Status(status) => status,
            other => panic!("{other:?}"),
        }
    }

    /// Upload and commit; says the hash.
    pub fn load(&mut self, plan: &Plan) -> u32 {
        let compiled = Compiled::new(plan).expect("the plan fits");
        let hash = compiled.hash();
        assert_eq!(self.ask(Command::Upload(compiled.bytes())), Reply::Hash(hash));
        assert_eq!(self.ask(Command::Commit(hash)), Reply::Hash(hash));
        hash
    }

    pub fn arm(&mut self, hash: u32) -> Reply {
        match self.ask(Command::Arm(hash)) {
            Reply::Nonce(nonce) => self.ask(Command::Confirm { hash, nonce }),
            refused => refused,
        }
    }

    /// Load, arm, start.
    pub fn start(&mut self, plan: &Plan) {
        let hash = self.load(plan);
        assert_eq!(self.arm(hash), Reply::Done);
        assert_eq!(self.ask(Command::Start), Reply::Done);
        assert_eq!(self.device.state(), State::Running);
    }

    /// Time zero of the last run.
    pub fn started(&self) -> u64 {
        let started = self.events.iter().rev().find_map(|(_, event)| match event {
            Event::Started { tick } => Some(*tick),
            _ => None,
        });
        started.expect("the board has told that it started")
    }

    /// Edges that the board says it has made, counted from time zero.
    pub fn made(&self) -> Vec<Edge> {
        let zero = self.started();
        let made = self.events.iter().filter_map(|(_, event)| match event {
            Event::Made(edge) => Some(Edge { tick: edge.tick - zero, ..*edge }),
            _ => None,
        });
        made.collect()
    }

    /// Run until 1 ms into the third sweep of [`small`], when the light is on, too.
    pub fn run_to_third_sweep(&mut self) {
        while !self.device.board().level(Channel::Stimulus) {
            assert_eq!(self.device.state(), State::Running);
            self.pass();
        }
        self.run(MS);
        assert!(self.device.board().level(Channel::Laser));
    }

    /// All outputs are low, and nothing will make them high.
    pub fn is_dark(&mut self) -> bool {
        let dark = |desk: &mut Self| {
            Channel::ALL.iter().all(|&channel| !desk.device.board().level(channel))
        };
        let now = dark(self);
        self.run(2 * M::LIMITS.reach);
        now && dark(self)
    }
}

/// Five volumes of 2 ms, 10 ms apart, light with the third until the end.
pub fn small() -> Plan {
    Plan {
        inputs: Inputs { interlock: Interlock::On, ready: true, start: Start::Command },
        repeats: 1,
        repeat_period: 0,
        bursts: 5,
        interval: u64::from(10 * MS),
        sweeps: 1,
        spacing: [0; 2],
        laser: Pulse { delay: 0, width: 2 * MS },
        camera: Pulse { delay: 100, width: 1_600 },
        frame: 0,
        phase_limit: None,
        stimulus: Some(Stimulus {
            burst: 2,
            sweep: 0,
            delay: 0,
            on: u64::from(22 * MS),
            pulses: 1,
            period: 0,
            sham: false,
        }),
        caps: Caps {
            laser_pulse: 3 * MS,
            laser_total: u64::from(20 * MS),
            stimulus_pulse: u64::from(30 * MS),
            stimulus_total: u64::from(30 * MS),
            images_per_sweep: 512,
            camera_images: 10_000,
            heartbeat: 0,
        },
    }
}
