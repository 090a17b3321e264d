//! The second simulator: avr8js, driven over its pipe (tests/avr8js).

use crate::board::{Pin, PinEdge};
use crate::session::Simulator;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A board on avr8js. Its program is Node's: see tests/avr8js/README.md.
pub struct Avr8js {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    cycle: u64,
    edges: Vec<PinEdge>,
}

impl Avr8js {
    /// Flash an Intel HEX image and switch the power on.
    ///
    /// # Panics
    /// When Node or the package is missing (`cargo xtask test` installs them).
    #[must_use]
    pub fn load(image: &Path) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("avr8js");
        let mut node = Command::new("node");
        node.arg(folder.join("run.mjs")).arg(image).arg("--pipe");
        let node = node.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = node.expect("node starts");
        let input = child.stdin.take().expect("a pipe");
        let output = BufReader::new(child.stdout.take().expect("a pipe"));
        let mut board = Self { child, input, output, cycle: 0, edges: Vec::new() };
        assert_eq!(board.line(), "ready 0", "npm ci in tests/avr8js brings the simulator");
        board
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("the simulator answers");
        line.trim_end().to_owned()
    }

    fn ask(&mut self, command: &str) -> String {
        writeln!(self.input, "{command}").expect("the simulator listens");
        let answer = self.line();
        assert!(!answer.is_empty() && !answer.starts_with("error"), "{command}: {answer}");
        answer
    }
}

impl Drop for Avr8js {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Simulator for Avr8js {
    fn cycle(&self) -> u64 {
        self.cycle
    }

    fn run(&mut self, until: u64) -> Vec<u8> {
        // `at CYCLE HEX`
        let answer = self.ask(&format!("run {until}"));
        let fields: Vec<&str> = answer.split(' ').collect();
        self.cycle = fields[1].parse().expect("a cycle");
        let bytes = fields[2].trim_end_matches('-').as_bytes().chunks_exact(2);
        let byte = |pair: &[u8]| {
            let pair = std::str::from_utf8(pair).expect("hexadecimal digits");
            u8::from_str_radix(pair, 16).expect("hexadecimal digits")
        };
        bytes.map(byte).collect()
    }

    fn send(&mut self, bytes: &[u8]) {
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        self.ask(&format!("send {hex}"));
    }

    fn drive(&mut self, pin: Pin, level: bool) {
        self.ask(&format!("drive {pin} {}", u8::from(level)));
    }

    fn edges(&mut self) -> Vec<PinEdge> {
        // `edges N`, then N times `CYCLE,PIN,LEVEL`.
        let answer = self.ask("edges");
        let count: usize = answer.trim_start_matches("edges ").parse().expect("a count");
        for _ in 0..count {
            let line = self.line();
            let fields: Vec<&str> = line.split(',').collect();
            let cycle = fields[0].parse().expect("a cycle");
            let pin = fields[1].parse().expect("a pin");
            self.edges.push(PinEdge { cycle, pin, level: fields[2] == "1" });
        }
        self.edges.clone()
    }
}
