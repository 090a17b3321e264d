//! When each volume was taken.

use super::RunLog;
use crate::error::{Error, Result};
use phasewalk_firmware::channel::Channel;
use serde::{Deserialize, Serialize};

/// The edge that times a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TimedBy {
    /// The first edge of the camera's EXPOSE output: when the camera began.
    Exposed,
    /// The rising edge of the camera's trigger: when it was asked to begin.
    Camera,
}

/// When each volume was taken, in seconds after the run's time zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VolumeTimes {
    /// The edge that times them: EXPOSE if it was captured for every volume.
    pub by: TimedBy,
    /// By the board's nominal clock.
    pub nominal_s: Vec<f64>,
    /// By the board's clock as the host's saw it; none if that is not known well enough.
    pub fitted_s: Option<Vec<f64>>,
}

impl VolumeTimes {
    /// By the better clock.
    #[must_use]
    pub fn best_s(&self) -> &[f64] {
        self.fitted_s.as_deref().unwrap_or(&self.nominal_s)
    }
}

impl RunLog {
    /// When each volume was taken, as far as the run went.
    ///
    /// # Errors
    /// When the run did not start, or events were lost so that a volume cannot be told.
    pub fn times(&self) -> Result<VolumeTimes> {
        let start = self.start.ok_or_else(|| Error::failed("the run did not start"))?;
        if self.lost > 0 {
            let lost = self.lost;
            return Err(Error::failed(format!(
                "events lost: {lost}; the times of the volumes are not complete"
            )));
        }
        let triggers = self.ticks(Channel::Camera, true);
        let exposed = self.exposed_ticks(triggers.len());
        let (by, ticks) = match exposed {
            Some(ticks) => (TimedBy::Exposed, ticks),
            None => (TimedBy::Camera, triggers),
        };
        let by_clock = |rate: f64| ticks.iter().map(|&tick| since(start, tick) / rate).collect();
        Ok(VolumeTimes {
            by,
            nominal_s: by_clock(self.nominal_rate()),
            fitted_s: self.fitted_rate().map(by_clock),
        })
    }

    /// When each volume was taken, in seconds after the run's time zero, by the better clock.
    ///
    /// # Errors
    /// As [`Self::times`].
    pub fn volume_times_s(&self) -> Result<Vec<f64>> {
        Ok(self.times()?.best_s().to_vec())
    }

    /// When the stimulus first went on, on the axis of [`Self::volume_times_s`]; none if it did not.
    #[must_use]
    pub fn stimulus_s(&self) -> Option<f64> {
        let first = *self.ticks(Channel::Stimulus, true).first()?;
        Some(since(self.start?, first) / self.fitted_rate().unwrap_or_else(|| self.nominal_rate()))
    }

    /// Ticks per second of the board's nominal clock.
    fn nominal_rate(&self) -> f64 {
        f64::from(self.header.ticks_per_second)
    }

    /// Ticks per second as the host's clock saw them, if that is known well enough.
    fn fitted_rate(&self) -> Option<f64> {
        let fit = self.fit().filter(crate::trigger::clock::Fit::is_useful)?;
        Some(fit.ticks_per_second)
    }

    /// EXPOSE edges, if there is one for each of the volumes.
    fn exposed_ticks(&self, volumes: usize) -> Option<Vec<u64>> {
        let in_order = self.exposures.iter().enumerate();
        let each = in_order.map(|(index, (tick, volume))| {
            (volume.map(|volume| volume as usize) == Some(index)).then_some(*tick)
        });
        let ticks: Vec<u64> = each.collect::<Option<_>>()?;
        (volumes > 0 && ticks.len() == volumes).then_some(ticks)
    }
}

/// Ticks after time zero.
fn since(start: u64, tick: u64) -> f64 {
    tick.saturating_sub(start) as f64
}
