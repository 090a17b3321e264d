//! Plan files: TOML with the units in the keys, and the presets that come with the program.
//!
//! ```toml
//! name = "paper"
//! volumes = 70                # one per sweep; a multiple of burst.sweeps
//! interval_ms = 225           # from burst to burst
//! [camera]
//! images_per_volume = 512
//! frame_rate_hz = 60_000
//! [stimulus]
//! volume = 5                  # counted from 0
//! until = "end"               # of the last sweep
//! [phase_limit]               # of the board's on-line solver
//! radians = 2
//! action = "stimulus"         # or "line", "stop"
//! ```
//!
//! Times are rounded to the nearest tick of the board; what differs from what was asked is said.

use super::check::NO_FRAME_CLOCK;
use super::plan_values::{Entry, Place, Value, Values};
use super::units::exact;
use crate::error::{Error, Result};
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::plan::{
    Action, Caps, Inputs, Interlock, MAX_SWEEPS, PhaseLimit, Plan, Pulse, Start, Stimulus,
};
use std::path::Path;

/// The presets: name and text.
const PRESETS: [(&str, &str); 3] = [
    ("paper", include_str!("presets/paper.toml")),
    ("pairs", include_str!("presets/pairs.toml")),
    ("triples", include_str!("presets/triples.toml")),
];

/// Camera trigger where the plan gives none: 100 us, well above the camera's least of 200 ns.
const CAMERA_PULSE_S: f64 = 100e-6;
/// The host may be silent for so long where the plan does not say.
const HEARTBEAT_S: f64 = 2.0;
/// Images of a volume and images per second where the plan does not say: the paper's.
const IMAGES_PER_VOLUME: u64 = 512;
const FRAME_RATE_HZ: f64 = 60_000.0;
/// Longer times are refused: 101 days at 16 MHz, as far as the board's rules go.
const LONGEST_TICKS: f64 = (1_u64 << 47) as f64;
/// A silence of the solver from here on could not be told from none: half of what 32 bits count.
const LONGEST_SILENCE: u64 = (1 << 31) - 1;
/// A difference to whole ticks that is worth a word.
const ROUNDED: f64 = 1e-3;

/// A plan as a user gave it, ready to be checked and sent.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// File or preset it came from, for messages and the log.
    pub source: String,
    /// Its `name`.
    pub name: String,
    /// In ticks of the board. Its caps lie a little above what it needs; a laboratory's limits
    /// lower them ([`LimitsFile::caps`](super::limits::LimitsFile::caps)).
    pub plan: Plan,
    /// What was turned off or rounded: shown, and kept in the run log.
    pub warnings: Vec<String>,
    /// Images per second within a sweep.
    pub frame_rate_hz: f64,
    /// Bits of an image in the camera's memory, where the plan gives its size.
    pub image_bits: Option<u64>,
}

/// Load a plan file or a built-in preset (`paper`, `pairs`, `triples`), change it by `settings`
/// (`key=value`, the value with its unit), and convert its times to ticks of the board.
///
/// An existing file goes before a preset of the same name.
///
/// # Errors
/// An unreadable file, an unknown key, a value without unit or out of range.
pub fn load(plan: &str, settings: &[String], limits: &Limits) -> Result<Loaded> {
    let text = read(plan)?;
    let mut values = Values::read(&text, plan)?;
    for setting in settings {
        values.set(setting)?;
    }
    Assembly { source: plan, values, limits, warnings: Vec::new() }.loaded()
}

fn read(plan: &str) -> Result<String> {
    let path = Path::new(plan);
    if path.exists() {
        return std::fs::read_to_string(path)
            .map_err(|error| Error::file(path, format!("cannot be read: {error}")));
    }
    let preset = PRESETS.iter().find(|(name, _)| *name == plan);
    preset.map(|(_, text)| (*text).to_owned()).ok_or_else(|| {
        let names = PRESETS.map(|(name, _)| name).join(", ");
        Error::file(path, format!("no such file, and no preset of this name: there are {names}"))
    })
}

/// A plan being put together.
struct Assembly<'a> {
    source: &'a str,
    values: Values,
    limits: &'a Limits,
    warnings: Vec<String>,
}

