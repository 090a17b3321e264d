//! What the system must have: installed where we may, named where we may not.

use crate::Result;
use crate::command::{command, run, succeeds};
use std::path::{Path, PathBuf};

/// Something that a step needs.
pub(crate) struct Need {
    /// For people.
    what: &'static str,
    /// Debian's packages that bring it.
    packages: &'static str,
    is_there: fn() -> bool,
}

/// numpy, scipy and zarr of tests/peers/requirements.txt need this version; so does the check below.
const PYTHON: Need = Need {
    what: "Python 3.11 or newer with venv and pip",
    // What Debian splits off from its Python and our virtual environment needs.
    packages: "python3 python3-venv python3-pip",
    is_there: || find_python().is_some(),
};
const PYTHON_CHECK: &str = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))";

/// Linker and tools of the Uno's image.
pub(crate) const AVR_TOOLS: Need = Need {
    what: "avr-gcc with avr-libc",
    packages: "gcc-avr binutils-avr avr-libc",
    is_there: || succeeds(command("avr-gcc").arg("--version")),
};

/// Linker and tools of the STM32F405's images.
pub(crate) const ARM_TOOLS: Need = Need {
    what: "a linker for ARM (arm-none-eabi-ld)",
    packages: "binutils-arm-none-eabi",
    is_there: || succeeds(command("arm-none-eabi-ld").arg("--version")),
};

/// The emulated STM32F405.
pub(crate) const QEMU: Need = Need {
    what: "QEMU for ARM",
    packages: "qemu-system-arm",
    is_there: || succeeds(command("qemu-system-arm").arg("--version")),
};

/// A Rust that can build its own `core` for a target that comes without.
pub(crate) const RUST_SOURCES: Need = Need {
    what: "a Rust compiler with the sources of its library (rustup component add rust-src)",
    packages: "rustc-web cargo-web rust-web-src",
    is_there: || crate::firmware::toolchain().is_ok(),
};

/// The emulated Uno.
pub(crate) const SIMAVR: Need = Need {
    what: "a C compiler and libsimavr",
    packages: "gcc libsimavr-dev",
    is_there: || Path::new("/usr/include/simavr/sim_avr.h").exists(),
};

/// What the sketches that the board is compared with need.
pub(crate) const ARDUINO: Need = Need {
    what: "the Arduino core for AVR",
    packages: "arduino-core-avr",
    is_there: || Path::new("/usr/share/arduino/hardware/arduino/avr/cores/arduino").exists(),
};

/// The second simulator.
pub(crate) const NODE: Need = Need {
    what: "Node.js 18 or newer with npm",
    packages: "nodejs npm",
    is_there: || {
        let version = "process.exit(Number(process.versions.node.split('.')[0]) < 18 ? 1 : 0)";
        succeeds(command("node").args(["-e", version])) && succeeds(command("npm").arg("--version"))
    },
};

/// Counts instructions.
pub(crate) const VALGRIND: Need = Need {
    what: "Valgrind",
    packages: "valgrind",
    is_there: || succeeds(command("valgrind").arg("--version")),
};

impl Need {
    /// As root on Debian it is installed if missing.
    pub(crate) fn meet(&self) -> Result {
        if (self.is_there)() {
            return Ok(());
        }
        let Self { what, packages, .. } = self;
        if !Path::new("/etc/debian_version").exists() {
            return Err(format!("{what} is missing: install it (Debian: {packages})"));
        }
        if !is_root() {
            return Err(format!("{what} is missing: sudo apt-get install --yes {packages}"));
        }
        run(apt_get().arg("update"))?;
        let install = ["install", "--yes", "--no-install-recommends"];
        run(apt_get().args(install).args(packages.split_whitespace()))?;
        if (self.is_there)() {
            Ok(())
        } else {
            Err(format!("{what} is still missing after installing {packages}"))
        }
    }
}

/// A Python that can make virtual environments.
pub(crate) fn python() -> Result<PathBuf> {
    PYTHON.meet()?;
    find_python().ok_or_else(|| format!("{} is missing", PYTHON.what))
}

/// The first of the user's own and the system's Python that serves.
fn find_python() -> Option<PathBuf> {
    let candidates = ["python3", "/usr/bin/python3"].map(PathBuf::from);
    candidates.into_iter().find(|python| succeeds(command(python).args(["-c", PYTHON_CHECK])))
}

fn is_root() -> bool {
    let id = command("id").arg("-u").output();
    id.is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

fn apt_get() -> std::process::Command {
    let mut apt_get = command("apt-get");
    apt_get.env("DEBIAN_FRONTEND", "noninteractive");
    apt_get
}
