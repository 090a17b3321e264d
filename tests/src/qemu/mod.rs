//! The image of the STM32F405, the very one that is flashed, in QEMU's `netduinoplus2`.
//!
//! QEMU has the processor, its interrupts, SysTick, USARTs and the counter of TIM2. It has no GPIO, no
//! compare outputs, no capture, no watchdog and no clock tree, and does not say that it is an
//! STM32F405; so the image leaves its outputs disconnected and calls itself a rehearsal. Order,
//! protocol and states are claimed here, never timing.
//!
//! With `-icount shift=3` one instruction takes eight nanoseconds of QEMU's time, so its clocks count
//! instructions, and time passes about as fast as outside.

mod debugger;
mod elf;
mod log;
mod monitor;

use monitor::Monitor;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;

pub use log::{Log, Logged};

/// QEMU's timers count nanoseconds; the image makes ticks of so many, to be near 84 MHz.
const TICK_NS: f64 = 12.0;

/// With `-icount shift=3`.
const INSTRUCTION_NS: f64 = 8.0;

/// What its clocks count.
pub const INSTRUCTIONS_PER_TICK: f64 = TICK_NS / INSTRUCTION_NS;

/// The serial line of the board: USART6.
const LINE: &str = "serial5";

/// The board's main memory.
const MEMORY: u32 = 0x2000_0000;
const MEMORY_BYTES: usize = 128 * 1024;

const PATIENCE: Duration = Duration::from_secs(20);

/// A running machine; dropped, it ends.
pub struct Machine {
    child: Child,
    folder: TempDir,
    monitor: Monitor,
    image: PathBuf,
    /// The terminal of its serial line.
    pub port: String,
    _turn: MutexGuard<'static, ()>,
}

/// A machine keeps a processor busy: one at a time.
static TURN: Mutex<()> = Mutex::new(());

impl Machine {
    /// Start an image that `cargo xtask firmware` has left.
    ///
    /// # Panics
    /// When there is no QEMU or no image, or it does not start.
    #[must_use]
    pub fn start(image: &Path) -> Self {
        Self::start_with(image, &[])
    }

    /// The same, and accesses to devices that QEMU does not have are written down for
    /// [`Self::accesses`]: some thousands of lines for each second.
    ///
    /// # Panics
    /// As [`Self::start`].
    #[must_use]
    pub fn start_watched(image: &Path) -> Self {
        Self::start_with(image, &["-d", "unimp", "-D", "accesses"])
    }

    fn start_with(image: &Path, options: &[&str]) -> Self {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = TempDir::new().expect("the machine gives a folder");
        let mut command = Command::new("qemu-system-arm");
        command.args(["-M", "netduinoplus2", "-icount", "shift=3,align=on,sleep=on"]);
        command.args(["-display", "none", "-monitor", "none", "-kernel"]).arg(image);
        for _ in 1..6 {
            command.args(["-serial", "null"]);
        }
        command.args(["-serial", "pty", "-qmp", "unix:monitor,server=on,wait=off"]);
        command.args(["-gdb", "unix:debugger,server=on,wait=off"]).args(options);
        let output = File::create(folder.path().join("output")).expect("the folder can be written");
        command.current_dir(&folder).stdin(Stdio::null()).stdout(Stdio::null()).stderr(output);
        let mut child = command.spawn().expect("QEMU starts (Debian: qemu-system-arm)");
        let mut monitor = Monitor::open(&folder.path().join("monitor"), &mut child);
        let port = monitor.port(LINE);
        Self { child, folder, monitor, image: image.to_owned(), port, _turn: turn }
    }

    /// Bytes of its memory.
    ///
    /// # Panics
    /// When the monitor does not give them.
    pub fn memory(&mut self, address: u32, bytes: usize) -> Vec<u8> {
        let file = self.folder.path().join("memory");
        self.monitor.save(address, bytes, &file);
        std::fs::read(file).expect("the monitor has written them")
    }

    /// Change the first of these bytes wherever they lie in its memory.
    ///
    /// # Panics
    /// When they lie nowhere.
    pub fn damage(&mut self, bytes: &[u8]) {
        let memory = self.memory(MEMORY, MEMORY_BYTES);
        let places = memory.windows(bytes.len()).enumerate().filter(|(_, window)| *window == bytes);
        let places: Vec<u32> = places.map(|(offset, _)| MEMORY + offset as u32).collect();
        assert!(!places.is_empty(), "the bytes are not in its memory");
        for place in places {
            debugger::poke(&self.folder.path().join("debugger"), place, &[bytes[0] ^ 1]);
        }
    }

    /// A reader of what the image logs through defmt.
    #[must_use]
    pub fn log(&self) -> Log {
        Log::new(&self.image)
    }

    /// Bytes of the stack that have been used: those that are no longer painted.
    ///
    /// # Panics
    /// When the image has no stack.
    pub fn stack_used(&mut self) -> usize {
        let end =
            elf::symbol(&self.image, "_stack_end").expect("the image says where its stack ends");
        let start = elf::symbol(&self.image, "_stack_start").expect("and where it starts");
        let stack = self.memory(end, (start - end) as usize);
        stack.iter().skip_while(|&&byte| byte == 0xCC).count()
    }

    /// What was written to devices that QEMU does not have, so far: device, offset, value.
    ///
    /// # Panics
    /// When the machine was not started with [`Self::start_watched`].
    #[must_use]
    pub fn accesses(&self) -> Vec<(String, u32, u32)> {
        let file = File::open(self.folder.path().join("accesses")).expect("accesses are watched");
        BufReader::new(file).lines().map_while(Result::ok).filter_map(|line| write(&line)).collect()
    }

    /// Wait until something is so.
    ///
    /// # Panics
    /// When it is not in time.
    pub fn wait(&mut self, what: &str, mut is: impl FnMut(&mut Self) -> bool) {
        let begin = Instant::now();
        while !is(self) {
            assert!(begin.elapsed() < PATIENCE, "in vain: {what}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// `GPIOA: unimplemented device write (size 4, offset 0x018, value 0x00470000)`.
fn write(line: &str) -> Option<(String, u32, u32)> {
    let (device, rest) = line.split_once(": unimplemented device write")?;
    let number = |name: &str| {
        let (_, after) = rest.split_once(name)?;
        let digits: String = after.chars().take_while(char::is_ascii_hexdigit).collect();
        u32::from_str_radix(&digits, 16).ok()
    };
    Some((device.to_owned(), number("offset 0x")?, number("value 0x")?))
}

/// Flash and variables of an image, in bytes.
///
/// # Panics
/// When it is none.
#[must_use]
pub fn size_of(image: &Path) -> (u64, u64) {
    (elf::sections(image, &FLASH), elf::sections(image, &VARIABLES))
}

/// What has first values is in both.
const FLASH: [&str; 4] = [".vector_table", ".text", ".rodata", ".data"];
const VARIABLES: [&str; 3] = [".data", ".bss", ".uninit"];

/// An image of the STM32F405 as `cargo xtask firmware` leaves it beside the tests.
///
/// # Panics
/// When the tests do not lie where cargo puts them.
#[must_use]
pub fn image(name: &str) -> PathBuf {
    let program = std::env::current_exe().expect("a test is a file");
    let target = program.ancestors().nth(3).expect("<target>/<profile>/deps/<test>");
    target.join("firmware").join(name)
}
