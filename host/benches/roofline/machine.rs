//! What this machine can do, on the path in use: plain loops in the same lane types as the imaging code.

use phasewalk::error::Result;
use phasewalk::lanes::{LaneTask, Lanes, Path};
use std::hint::black_box;
use std::time::Instant;

/// Every measurement is the best of so many.
const BEST_OF: usize = 9;

/// Names and bytes of the buffers whose bandwidth is measured: inside the first and the second cache, as large as the
/// frames of a strip or what linked phases keep of them, and as large as its samples.
pub const BUFFERS: [(&str, usize); 4] =
    [("16 KB", 16 << 10), ("512 KB", 512 << 10), ("16 MB", 16 << 20), ("256 MB", 256 << 20)];

/// Rates per second, of vector operations or bytes.
pub struct Machine {
    path: Path,
    /// Pixels of a vector.
    lanes: usize,
    /// Clock of one core, Hz.
    pub hertz: f64,
    /// Additions alone.
    pub add: f64,
    /// Multiplications alone, or fused with additions where the path has that.
    pub multiply: f64,
    /// Both in equal parts: no faster than one of them where they share their ports.
    pub both: f64,
    /// Multiply-adds; where the path has none, pairs of both.
    pub multiply_add: f64,
    /// Divisions.
    pub divide: f64,
    /// Square roots.
    pub root: f64,
    /// Bytes read from and written to each of [`BUFFERS`].
    pub bandwidth: [[f64; 2]; 4],
    /// Multiply-adds of all cores at once, bytes of the largest buffer read and written by all.
    all_cores: [f64; 3],
    cores: usize,
}

impl Machine {
    /// Takes a few seconds.
    pub fn measure(path: Path) -> Result<Self> {
        let rate = |kind| path.run(Arithmetic { path, kind });
        let fused = if path == Path::Portable { Kind::Multiply } else { Kind::MultiplyAdd };
        let mut bandwidth = [[0.0; 2]; 4];
        for (rates, (_, bytes)) in bandwidth.iter_mut().zip(BUFFERS) {
            for (rate, write) in rates.iter_mut().zip([false, true]) {
                *rate = path.run(Bytes { bytes, write })?;
            }
        }
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let bytes = BUFFERS[3].1;
        let all_cores = [
            on_all(cores, || path.run(Arithmetic { path, kind: Kind::MultiplyAdd }))?,
            on_all(cores, || path.run(Bytes { bytes, write: false }))?,
            on_all(cores, || path.run(Bytes { bytes, write: true }))?,
        ];
        Ok(Self {
            path,
            lanes: path.run(Width)?,
            hertz: clock(),
            add: rate(Kind::Add)?,
            multiply: rate(fused)?,
            both: rate(Kind::Both)?,
            multiply_add: rate(Kind::MultiplyAdd)?,
            divide: rate(Kind::Divide)?,
            root: rate(Kind::Root)?,
            bandwidth,
            all_cores,
            cores,
        })
    }

    /// Does a multiply-add count as one operation?
    pub fn is_fused(&self) -> bool {
        self.path != Path::Portable
    }

    /// Floating-point operations per second of the multiply-adds of one core.
    pub fn peak(&self) -> f64 {
        2.0 * self.lanes as f64 * self.multiply_add
    }

    /// As Markdown.
    pub fn print(&self) {
        let Self { path, lanes, hertz, all_cores, cores, .. } = self;
        println!("## Machine: {path:?}, {lanes} x f32, clock {:.2} GHz\n", hertz / 1e9);
        println!(
            "f32 peak of multiply-adds: {:.0} GF/s on one core, {:.0} on {cores}\n",
            self.peak() / 1e9,
            2.0 * *lanes as f64 * all_cores[0] / 1e9
        );
        println!("| a cycle, one core | add | multiply | both | multiply-add | divide | root |");
        println!("|---|---|---|---|---|---|---|");
        let rates = [self.add, self.multiply, self.both, self.multiply_add, self.divide, self.root];
        let cells = rates.map(|rate| format!("{:.3}", rate / hertz));
        println!("| vectors | {} |\n", cells.join(" | "));
        println!("| buffer | read, GB/s | bytes a cycle | write, GB/s | bytes a cycle |");
        println!("|---|---|---|---|---|");
        for ((name, _), [read, write]) in BUFFERS.iter().zip(self.bandwidth) {
            let row = [read / 1e9, read / hertz, write / 1e9, write / hertz];
            println!("| {name} | {} |", row.map(|number| format!("{number:.1}")).join(" | "));
        }
        let [_, read, write] = all_cores.map(|rate| format!("{:.1}", rate / 1e9));
        println!("| 256 MB, each of {cores} cores at once | {read} | | {write} | |\n");
    }
}

/// The sum of what every core reaches while all are at it.
fn on_all(cores: usize, one: impl Fn() -> Result<f64> + Sync) -> Result<f64> {
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..cores).map(|_| scope.spawn(&one)).collect();
        threads.into_iter().map(|thread| thread.join().unwrap_or(Ok(0.0))).sum()
    })
}

