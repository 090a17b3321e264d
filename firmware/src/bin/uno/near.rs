//! What main loop and interrupts share: near edges, edges made, what went wrong.

use crate::shared::Shared;
use crate::timers::{self, CLOSE, FAR, Phases};
use phasewalk_firmware::arming::{Arming, NearEdge, NearEdges};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::fault::Fault;

/// Edges from being near until being told.
pub struct Near {
    laser: NearEdges,
    camera: NearEdges,
    led: NearEdges,
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
    trigger: None,
    exposed: None,
    fault: None,
    phases: Phases::UNKNOWN,
    overflows: 0,
    start: None,
});

impl Near {
    /// Take an edge less than [`FAR`]`.reach` ahead, and arm it if it is the next; false when there
    /// is no room.
    #[inline(never)]
    pub fn push(&mut self, channel: Channel, edge: NearEdge) -> bool {
        match channel {
            Channel::Laser => self.laser.push(edge) && self.arm_laser(),
            Channel::Camera => self.camera.push(edge) && self.arm_camera(),
            Channel::Stimulus => self.led.push(edge) && self.wake_led(),
        }
    }

    #[inline(always)]
    fn arm_laser(&mut self) -> bool {
        match self.laser.arm(timers::counter(), FAR) {
            Arming::Set(edge) => timers::arm_laser(edge),
            Arming::Late => self.stop(Fault::Late),
            Arming::Nothing | Arming::Wait => {}
        }
        true
    }

    #[inline(always)]
    fn arm_camera(&mut self) -> bool {
        match self.camera.arm(timers::counter(), FAR) {
            Arming::Set(edge) => {
                timers::arm_camera(edge);
                if edge.high {
                    timers::forget_capture();
                }
            }
            Arming::Late => self.stop(Fault::Late),
            Arming::Nothing | Arming::Wait => {}
        }
        true
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
            Arming::Nothing | Arming::Wait => {}
        }
    }

    #[inline(always)]
    fn wake_led(&mut self) -> bool {
        match self.led.next() {
            Some(edge) => timers::wake_led(edge.tick, self.phases),
            None => timers::let_led_sleep(),
        }
        true
    }

    /// A match of the laser's output.
    #[inline(always)]
    pub fn laser_matched(&mut self) {
        if let Some(edge) = self.laser.matched(timers::counter()) {
            if timers::laser_level() != edge.high {
                return self.stop(Fault::ReadBack);
            }
            self.arm_laser();
        }
    }

    /// A match of the camera's output.
    #[inline(always)]
    pub fn camera_matched(&mut self) {
        if let Some(edge) = self.camera.matched(timers::counter()) {
            if timers::camera_level() != edge.high {
                return self.stop(Fault::ReadBack);
            }
            if edge.high {
                self.await_exposure(edge.tick);
            }
            self.arm_camera();
        }
    }

    /// A match of the LED's output.
    #[inline(always)]
    pub fn led_matched(&mut self) {
        if let Some(edge) = self.led.matched(timers::counter()) {
            timers::led_made();
            if timers::led_level() != edge.high {
                self.stop(Fault::ReadBack);
            }
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
    #[inline(never)]
    pub fn made(&mut self) -> Option<(Channel, NearEdge)> {
        if let Some(edge) = self.laser.collect() {
            return Some((Channel::Laser, edge));
        }
        if let Some(edge) = self.camera.collect() {
            return Some((Channel::Camera, edge));
        }
        self.led.collect().map(|edge| (Channel::Stimulus, edge))
    }

    /// The first exposure after a trigger.
    pub fn exposed(&mut self) -> Option<u16> {
        self.exposed.take()
    }

    /// Whether the pins are what the edges made so far say. A pin whose edge has been made but not
    /// noted is not looked at: its interrupt does.
    #[inline(never)]
    pub fn read_back(&self) -> bool {
        let laser = timers::laser_level() == self.laser.level();
        let camera = timers::camera_level() == self.camera.level();
        let led = timers::led_level() == self.led.level();
        if laser && camera && led {
            return true;
        }
        // After the pins: an edge between the two reads counts as passed.
        let now = timers::counter();
        (laser || self.laser.has_passed(now))
            && (camera || self.camera.has_passed(now))
            && (led || self.led.has_passed(now))
    }

    /// All outputs low for a reason.
    #[inline(never)]
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
        self.laser.stop();
        self.camera.stop();
        self.led.stop();
        self.trigger = None;
    }
}
