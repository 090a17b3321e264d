//! The plan: what is triggered when, as nested loops in ticks.
//!
//! ```text
//! repeats × ( bursts × ( sweeps × ( laser pulse, camera pulse ) ) ∥ stimulus )
//!
//! start of sweep k of burst b of repeat r, in ticks after the start of the run:
//!     r·repeat_period + b·interval + spacing[0] + … + spacing[k-1]
//! ```
//!
//! A sweep makes one volume. The paper's sequence (lines 669-683) is `bursts = 70`, `sweeps = 1`;
//! pairs and triples of volumes, as its outlook proposes, have `sweeps = 2` and `3`.
//!
//! Sums and products here wrap: they are right for plans that [`check`](crate::check) lets pass.

use serde::{Deserialize, Serialize};

/// Sweeps of a burst at most.
pub const MAX_SWEEPS: usize = 3;

/// What is triggered when.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Plan {
    /// What must be wired, and what starts the run.
    pub inputs: Inputs,
    /// How often everything below is done, at least 1.
    pub repeats: u16,
    /// From the start of a repeat to the start of the next.
    pub repeat_period: u64,
    /// Bursts of a repeat, at least 1.
    pub bursts: u16,
    /// From the start of a burst to the start of the next.
    pub interval: u64,
    /// Sweeps of a burst, 1 to [`MAX_SWEEPS`].
    pub sweeps: u8,
    /// From the start of sweep k to the start of sweep k + 1 of a burst; the surplus is 0.
    pub spacing: [u32; MAX_SWEEPS - 1],
    /// The laser's trigger in each sweep.
    pub laser: Pulse,
    /// The camera's trigger in each sweep.
    pub camera: Pulse,
    /// Period of the frame clock that runs while the camera's trigger is high, in ticks; 0: the camera
    /// keeps its own clock.
    #[serde(default)]
    pub frame: u32,
    /// The light stimulus of each repeat.
    pub stimulus: Option<Stimulus>,
    /// What happens when the phase of the on-line solver leaves its bounds.
    #[serde(default)]
    pub phase_limit: Option<PhaseLimit>,
    /// What the board must not exceed in any case.
    pub caps: Caps,
}

/// What must be wired, and what starts the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs {
    /// The safety loop.
    pub interlock: Interlock,
    /// The camera's READY must be high before every sweep.
    pub ready: bool,
    /// What starts an armed run.
    pub start: Start,
}

/// How the safety loop is watched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Interlock {
    /// Not at all: nothing is wired.
    Off,
    /// Open stops the run.
    On,
    /// As `On`, and the loop's far end is at the board's test output rather than at ground: short
    /// pulses on it must come through, so that an input stuck at "closed" is found.
    Pulsed,
}

/// What starts an armed run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Start {
    /// The host's command.
    Command,
    /// A rising edge at the start input.
    External,
}

/// A pulse in each sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pulse {
    /// From the start of the sweep to the rising edge, in ticks.
    pub delay: u32,
    /// From the rising to the falling edge, in ticks.
    pub width: u32,
}

impl Pulse {
    /// From the start of the sweep to the falling edge, in ticks.
    #[must_use]
    pub const fn end(self) -> u64 {
        self.delay as u64 + self.width as u64
    }
}

/// The light stimulus of a repeat: one pulse, or a flicker of many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stimulus {
    /// The burst at one of whose sweeps it is timed, counted from 0.
    pub burst: u16,
    /// The sweep of that burst, counted from 0.
    pub sweep: u8,
    /// From the start of that sweep to the first rising edge, in ticks.
    pub delay: u64,
    /// From a rising edge to its falling edge, in ticks.
    pub on: u64,
    /// Number of pulses, at least 1.
    pub pulses: u32,
    /// From one rising edge to the next, in ticks; without meaning for one pulse.
    pub period: u32,
    /// Everything but the light: for a control that differs in nothing else.
    pub sham: bool,
}

/// What happens when the phase of the on-line solver leaves its bounds. It only ever takes light away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhaseLimit {
    /// The phase may be as far from that of the reference volumes, in either direction.
    pub milliradians: u32,
    /// The run ends when no phase has come for so long, in ticks; 0: it need not.
    pub silence: u32,
    /// What happens.
    pub action: Action,
}

/// What happens when the phase leaves its bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Action {
    /// The phase line goes high until the run ends.
    Line,
    /// And the stimulus ends; volumes go on.
    Stimulus,
    /// And the run ends.
    Stop,
}

