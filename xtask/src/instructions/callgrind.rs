//! One run of the program under Valgrind's callgrind.

use super::Case;
use crate::Result;
use crate::command::command;
use std::fs::File;
use std::path::Path;

/// Instructions that the case executes in all, in the folder of its files. One thread: several wait for each other in
/// loops, whose turns are chance.
pub(super) fn count(program: &Path, case: &Case, folder: &Path) -> Result<u64> {
    let Case { name, simd, arguments } = case;
    let profile = folder.join(format!("{}.callgrind", name.replace([' ', ','], "-")));
    let pipe = folder.join("F.pipe");
    let frames = File::open(&pipe).map_err(|e| format!("cannot read {}: {e}", pipe.display()))?;
    let mut valgrind = command("valgrind");
    valgrind.args(["--tool=callgrind", "--quiet"]);
    valgrind.arg(format!("--callgrind-out-file={}", profile.display()));
    valgrind.arg(program).args(arguments.split_whitespace()).args(["--threads", "1"]);
    valgrind.env("PHASEWALK_SIMD", simd).env("RAYON_NUM_THREADS", "1").current_dir(folder);
    let output =
        valgrind.stdin(frames).output().map_err(|e| format!("cannot start valgrind: {e}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        return Err(format!("{name}: `phasewalk {arguments}` failed under valgrind:\n{said}"));
    }
    let text = std::fs::read_to_string(&profile)
        .map_err(|e| format!("cannot read {}: {e}", profile.display()))?;
    total(&text).ok_or_else(|| format!("{}: holds no total", profile.display()))
}

/// The number behind `totals:` in a file of callgrind's.
fn total(profile: &str) -> Option<u64> {
    profile.lines().rev().find_map(|line| line.strip_prefix("totals:"))?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::total;

    #[test]
    fn the_total_stands_at_the_end() {
        let profile = "version: 1\nevents: Ir\nsummary: 12\n\nfn=(1) main\n5 7\n\ntotals: 3045\n";
        assert_eq!(total(profile), Some(3045));
        for broken in ["", "events: Ir\nsummary: 12\n", "totals: many\n"] {
            assert_eq!(total(broken), None, "{broken}");
        }
    }
}
