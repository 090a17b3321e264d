//! The image of the Arduino Uno.

use super::size::Ceilings;
use super::{copy, sources, toolchain};
use crate::Result;
use crate::command::{command, run};
use crate::packages::{AVR_TOOLS, RUST_SOURCES};
use std::path::Path;

const CEILINGS: Ceilings = Ceilings {
    // 32 KiB less the boot loader of the Uno, 512 bytes, and less 256 in reserve.
    flash: 32_000,
    variables: 480,
};

/// uno.elf and uno.hex.
pub(super) fn build(folder: &Path) -> Result {
    AVR_TOOLS.meet()?;
    RUST_SOURCES.meet()?;
    let build = folder.join("build");
    let arguments = "build -p phasewalk-firmware --no-default-features --features uno --bin uno \
                     --profile firmware -Zbuild-std=core --target avr-none --target-dir";
    let mut cargo = toolchain::find()?.cargo();
    cargo.args(arguments.split_whitespace()).arg(&build);
    cargo.env("CARGO_ENCODED_RUSTFLAGS", "-Ctarget-cpu=atmega328p");
    let sources = sources::hash(&["firmware/src", "firmware/Cargo.toml"])?;
    cargo.env("PHASEWALK_BUILD", format!("{sources:08x}"));
    run(&mut cargo)?;

    let (elf, hex) = (folder.join("uno.elf"), folder.join("uno.hex"));
    let built = build.join("avr-none").join("firmware").join("uno.elf");
    copy(&built, &elf)?;
    let sections = ["-O", "ihex", "-j", ".text", "-j", ".data"];
    run(command("avr-objcopy").args(sections).args([&elf, &hex]))?;
    CEILINGS.hold(&elf, "avr-size")
}
