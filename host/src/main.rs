//! The `phasewalk` program; see `phasewalk::cli`.

use std::process::ExitCode;

fn main() -> ExitCode {
    phasewalk::cli::main()
}
