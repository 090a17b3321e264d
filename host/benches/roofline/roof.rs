//! The least time that a stage can take on the measured machine.

use crate::costs::{Cost, Operations};
use crate::machine::{BUFFERS, Machine};

/// Seconds for one vector and pair.
pub struct Roof {
    /// By arithmetic.
    pub arithmetic_s: f64,
    /// By bytes.
    pub bytes_s: f64,
    /// What decides: ports, the divider, or a buffer.
    pub by: &'static str,
    /// Floating-point operations of a lane, a multiply-add being two.
    pub flops: f64,
}

impl Roof {
    /// The greater of both.
    pub fn seconds(&self) -> f64 {
        self.arithmetic_s.max(self.bytes_s)
    }

    /// Of a stage in vectors of so many bytes.
    pub fn of(cost: &Cost, machine: &Machine, vector: usize) -> Self {
        let operations = in_primitives(cost.operations, machine);
        let Operations { adds, multiplies, multiply_adds, divisions, roots, .. } = operations;
        // A sum of additions has no use for the half of a multiply-add that multiplies; so they count as
        // instructions. Where adders and multipliers are apart, `both` is the sum of the two rates, elsewhere
        // it is one of them.
        let slots = multiplies + multiply_adds;
        let ports = [adds / machine.add, slots / machine.multiply, (adds + slots) / machine.both]
            .into_iter()
            .fold(0.0, f64::max);
        // Roots and quotients are made in the same unit, beside the others.
        let divider = divisions / machine.divide + roots / machine.root;
        let mut roof = Self {
            arithmetic_s: ports.max(divider),
            bytes_s: 0.0,
            by: if divider > ports { "divider" } else { "ports" },
            flops: adds + multiplies + 2.0 * multiply_adds + divisions + roots,
        };
        for traffic in &cost.traffic {
            let [read, write] = machine.bandwidth[traffic.level as usize];
            let bytes = vector as f64;
            let seconds = (bytes * traffic.reads / read).max(bytes * traffic.writes / write);
            if seconds > roof.arithmetic_s.max(roof.bytes_s) {
                roof.by = BUFFERS[traffic.level as usize].0;
            }
            roof.bytes_s = roof.bytes_s.max(seconds);
        }
        roof
    }
}

/// Without reciprocal roots, and without multiply-adds where the path has none.
fn in_primitives(mut operations: Operations, machine: &Machine) -> Operations {
    let inverse_roots = std::mem::take(&mut operations.inverse_roots);
    if machine.is_fused() {
        // Estimate, x y, y / 2; 1 - x y y and the sum.
        operations.multiplies += 3.0 * inverse_roots;
        operations.multiply_adds += 2.0 * inverse_roots;
    } else {
        operations.roots += inverse_roots;
        operations.divisions += inverse_roots;
        let pairs = std::mem::take(&mut operations.multiply_adds);
        operations.adds += pairs;
        operations.multiplies += pairs;
    }
    operations
}
