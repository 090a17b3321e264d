//! A Rust that can build its own `core` for a processor that comes without.

use crate::Result;
use crate::command::command;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A cargo and its rustc.
pub(crate) struct Toolchain {
    cargo: PathBuf,
    rustc: PathBuf,
}

impl Toolchain {
    /// This cargo, allowed to build `core` for a target that stable Rust has no ready-made one for.
    pub(super) fn cargo(&self) -> Command {
        let mut cargo = command(&self.cargo);
        cargo.env("RUSTC", &self.rustc).env("RUSTC_BOOTSTRAP", "1").env_remove("RUSTUP_TOOLCHAIN");
        // Of the cargo that runs us.
        cargo.env_remove("RUSTDOC").env_remove("CARGO").env_remove("RUSTFLAGS");
        cargo
    }
}

/// The user's own Rust if it has its library's sources, else Debian's.
pub(crate) fn find() -> Result<Toolchain> {
    let own = Toolchain {
        cargo: std::env::var_os("CARGO").map_or_else(|| "cargo".into(), PathBuf::from),
        rustc: std::env::var_os("RUSTC").map_or_else(|| "rustc".into(), PathBuf::from),
    };
    let debian = Toolchain { cargo: "/usr/bin/cargo".into(), rustc: "/usr/bin/rustc".into() };
    let mut both = [own, debian].into_iter();
    both.find(serves).ok_or_else(|| "no Rust compiler here has its library's sources".to_owned())
}

/// Whether it knows the target and has the sources of `core`.
fn serves(toolchain: &Toolchain) -> bool {
    let ask = |arguments: &[&str]| {
        let output = command(&toolchain.rustc).args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let knows = ask(&["--print", "target-list"]).is_some_and(|list| list.contains("avr-none"));
    let sources = ask(&["--print", "sysroot"]).is_some_and(|root| {
        Path::new(root.trim()).join("lib/rustlib/src/rust/library/core").exists()
    });
    knows && sources
}
