//! What this machine can do, on the path in use: plain loops in the same lane types as the imaging code.

#[macro_use]
mod repeat;
mod arithmetic;
mod bytes;

use arithmetic::{Arithmetic, Clock, Kind};
use bytes::{Access, Bytes};
use phasewalk::error::Result;
use phasewalk::lanes::{LaneTask, Lanes, Path};

/// Names and bytes of the buffers whose bandwidth is measured: inside the first and the second cache, as large
/// as the frames of a strip or what linked phases keep of them, and as large as its samples.
pub const BUFFERS: [(&str, usize); 4] =
    [("16 KB", 16 << 10), ("512 KB", 512 << 10), ("16 MB", 16 << 20), ("256 MB", 256 << 20)];

/// Rates per second, of vector operations or bytes.
pub struct Machine {
    path: Path,
    /// Pixels of a vector.
    lanes: usize,
    /// Clock of one core at work on vectors, Hz.
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
    /// Bytes read from and written to each of [`BUFFERS`], to the largest past the caches.
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
        let largest = BUFFERS[3].1;
        for (rates, (_, bytes)) in bandwidth.iter_mut().zip(BUFFERS) {
            let write = if bytes < largest { Access::Write } else { Access::Stream };
            for (rate, access) in rates.iter_mut().zip([Access::Read, write]) {
                *rate = path.run(Bytes { bytes, access })?;
            }
        }
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let of_largest = |access| path.run(Bytes { bytes: largest, access });
        let all_cores = [
            on_all(cores, || path.run(Arithmetic { path, kind: Kind::MultiplyAdd }))?,
            on_all(cores, || of_largest(Access::Read))?,
            on_all(cores, || of_largest(Access::Stream))?,
        ];
        Ok(Self {
            path,
            lanes: path.run(Width)?,
            hertz: path.run(Clock)?,
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

struct Width;

impl LaneTask for Width {
    type Output = usize;

    fn run<L: Lanes<Element = f32>>(self) -> usize {
        L::WIDTH
    }
}
