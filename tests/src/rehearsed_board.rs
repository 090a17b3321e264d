//! The board's whole program on the desktop, behind a pseudo-terminal: what the host program
//! talks to is the firmware itself, its clock tied to the real one.

use num_complex::Complex;
use phasewalk_core::online::OnlineTracker;
use phasewalk_firmware::board::{Board, Identity, Inputs, Life, Line, Offer, Outputs, Solve};
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::device::Device;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::frame::{self, Received, Receiver};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{Answer, Estimate, SPECKLE_BYTES, State};
use phasewalk_firmware::rehearsal::{AsF405, AsUno, Rehearsal, Rehearses};
use serialport::{SerialPort, TTYPort};
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver as Orders, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A board that can be rehearsed.
pub trait Kind: Rehearses + Send + 'static {
    /// Ticks of a pass of the main loop.
    const PASS: u32;
}

impl Kind for AsUno {
    const PASS: u32 = 2_000;
}

impl Kind for AsF405 {
    const PASS: u32 = 8_400;
}

/// The desktop's thread looks at the line so often.
const TURN: Duration = Duration::from_millis(1);

/// What answers are turned into on their way: dropped, changed, doubled.
pub type Filter = Box<dyn FnMut(Answer) -> Vec<Answer> + Send>;

/// The rehearsal, with a camera that says when it exposes, and with the core's solver.
pub struct Bench<M = AsUno> {
    /// The board without hardware.
    pub rehearsal: Rehearsal<M>,
    /// From the camera's trigger to its EXPOSE edge, in ticks; none: not wired.
    pub exposure_delay: Option<u64>,
    /// What it says of itself.
    pub identity: Identity,
    /// Every edge of the outputs.
    pub edges: Vec<Edge>,
    exposures: VecDeque<u64>,
    solver: Option<Solver>,
}

impl<M: Kind> Default for Bench<M> {
    fn default() -> Self {
        let mut rehearsal = Rehearsal::default();
        let identity = rehearsal.identity();
        let (edges, exposures) = (Vec::new(), VecDeque::new());
        Self { rehearsal, exposure_delay: None, identity, edges, exposures, solver: None }
    }
}

/// The on-line solver with the speckles of a volume so far.
struct Solver {
    tracker: Box<OnlineTracker<f32>>,
    speckles: usize,
    volume: Vec<Complex<f32>>,
}

impl Solver {
    /// Ticks that a volume takes, by its word.
    const TOOK: u32 = 84_000;

    fn new(speckles: u16, looks: u32) -> Option<Self> {
        let speckles = usize::from(speckles);
        let tracker = OnlineTracker::new(speckles, f32::from_bits(looks).into()).ok()?;
        Some(Self { tracker: Box::new(tracker), speckles, volume: Vec::new() })
    }

    fn take(&mut self, first: u16, bytes: &[u8]) -> bool {
        let count = bytes.len() / SPECKLE_BYTES;
        let next = self.volume.len();
        let whole = bytes.len().is_multiple_of(SPECKLE_BYTES);
        if usize::from(first) != next || !whole || next + count > self.speckles {
            return false;
        }
        let part = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
        let speckle = |bytes: &[u8]| Complex { re: part(&bytes[..4]), im: part(&bytes[4..]) };
        self.volume.extend(bytes.chunks_exact(SPECKLE_BYTES).map(speckle));
        true
    }

    fn solved(&mut self) -> Option<Estimate> {
        if self.volume.len() < self.speckles {
            return None;
        }
        let estimate = self.tracker.push(&self.volume);
        self.volume.clear();
        Some(Estimate {
            volume: estimate.frame as u32,
            phase: estimate.phase_rad.to_bits(),
            sigma: estimate.sigma_rad.to_bits(),
            took: Self::TOOK,
        })
    }
}

impl<M> Solve for Bench<M> {
    fn begin_series(&mut self, speckles: u16, looks: u32) -> bool {
        self.solver = Solver::new(speckles, looks);
        self.solver.is_some()
    }

    fn samples(&mut self, first: u16, bytes: &[u8]) -> bool {
        self.solver.as_mut().is_some_and(|solver| solver.take(first, bytes))
    }

    fn solved(&mut self) -> Option<Estimate> {
        self.solver.as_mut()?.solved()
    }

    fn phase_line(&mut self, high: bool) {
        self.rehearsal.phase_line(high);
    }
}

impl<M: Kind> Outputs for Bench<M> {
    fn now(&mut self) -> u64 {
        self.rehearsal.now()
    }

    fn offer(&mut self, edge: Edge) -> Offer {
        self.rehearsal.offer(edge)
    }

