//! What main loop and interrupts share: near edges, and what went wrong.
//!
//! While one of these functions runs, interrupts wait; that of the LED can wait for 150 cycles. So
//! they are short, and call nothing.

use crate::shared::Shared;
use crate::timers::{self, CLOSE, FAR, LedSetting, Phases};
use phasewalk_firmware::arming::{Arming, NearEdge, Output, REACH};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::fault::Fault;

/// Edges from being near until they are made.
pub struct Near {
    laser: Output,
    camera: Output,
    led: Output,
    /// The camera's trigger whose first exposure is awaited.
    trigger: u16,
    exposed: Option<u16>,
    fault: Option<Fault>,
    /// What Timer0 is to be set to.
    led_setting: LedSetting,
    pub phases: Phases,
    /// Wraps of Timer1.
    pub overflows: u32,
    /// When the start input rose.
    pub start: Option<u64>,
}

/// The one there is.
pub static NEAR: Shared<Near> = Shared::new(Near {
    laser: Output::new(),
    camera: Output::new(),
    led: Output::new(),
    trigger: 0,
    exposed: None,
    fault: None,
    led_setting: LedSetting::NONE,
    phases: Phases::UNKNOWN,
    overflows: 0,
    start: None,
});

impl Near {
    /// Take an edge less than [`FAR`]`.reach` ahead, and arm it if it is the next; false when one is
    /// ready already.
    #[inline(always)]
    pub fn put(&mut self, channel: Channel, edge: NearEdge) -> bool {
        match channel {
            Channel::Laser => self.laser.put(edge) && self.arm_laser(),
            Channel::Camera => self.camera.put(edge) && self.arm_camera(),
            Channel::Stimulus => self.led.put(edge) && self.prepare_led(),
        }
    }

    #[inline(always)]
    fn arm_laser(&mut self) -> bool {
        match self.laser.arm(timers::counter(), FAR) {
            Arming::Set(edge) if self.fault.is_none() => timers::arm_laser(edge),
            Arming::Late => self.stop(Fault::Late),
            _ => {}
        }
        true
    }

    #[inline(always)]
    fn arm_camera(&mut self) -> bool {
        match self.camera.arm(timers::counter(), FAR) {
            Arming::Set(edge) if self.fault.is_none() => {
                timers::arm_camera(edge);
                if edge.high {
                    timers::forget_capture();
                }
            }
            Arming::Late => self.stop(Fault::Late),
            _ => {}
        }
        true
    }

    /// Unless an edge of the LED is on its way: arm the next if it is close, else have Timer2 wake us.
    #[inline(always)]
    fn prepare_led(&mut self) -> bool {
        if let Some(edge) = self.led.ready()
            && !self.led.is_armed()
            && self.fault.is_none()
        {
            self.led.set();
            self.led_setting = LedSetting::new(edge, self.phases);
            if edge.tick.wrapping_sub(timers::counter()) >= timers::TOO_CLOSE_TO_WAKE {
                timers::wake_led(edge.tick, self.phases);
                return true;
            }
            // At most 80 cycles.
            while let left = edge.tick.wrapping_sub(timers::counter())
                && (CLOSE.most..timers::TOO_CLOSE_TO_WAKE).contains(&left)
            {}
            self.arm_led();
        }
        true
    }

    /// Less than 256 ticks are left until the LED's edge, and what takes longest is prepared.
    #[inline(always)]
    pub fn arm_led(&mut self) {
        let left = self.led_setting.tick.wrapping_sub(timers::counter());
        if left < CLOSE.least || left > REACH {
            return self.stop(Fault::Late);
        }
        // Else Timer2 has woken us some of its wraps too early.
        if left <= CLOSE.most {
            timers::arm_led(self.led_setting);
        }
    }

    // An edge that repeats the level before it cannot be the plan's: the memory has changed.

    /// A match of the laser's output.
    #[inline(always)]
    pub fn laser_matched(&mut self) {
        let before = self.laser.level();
        if let Some(edge) = self.laser.matched(timers::counter()) {
            if timers::laser_level() != edge.high || edge.high == before {
                return self.stop(Fault::ReadBack);
            }
            self.arm_laser();
        }
    }

    /// A match of the camera's output; whether it was a trigger.
    #[inline(always)]
    pub fn camera_matched(&mut self) -> bool {
        let before = self.camera.level();
        let Some(edge) = self.camera.matched(timers::counter()) else { return false };
        if timers::camera_level() != edge.high || edge.high == before {
            self.stop(Fault::ReadBack);
            return false;
        }
        self.trigger = edge.tick;
        self.arm_camera();
        edge.high
    }

    /// A match of the LED's output.
    #[inline(always)]
    pub fn led_matched(&mut self) {
        let before = self.led.level();
        if let Some(edge) = self.led.matched(timers::counter()) {
            timers::led_made();
            if timers::led_level() != edge.high || edge.high == before {
                return self.stop(Fault::ReadBack);
            }
            self.prepare_led();
        }
    }

    /// The camera was triggered; its first exposure may have begun since.
    #[inline(always)]
    pub fn await_exposure(&mut self) {
        // Earlier captures were forgotten when the trigger was armed; one that has come since may
        // be from before the trigger, and another may come while we look.
        if timers::has_captured() && !self.take_exposure() {
            timers::forget_capture();
            if !self.take_exposure() {
                timers::await_capture(true);
            }
        } else if self.exposed.is_none() {
            timers::await_capture(true);
        }
    }

    /// Whether the last capture is from after the trigger, which was a moment ago: then it is the
    /// exposure.
    #[inline(always)]
    fn take_exposure(&mut self) -> bool {
        let after = timers::capture().wrapping_sub(self.trigger);
        let elapsed = timers::counter().wrapping_sub(self.trigger);
        if after <= elapsed {
            self.exposed = Some(self.trigger.wrapping_add(after));
        }
        after <= elapsed
    }

    /// EXPOSE rose, after the trigger: earlier captures were forgotten since.
    #[inline(always)]
    pub fn capture(&mut self) {
        self.exposed = Some(timers::capture());
        timers::await_capture(false);
    }

    /// How many edges an output has made, wrapping.
    #[inline(always)]
    pub fn made(&self, channel: Channel) -> u8 {
        match channel {
            Channel::Laser => self.laser.made(),
            Channel::Camera => self.camera.made(),
            Channel::Stimulus => self.led.made(),
        }
    }

    /// The first exposure after a trigger.
    pub fn exposed(&mut self) -> Option<u16> {
        self.exposed.take()
    }

    /// Whether the pins are what the edges made so far say. A pin whose edge has been made but not
    /// noted is not looked at: its interrupt does.
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

    /// All outputs low for a reason; nothing is armed until [`Near::all_low`] forgets it.
    #[inline(always)]
    pub fn stop(&mut self, fault: Fault) {
        timers::all_low();
        if self.fault.is_none() {
            self.fault = Some(fault);
        }
    }

    /// What has gone wrong since [`Near::all_low`].
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// All outputs low; edges and faults forgotten.
    #[inline(never)]
    pub fn all_low(&mut self) {
        timers::all_low();
        timers::await_capture(false);
        self.laser.stop();
        self.camera.stop();
        self.led.stop();
        self.fault = None;
    }
}
