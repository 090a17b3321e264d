//! The safety budget: what a run brings, against the laboratory's limits.
//!
//! The program multiplies and compares; it certifies nothing. Light outside runs (alignment,
//! fixation, other instruments) is not in it.

use super::ledger::Doses;
use super::limits::{Emission, Exposure, LimitsFile, Plane, Source};
use serde::Serialize;

/// How long what is on in a run, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnTimes {
    /// The laser's trigger high.
    pub laser_s: f64,
    /// The stimulus, a sham not counted.
    pub stimulus_s: f64,
    /// From the start of the run to its last edge.
    pub run_s: f64,
}

impl OnTimes {
    /// How long a source lights the eye.
    #[must_use]
    pub fn exposed_s(&self, source: Source, emission: Emission) -> f64 {
        match (source, emission) {
            (Source::Stimulus, _) => self.stimulus_s,
            (Source::Laser, Emission::Gated) => self.laser_s,
            (Source::Laser, Emission::Continuous) => self.run_s,
        }
    }

    /// Radiant exposures of a run, by plane and source: for the ledger.
    #[must_use]
    pub fn doses(&self, limits: &LimitsFile) -> Doses {
        let dose = |entry: &Exposure| {
            entry.irradiance_w_cm2() * self.exposed_s(entry.source, limits.laser.emission)
        };
        limits.exposure.iter().map(|entry| (entry.name(), dose(entry))).collect()
    }
}

/// What is compared with limits besides the exposures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Use {
    /// On-times of the run.
    pub on: OnTimes,
    /// Longest laser pulse in seconds.
    pub laser_pulse_s: f64,
    /// Largest share of trigger high in the window of the limits file.
    pub laser_duty: f64,
    /// Longest light of the stimulus without a break in seconds.
    pub stimulus_pulse_s: f64,
}

/// A quantity and its limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What.
    pub what: String,
    /// What the plan brings.
    pub planned: f64,
    /// What is allowed at most.
    pub limit: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// `planned / limit`.
    pub share: f64,
}

/// All rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Budget {
    /// Quantities with their limits.
    pub rows: Vec<Row>,
    /// Radiant exposures of the run: what goes into the ledger.
    pub doses: Doses,
}

impl Budget {
    /// Compare; `before` is what the subject has got in the last 24 hours, where a ledger is kept.
    #[must_use]
    pub fn new(used: &Use, limits: &LimitsFile, before: Option<&Doses>) -> Self {
        let doses = used.on.doses(limits);
        let mut budget = Self { rows: Vec::new(), doses };
        budget.on_times(used, limits);
        let active = |source| used.on.exposed_s(source, limits.laser.emission) > 0.0;
        let entries: Vec<&Exposure> =
            limits.exposure.iter().filter(|entry| active(entry.source)).collect();
        for entry in &entries {
            budget.exposure(entry, before);
        }
        for plane in [Plane::Retina, Plane::Anterior] {
            let at: Vec<&Exposure> =
                entries.iter().copied().filter(|entry| entry.plane == plane).collect();
            if at.len() > 1 {
                budget.sums(plane, &at, before);
            }
        }
        budget
    }

    /// The first row above its limit: sums come last.
    #[must_use]
    pub fn exceeded(&self) -> Option<&Row> {
        self.rows.iter().find(|row| row.planned > row.limit)
    }

    fn on_times(&mut self, used: &Use, limits: &LimitsFile) {
        let (laser, stimulus) = (&limits.laser, &limits.stimulus);
        let window = super::units::rounded(laser.duty_window_s);
        self.row("laser pulse", used.laser_pulse_s * 1e3, laser.pulse_ms, "ms");
        self.row("laser on-time per run", used.on.laser_s, laser.on_time_per_run_s, "s");
        let duty = format!("laser duty in any {window}");
        self.row(&duty, used.laser_duty * 100.0, laser.duty * 100.0, "%");
        self.row("stimulus without a break", used.stimulus_pulse_s, stimulus.pulse_s, "s");
        let on = used.on.stimulus_s;
        self.row("stimulus on-time per run", on, stimulus.on_time_per_run_s, "s");
    }

