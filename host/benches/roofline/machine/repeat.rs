//! How often everything is measured.

use std::time::Duration;

/// Every measurement is the best of the repetitions that fit into this time,
pub const LONG: Duration = Duration::from_millis(250);

/// and of so many at the least.
pub const BEST_OF: usize = 9;

/// Work per second of the best repetition.
macro_rules! best_rate {
    ($work:expr, $run:expr) => {{
        let (begun, mut best, mut repetitions) = (std::time::Instant::now(), f64::INFINITY, 0);
        while repetitions < $crate::machine::repeat::BEST_OF
            || begun.elapsed() < $crate::machine::repeat::LONG
        {
            let start = std::time::Instant::now();
            $run;
            best = best.min(start.elapsed().as_secs_f64());
            repetitions += 1;
        }
        $work as f64 / best
    }};
}
