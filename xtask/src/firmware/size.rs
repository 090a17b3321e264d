//! What an image takes, and what it may take.

use crate::Result;
use crate::command::command;
use std::path::Path;

/// Ceilings of an image, in bytes.
pub(super) struct Ceilings {
    pub(super) flash: u64,
    /// Variables that are not on the stack; tests watch the stack.
    pub(super) variables: u64,
}

/// Sections in flash, and in memory; what has first values is in both.
const FLASH: [&str; 4] = [".vector_table", ".text", ".rodata", ".data"];
const VARIABLES: [&str; 4] = [".data", ".bss", ".noinit", ".uninit"];

impl Ceilings {
    /// Print flash and memory by `size`, a tool of the processor's, and refuse an image that has grown
    /// too large.
    pub(super) fn hold(&self, elf: &Path, size: &str) -> Result {
        let output = command(size).arg("-A").arg(elf).output();
        let output = output.map_err(|e| format!("cannot start {size}: {e}"))?;
        let table = String::from_utf8_lossy(&output.stdout);
        let (flash, variables) = (sum(&table, &FLASH), sum(&table, &VARIABLES));
        let name = elf.file_stem().unwrap_or_default().display();
        println!(
            "   {name}: flash {flash} of at most {} bytes, variables {variables} of at most {} bytes",
            self.flash, self.variables
        );
        if flash == 0 || flash > self.flash || variables > self.variables {
            return Err(format!("{}: too large (or not measured)", elf.display()));
        }
        Ok(())
    }
}

fn sum(table: &str, sections: &[&str]) -> u64 {
    let rows = table.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    let sizes = rows.filter(|row| row.first().is_some_and(|name| sections.contains(name)));
    sizes.filter_map(|row| row.get(1)?.parse::<u64>().ok()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_are_added_up() {
        let table =
            "x.elf  :\nsection size addr\n.text 100 0\n.data 20 8\n.bss 3 9\n.comment 7 0\n";
        assert_eq!((sum(table, &FLASH), sum(table, &VARIABLES)), (120, 23));
    }
}
