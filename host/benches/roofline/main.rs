//! How near each stage of the phase images comes to what this machine can do:
//!
//! ```text
//! cargo bench --bench roofline
//! PHASEWALK_SIMD=avx2 cargo bench --bench roofline      # or portable
//! ```
//! In one run it measures the machine (`machine`): clock, rates of arithmetic, bandwidths. Then it takes the
//! paper's scene at full size (`scene`) and, for the paper's method and for linked phases, times every stage of
//! a strip on the real code and buffers, puts beside it the least time that its arithmetic and its bytes can
//! take (`costs`, `roof`), and its share of the whole run's CPU time (`table`).
//!
//! Each lap of a stage (one pair of frames, one vector of pixels) is timed in every repetition. *Best* is the
//! sum of every lap's shortest time, which another load on the machine hardly touches; *median* that of the
//! medians.

mod costs;
mod machine;
mod roof;
mod scene;
mod table;

use machine::Machine;
use phasewalk::error::Result;
use phasewalk::lanes::Path;
use scene::Scene;

/// How often a strip is timed.
const REPETITIONS: usize = 7;

fn main() -> Result<()> {
    if !std::env::args().any(|argument| argument == "--bench") {
        println!("a bench, not a test: cargo bench --bench roofline");
        return Ok(());
    }
    let path = Path::best()?;
    let machine = Machine::measure(path)?;
    machine.print();
    let scene = Scene::simulate()?;
    for method in scene::METHODS {
        let run = scene.run(path, method, REPETITIONS)?;
        table::print(&machine, method, &run);
    }
    Ok(())
}
