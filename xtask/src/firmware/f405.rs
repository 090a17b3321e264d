//! The images of the STM32F405.

use super::size::Ceilings;
use super::{copy, sources, toolchain};
use crate::Result;
use crate::command::{command, run};
use crate::packages::{ARM_TOOLS, RUST_SOURCES};
use std::path::{Path, PathBuf};
use std::process::Command;

const CEILINGS: Ceilings = Ceilings {
    // An eighth of the 1 MiB; of the 88 KiB that memory.x gives to variables, a good third.
    flash: 131_072,
    variables: 32_768,
};

/// What the linker says when code that can panic is in the image (see its `main.rs`).
const PANIC: &str = "the_image_has_code_that_can_panic";

/// f405.elf and f405.bin; f405-libm.elf and f405-micromath.elf, to measure their solvers beside its; and
/// the proof that the linker refuses an image that can panic.
pub(super) fn build(folder: &Path) -> Result {
    ARM_TOOLS.meet()?;
    RUST_SOURCES.meet()?;
    image(folder, "f405,plain-f32", &folder.join("f405-libm.elf"))?;
    image(folder, "f405,micromath", &folder.join("f405-micromath.elf"))?;
    refuses_to_panic(folder)?;
    let elf = folder.join("f405.elf");
    image(folder, "f405", &elf)?;
    run(command("arm-none-eabi-objcopy")
        .args(["-O", "binary"])
        .args([&elf, &folder.join("f405.bin")]))
}

fn image(folder: &Path, features: &str, elf: &Path) -> Result {
    run(&mut cargo(folder, features)?)?;
    let built = built(folder);
    copy(&built, elf)?;
    CEILINGS.hold(elf, "arm-none-eabi-size")
}

/// An image that can panic does not link, for that reason.
fn refuses_to_panic(folder: &Path) -> Result {
    let output = cargo(folder, "f405,panic-on-purpose")?.output();
    let output = output.map_err(|e| format!("cannot start cargo: {e}"))?;
    let words = String::from_utf8_lossy(&output.stderr);
    if output.status.success() || !words.contains(PANIC) {
        return Err(format!("an image that can panic was not refused for it:\n{words}"));
    }
    println!("   f405: an image with a panic in it on purpose does not link, as it should not");
    Ok(())
}

fn cargo(folder: &Path, features: &str) -> Result<Command> {
    let arguments = "build -p phasewalk-firmware --no-default-features --bin f405 --profile \
                     firmware-fast -Zbuild-std=core --target thumbv7em-none-eabihf --features";
    let mut cargo = toolchain::find()?.cargo();
    cargo.args(arguments.split_whitespace()).arg(features);
    cargo.arg("--target-dir").arg(folder.join("build"));
    let flags = "-Clinker=arm-none-eabi-ld\x1f-Ctarget-cpu=cortex-m4";
    cargo.env("CARGO_ENCODED_RUSTFLAGS", flags);
    let places = ["firmware/src", "firmware/Cargo.toml", "core/src", "core/Cargo.toml", "memory.x"];
    let sources = sources::hash(&places)?;
    cargo.env("PHASEWALK_BUILD", format!("{sources:08x}"));
    cargo.env("DEFMT_LOG", "debug");
    Ok(cargo)
}

fn built(folder: &Path) -> PathBuf {
    folder.join("build").join("thumbv7em-none-eabihf").join("firmware-fast").join("f405")
}