impl Assembly<'_> {
    fn loaded(mut self) -> Result<Loaded> {
        let name = self.word("name", self.source).to_owned();
        let frame_rate_hz = self.number("camera.frame_rate").unwrap_or(FRAME_RATE_HZ);
        if frame_rate_hz <= 0.0 {
            return Err(self.wrong("camera.frame_rate", "must be above 0"));
        }
        let images = self.count("camera.images_per_volume", IMAGES_PER_VOLUME, u32::MAX.into())?;
        let mut plan = self.loops()?;
        // By default the laser's trigger is high for as long as the camera takes images.
        let sweep = images as f64 / frame_rate_hz;
        plan.laser = self.pulse("laser.delay", "laser.pulse", sweep)?;
        plan.camera = self.pulse("camera.delay", "camera.pulse", CAMERA_PULSE_S)?;
        plan.frame = self.frame(frame_rate_hz)?;
        if plan.frame > 0 {
            plan.camera.width = self.frames(&plan, images)?;
        }
        plan.stimulus = self.stimulus(&plan)?;
        plan.phase_limit = self.phase_limit()?;
        plan.caps = self.caps(&plan, images)?;
        let image_bits = self.image_bits()?;
        let Self { source, warnings, .. } = self;
        let source = source.to_owned();
        Ok(Loaded { source, name, plan, warnings, frame_rate_hz, image_bits })
    }

    /// Volumes, bursts, sweeps, repeats; the rest is filled in by the caller.
    fn loops(&mut self) -> Result<Plan> {
        let sweeps = self.count("burst.sweeps", 1, 255)?;
        if !(1..=MAX_SWEEPS as u64).contains(&sweeps) {
            let what = format!("must be 1 to {MAX_SWEEPS}, not {sweeps}");
            return Err(self.wrong("burst.sweeps", &what));
        }
        let volumes = self.required("volumes")?.place.clone();
        let volumes = (self.count("volumes", 0, u32::MAX.into())?, volumes);
        let bursts = bursts(volumes.0, sweeps).map_err(|what| volumes.1.error(what))?;
        let repeats = self.count("repeats", 1, u16::MAX.into())? as u16;
        let interval = self.times_if(bursts > 1, "interval", "more than one burst")?;
        let repeat_period = self.times_if(repeats > 1, "repeat_period", "more than one repeat")?;
        Ok(Plan {
            inputs: self.inputs(),
            repeats,
            repeat_period,
            bursts,
            interval,
            sweeps: sweeps as u8,
            spacing: self.spacing(sweeps as usize)?,
            laser: Pulse { delay: 0, width: 0 },
            camera: Pulse { delay: 0, width: 0 },
            frame: 0,
            stimulus: None,
            phase_limit: None,
            caps: Plan::EMPTY.caps,
        })
    }

    /// A time that must be given if it is `needed`, and is of no use otherwise.
    fn times_if(&mut self, needed: bool, key: &str, why: &str) -> Result<u64> {
        if needed && self.values.get(key).is_none() {
            let what = format!("{key} is missing: {why} needs it");
            return Err(Error::failed(format!("{}: {what}", self.source)));
        }
        let time = self.time(key, 0.0)?;
        Ok(if needed { time } else { 0 })
    }

    /// One time for all gaps, or one for each.
    fn spacing(&mut self, sweeps: usize) -> Result<[u32; MAX_SWEEPS - 1]> {
        let mut spacing = [0; MAX_SWEEPS - 1];
        if sweeps == 1 {
            return Ok(spacing);
        }
        let entry = self.required("burst.spacing")?.clone();
        let Value::List(times) = &entry.value else { return Ok(spacing) };
        let gaps = sweeps - 1;
        if times.len() != 1 && times.len() != gaps {
            let what = format!("burst.spacing: give 1 or {gaps} times for {sweeps} sweeps");
            return Err(entry.place.error(what));
        }
        for (gap, slot) in spacing.iter_mut().enumerate().take(gaps) {
            let time = times.get(gap).or(times.first()).copied().unwrap_or_default();
            let ticks = self.ticks("burst.spacing", time)?;
            *slot = self.narrow("burst.spacing", ticks)?;
        }
        Ok(spacing)
    }

    fn pulse(&mut self, delay: &str, width: &str, default: f64) -> Result<Pulse> {
        let delay_ticks = self.time(delay, 0.0)?;
        let width_ticks = self.time(width, default)?;
        Ok(Pulse {
            delay: self.narrow(delay, delay_ticks)?,
            width: self.narrow(width, width_ticks)?,
        })
    }

    /// Period of the board's frame clock in ticks; 0: the camera keeps its own.
    fn frame(&self, rate_hz: f64) -> Result<u32> {
        if self.word("camera.frame_clock", "camera") != "board" {
            return Ok(0);
        }
        if self.limits.frame_longest == 0 {
            return Err(self.wrong("camera.frame_clock", NO_FRAME_CLOCK));
        }
        let per_second = f64::from(self.limits.ticks_per_second);
        let period = per_second / rate_hz;
        let ticks = period.round();
        if !(1.0..=f64::from(u32::MAX)).contains(&ticks) {
            let what = "a frame clock of this rate cannot be made";
            return Err(self.wrong("camera.frame_rate", what));
        }
        if (period - ticks).abs() > ROUNDED {
            let near = [period.ceil(), period.floor().max(1.0)];
            let [below, above] = near.map(|ticks| decimals(per_second / ticks));
            let [longer, shorter] = near;
            let what = format!(
                "{} Hz is no whole number of the board's ticks ({per_second} per second), as its frame \
                 clock needs: the nearest that are take {longer} ticks, {below} Hz, and {shorter} \
                 ticks, {above} Hz",
                decimals(rate_hz),
            );
            return Err(self.wrong("camera.frame_rate", &what));
        }
        Ok(ticks as u32)
    }

    /// The camera's pulse with a frame clock: as long as the images of a sweep.
    fn frames(&self, plan: &Plan, images: u64) -> Result<u32> {
        let ticks = images.saturating_mul(plan.frame.into());
        let width = self.narrow("camera.images_per_volume", ticks)?;
        if self.values.get("camera.pulse").is_some() && plan.camera.width != width {
            let time = |ticks: u32| exact(ticks.into(), self.limits.ticks_per_second);
            let what = format!(
                "is {} ({} ticks), but camera.images_per_volume = {images} with camera.frame_clock = \
                 \"board\" make {} ({width} ticks): leave camera.pulse out",
                time(plan.camera.width),
                plan.camera.width,
                time(width)
            );
            return Err(self.wrong("camera.pulse", &what));
        }
        Ok(width)
    }

    fn phase_limit(&mut self) -> Result<Option<PhaseLimit>> {
        if !self.values.has_table("phase_limit") {
            return Ok(None);
        }
        let _ = self.required("phase_limit.action")?;
        let action = match self.word("phase_limit.action", "stop") {
            "line" => Action::Line,
            "stimulus" => Action::Stimulus,
            _ => Action::Stop,
        };
        let silence = self.time("phase_limit.silence", 0.0)?;
        if silence > LONGEST_SILENCE {
            let most = exact(LONGEST_SILENCE, self.limits.ticks_per_second);
            return Err(self.wrong("phase_limit.silence", &format!("is longer than {most}")));
        }
        let milliradians = self.milliradians()?;
        Ok(Some(PhaseLimit { milliradians, silence: silence as u32, action }))
    }

    fn milliradians(&mut self) -> Result<u32> {
        let key = "phase_limit.radians";
        let _ = self.required(key)?;
        let radians = self.number(key).unwrap_or_default();
        let asked = radians * 1e3;
        if !(0.5..f64::from(u32::MAX)).contains(&asked) {
            return Err(self.wrong(key, "must be 0.001 to 4294967"));
        }
        let milliradians = asked.round();
        if (asked - milliradians).abs() > ROUNDED {
            let rounded = milliradians / 1e3;
            self.warnings.push(format!("{key} is rounded to {rounded} (asked: {radians})"));
        }
        Ok(milliradians as u32)
    }

    /// What is turned off is noted.
    fn inputs(&mut self) -> Inputs {
        let interlock = match self.word("inputs.interlock", "on") {
            "off" => Interlock::Off,
            "pulsed" => Interlock::Pulsed,
            _ => Interlock::On,
        };
        let ready = self.word("inputs.ready", "on") == "on";
        let external = self.word("inputs.start", "command") == "external";
        let start = if external { Start::External } else { Start::Command };
        if interlock == Interlock::Off {
            let what = "interlock off: the board does not watch the safety loop";
            self.warnings.push(what.to_owned());
        }
        if !ready {
            let what = "ready off: sweeps start whether or not the camera is ready";
            self.warnings.push(what.to_owned());
        }
        Inputs { interlock, ready, start }
    }

    fn stimulus(&mut self, plan: &Plan) -> Result<Option<Stimulus>> {
        if !self.values.has_table("stimulus") {
            return Ok(None);
        }
        let volume = self.count("stimulus.volume", 0, u32::MAX.into())?;
        if volume >= u64::from(plan.volumes()) {
            let last = plan.volumes() - 1;
            let what = format!("{volume} is not there: volumes are counted from 0 to {last}");
            return Err(self.wrong("stimulus.volume", &what));
        }
        let sweeps = u64::from(plan.sweeps);
        let mut stimulus = Stimulus {
            burst: (volume / sweeps) as u16,
            sweep: (volume % sweeps) as u8,
            delay: self.time("stimulus.delay", 0.0)?,
            on: 0,
            pulses: 1,
            period: 0,
            sham: self.flag("stimulus.sham"),
        };
        let start = plan.stimulus_start(&stimulus);
        let duration = match self.values.get("stimulus.duration") {
            Some(_) => self.time("stimulus.duration", 0.0)?,
            None => self.until_the_end(plan, start)?,
        };
        stimulus.on = duration;
        if self.values.has_table("stimulus.flicker") {
            self.flicker(&mut stimulus, duration)?;
        }
        Ok(Some(stimulus))
    }

    /// From the stimulus' start until the end of the last sweep.
    fn until_the_end(&self, plan: &Plan, start: u64) -> Result<u64> {
        let end = plan.burst_offset(plan.bursts - 1) + plan.burst_length();
        end.checked_sub(start).filter(|&duration| duration > 0).ok_or_else(|| {
            let what = "the stimulus would start after the end of the last sweep";
            self.wrong("stimulus.delay", what)
        })
    }

    /// Whole pulses only: what does not fit is left out.
    fn flicker(&mut self, stimulus: &mut Stimulus, duration: u64) -> Result<()> {
        let period = self.flicker_period_s()?;
        let on = match self.number("stimulus.flicker.duty") {
            Some(duty) => period * duty,
            None => self.number("stimulus.flicker.on").unwrap_or(period / 2.0),
        };
        let period = self.ticks("stimulus.flicker.period", period)?;
        stimulus.period = self.narrow("stimulus.flicker.period", period)?;
        stimulus.on = self.ticks("stimulus.flicker.on", on)?;
        let pulses = duration.checked_sub(stimulus.on).map_or(0, |rest| rest / period.max(1) + 1);
        if pulses == 0 {
            return Err(self.wrong("stimulus.flicker.on", "is longer than the stimulus"));
        }
        stimulus.pulses = u32::try_from(pulses)
            .map_err(|_| self.wrong("stimulus.flicker.period", "too many pulses"))?;
        Ok(())
    }

    fn flicker_period_s(&self) -> Result<f64> {
        let frequency = self.number("stimulus.flicker.frequency").map(|hertz| 1.0 / hertz);
        let period = self.number("stimulus.flicker.period").or(frequency);
        let period = period.ok_or_else(|| {
            let what = "stimulus.flicker needs period or frequency";
            Error::failed(format!("{}: {what}", self.source))
        })?;
        if period > 0.0 && period.is_finite() {
            Ok(period)
        } else {
            Err(self.wrong("stimulus.flicker.period", "must be above 0"))
        }
    }

    /// As low as the plan allows; see [`headroom`].
    fn caps(&mut self, plan: &Plan, images: u64) -> Result<Caps> {
        let heartbeat = self.time("heartbeat", HEARTBEAT_S)?;
        if heartbeat == 0 {
            let what = "heartbeat off: the run goes on when the host falls silent";
            self.warnings.push(what.to_owned());
        }
        let above = |ticks: u64| ticks.saturating_add(headroom(self.limits));
        let light = plan.stimulus.filter(|stimulus| !stimulus.sham);
        let pulse = light.map_or(0, |stimulus| above(stimulus.on));
        let total = light.map_or(0, |_| above(plan.stimulus_on()));
        let laser = above(plan.laser.width.into()).min(u32::MAX.into());
        let memory = self.count("camera.memory_images", u32::MAX.into(), u32::MAX.into())?;
        Ok(Caps {
            // The least of the two was taken: it fits.
            laser_pulse: laser as u32,
            laser_total: above(plan.laser_on()),
            stimulus_pulse: pulse,
            stimulus_total: total,
            images_per_sweep: images as u32,
            camera_images: memory as u32,
            heartbeat: self.narrow("heartbeat", heartbeat)?,
        })
    }

    fn image_bits(&self) -> Result<Option<u64>> {
        let side = u64::from(u16::MAX);
        let width = self.count("camera.width_px", 0, side)?;
        let height = self.count("camera.height_px", 0, side)?;
        let bits = self.count("camera.bits_per_pixel", 8, 64)?;
        let all = width * height * bits;
        Ok((all > 0).then_some(all))
    }

    fn required(&self, key: &str) -> Result<&Entry> {
        self.values
            .get(key)
            .ok_or_else(|| Error::failed(format!("{}: {key} is missing", self.source)))
    }

    fn word<'a>(&'a self, key: &str, default: &'a str) -> &'a str {
        match self.values.get(key).map(|entry| &entry.value) {
            Some(Value::Word(word)) => word,
            _ => default,
        }
    }

    fn flag(&self, key: &str) -> bool {
        self.values.get(key).is_some_and(|entry| entry.value == Value::Flag(true))
    }

    fn number(&self, key: &str) -> Option<f64> {
        match self.values.get(key)?.value {
            Value::Number(number) => Some(number),
            _ => None,
        }
    }

    fn count(&self, key: &str, default: u64, most: u64) -> Result<u64> {
        let count = match self.values.get(key).map(|entry| &entry.value) {
            Some(Value::Count(count)) => *count,
            _ => default,
        };
        if count <= most { Ok(count) } else { Err(self.wrong(key, &format!("at most {most}"))) }
    }

    /// A time in ticks.
    fn time(&mut self, key: &str, default: f64) -> Result<u64> {
        let seconds = self.number(key).unwrap_or(default);
        self.ticks(key, seconds)
    }

    /// Seconds in ticks; what is made instead is noted where it differs.
    fn ticks(&mut self, key: &str, seconds: f64) -> Result<u64> {
        let per_second = self.limits.ticks_per_second;
        let asked = seconds * f64::from(per_second);
        if asked > LONGEST_TICKS {
            return Err(self.wrong(key, &format!("{seconds} s is too long for the board's clock")));
        }
        let ticks = asked.round() as u64;
        if (asked - ticks as f64).abs() > ROUNDED {
            self.warnings.push(format!(
                "{key} is rounded to {ticks} ticks = {} (asked: {} ms)",
                exact(ticks, per_second),
                (seconds * 1e10).round() / 1e7
            ));
        }
        Ok(ticks)
    }

    /// Ticks that the plan holds in 32 bits.
    fn narrow(&self, key: &str, ticks: u64) -> Result<u32> {
        u32::try_from(ticks).map_err(|_| {
            let most = exact(u32::MAX.into(), self.limits.ticks_per_second);
            self.wrong(key, &format!("is longer than {most}"))
        })
    }

    fn wrong(&self, key: &str, what: &str) -> Error {
        match self.values.get(key).map(|entry| &entry.place) {
            Some(Place::Setting(text)) => Place::Setting(text.clone()).error(what),
            Some(place) => place.error(format!("{key}: {what}")),
            None => Error::failed(format!("{}: {key}: {what}", self.source)),
        }
    }
}

