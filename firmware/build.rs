//! How the image of the STM32F405 is linked: memory map at the top of the workspace, cortex-m-rt's and
//! defmt's scripts.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_F405").is_none() {
        return;
    }
    let top = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    println!("cargo::rerun-if-changed={top}/memory.x");
    println!("cargo::rustc-link-search={top}");
    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo::rustc-link-arg-bin=f405={argument}");
    }
}