    fn made(&mut self) -> Option<Edge> {
        let edge = self.rehearsal.made()?;
        self.edges.push(edge);
        if let Some(delay) =
            self.exposure_delay.filter(|_| edge.channel == Channel::Camera && edge.high)
        {
            self.exposures.push_back(edge.tick + delay);
        }
        Some(edge)
    }

    fn exposed(&mut self) -> Option<u64> {
        let now = self.rehearsal.now;
        let due = self.exposures.front().is_some_and(|&tick| tick <= now);
        if due { self.exposures.pop_front() } else { None }
    }

    fn all_low(&mut self) {
        self.exposures.clear();
        self.rehearsal.all_low();
    }

    fn stimulus_low(&mut self) {
        self.rehearsal.stimulus_low();
    }

    fn frame_clock(&mut self, period: u32) {
        self.rehearsal.frame_clock(period);
    }

    fn read_back(&mut self) -> bool {
        self.rehearsal.read_back()
    }

    fn latched(&mut self) -> Option<Fault> {
        self.rehearsal.latched()
    }

    fn interrupts(&mut self) -> u16 {
        self.rehearsal.interrupts()
    }
}

impl<M> Inputs for Bench<M> {
    fn interlock_closed(&mut self) -> bool {
        self.rehearsal.interlock_closed()
    }

    fn interlock_passes_pulse(&mut self) -> bool {
        self.rehearsal.interlock_passes_pulse()
    }

    fn guard_interlock(&mut self, on: bool) {
        self.rehearsal.guard_interlock(on);
    }

    fn await_start(&mut self, on: bool) {
        self.rehearsal.await_start(on);
    }

    fn camera_ready(&mut self) -> bool {
        self.rehearsal.camera_ready()
    }

    fn start_edge(&mut self) -> Option<u64> {
        self.rehearsal.start_edge()
    }
}

impl<M> Line for Bench<M> {
    fn read(&mut self) -> Option<u8> {
        self.rehearsal.read()
    }

    fn write(&mut self, byte: u8) -> bool {
        self.rehearsal.write(byte)
    }

    fn overrun(&mut self) -> u16 {
        self.rehearsal.overrun()
    }
}

impl<M> Life for Bench<M> {
    fn feed_watchdog(&mut self) {
        self.rehearsal.feed_watchdog();
    }

    fn toggle_enable(&mut self) {
        self.rehearsal.toggle_enable();
    }

    fn rest_enable(&mut self) {
        self.rehearsal.rest_enable();
    }

    fn stack_intact(&mut self) -> bool {
        self.rehearsal.stack_intact()
    }
}

impl<M: Kind> Board for Bench<M> {
    const LIMITS: Limits = M::LIMITS;

    fn identity(&mut self) -> Identity {
        self.identity
    }
}

/// How a board differs from a good one that has been running for long.
#[derive(Debug, Clone, Copy, Default)]
pub struct Setup {
    /// Its clock against the desktop's, in parts per million.
    pub ppm: f64,
    /// From the camera's trigger to its EXPOSE edge, in ticks; none: not wired.
    pub exposure_delay: Option<u64>,
    /// A boot loader swallows what comes until so long after the first byte.
    pub boot: Duration,
}

type Order<M> = Box<dyn FnOnce(&mut World<M>) + Send>;

/// The board's side of the line.
pub struct World<M = AsUno> {
    /// The board.
    pub device: Device<Bench<M>>,
    /// What its answers are turned into.
    pub filter: Filter,
    /// The line itself, for bytes that no board would send.
    pub line: TTYPort,
    /// It neither hears nor is heard.
    pub deaf: bool,
    setup: Setup,
    begin: Instant,
    first_byte: Option<Instant>,
    answers: Receiver,
}

/// A board behind a pseudo-terminal; dropped, it is unplugged.
pub struct RehearsedBoard<M: Kind = AsUno> {
    /// What the host program opens.
    pub port: String,
    orders: Option<Sender<Order<M>>>,
    thread: Option<JoinHandle<()>>,
    /// Held open, so that the line outlives one program and serves the next.
    _far_end: TTYPort,
}

impl Default for RehearsedBoard {
    fn default() -> Self {
        Self::start(Setup::default())
    }
}

impl RehearsedBoard {
    /// Plug an Uno in.
    ///
    /// # Panics
    /// If the machine has no pseudo-terminals.
    #[must_use]
    pub fn start(setup: Setup) -> Self {
        Self::plug_in(setup)
    }
}

impl RehearsedBoard<AsF405> {
    /// Plug an STM32F405 in.
    ///
    /// # Panics
    /// If the machine has no pseudo-terminals.
    #[must_use]
    pub fn f405() -> Self {
        Self::plug_in(Setup::default())
    }
}

