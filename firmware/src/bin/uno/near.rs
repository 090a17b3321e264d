//! What main loop and interrupts share: near edges, edges made, what went wrong.

use crate::shared::Shared;
use crate::timers::{self, CLOSE, FAR, Phases};
use heapless::Deque;
use phasewalk_firmware::arming::{Arming, NearEdge, NearEdges};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::fault::Fault;

/// Edges made that wait for the main loop. In its longest pass each output makes at most
/// one armed edge and those waiting behind it.
const MADE: usize = 16;

/// Edges from being near until being told.
pub struct Near {
    laser: NearEdges,
    camera: NearEdges,
    led: NearEdges,
    made: Deque<(Channel, NearEdge), MADE>,
    /// What the outputs became last: laser, camera, LED.
    levels: [bool; 3],
    /// The camera's trigger whose first exposure is awaited.
    trigger: Option<u16>,
    exposed: Option<u16>,
    fault: Option<Fault>,
    pub phases: Phases,
    /// Wraps of Timer1.
    pub overflows: u32,
    /// When the start input rose.
    pub start: Option<u64>,
}

/// The one there is.
pub static NEAR: Shared<Near> = Shared::new(Near {
    laser: NearEdges::new(),
    camera: NearEdges::new(),
    led: NearEdges::new(),
    made: Deque::new(),
    levels: [false; 3],
    trigger: None,
    exposed: None,
    fault: None,
    phases: Phases::UNKNOWN,
    overflows: 0,
    start: None,
});

impl Near {
    /// Whether a channel has room for an edge.
    pub fn has_room(&self, channel: Channel) -> bool {
        match channel {
            Channel::Laser => self.laser.has_room(),
            Channel::Camera => self.camera.has_room(),
            Channel::Stimulus => self.led.has_room(),
        }
    }

    /// Take an edge less than [`FAR`]`.reach` ahead and arm it if it is the next.
    pub fn push(&mut self, channel: Channel, edge: NearEdge) {
        match channel {
            Channel::Laser => {
                self.laser.push(edge);
                self.arm_laser();
            }
            Channel::Camera => {
                self.camera.push(edge);
                self.arm_camera();
            }
            Channel::Stimulus => {
                self.led.push(edge);
                self.wake_led();
            }
        }
    }

    #[inline(always)]
    fn arm_laser(&mut self) {
        match self.laser.arm(timers::counter(), FAR) {
            Arming::Set(edge) => timers::arm_laser(edge),
            Arming::Late => self.stop(Fault::Late),
            Arming::Nothing | Arming::Wait(_) => {}
        }
    }

    #[inline(always)]
    fn arm_camera(&mut self) {
        match self.camera.arm(timers::counter(), FAR) {
            Arming::Set(edge) => {
                timers::arm_camera(edge);
                if edge.high {
                    timers::forget_capture();
                }
            }
            Arming::Late => self.stop(Fault::Late),
            Arming::Nothing | Arming::Wait(_) => {}
        }
    }

    /// Timer2 has woken us for the LED.
    #[inline(always)]
    pub fn arm_led(&mut self) {
        match self.led.arm(timers::counter(), CLOSE) {
            Arming::Set(edge) => {
                timers::arm_led(edge, self.phases);
                self.wake_led();
            }
            Arming::Late => self.stop(Fault::Late),
            // Some wraps of Timer2 too early.
            Arming::Nothing | Arming::Wait(_) => {}
        }
    }

    #[inline(always)]
    fn wake_led(&mut self) {
        timers::wake_led(self.led.next().map(|edge| edge.tick), self.phases);
    }

    /// A match of the laser's output.
    #[inline(always)]
    pub fn laser_matched(&mut self) {
        if let Some(edge) = self.laser.matched(timers::counter()) {
            self.arm_laser();
            self.note(Channel::Laser, edge);
        }
    }

    /// A match of the camera's output.
    #[inline(always)]
    pub fn camera_matched(&mut self) {
        if let Some(edge) = self.camera.matched(timers::counter()) {
            if edge.high {
                self.await_exposure(edge.tick);
            }
            self.arm_camera();
            self.note(Channel::Camera, edge);
        }
    }

    /// A match of the LED's output.
    #[inline(always)]
    pub fn led_matched(&mut self) {
        if let Some(edge) = self.led.matched(timers::counter()) {
            timers::led_made();
            self.note(Channel::Stimulus, edge);
        }
    }

    /// An edge was made: is the pin what it should be?
    #[inline(always)]
    fn note(&mut self, channel: Channel, edge: NearEdge) {
        let index = channel.index();
        if let Some(level) = self.levels.get_mut(index) {
            *level = edge.high;
        }
        let full = self.made.push_back((channel, edge)).is_err();
        if full || timers::levels().get(index) != Some(&edge.high) {
            self.stop(Fault::ReadBack);
        }
    }

    /// The camera was triggered at `tick`; its first exposure may have begun since.
    #[inline(always)]
    fn await_exposure(&mut self, tick: u16) {
        self.trigger = Some(tick);
        match timers::captured() {
            Some(capture) if self.exposure(capture) => {}
            _ => {
                timers::forget_capture();
                timers::await_capture(true);
            }
        }
    }

    /// EXPOSE rose.
    #[inline(always)]
    pub fn capture(&mut self) {
        if self.exposure(timers::capture()) {
            timers::await_capture(false);
        }
    }

    /// Whether the capture came after the trigger.
    #[inline(always)]
    fn exposure(&mut self, capture: u16) -> bool {
        let Some(trigger) = self.trigger else { return true };
        let after = capture.wrapping_sub(trigger) < 0x8000;
        if after {
            self.exposed = Some(capture);
            self.trigger = None;
        }
        after
    }

    /// An edge that was made.
    pub fn made(&mut self) -> Option<(Channel, NearEdge)> {
        self.made.pop_front()
    }

    /// The first exposure after a trigger.
    pub fn exposed(&mut self) -> Option<u16> {
        self.exposed.take()
    }

    /// Whether the pins are what the edges made so far say. A pin whose edge has been made but not
    /// noted is not looked at: its interrupt does.
    pub fn read_back(&mut self) -> bool {
        let levels = timers::levels();
        // After the pins: an edge between the two reads counts as passed.
        let now = timers::counter();
        let edges = [&self.laser, &self.camera, &self.led];
        let agrees = |((edges, level), expected): ((&&NearEdges, &bool), &bool)| {
            level == expected || edges.has_passed(now)
        };
        edges.iter().zip(&levels).zip(&self.levels).all(agrees)
    }

    /// All outputs low for a reason.
    pub fn stop(&mut self, fault: Fault) {
        timers::all_low();
        self.forget();
        self.fault = self.fault.or(Some(fault));
    }

    /// What has gone wrong since [`Near::all_low`].
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// All outputs low, faults forgotten.
    pub fn all_low(&mut self) {
        timers::all_low();
        self.forget();
        self.fault = None;
    }

    fn forget(&mut self) {
        timers::await_capture(false);
        self.laser.clear();
        self.camera.clear();
        self.led.clear();
        self.levels = [false; 3];
        self.trigger = None;
    }
}
