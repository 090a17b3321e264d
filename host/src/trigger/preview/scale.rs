//! A time axis: ticks to pixels, and round numbers in a unit that suits.

use super::windows::Window;

/// Ticks of the board along a horizontal line.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    from: i64,
    to: i64,
    zero: i64,
    left: f64,
    width: f64,
    ticks_per_second: f64,
}

impl Scale {
    /// The span of a window on a line.
    pub fn new(window: &Window, left: f64, width: f64, ticks_per_second: u32) -> Self {
        let Window { from, to, zero, .. } = *window;
        Self { from, to, zero, left, width, ticks_per_second: ticks_per_second.into() }
    }

    /// Where a tick lies, in pixels; what is outside lies on the border.
    pub fn x(&self, tick: i64) -> f64 {
        let span = (self.to - self.from).max(1) as f64;
        let share = (tick.saturating_sub(self.from)) as f64 / span;
        self.left + self.width * share.clamp(0.0, 1.0)
    }

    /// The unit of the axis: its name and its size in seconds.
    pub fn unit(&self) -> (&'static str, f64) {
        let (first, last) = self.seconds();
        match last.abs().max(first.abs()) {
            most if most < 2e-3 => ("us", 1e-6),
            most if most < 2.0 => ("ms", 1e-3),
            most if most < 600.0 => ("s", 1.0),
            most if most < 36_000.0 => ("min", 60.0),
            _ => ("h", 3600.0),
        }
    }

    /// Round numbers along the axis: pixel and label.
    pub fn labels(&self) -> Vec<(f64, String)> {
        let (_, unit) = self.unit();
        let (first, last) = self.seconds();
        let (first, last) = (first / unit, last / unit);
        let step = round_step((last - first) / 9.0);
        let digits = (-step.log10().floor()).max(0.0) as usize;
        let (begin, end) = ((first / step).ceil() as i64, (last / step).floor() as i64);
        let label = |number: i64| {
            let value = number as f64 * step;
            let x = self.left + self.width * (value - first) / (last - first);
            (x, format!("{value:.digits$}"))
        };
        (begin..=end).map(label).collect()
    }

    /// Begin and end in seconds after the axis' zero.
    fn seconds(&self) -> (f64, f64) {
        let seconds = |tick: i64| (tick - self.zero) as f64 / self.ticks_per_second;
        (seconds(self.from), seconds(self.to.max(self.from + 1)))
    }
}

/// 1, 2 or 5 times a power of ten, at least `least`.
fn round_step(least: f64) -> f64 {
    let power = 10_f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= least * 0.999);
    factor.unwrap_or(10.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_round() {
        let window =
            Window { title: String::new(), from: -1600, to: 160_000, zero: 0, zero_name: "" };
        let scale = Scale::new(&window, 100.0, 1010.0, 16_000_000);
        assert_eq!(scale.unit().0, "ms");
        let labels = scale.labels();
        assert_eq!(labels.first(), Some(&(110.0, "0".to_owned())));
        assert_eq!(labels.last().map(|label| label.1.as_str()), Some("10"));
        assert_eq!(scale.x(i64::MAX), 1110.0);
        for (least, step) in [(0.9, 1.0), (1.1, 2.0), (3.0, 5.0), (6.0, 10.0), (0.03, 0.05)] {
            assert!((round_step(least) - step).abs() < 1e-12 * step, "{least}");
        }
    }
}