impl<M: Kind> RehearsedBoard<M> {
    fn plug_in(setup: Setup) -> Self {
        let (line, far_end) = TTYPort::pair().expect("a pseudo-terminal");
        let (mut line, far_end) = (ours_alone(line), ours_alone(far_end));
        line.set_timeout(TURN).expect("a time-out");
        let port = far_end.name().expect("it has a name");
        let (orders, receiver) = channel();
        let thread = std::thread::spawn(move || World::new(line, setup).live(&receiver));
        Self { port, orders: Some(orders), thread: Some(thread), _far_end: far_end }
    }

    /// Do something to the board and wait for what it returns.
    ///
    /// # Panics
    /// If the board's thread has panicked.
    pub fn with<R: Send + 'static>(
        &self,
        act: impl FnOnce(&mut World<M>) -> R + Send + 'static,
    ) -> R {
        let (sender, receiver) = channel();
        let order: Order<M> = Box::new(move |world| {
            let _ = sender.send(act(world));
        });
        self.orders.as_ref().expect("it is plugged in").send(order).expect("its thread lives");
        receiver.recv().expect("its thread lives")
    }

    /// Let answers pass through `filter`.
    pub fn filter(&self, filter: impl FnMut(Answer) -> Vec<Answer> + Send + 'static) {
        self.with(move |world| world.filter = Box::new(filter));
    }

    /// The edges its outputs have made.
    #[must_use]
    pub fn edges(&self) -> Vec<Edge> {
        self.with(|world| world.device.board().edges.clone())
    }

    /// What it is doing.
    #[must_use]
    pub fn state(&self) -> State {
        self.with(|world| world.device.state())
    }

    /// Wait until it does what `is` says.
    ///
    /// # Panics
    /// If it does not within a minute.
    pub fn wait_until(&self, is: impl Fn(State) -> bool) {
        let begin = Instant::now();
        while !is(self.state()) {
            assert!(begin.elapsed() < Duration::from_secs(60), "still {:?}", self.state());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Pull the plug.
    pub fn unplug(mut self) {
        self.stop();
    }

    fn stop(&mut self) {
        drop(self.orders.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl<M: Kind> Drop for RehearsedBoard<M> {
    fn drop(&mut self) {
        self.stop();
    }
}

/// The same file, closed in the programs that are started: held by them, it could not be unplugged.
fn ours_alone(end: TTYPort) -> TTYPort {
    end.try_clone_native().expect("a second handle")
}

impl<M: Kind> World<M> {
    fn new(line: TTYPort, setup: Setup) -> Self {
        let bench = Bench { exposure_delay: setup.exposure_delay, ..Bench::default() };
        Self {
            device: Device::new(bench),
            filter: Box::new(|answer| vec![answer]),
            line,
            deaf: false,
            setup,
            begin: Instant::now(),
            first_byte: None,
            answers: Receiver::default(),
        }
    }

    /// Start anew, as by its reset button.
    pub fn reset(&mut self) {
        let exposure_delay = self.setup.exposure_delay;
        self.device = Device::new(Bench { exposure_delay, ..Bench::default() });
        self.begin = Instant::now();
    }

    fn live(mut self, orders: &Orders<Order<M>>) {
        loop {
            match orders.try_recv() {
                Ok(order) => order(&mut self),
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => return,
            }
            self.take_bytes();
            self.catch_up();
        }
    }

    fn take_bytes(&mut self) {
        let mut bytes = [0; 64];
        let taken = match self.line.read(&mut bytes) {
            Ok(taken) => taken,
            Err(error) if error.kind() == ErrorKind::TimedOut => return,
            Err(error) => panic!("the line: {error}"),
        };
        let first = *self.first_byte.get_or_insert_with(Instant::now);
        if self.deaf || first.elapsed() < self.setup.boot {
            return;
        }
        for &byte in &bytes[..taken] {
            let full = self.device.board().rehearsal.inward.push_back(byte);
            full.expect("the host says no more than it may");
        }
    }

    /// Passes until the board's clock is where the desktop's is.
    fn catch_up(&mut self) {
        let rate = f64::from(M::LIMITS.ticks_per_second) * (1.0 + self.setup.ppm * 1e-6);
        let target = (self.begin.elapsed().as_secs_f64() * rate) as u64;
        while self.device.board().rehearsal.now + u64::from(M::PASS) <= target {
            self.device.board().rehearsal.advance(M::PASS);
            self.device.pass();
            self.say();
        }
    }

    fn say(&mut self) {
        while let Some(byte) = self.device.board().rehearsal.outward.pop_front() {
            let Received::Message(answer) = self.answers.take::<Answer>(byte) else { continue };
            let deaf = self.deaf;
            for answer in (self.filter)(answer).into_iter().filter(|_| !deaf) {
                let frame = frame::encode(&answer).expect("an answer fits");
                // Nobody listens: lost, as on a real line.
                let _ = self.line.write_all(&frame);
            }
        }
    }
}