/// What the board must not exceed in any case: the laboratory's limits.
///
/// The board compares them with the plan before it arms, and with the edges it makes while it runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Caps {
    /// The laser's trigger without a break, in ticks.
    pub laser_pulse: u32,
    /// The laser's trigger over the whole run, in ticks.
    pub laser_total: u64,
    /// The stimulus without a break, in ticks.
    pub stimulus_pulse: u64,
    /// The stimulus over the whole run, in ticks.
    pub stimulus_total: u64,
    /// Images the camera takes per sweep.
    pub images_per_sweep: u32,
    /// Images the camera's memory holds.
    pub camera_images: u32,
    /// The run ends when the host is silent for so long, in ticks; 0: it need not speak.
    pub heartbeat: u32,
}

impl Plan {
    /// No plan: every check refuses it.
    pub const EMPTY: Self = Self {
        inputs: Inputs { interlock: Interlock::On, ready: true, start: Start::Command },
        repeats: 0,
        repeat_period: 0,
        bursts: 0,
        interval: 0,
        sweeps: 0,
        spacing: [0; MAX_SWEEPS - 1],
        laser: Pulse { delay: 0, width: 0 },
        camera: Pulse { delay: 0, width: 0 },
        frame: 0,
        stimulus: None,
        phase_limit: None,
        caps: Caps {
            laser_pulse: 0,
            laser_total: 0,
            stimulus_pulse: 0,
            stimulus_total: 0,
            images_per_sweep: 0,
            camera_images: 0,
            heartbeat: 0,
        },
    };

    /// Volumes of a repeat: one per sweep.
    #[must_use]
    pub const fn volumes(&self) -> u32 {
        self.bursts as u32 * self.sweeps as u32
    }

    /// Sweeps of the whole run.
    #[must_use]
    pub const fn total_sweeps(&self) -> u64 {
        self.repeats as u64 * self.volumes() as u64
    }

    /// From the start of a sweep until its last edge, in ticks.
    #[must_use]
    pub fn sweep_length(&self) -> u64 {
        self.laser.end().max(self.camera.end())
    }

    /// From the start of a burst to the start of its sweep number `sweep`, in ticks.
    #[must_use]
    pub fn sweep_offset(&self, sweep: u8) -> u64 {
        self.spacing.iter().take(usize::from(sweep)).map(|&ticks| u64::from(ticks)).sum()
    }

    /// From the start of a burst until its last edge, in ticks.
    #[must_use]
    pub fn burst_length(&self) -> u64 {
        self.sweep_offset(self.sweeps.wrapping_sub(1)).wrapping_add(self.sweep_length())
    }

    /// From the start of a repeat to the start of burst `burst`, in ticks.
    #[must_use]
    pub fn burst_offset(&self, burst: u16) -> u64 {
        u64::from(burst).wrapping_mul(self.interval)
    }

    /// From the start of a repeat until its last edge, in ticks.
    #[must_use]
    pub fn repeat_length(&self) -> u64 {
        let last = self.burst_offset(self.bursts.wrapping_sub(1));
        let sweeps = last.wrapping_add(self.burst_length());
        let light = self
            .stimulus
            .map_or(0, |stimulus| self.stimulus_start(&stimulus).wrapping_add(stimulus.duration()));
        sweeps.max(light)
    }

    /// From the start of the run until its last edge, in ticks.
    #[must_use]
    pub fn length(&self) -> u64 {
        let last = u64::from(self.repeats.wrapping_sub(1)).wrapping_mul(self.repeat_period);
        last.wrapping_add(self.repeat_length())
    }

    /// From the start of a repeat to the first rising edge of the stimulus, in ticks.
    #[must_use]
    pub fn stimulus_start(&self, stimulus: &Stimulus) -> u64 {
        let burst = self.burst_offset(stimulus.burst);
        burst.wrapping_add(self.sweep_offset(stimulus.sweep)).wrapping_add(stimulus.delay)
    }

    /// The laser's trigger over the whole run, in ticks.
    #[must_use]
    pub fn laser_on(&self) -> u64 {
        self.total_sweeps().wrapping_mul(u64::from(self.laser.width))
    }

    /// Light of the stimulus over the whole run, in ticks.
    #[must_use]
    pub fn stimulus_on(&self) -> u64 {
        let once = self.stimulus.filter(|stimulus| !stimulus.sham);
        let once = once.map_or(0, |stimulus| stimulus.on.wrapping_mul(u64::from(stimulus.pulses)));
        once.wrapping_mul(u64::from(self.repeats))
    }

    /// Images the camera takes in the whole run.
    #[must_use]
    pub fn images(&self) -> u64 {
        self.total_sweeps().wrapping_mul(u64::from(self.caps.images_per_sweep))
    }
}

impl Stimulus {
    /// From the first rising to the last falling edge, in ticks.
    #[must_use]
    pub fn duration(&self) -> u64 {
        let periods = u64::from(self.pulses.wrapping_sub(1));
        periods.wrapping_mul(u64::from(self.period)).wrapping_add(self.on)
    }
}
