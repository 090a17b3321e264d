//! The range of an axis and where its ticks go.

/// A range of values, never empty and never infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Lower end.
    pub low: f64,
    /// Upper end, above the lower.
    pub high: f64,
}

/// A mark on an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Where it is.
    pub value: f64,
    /// What is written beside it.
    pub label: String,
}

impl Span {
    /// A range with room around it when its ends coincide; 0..1 when they are not finite.
    #[must_use]
    pub fn new(low: f64, high: f64) -> Self {
        let (low, high) = (low.min(high), low.max(high));
        let width = high - low;
        if !width.is_finite() {
            return Self { low: 0.0, high: 1.0 };
        }
        let least = 1e-9 * low.abs().max(high.abs());
        if width > least {
            return Self { low, high };
        }
        let room = (0.1 * low.abs()).max(0.5);
        Self { low: low - room, high: high + room }
    }

    /// The range of all finite values; 0..1 when there is none.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let finite = values.into_iter().filter(|v| v.is_finite());
        let ends = finite
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        if ends.0 > ends.1 {
            return Self { low: 0.0, high: 1.0 };
        }
        Self::new(ends.0, ends.1)
    }

    /// The range with a fraction of its width added at both ends.
    #[must_use]
    pub fn padded(self, fraction: f64) -> Self {
        let room = fraction * (self.high - self.low);
        Self::new(self.low - room, self.high + room)
    }

    /// Where a value lies: 0 at the lower end, 1 at the upper.
    #[must_use]
    pub fn position(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// The value as far from the upper end as this one is from the lower: what counts downwards.
    #[must_use]
    pub fn mirrored(&self, value: f64) -> f64 {
        self.low + (self.high - value)
    }

    /// Round ticks of an axis that counts downwards.
    #[must_use]
    pub fn ticks_down(&self, most: usize) -> Vec<Tick> {
        let mut ticks = self.ticks(most);
        for tick in &mut ticks {
            tick.value = self.mirrored(tick.value);
        }
        ticks
    }

    /// At most about `most` ticks at round values: 1, 2 or 5 times a power of ten.
    #[must_use]
    pub fn ticks(&self, most: usize) -> Vec<Tick> {
        let step = round_step((self.high - self.low) / most.max(1) as f64);
        let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
        let slack = 1e-9 * step;
        let first = ((self.low - slack) / step).ceil();
        (0..=2 * most)
            .map(|n| (first + n as f64) * step)
            .take_while(|value| *value <= self.high + slack)
            .map(|value| Tick { value, label: number(value, decimals) })
            .collect()
    }
}

/// A number as printed in a figure: fixed decimals, a real minus sign, no negative zero.
#[must_use]
pub fn number(value: f64, decimals: usize) -> String {
    let plain = format!("{value:.decimals$}");
    match plain.strip_prefix('-') {
        Some(digits) if digits.chars().any(|c| ('1'..='9').contains(&c)) => {
            format!("\u{2212}{digits}")
        }
        Some(digits) => digits.to_owned(),
        None => plain,
    }
}

/// The largest round length, 1, 2 or 5 times a power of ten, that is not above a limit.
#[must_use]
pub fn round_below(limit: f64) -> f64 {
    let power = 10_f64.powf(limit.log10().floor());
    let steps = [5.0, 2.0].map(|factor| factor * power);
    steps.into_iter().find(|step| *step <= limit).unwrap_or(power)
}

/// The smallest of 1, 2 and 5 times a power of ten that is not below `least`.
#[must_use]
pub fn round_step(least: f64) -> f64 {
    let power = 10_f64.powf(least.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power);
    let fits = steps.into_iter().find(|step| *step >= least * 0.999);
    fits.unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let labels = |low, high, most| -> Vec<String> {
            let ticks = Span::new(low, high).ticks(most);
            ticks.into_iter().map(|tick| tick.label).collect()
        };
        assert_eq!(labels(0.0, 69.0, 4), ["0", "20", "40", "60"]);
        assert_eq!(labels(-0.4, 0.4, 4), ["\u{2212}0.4", "\u{2212}0.2", "0.0", "0.2", "0.4"]);
    }

    #[test]
    fn round_lengths_stay_below_their_limit() {
        let lengths = [0.04, 1.0, 49.0, 50.0, 199.0].map(round_below);
        assert_eq!(lengths, [0.02, 1.0, 20.0, 50.0, 100.0]);
    }

    #[test]
    fn odd_ranges_stay_usable() {
        let nan = f64::NAN;
        assert_eq!(Span::of([]), Span { low: 0.0, high: 1.0 });
        assert_eq!(Span::of([nan, f64::INFINITY]), Span { low: 0.0, high: 1.0 });
        for (low, high) in [(2.0, 2.0), (0.0, 0.0), (-1e300, 1e300), (-1e308, 1e308), (nan, 1.0)] {
            let span = Span::new(low, high);
            assert!(span.low < span.high && (span.high - span.low).is_finite());
            assert!(span.ticks(5).len() <= 11);
        }
    }
}
