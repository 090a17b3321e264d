//! `cargo xtask firmware`: the images of the boards, and the emulated board.

use crate::command::{cargo, command, run};
use crate::packages::{AVR_TOOLS, RUST_SOURCES, SIMAVR};
use crate::{Result, folders};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Flash for the image: 32 KiB less the boot loader of the Uno, 512 bytes, and less 256 in reserve.
const FLASH_CEILING: u64 = 32_000;

/// Variables that are not on the stack; tests watch the stack.
const VARIABLES_CEILING: u64 = 480;

/// Images and emulated board into `<target>/firmware`.
pub(crate) fn build() -> Result {
    let folder = folders::target()?.join("firmware");
    fs::create_dir_all(&folder).map_err(|e| format!("cannot make {}: {e}", folder.display()))?;
    uno(&folder)?;
    emulated_board(&folder)
}

/// The image of the Arduino Uno: uno.elf and uno.hex.
fn uno(folder: &Path) -> Result {
    AVR_TOOLS.meet()?;
    RUST_SOURCES.meet()?;
    let build = folder.join("build");
    let arguments = "build -p phasewalk-firmware --no-default-features --features uno --bin uno --profile firmware \
                     -Zbuild-std=core --target avr-none --target-dir";
    let mut cargo = toolchain()?.cargo();
    cargo.args(arguments.split_whitespace()).arg(&build);
    cargo.env("CARGO_ENCODED_RUSTFLAGS", "-Ctarget-cpu=atmega328p");
    cargo.env("PHASEWALK_BUILD", format!("{:08x}", sources_hash()?));
    run(&mut cargo)?;

    let (elf, hex) = (folder.join("uno.elf"), folder.join("uno.hex"));
    let built = build.join("avr-none").join("firmware").join("uno.elf");
    fs::copy(&built, &elf).map_err(|e| format!("cannot copy {}: {e}", built.display()))?;
    let sections = ["-O", "ihex", "-j", ".text", "-j", ".data"];
    run(command("avr-objcopy").args(sections).args([&elf, &hex]))?;
    within_ceilings(&elf)
}

/// Print flash and memory, and refuse an image that has grown too large.
fn within_ceilings(elf: &Path) -> Result {
    let output = command("avr-size").arg("-A").arg(elf).output();
    let output = output.map_err(|e| format!("cannot start avr-size: {e}"))?;
    let table = String::from_utf8_lossy(&output.stdout);
    let size = |section: &str| -> u64 {
        let fields = table.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
        let sizes = fields.filter(|fields| fields.first() == Some(&section));
        sizes.filter_map(|fields| fields.get(1)?.parse::<u64>().ok()).sum()
    };
    let flash = size(".text") + size(".data");
    let variables = size(".data") + size(".bss") + size(".noinit");
    println!(
        "   uno: flash {flash} of at most {FLASH_CEILING} bytes, variables {variables} of at most \
         {VARIABLES_CEILING} bytes"
    );
    if flash == 0 || flash > FLASH_CEILING || variables > VARIABLES_CEILING {
        return Err(format!("{}: too large (or not measured)", elf.display()));
    }
    Ok(())
}

/// The emulated board, as `--port sim:` starts it.
fn emulated_board(folder: &Path) -> Result {
    SIMAVR.meet()?;
    let build =
        "build --release -p phasewalk-tests --features emulated-boards --bin emulated-board";
    run(&mut cargo(build))?;
    let built = folders::target()?.join("release").join("emulated-board");
    let copy = folder.join("emulated-board");
    fs::copy(&built, &copy).map_err(|e| format!("cannot copy {}: {e}", built.display()))?;
    Ok(())
}

/// A cargo and its rustc.
pub(crate) struct Toolchain {
    cargo: PathBuf,
    rustc: PathBuf,
}

impl Toolchain {
    /// This cargo, allowed to build `core` for a target that stable Rust has no ready-made one for.
    fn cargo(&self) -> Command {
        let mut cargo = command(&self.cargo);
        cargo.env("RUSTC", &self.rustc).env("RUSTC_BOOTSTRAP", "1").env_remove("RUSTUP_TOOLCHAIN");
        // Of the cargo that runs us.
        cargo.env_remove("RUSTDOC").env_remove("CARGO").env_remove("RUSTFLAGS");
        cargo
    }
}

/// The user's own Rust if it has its library's sources, else Debian's.
pub(crate) fn toolchain() -> Result<Toolchain> {
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

/// FNV-1a of all sources that go into the images, in the order of their names.
fn sources_hash() -> Result<u32> {
    let mut files = Vec::new();
    let firmware = folders::workspace().join("firmware");
    collect(&firmware.join("src"), &mut files)?;
    files.push(firmware.join("Cargo.toml"));
    files.sort();
    let mut hash = 0x811C_9DC5_u32;
    for file in files {
        let bytes = fs::read(&file).map_err(|e| format!("cannot read {}: {e}", file.display()))?;
        for byte in bytes {
            hash = (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193);
        }
    }
    Ok(hash)
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result {
    let failed = |e: std::io::Error| format!("cannot read {}: {e}", folder.display());
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() { collect(&path, files)? } else { files.push(path) }
    }
    Ok(())
}