/// Work per second of the best of [`BEST_OF`] runs.
macro_rules! best_rate {
    ($work:expr, $run:expr) => {{
        let mut best = f64::INFINITY;
        for _ in 0..BEST_OF {
            let start = Instant::now();
            $run;
            best = best.min(start.elapsed().as_secs_f64());
        }
        $work as f64 / best
    }};
}

/// Cycles per second, from a chain of operations on whole numbers of which each needs the one before: one cycle each, and the
/// compiler cannot shorten it.
fn clock() -> f64 {
    const STEPS: u64 = 2_000_000;
    let (a, b) = (black_box(0x9E37_79B9_7F4A_7C15_u64), black_box(0xD1B5_4A32_D192_ED03_u64));
    let chain = || {
        let mut x = 1_u64;
        for _ in 0..STEPS {
            x = (x ^ a).wrapping_add(b);
            x = (x ^ a).wrapping_add(b);
            x = (x ^ a).wrapping_add(b);
            x = (x ^ a).wrapping_add(b);
        }
        black_box(x)
    };
    best_rate!(8 * STEPS, chain())
}

struct Width;

impl LaneTask for Width {
    type Output = usize;

    fn run<L: Lanes<Element = f32>>(self) -> usize {
        L::WIDTH
    }
}

/// Which operation is repeated.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Add,
    Multiply,
    Both,
    MultiplyAdd,
    Divide,
    Root,
}

/// Operations per second in so many independent chains that none waits for the other.
struct Arithmetic {
    path: Path,
    kind: Kind,
}

impl LaneTask for Arithmetic {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> f64 {
        // As many as there are registers, but for two (a portable vector takes two).
        match self.path {
            Path::Avx512 => rate::<L, 24>(self.kind),
            Path::Avx2 => rate::<L, 12>(self.kind),
            Path::Portable => rate::<L, 6>(self.kind),
        }
    }
}

#[inline(always)]
fn rate<L: Lanes, const CHAINS: usize>(kind: Kind) -> f64 {
    match kind {
        Kind::Add => chains::<L, CHAINS, 0>(),
        Kind::Multiply => chains::<L, CHAINS, 1>(),
        Kind::Both => chains::<L, CHAINS, 2>(),
        Kind::MultiplyAdd => chains::<L, CHAINS, 3>(),
        Kind::Divide => chains::<L, CHAINS, 4>(),
        Kind::Root => chains::<L, CHAINS, 5>(),
    }
}

/// The loop, `KIND` being the operation.
#[inline(always)]
fn chains<L: Lanes, const CHAINS: usize, const KIND: usize>() -> f64 {
    const STEPS: usize = 100_000;
    // Numbers that stay as they are, or nearly: none must become subnormal, which is slow.
    let (one, other) = (black_box(L::one()), black_box(L::from_f64(1.37)));
    best_rate!(CHAINS * STEPS, {
        let mut sums = black_box([L::one(); CHAINS]);
        for _ in 0..STEPS {
            for (i, sum) in sums.iter_mut().enumerate() {
                *sum = match KIND {
                    0 => *sum + one,
                    1 => *sum * one,
                    2 if i % 2 == 0 => *sum + one,
                    2 => *sum * one,
                    3 => sum.mul_add(one, other),
                    4 => other / *sum,
                    // The addition is made while the root waits.
                    _ => (*sum + other).sqrt(),
                };
            }
        }
        black_box(sums);
    })
}

/// Bytes per second.
struct Bytes {
    bytes: usize,
    write: bool,
}

impl LaneTask for Bytes {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> f64 {
        // At least 16 MB a measurement.
        let turns = ((16 << 20) / self.bytes).max(1);
        let mut buffer = vec![L::one(); self.bytes / size_of::<L>()];
        let mut value = L::zero();
        if self.write {
            return best_rate!(
                turns * self.bytes,
                for _ in 0..turns {
                    value += L::one();
                    fill(&mut buffer, value);
                    black_box(&mut buffer);
                }
            );
        }
        best_rate!(
            turns * self.bytes,
            for _ in 0..turns {
                value += sum(&buffer);
                black_box(value);
            }
        )
    }
}

/// Places that are read or written in turns: the processor fetches several streams ahead faster than one.
const STREAMS: usize = 4;

/// Vectors that are taken from each, and sums side by side, so that none waits for another.
const TOGETHER: usize = 4;

#[inline(always)]
fn sum<L: Lanes>(buffer: &[L]) -> L {
    let mut sums = [[L::zero(); TOGETHER]; 2];
    let streams = buffer.as_chunks::<TOGETHER>().0;
    let length = streams.len() / STREAMS;
    for at in 0..length {
        for stream in 0..STREAMS {
            let vectors = streams[stream * length + at];
            for (sum, vector) in sums[stream % 2].iter_mut().zip(vectors) {
                *sum += vector;
            }
        }
    }
    let mut all = L::zero();
    for &sum in sums.as_flattened() {
        all += sum;
    }
    all
}

#[inline(always)]
fn fill<L: Lanes>(buffer: &mut [L], value: L) {
    let streams = buffer.as_chunks_mut::<TOGETHER>().0;
    let length = streams.len() / STREAMS;
    for at in 0..length {
        for stream in 0..STREAMS {
            streams[stream * length + at] = [value; TOGETHER];
        }
    }
}
