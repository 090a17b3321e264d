//! How much memory a job takes, known before it starts.

use super::filter::Passes;
use super::linked;
use super::phase::{Sample, Workspace};
use super::strip::Layout;
use super::{ImageJob, Kernel, Tiles};
use crate::error::{Error, Result};
use crate::io::Shape;
use crate::lanes::Lanes;
use crate::method::Method;

/// Rows of the strips when memory does not forbid it: the two frames of a pair then stay in a core's
/// second-level cache. Tiles are whole strips.
pub(super) const STRIP_ROWS: usize = 16;

/// The same for least squares, where unit phasors make lines of halo dearer.
const LEAST_SQUARES_ROWS: usize = 24;

/// What a job will take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryPlan {
    /// Height of the strips.
    pub strip_rows: usize,
    /// Threads that have work.
    pub threads: usize,
    /// Bytes of the strips of all threads, and of the tiles that linked phases start from.
    pub bytes: u64,
}

impl MemoryPlan {
    /// The highest strips that fit, up to the preferred ones.
    pub(super) fn new<L: Lanes>(job: &ImageJob<'_>, kernel: &Kernel) -> Result<Self> {
        let Shape { height, .. } = job.series.shape();
        let preferred = if job.tiles.is_some() { STRIP_ROWS } else { LEAST_SQUARES_ROWS };
        let mut rows = preferred.min(height);
        loop {
            rows = if job.tiles.is_some() { rows } else { in_pairs(height, rows) };
            let threads = job.threads.clamp(1, height.div_ceil(rows));
            let strips = threads as u64 * bytes_per_thread::<L>(job, kernel, rows)?;
            let bytes = strips + job.tiles.map_or(0, Tiles::bytes);
            if bytes <= job.memory {
                return Ok(Self { strip_rows: rows, threads, bytes });
            }
            if rows == 1 {
                let megabytes = |bytes: u64| bytes.div_ceil(1_000_000);
                return Err(Error::usage(format!(
                    "--memory: {} MB do not hold one row of the image; at least {} MB are needed \
                     with {threads} threads{}",
                    megabytes(job.memory),
                    megabytes(bytes),
                    advice(threads, job.plan.method),
                )));
            }
            // Tiles are whole strips.
            rows = if job.tiles.is_some() { rows.div_ceil(2) } else { rows - 1 };
        }
    }
}

/// Rows of strips of at most `rows`, so that two threads have as many where the height allows it. (Not so many as there are
/// threads: the strips are a file's chunks, which ought to be the same with any number of them, and are but where memory is
/// short.)
fn in_pairs(height: usize, rows: usize) -> usize {
    match height.div_ceil(rows) {
        1 => height,
        strips => height.div_ceil(strips.next_multiple_of(2)),
    }
}

/// What needs less, of the options that the method takes.
fn advice(threads: usize, method: Method) -> String {
    let fewer_threads = (threads > 1).then_some("fewer --threads");
    let smaller_lag = matches!(method, Method::Paper(_)).then_some("a smaller --max-lag");
    let all: Vec<&str> = [fewer_threads, smaller_lag].into_iter().flatten().collect();
    if all.is_empty() { String::new() } else { format!(" ({} need less)", all.join(" or ")) }
}

fn bytes_per_thread<L: Lanes>(job: &ImageJob<'_>, kernel: &Kernel, rows: usize) -> Result<u64> {
    if job.tiles.is_some() {
        return linked::bytes::<L>(job, kernel, rows);
    }
    let Shape { frames, width, .. } = job.series.shape();
    let layout = Layout::new(width, L::WIDTH, kernel.radius());
    let places = (rows * layout.blocks) as u64;
    let tall = (rows + 2 * layout.halo) as u64;
    let vector = size_of::<L>() as u64;
    let pairs = job.plan.pairs().len() as u64;
    let depths = job.plan.depths.all().len() as u64;
    let frames = frames as u64;
    let fields = frames * depths * tall * layout.blocks as u64 * 2 * vector;
    let samples = pairs * places * size_of::<Sample<L>>() as u64;
    let coherences = if job.keeps_coherence() { pairs * places * vector } else { 0 };
    let powers = if job.needs_coherence() { frames * places * vector } else { 0 };
    let results = frames * (rows * width * 8) as u64;
    let buffer = tall * width as u64 * 8;
    let passes = Passes::<L>::bytes(&layout, rows) as u64;
    let workspace = Workspace::<L>::bytes(job.plan, job.keeps_coherence()) as u64;
    Ok(fields + samples + coherences + powers + results + buffer + passes + workspace)
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasewalk_core::weights::Weighting;

    #[test]
    fn strips_come_in_pairs() {
        assert_eq!(in_pairs(368, 24), 23);
        assert_eq!(in_pairs(384, 24), 24);
        assert_eq!(in_pairs(400, 24), 23);
        assert_eq!(in_pairs(24, 24), 24);
        assert_eq!(in_pairs(25, 24), 13);
        assert_eq!(in_pairs(5, 1), 1);
        assert_eq!(in_pairs(1, 1), 1);
    }

    #[test]
    fn only_what_the_method_takes_is_advised() {
        let paper = Method::Paper(Weighting::Paper);
        assert_eq!(advice(2, paper), " (fewer --threads or a smaller --max-lag need less)");
        assert_eq!(advice(2, Method::Linked), " (fewer --threads need less)");
        assert_eq!(advice(1, Method::Linked), "");
    }
}
