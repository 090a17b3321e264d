//! Compiles the emulated board's C part, if the feature `emulated-boards` asks for it.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    #[cfg(feature = "emulated-boards")]
    emulated_board();
}

/// simavr's processor core and the peripherals written for it here.
#[cfg(feature = "emulated-boards")]
fn emulated_board() {
    const FOLDER: &str = "src/board/shim";
    const FILES: [&str; 8] = [
        "access.c",
        "engine.c",
        "interrupts.c",
        "list.c",
        "pins.c",
        "serial.c",
        "timers.c",
        "watchdog.c",
    ];
    println!("cargo::rerun-if-changed={FOLDER}");
    let files = FILES.map(|file| format!("{FOLDER}/{file}"));
    cc::Build::new().files(files).opt_level(2).compile("phasewalk_board");
    println!("cargo::rustc-link-lib=simavr");
}