/// So many that the number comes back as a whole number of ticks.
fn decimals(hertz: f64) -> String {
    let text = format!("{hertz:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// One volume per sweep.
fn bursts(volumes: u64, sweeps: u64) -> std::result::Result<u16, String> {
    if volumes == 0 {
        return Err("volumes: at least 1".to_owned());
    }
    if !volumes.is_multiple_of(sweeps) {
        let (below, above) = (volumes / sweeps * sweeps, volumes.div_ceil(sweeps) * sweeps);
        return Err(format!(
            "volumes: {volumes} is no multiple of the {sweeps} sweeps of a burst (one volume per \
             sweep): take {} or {above}",
            if below == 0 { above } else { below }
        ));
    }
    u16::try_from(volumes / sweeps).map_err(|_| format!("volumes: at most {} bursts", u16::MAX))
}

/// How far the board's own caps lie above what a plan needs, in ticks.
///
/// A cap close to the plan ends a run that has gone wrong sooner than the laboratory's limit would.
/// The board compares once per pass of its main loop, so an output that falls as planned may be seen
/// as high for a pass longer; two passes keep that from ending a run.
fn headroom(limits: &Limits) -> u64 {
    2 * u64::from(limits.pass)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn preset(name: &str, settings: &[&str]) -> Result<Loaded> {
        let settings: Vec<String> = settings.iter().map(|&text| text.to_owned()).collect();
        load(name, &settings, &Limits::UNO)
    }

    fn plan(settings: &[&str]) -> Plan {
        preset("paper", settings).unwrap().plan
    }

    fn refused(settings: &[&str]) -> String {
        preset("paper", settings).unwrap_err().to_string()
    }

    fn file(text: &str) -> Result<Loaded> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("P.toml");
        std::fs::write(&path, text).unwrap();
        load(path.to_str().unwrap(), &[], &Limits::UNO)
    }

    #[test]
    fn the_papers_sequence() {
        let plan = plan(&[]);
        assert_eq!((plan.bursts, plan.sweeps, plan.interval), (70, 1, 3_600_000));
        assert_eq!(plan.laser, Pulse { delay: 0, width: 136_533 });
        let stimulus = plan.stimulus.unwrap();
        assert_eq!((stimulus.burst, stimulus.pulses), (5, 1));
        // After sweep 4's trigger, not later than sweep 5's; until the end of the last sweep.
        let start = plan.stimulus_start(&stimulus);
        assert!(start > plan.burst_offset(4) && start <= plan.burst_offset(5));
        assert_eq!(start + stimulus.on, plan.length());
        assert_eq!((plan.images(), plan.caps.camera_images), (35_840, 35_840));
    }

    fn f405(settings: &[&str]) -> Result<Loaded> {
        let settings: Vec<String> = settings.iter().map(|&text| text.to_owned()).collect();
        load("paper", &settings, &Limits::F405)
    }

    #[test]
    fn a_frame_clock_makes_the_cameras_pulse() {
        let plan = f405(&["camera.frame_clock=board"]).unwrap().plan;
        assert_eq!((plan.frame, plan.camera.width, plan.laser.width), (1400, 716_800, 716_800));
        let own = f405(&["camera.frame_clock=camera"]).unwrap().plan;
        assert_eq!((own.frame, own.camera.width), (0, 8_400));
        // The same pulse may be given.
        let both = ["camera.frame_clock=board", "camera.pulse=8.533333333ms"];
        assert_eq!(f405(&both).unwrap().plan, plan);
        for (settings, words) in [
            (&["camera.frame_clock=board", "camera.pulse=8ms"][..], ["672000", "716800"]),
            (
                &["camera.frame_clock=board", "camera.frame_rate=59kHz"],
                ["1424 ticks", "1423 ticks"],
            ),
            (
                &["camera.frame_clock=board", "camera.frame_rate=59kHz"],
                ["58988.764045", "59030.217850"],
            ),
            (&["camera.frame_clock=maybe"], ["camera or board", "maybe"]),
        ] {
            let message = f405(settings).unwrap_err().to_string();
            for word in words {
                assert!(message.contains(word.trim_end_matches('0')), "{settings:?}: {message}");
            }
        }
        // What is advised is taken.
        let advised = ["camera.frame_clock=board", "camera.frame_rate=59030.21785Hz"];
        assert_eq!(f405(&advised).unwrap().plan.frame, 1423);
        assert!(refused(&["camera.frame_clock=board"]).contains("--board f405"));
    }

    #[test]
    fn a_phase_has_a_limit() {
        let limit = |settings: &[&str]| f405(settings).map(|loaded| loaded.plan.phase_limit);
        let settings =
            ["phase_limit.radians=2", "phase_limit.action=stimulus", "phase_limit.silence=5s"];
        let expected =
            PhaseLimit { milliradians: 2000, silence: 420_000_000, action: Action::Stimulus };
        assert_eq!(limit(&settings).unwrap(), Some(expected));
        assert_eq!(limit(&[]).unwrap(), None);
        for (settings, words) in [
            (&["phase_limit.radians=2"][..], ["phase_limit.action", "missing"]),
            (&["phase_limit.action=stop"], ["phase_limit.radians", "missing"]),
            (&["phase_limit.radians=0"], ["above 0", "radians=0"]),
            (&["phase_limit.radians=-1"], ["above 0", "radians=-1"]),
            (&["phase_limit.radians=1e7", "phase_limit.action=stop"], ["0.001", "4294967"]),
            (&["phase_limit.action=on"], ["line or stimulus or stop", "on"]),
            (&[settings[0], settings[1], "phase_limit.silence=26s"], ["longer than 25.56", "26s"]),
        ] {
            let message = f405(settings).unwrap_err().to_string();
            for word in words {
                assert!(message.contains(word), "{settings:?}: {message}");
            }
        }
        let rounded = f405(&["phase_limit.radians=1.23456", settings[1]]).unwrap();
        assert!(rounded.warnings.iter().any(|words| words.contains("1.235")), "{rounded:?}");
    }

    #[test]
    fn faster_ticks_are_rounded_and_refused_as_others_are() {
        let flicker = ["stimulus.flicker.frequency=10Hz", "stimulus.duration=2s", "interval=300ms"];
        let stimulus = f405(&flicker).unwrap().plan.stimulus.unwrap();
        assert_eq!((stimulus.pulses, stimulus.period, stimulus.on), (20, 8_400_000, 4_200_000));
        for setting in ["laser.pulse=52s", "heartbeat=52s", "stimulus.flicker.period=52s"] {
            let interval = ["interval=60s", "stimulus.duration=2h", setting];
            let message = f405(&interval).unwrap_err().to_string();
            assert!(message.contains("longer than 51.13"), "{setting}: {message}");
        }
    }

    #[test]
    fn rounding_is_said() {
        let loaded = preset("paper", &[]).unwrap();
        assert_eq!(
            loaded.warnings,
            ["laser.pulse is rounded to 136533 ticks = 8.5333125 ms (asked: 8.5333333 ms)"]
        );
    }

    #[test]
    fn pairs_and_triples() {
        for (name, sweeps) in [("pairs", 2), ("triples", 3)] {
            let plan = preset(name, &[]).unwrap().plan;
            assert_eq!(plan.sweeps, sweeps);
            assert!(u64::from(plan.spacing[0]) * 10 < plan.interval, "{name}");
            assert_eq!(plan.volumes() % u32::from(sweeps), 0);
        }
    }

    #[test]
    fn settings_change_a_plan() {
        let plan = plan(&[
            "volumes=10",
            "interval=300s",
            "interlock=off",
            "ready=off",
            "start=external",
            "stimulus.duration=2s",
            "stimulus.flicker.frequency=10Hz",
            "stimulus.flicker.duty=0.25",
            "heartbeat=off",
        ]);
        assert_eq!((plan.bursts, plan.interval), (10, 4_800_000_000));
        assert_eq!(plan.inputs.interlock, Interlock::Off);
        assert_eq!((plan.inputs.ready, plan.inputs.start), (false, Start::External));
        let stimulus = plan.stimulus.unwrap();
        assert_eq!((stimulus.pulses, stimulus.on, stimulus.period), (20, 400_000, 1_600_000));
        assert_eq!(plan.caps.heartbeat, 0);
    }

    #[test]
    fn a_stimulus_can_be_taken_away_and_given_back() {
        assert_eq!(plan(&["stimulus=off"]).stimulus, None);
        assert!(plan(&["stimulus=off", "stimulus.volume=1"]).stimulus.is_some());
        assert!(plan(&["stimulus.sham=true"]).stimulus.unwrap().sham);
    }

    #[test]
    fn what_was_turned_off_is_said() {
        let settings = ["interlock=off", "ready=off", "heartbeat=off", "laser.pulse=8.5ms"];
        let warnings = preset("paper", &settings).unwrap().warnings.join("\n");
        for word in ["interlock off", "ready off", "heartbeat off"] {
            assert!(warnings.contains(word), "{warnings}");
        }
        assert_eq!(warnings.lines().count(), 3);
    }

    #[test]
    fn settings_that_are_wrong() {
        for (setting, words) in [
            ("interval=225", ["--set interval=225", "no unit"]),
            ("interval=2kHz", ["2kHz", "ms"]),
            ("intervall=2s", ["no such key", "interval_"]),
            ("camera.puls=2ms", ["no such key", "pulse_"]),
            ("volumes", ["KEY=VALUE", "volumes"]),
            ("volumes=0", ["at least 1", "volumes=0"]),
            ("volumes=7.5", ["whole number", "7.5"]),
            ("interlock=maybe", ["on or pulsed or off", "maybe"]),
            ("stimulus.volume=70", ["70", "0 to 69"]),
            ("burst.sweeps=4", ["1 to 3", "4"]),
            ("burst.sweeps=2", ["burst.spacing", "missing"]),
            ("laser.pulse=300s", ["longer than", "268"]),
            ("interval=-1s", ["not negative", "-1s"]),
            ("interval=1e9s", ["too long", "1e9"]),
            ("stimulus.flicker.duty=1.5", ["between 0 and 1", "duty"]),
            ("stimulus.flicker.duty=0.5", ["period or frequency", "flicker"]),
        ] {
            let message = refused(&[setting]);
            for word in words {
                assert!(message.contains(word), "{setting}: {message}");
            }
        }
        let message = refused(&["burst.sweeps=3", "burst.spacing=12ms"]);
        assert!(message.contains("multiple of the 3 sweeps") && message.contains("69 or 72"));
    }

    #[test]
    fn files_that_are_wrong() {
        for (text, words) in [
            ("volumes = 1\ncamra = 2", ["line 2", "unknown key 'camra'"]),
            ("volumes = 1\n[camera]\npulse = 2", ["line 3", "pulse_(ns|us|ms|s|min|h)"]),
            ("volumes = 1\n[camera]\npulse_hz = 2", ["line 3", "camera.pulse_hz"]),
            ("volumes = 1.5", ["line 1", "whole number"]),
            ("volumes = 1\ninterval_ms = 1\ninterval_s = 1", ["line 3", "given twice"]),
            ("volumes = 2", ["interval is missing", "more than one burst"]),
            ("interval_ms = 2", ["volumes is missing", "P.toml"]),
            ("volumes = ", ["line 1", "P.toml"]),
            (
                "volumes = 1\n[stimulus]\nuntil = \"end\"\nduration_ms = 3",
                ["line 4", "one of them"],
            ),
        ] {
            let message = file(text).unwrap_err().to_string();
            for word in words {
                assert!(message.contains(word), "{text}: {message}");
            }
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }

    #[test]
    fn the_least_file() {
        let loaded = file("volumes = 1\n[inputs]\nready = \"off\"").unwrap();
        assert_eq!((loaded.plan.bursts, loaded.plan.stimulus), (1, None));
        assert_eq!(loaded.plan.camera.width, 1600);
        assert_eq!(loaded.plan.caps.heartbeat, 32_000_000);
    }

    #[test]
    fn unknown_plans_name_the_presets() {
        let message = load("papers", &[], &Limits::UNO).unwrap_err().to_string();
        assert!(message.contains("paper, pairs, triples"), "{message}");
    }
}