    fn exposure(&mut self, entry: &Exposure, before: Option<&Doses>) {
        let name = entry.name();
        let dose = self.dose(&name);
        let irradiance = entry.irradiance_w_cm2();
        let row = format!("{name}: irradiance");
        self.row(&row, irradiance, entry.limit_irradiance_w_cm2, "W/cm2");
        self.row(&format!("{name}: run"), dose, entry.limit_per_run_j_cm2, "J/cm2");
        let day = dose + earlier(before, &name);
        let row = match before {
            Some(_) => format!("{name}: 24 h with this run"),
            None => format!("{name}: 24 h, this run alone"),
        };
        self.row(&row, day, entry.limit_per_day_j_cm2, "J/cm2");
    }

    /// Sources at one plane act together: their shares must not add up to more than all.
    fn sums(&mut self, plane: Plane, entries: &[&Exposure], before: Option<&Doses>) {
        let (mut irradiance, mut run, mut day) = (0.0, 0.0, 0.0);
        for entry in entries {
            let name = entry.name();
            let dose = self.dose(&name);
            irradiance += entry.irradiance_w_cm2() / entry.limit_irradiance_w_cm2;
            run += dose / entry.limit_per_run_j_cm2;
            day += (dose + earlier(before, &name)) / entry.limit_per_day_j_cm2;
        }
        let plane = plane.name();
        for (what, share) in [("irradiance", irradiance), ("run", run), ("24 h", day)] {
            self.row(&format!("{plane}, both sources: {what}"), share * 100.0, 100.0, "%");
        }
    }

    fn dose(&self, name: &str) -> f64 {
        self.doses.get(name).copied().unwrap_or(0.0)
    }

    fn row(&mut self, what: &str, planned: f64, limit: f64, unit: &'static str) {
        let share = planned / limit;
        self.rows.push(Row { what: what.to_owned(), planned, limit, unit, share });
    }
}

fn earlier(before: Option<&Doses>, name: &str) -> f64 {
    before.and_then(|doses| doses.get(name)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used() -> Use {
        Use {
            on: OnTimes { laser_s: 0.6, stimulus_s: 10.0, run_s: 16.0 },
            laser_pulse_s: 0.0085,
            laser_duty: 0.04,
            stimulus_pulse_s: 10.0,
        }
    }

    fn row<'a>(budget: &'a Budget, what: &str) -> &'a Row {
        budget.rows.iter().find(|row| row.what.starts_with(what)).unwrap()
    }

    #[test]
    fn doses_are_irradiance_times_time() {
        let mut limits = LimitsFile::example().unwrap();
        let irradiance = 5e-3 / 0.039;
        let continuous = used().on.doses(&limits)["retina, laser"];
        assert!((continuous - irradiance * 16.0).abs() < 1e-12);
        limits.laser.emission = Emission::Gated;
        let gated = used().on.doses(&limits)["retina, laser"];
        assert!((gated - irradiance * 0.6).abs() < 1e-12);
        let stimulus = used().on.doses(&limits)["retina, stimulus"];
        assert!((stimulus - 2e-5 / 0.039 * 10.0).abs() < 1e-12);
    }

    #[test]
    fn the_day_adds_what_was_before() {
        let limits = LimitsFile::example().unwrap();
        let budget = Budget::new(&used(), &limits, None);
        assert_eq!(budget.exceeded(), None);
        let before = Doses::from([("retina, laser".to_owned(), 48.5)]);
        let budget = Budget::new(&used(), &limits, Some(&before));
        let day = row(&budget, "retina, laser: 24 h");
        assert!((day.planned - 48.5 - 5e-3 / 0.039 * 16.0).abs() < 1e-12);
        let exceeded = budget.exceeded().unwrap();
        assert!(exceeded.what.starts_with("retina"), "{exceeded:?}");
    }

    #[test]
    fn shares_at_one_plane_add_up() {
        let limits = LimitsFile::example().unwrap();
        let budget = Budget::new(&used(), &limits, None);
        let (laser, light) =
            (row(&budget, "retina, laser: run"), row(&budget, "retina, stimulus: run"));
        let both = row(&budget, "retina, both sources: run");
        assert!((both.share - laser.share - light.share).abs() < 1e-12);
    }

    #[test]
    fn a_source_that_is_off_does_not_count() {
        let limits = LimitsFile::example().unwrap();
        let mut used = used();
        (used.on.stimulus_s, used.stimulus_pulse_s) = (0.0, 0.0);
        let budget = Budget::new(&used, &limits, None);
        assert!(!budget.rows.iter().any(|row| row.what.contains("retina, stimulus")));
        assert!(!budget.rows.iter().any(|row| row.what.contains("both")));
    }
}
