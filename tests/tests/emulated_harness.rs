//! The emulated board against the data sheet.
//!
//! Each test assembles a small program, and states by hand in which cycle things happen: one cycle
//! per `ldi`, `nop`, `in`, `out`; two per `sbi`, `cbi`, `lds`, `sts`, `rjmp`. What an instruction
//! writes holds from the cycle after its last on. In the comments, `@n` is the cycle in which the
//! instruction begins.

use nix::fcntl::OFlag;
use phasewalk_tests::board::{Image, Latency, Pin, PinEdge, Reset, State, Uno, Vector};
use phasewalk_tests::board::{write_csv, write_vcd};
use phasewalk_tests::random::Random;
use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

// ---- programs ------------------------------------------------------------------------------

/// A program, compiled into a folder of its own.
struct Program {
    folder: TempDir,
}

impl Program {
    fn compile(name: &str, source: &str, options: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(name), source).unwrap();
        let program = Self { folder };
        let mut gcc = Command::new("avr-gcc");
        gcc.args(["-mmcu=atmega328p", "-DF_CPU=16000000UL", "-Os"]).args(options);
        program.run(gcc.args(["-o", "program.elf", name]));
        program.run(Command::new("avr-objcopy").args(["-O", "ihex", "program.elf", "program.hex"]));
        program
    }

    fn run(&self, command: &mut Command) {
        let output =
            command.current_dir(self.folder.path()).output().expect("avr-gcc is installed");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }

    /// Assembly from address 0 on, with short names for I/O addresses.
    fn assembly(body: &str) -> Self {
        let head = "#define __SFR_OFFSET 0\n#include <avr/io.h>\n#define MEM(io) (io + 0x20)\n";
        Self::compile("program.S", &format!("{head}{body}\n"), &["-nostartfiles"])
    }

    fn c(source: &str) -> Self {
        let head = "#include <avr/interrupt.h>\n#include <avr/io.h>\n#include <avr/wdt.h>\n";
        Self::compile("program.c", &format!("{head}{source}\n"), &[])
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn uno(&self) -> Uno {
        Uno::load(&self.file("program.elf")).unwrap()
    }
}

fn assembled(body: &str) -> Uno {
    Program::assembly(body).uno()
}

/// Cycles and levels of the edges of a pin.
fn edges(uno: &Uno, pin: Pin) -> Vec<(u64, bool)> {
    uno.edges_of(pin).map(|edge| (edge.cycle, edge.level)).collect()
}

/// Registers r0 to r31.
fn register(uno: &mut Uno, number: u16) -> u8 {
    uno.peek(number)
}

const END: &str = "end: rjmp end\n";

// ---- port ----------------------------------------------------------------------------------

#[test]
fn a_port_changes_after_the_last_cycle_of_the_instruction() {
    let mut uno = assembled(&format!(
        "sbi DDRB, 1        ; @0
         sbi PORTB, 1       ; @2 -> 4
         ldi r16, 0         ; @4
         out PORTB, r16     ; @5 -> 6
         ldi r16, 2         ; @6
         sts MEM(PORTB), r16; @7 -> 9
         {END}"
    ));
    let _ = uno.run_until(100);
    assert_eq!(edges(&uno, Pin::D9), [(4, true), (6, false), (9, true)]);
}

#[test]
fn a_pin_is_read_one_cycle_late() {
    let mut uno = assembled(&format!(
        "sbi DDRB, 1
         ldi r16, 2
         out PORTB, r16
         in r17, PINB
         in r18, PINB
         {END}"
    ));
    let _ = uno.run_until(100);
    assert_eq!((register(&mut uno, 17), register(&mut uno, 18)), (0, 2));
}

#[test]
fn setting_a_bit_of_pinx_toggles_that_bit_alone() {
    let mut uno = assembled(&format!(
        "ldi r16, 0x3f
         out DDRB, r16
         ldi r16, 0x15
         out PORTB, r16
         nop
         nop
         sbi PINB, 1
         in r17, PORTB
         {END}"
    ));
    let _ = uno.run_until(100);
    assert_eq!(register(&mut uno, 17), 0x17);
}

#[test]
fn what_nothing_drives_is_low_outside_and_pulled_up_inside() {
    let mut uno = assembled(&format!(
        "sbi PORTD, 2
         nop
         nop
         in r17, PIND
         {END}"
    ));
    let _ = uno.run_until(100);
    assert_eq!(register(&mut uno, 17), 4);
    assert!(uno.level(Pin::D2) && !uno.level(Pin::D3) && !uno.level(Pin::D9));
    uno.drive(Pin::D2, false);
    assert!(!uno.level(Pin::D2));
}

#[test]
fn a_stuck_pin_reads_as_it_is_stuck() {
    let body = format!(
        "sbi DDRB, 1
         loop: sbi PORTB, 1
         nop
         in r17, PINB
         cbi PORTB, 1
         nop
         in r18, PINB
         rjmp loop
         {END}"
    );
    let mut uno = assembled(&body);
    uno.stick(Pin::D9, true);
    let _ = uno.run_until(200);
    assert_eq!((register(&mut uno, 17), register(&mut uno, 18)), (2, 2));
    assert_eq!(edges(&uno, Pin::D9), [(0, true)]);
    uno.stick(Pin::D9, false);
    let _ = uno.run_for(200);
    assert_eq!((register(&mut uno, 17), register(&mut uno, 18)), (0, 0));
    uno.unstick(Pin::D9);
    let _ = uno.run_for(200);
    assert_eq!((register(&mut uno, 17), register(&mut uno, 18)), (2, 0));
}

// ---- compare outputs -----------------------------------------------------------------------

/// Timer 1 from cycle 14 on, OC1A set at the match with 1000.
const TIMER1_SET_AT_1000: &str = "
    sbi DDRB, 1             ; @0
    ldi r16, 0xc0           ; @2
    sts TCCR1A, r16         ; @3
    ldi r16, hi8(1000)      ; @5
    sts OCR1AH, r16         ; @6
    ldi r16, lo8(1000)      ; @8
    sts OCR1AL, r16         ; @9
    ldi r16, 1              ; @11
    sts TCCR1B, r16         ; @12 -> counts 0 in cycle 14
";

#[test]
fn timer_1_moves_its_output_one_clock_after_the_match() {
    let mut uno = assembled(&format!("{TIMER1_SET_AT_1000} {END}"));
    let _ = uno.run_until(400_000);
    assert_eq!(edges(&uno, Pin::D9), [(14 + 1000 + 1, true)], "and neither overflow moves it");
}

#[test]
fn neither_overflow_nor_a_new_compare_value_moves_an_output() {
    // Once the pin is high: OCR1A = 2000, cleared at the match, again and again.
    let mut uno = assembled(&format!(
        "{TIMER1_SET_AT_1000}
         wait: sbis PINB, 1
         rjmp wait
         ldi r16, 0x80
         sts TCCR1A, r16
         again: ldi r16, hi8(2000)
         sts OCR1AH, r16
         ldi r16, lo8(2000)
         sts OCR1AL, r16
         rjmp again"
    ));
    let _ = uno.run_until(400_000);
    assert_eq!(edges(&uno, Pin::D9), [(1015, true), (2015, false)]);
}

#[test]
fn timer_0_and_its_port_value_when_it_is_not_connected() {
    let mut uno = assembled(&format!(
        "sbi DDRD, 6         ; @0
         sbi PORTD, 6        ; @2 -> 4
         ldi r16, 0xc0       ; @4
         out TCCR0A, r16     ; @5 -> 6, the latch is low
         ldi r16, 100        ; @6
         out OCR0A, r16      ; @7
         ldi r16, 1          ; @8
         out TCCR0B, r16     ; @9 -> counts 0 in cycle 10
         {END}"
    ));
    let _ = uno.run_until(4000);
    assert_eq!(edges(&uno, Pin::D6), [(4, true), (6, false), (10 + 100 + 1, true)]);
}

#[test]
fn timer_2_at_an_eighth_counts_from_the_reset_of_its_prescaler() {
    let mut uno = assembled(&format!(
        "sbi DDRB, 3         ; @0
         ldi r16, 0xc0       ; @2
         sts TCCR2A, r16     ; @3
         ldi r16, 50         ; @5
         sts OCR2A, r16      ; @6
         ldi r16, 2          ; @8
         sts TCCR2B, r16     ; @9 -> 11
         ldi r16, 2          ; @11
         nop                 ; @12
         out GTCCR, r16      ; @13 -> 14
         {END}"
    ));
    let _ = uno.run_until(10_000);
    // At cycle 8 of the running prescaler it was not started yet; then it was reset at 14.
    assert_eq!(edges(&uno, Pin::D11), [(14 + 8 * 51, true)]);
}

#[test]
fn toggling_repeats_at_every_match_and_a_force_acts_at_once() {
    let mut uno = assembled(&format!(
        "sbi DDRD, 5         ; @0
         ldi r16, 0x10       ; @2
         out TCCR0A, r16     ; @3: OC0B toggles
         ldi r16, 9          ; @4
         out OCR0B, r16      ; @5
         ldi r16, 0x41       ; @6
         out TCCR0B, r16     ; @7 -> 8: count, and force B
         {END}"
    ));
    let _ = uno.run_until(600);
    let expected = [(8, true), (18, false), (18 + 256, true), (18 + 512, false)];
    assert_eq!(edges(&uno, Pin::D5), expected);
}

#[test]
fn a_written_count_is_not_compared_at_the_next_clock() {
    let mut uno = assembled(&format!(
        "sbi DDRD, 6         ; @0
         ldi r16, 0x40       ; @2
         out TCCR0A, r16     ; @3
         ldi r16, 77         ; @4
         out OCR0A, r16      ; @5
         ldi r17, 1          ; @6
         out TCCR0B, r17     ; @7
         out TCNT0, r16      ; @8 -> 77 in cycle 9
         {END}"
    ));
    let _ = uno.run_until(300);
    assert_eq!(edges(&uno, Pin::D6), [(9 + 256 + 1, true)]);
}

#[test]
fn clear_on_compare_and_fast_pwm() {
    let mut ctc = assembled(&format!(
        "sbi DDRB, 1         ; @0
         ldi r16, 0x40       ; @2
         sts TCCR1A, r16     ; @3: toggle
         ldi r16, 99         ; @5
         sts OCR1AL, r16     ; @6
         ldi r16, 9          ; @8
         sts TCCR1B, r16     ; @9 -> 11
         {END}"
    ));
    let _ = ctc.run_until(500);
    assert_eq!(edges(&ctc, Pin::D9), [(111, true), (211, false), (311, true), (411, false)]);
    let mut pwm = assembled(&format!(
        "sbi DDRD, 6         ; @0
         ldi r16, 63         ; @2
         out OCR0A, r16      ; @3
         ldi r16, 0x83       ; @4
         out TCCR0A, r16     ; @5
         ldi r16, 1          ; @6
         out TCCR0B, r16     ; @7 -> 8
         {END}"
    ));
    let _ = pwm.run_until(800);
    // The compare value, which was written in another mode, is in use at once.
    assert_eq!(
        edges(&pwm, Pin::D6),
        [(264, true), (328, false), (520, true), (584, false), (776, true)]
    );
}

// ---- counts and flags ----------------------------------------------------------------------

#[test]
fn counts_are_read_in_the_cycle_of_the_access() {
    let mut uno = assembled(&format!(
        "ldi r16, 1          ; @0
         sts TCCR1B, r16     ; @1 -> counts 0 in cycle 3
         out TCCR0B, r16     ; @3 -> counts 0 in cycle 4
         lds r17, TCNT1L     ; @4: reads in 5
         lds r18, MEM(TCNT0) ; @6: reads in 7
         in r19, TCNT0       ; @8: reads in 8
         in r20, TCNT0       ; @9
         lds r21, TCNT1L     ; @10: reads in 11
         {END}"
    ));
    let _ = uno.run_until(100);
    let read: Vec<u8> = (17..=21).map(|number| register(&mut uno, number)).collect();
    assert_eq!(read, [5 - 3, 7 - 4, 8 - 4, 9 - 4, 11 - 3]);
}

#[test]
fn a_count_is_read_after_it_was_written_as_on_hardware() {
    let mut uno = assembled(&format!(
        "ldi r16, 1
         out TCCR0B, r16
         ldi r16, 0x30
         out TCNT0, r16
         nop
         in r17, TCNT0
         out TCNT0, r16
         nop
         lds r18, MEM(TCNT0)
         {END}"
    ));
    let _ = uno.run_until(100);
    assert_eq!((register(&mut uno, 17), register(&mut uno, 18)), (0x31, 0x32));
}

#[test]
fn the_high_byte_of_a_count_waits_in_temp() {
    let mut uno = assembled(&format!(
        "ldi r16, 1
         sts TCCR1B, r16
         ldi r17, 0x01
         ldi r18, 0xfe
         sts TCNT1H, r17
         sts TCNT1L, r18     ; -> 0x1fe in the next cycle
         lds r20, TCNT1L     ; 0x1ff
         lds r21, TCNT1H     ; would be 0x02
         {END}"
    ));
    let _ = uno.run_until(100);
    assert_eq!((register(&mut uno, 20), register(&mut uno, 21)), (0xff, 0x01));
}

#[test]
fn flags_are_cleared_one_by_one() {
    let mut uno = assembled(&format!(
        "ldi r16, 1
         out TCCR0B, r16
         ldi r16, 3
         delay: dec r17
         brne delay          ; past overflow: TOV0, OCF0A and OCF0B are set
         in r18, TIFR0
         ldi r16, 2
         out TIFR0, r16
         in r19, TIFR0
         sbi TIFR0, 0
         in r20, TIFR0
         {END}"
    ));
    let _ = uno.run_until(2000);
    let read: Vec<u8> = (18..=20).map(|number| register(&mut uno, number)).collect();
    assert_eq!(read, [7, 5, 4]);
}

// ---- timer 0 against a second model, clock by clock ----------------------------------------

/// What a random program does next.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// `out`, after `ldi`.
    Write(&'static str, u8),
    /// `in`, before `st`.
    Read(&'static str),
    /// So many `nop`.
    Wait(u64),
}

impl Step {
    fn random(random: &mut Random) -> Self {
        let mut below = |n: u8| (random.uniform() * f64::from(n)) as u8;
        let (kind, near, any) = (below(12), below(12), below(255));
        let value = if any < 180 { near } else { any };
        match kind {
            0 | 1 => Self::Write("OCR0A", value),
            2 | 3 => Self::Write("OCR0B", value),
            4 | 5 => Self::Write("TCCR0A", (below(16) << 4) | (below(2) << 1)),
            6 => Self::Write("TCCR0B", [1, 1, 2, 0][usize::from(below(4))]),
            7 => Self::Write("TCNT0", value),
            8 => Self::Write("TIFR0", below(8)),
            9 => Self::Read("TIFR0"),
            10 => Self::Read("TCNT0"),
            _ => Self::Wait(u64::from(below(60))),
        }
    }

    fn assembly(self) -> String {
        match self {
            Self::Write(register, value) => format!("ldi r16, {value}\nout {register}, r16\n"),
            Self::Read(register) => format!("in r16, {register}\nst X+, r16\n"),
            Self::Wait(cycles) => format!(".rept {cycles}\nnop\n.endr\n"),
        }
    }
}

/// Timer 0 in the modes normal and CTC, as the data sheet draws it.
#[derive(Default)]
struct Model {
    cycle: u64,
    count: u8,
    compare: [u8; 2],
    control: u8,
    clock: u8,
    flags: u8,
    latch: [bool; 2],
    blocked: bool,
    level: [bool; 2],
    edges: [Vec<(u64, bool)>; 2],
}

impl Model {
    fn com(&self, x: usize) -> u8 {
        self.control >> (6 - 2 * x) & 3
    }

    /// The timer's clock: the flags it sets.
    fn tick(&mut self) -> u8 {
        let mut set = 0;
        for x in 0..2 {
            if self.count == self.compare[x] && !self.blocked {
                set |= 2 << x;
                self.latch[x] = match self.com(x) {
                    0 => self.latch[x],
                    1 => !self.latch[x],
                    com => com == 3,
                };
            }
        }
        set |= u8::from(self.count == 0xff);
        let top = self.control & 2 != 0 && self.count == self.compare[0];
        self.count = if top { 0 } else { self.count.wrapping_add(1) };
        self.blocked = false;
        set
    }

    /// One cycle, with what is written at its end.
    fn pass(&mut self, write: Option<(&str, u8)>) {
        self.cycle += 1;
        let clock = self.clock == 1 || (self.clock == 2 && self.cycle.is_multiple_of(8));
        let set = if clock { self.tick() } else { 0 };
        match write {
            Some(("OCR0A", value)) => self.compare[0] = value,
            Some(("OCR0B", value)) => self.compare[1] = value,
            Some(("TCCR0A", value)) => self.control = value,
            Some(("TCCR0B", value)) => self.clock = value,
            Some(("TCNT0", value)) => (self.count, self.blocked) = (value, true),
            Some((_, value)) => self.flags &= !value,
            None => {}
        }
        self.flags |= set;
        for x in 0..2 {
            let level = self.com(x) != 0 && self.latch[x];
            if level != self.level[x] {
                self.level[x] = level;
                self.edges[x].push((self.cycle, level));
            }
        }
    }

    /// One step of the program: what it reads.
    fn step(&mut self, step: Step) -> Option<u8> {
        match step {
            Step::Write(register, value) => {
                self.pass(None);
                self.pass(Some((register, value)));
                None
            }
            Step::Read(register) => {
                let read = if register == "TCNT0" { self.count } else { self.flags };
                (0..3).for_each(|_| self.pass(None));
                Some(read)
            }
            Step::Wait(cycles) => {
                (0..cycles).for_each(|_| self.pass(None));
                None
            }
        }
    }
}

#[test]
fn random_programs_find_timer_0_as_modelled_clock_by_clock() {
    let mut moved = 0;
    for seed in 0..12 {
        let mut random = Random::new(seed);
        let steps: Vec<Step> = (0..500).map(|_| Step::random(&mut random)).collect();
        let body: String = steps.iter().map(|step| step.assembly()).collect();
        let start = "ldi r26, 0\nldi r27, 2\nldi r16, 0x60\nout DDRD, r16\n";
        let mut uno = assembled(&format!("{start}{body}{END}"));
        let mut model = Model::default();
        (0..4).for_each(|_| model.pass(None));
        let read: Vec<u8> = steps.iter().filter_map(|&step| model.step(step)).collect();
        let _ = uno.run_until(model.cycle);
        let addresses = 0x200..0x200 + u16::try_from(read.len()).unwrap();
        assert_eq!(addresses.map(|at| uno.peek(at)).collect::<Vec<_>>(), read, "seed {seed}");
        assert_eq!(edges(&uno, Pin::D6), model.edges[0], "seed {seed}");
        assert_eq!(edges(&uno, Pin::D5), model.edges[1], "seed {seed}");
        moved += model.edges.iter().map(Vec::len).sum::<usize>();
    }
    assert!(moved > 500, "{moved} edges");
}

// ---- interrupts ----------------------------------------------------------------------------

/// Vectors with one handler, and a body.
fn with_handler(vector: u16, handler: &str, body: &str) -> String {
    format!("rjmp main\n.org {}\n{handler}\n.org 0x100\nmain:\n{body}", 4 * vector)
}

#[test]
fn entering_an_interrupt_takes_four_cycles() {
    let nops = "nop\n".repeat(1200);
    let body = format!(
        "{TIMER1_SET_AT_1000}
         ldi r16, 2
         sts TIMSK1, r16
         sbi DDRB, 5
         sei
         {nops}"
    );
    let mut uno = assembled(&with_handler(11, "sbi PORTB, 5\nreti", &body));
    let _ = uno.run_until(1200);
    // All is two cycles later by the jump to main: the match is at 1017, between two nops.
    assert_eq!(edges(&uno, Pin::D9), [(1017, true)]);
    assert_eq!(edges(&uno, Pin::D13), [(1017 + 4 + 2, true)]);
    let expected = Latency { vector: Vector::Timer1CompareA, worst: 4, served: 1 };
    assert_eq!(uno.max_interrupt_latency(), [expected]);
    assert_eq!(uno.stack_low_water(), 0x8ff - 2);
}

#[test]
fn waking_from_sleep_takes_four_more() {
    let body = format!(
        "{TIMER1_SET_AT_1000}
         ldi r16, 2
         sts TIMSK1, r16
         sbi DDRB, 5
         ldi r16, 1
         out SMCR, r16
         sei
         sleep
         {END}"
    );
    let mut uno = assembled(&with_handler(11, "sbi PORTB, 5\nreti", &body));
    assert_eq!(uno.run_until(500), State::Sleeping);
    let _ = uno.run_until(1200);
    assert_eq!(edges(&uno, Pin::D13), [(1017 + 8 + 2, true)]);
}

#[test]
fn an_interrupt_enabled_after_its_flag_is_served_one_instruction_after_sei() {
    let body = format!(
        "ldi r16, 1
         out TCCR0B, r16
         delay: dec r17
         brne delay
         sts TIMSK0, r16     ; TOV0 is set long since
         ldi r18, 1
         sei
         inc r18
         inc r18
         {END}"
    );
    let mut uno = assembled(&with_handler(16, "mov r19, r18\nsts TIMSK0, r20\nreti", &body));
    let _ = uno.run_until(3000);
    assert_eq!((register(&mut uno, 18), register(&mut uno, 19)), (3, 2));
}

#[test]
fn after_an_interrupt_the_program_gets_one_instruction() {
    // INT0 by level stays pending: each entry is followed by one `inc` of the main program.
    let body = "ldi r16, 1\nout EIMSK, r16\nsei\nloop: inc r18\nrjmp loop";
    let mut uno = assembled(&with_handler(1, "inc r19\nreti", body));
    let _ = uno.run_until(400);
    let (main, handler) = (register(&mut uno, 18), register(&mut uno, 19));
    assert!(handler > 30 && handler.abs_diff(2 * main) <= 2, "{main} {handler}");
}

#[test]
fn int0_hears_a_rising_edge() {
    let body = format!(
        "ldi r16, 3\nsts EICRA, r16\nldi r16, 1\nout EIMSK, r16\nsbi DDRB, 5\nsei\n{}",
        "nop\n".repeat(300)
    );
    let mut uno = assembled(&with_handler(1, "sbi PORTB, 5\nreti", &body));
    uno.drive_at(100, Pin::D2, true);
    uno.drive_at(150, Pin::D2, false);
    let _ = uno.run_until(250);
    assert_eq!(edges(&uno, Pin::D2), [(100, true), (150, false)]);
    assert_eq!(edges(&uno, Pin::D13), [(106, true)]);
}

#[test]
fn capture_keeps_the_count_of_the_edge() {
    let body = "
        ldi r16, 0x41
        sts TCCR1B, r16      ; @1 -> counts 0 in cycle 3, rising edges
        loop: rjmp loop";
    let mut uno = assembled(body);
    for cycle in [1001, 70_002] {
        uno.drive_at(cycle, Pin::D8, true);
        uno.drive_at(cycle + 50, Pin::D8, false);
        let _ = uno.run_until(cycle + 100);
        assert_eq!(u64::from(uno.peek_u16(0x86)), (cycle - 3) & 0xffff);
        assert_eq!(uno.peek(0x36) & 0x20, 0x20);
    }
}

#[test]
fn a_jumper_carries_a_compare_output_to_the_capture_input() {
    let body = TIMER1_SET_AT_1000.replace("ldi r16, 1 ", "ldi r16, 0x41 ");
    let mut uno = assembled(&format!("{body} {END}"));
    uno.connect(Pin::D9, Pin::D8);
    let _ = uno.run_until(2000);
    assert_eq!(edges(&uno, Pin::D8), [(1015, true)]);
    assert_eq!(uno.peek_u16(0x86), 1001);
    uno.disconnect(Pin::D8);
    assert!(!uno.level(Pin::D8));
}

#[test]
fn a_program_reads_its_compare_output_back() {
    let body = "
        wait: sbis PINB, 1
        rjmp wait
        sbi DDRB, 5
        sbi PORTB, 5";
    let mut uno = assembled(&format!("{TIMER1_SET_AT_1000} {body}\n{END}"));
    let _ = uno.run_until(2000);
    let seen = edges(&uno, Pin::D13)[0].0;
    assert!((1015 + 7..1015 + 12).contains(&seen), "{seen}");
}

// ---- serial line ---------------------------------------------------------------------------

/// Echo at 250,000 baud.
const ECHO: &str = "
    int main(void) {
        UBRR0 = 3;
        UCSR0B = _BV(RXEN0) | _BV(TXEN0);
        for (;;) {
            while (!(UCSR0A & _BV(RXC0)));
            uint8_t byte = UDR0;
            while (!(UCSR0A & _BV(UDRE0)));
            UDR0 = byte;
        }
    }";

#[test]
fn bytes_take_640_cycles_at_250_000_baud() {
    let mut uno = Program::c(ECHO).uno();
    let _ = uno.run_until(1000);
    assert_eq!(uno.cycles_per_byte(), 640);
    let start = uno.cycle();
    uno.send(b"Phasewalk");
    let _ = uno.run_for(20 * 640);
    let sent = uno.received_with_cycles();
    assert_eq!(sent.iter().map(|byte| byte.value).collect::<Vec<_>>(), b"Phasewalk");
    assert!((1280..1320).contains(&(sent[0].cycle - start)), "{sent:?}");
    // The line does not idle: the program is at most some cycles late after each byte it gets.
    assert!(
        sent.windows(2).all(|pair| (630..680).contains(&(pair[1].cycle - pair[0].cycle))),
        "{sent:?}"
    );
    assert_eq!(uno.overruns(), 0);
}

#[test]
fn the_receiver_holds_three_bytes() {
    let source = "
        volatile uint8_t got[8], status[8], go;
        int main(void) {
            UBRR0 = 3;
            UCSR0B = _BV(RXEN0);
            while (!go);
            for (uint8_t i = 0; i < 8; i++) { status[i] = UCSR0A; got[i] = UDR0; }
            for (;;);
        }";
    let program = Program::c(source);
    for (count, kept, overrun) in [(3, [1, 2, 3], false), (5, [1, 2, 5], true)] {
        let mut uno = program.uno();
        let _ = uno.run_until(1000);
        uno.send(&[1, 2, 3, 4, 5][..count]);
        let _ = uno.run_for(10_000);
        let address = |name: &str| u16::try_from(uno.symbol(name).unwrap()).unwrap();
        let (go, got, status) = (address("go"), address("got"), address("status"));
        uno.poke(go, 1);
        let _ = uno.run_for(1000);
        let read: Vec<u8> = (0..3).map(|i| uno.peek(got + i)).collect();
        assert_eq!(read, kept);
        assert_eq!(uno.peek(status) & 8 != 0, overrun);
        assert_eq!((uno.peek(status) & 0x80, uno.peek(status + 3) & 0x80), (0x80, 0));
    }
}

#[test]
fn a_flooded_line_has_no_gaps() {
    let mut uno = Program::c(ECHO).uno();
    let _ = uno.run_until(1000);
    let mut next = 0_u8;
    let start = uno.cycle();
    let _ = uno.flood(start + 1_600_000, || {
        next = next.wrapping_add(1);
        next
    });
    let sent = uno.received();
    assert_eq!((uno.overruns(), sent.len()), (0, 2498), "2500 bytes less those on their way");
    assert!(sent.iter().zip(1_u32..).all(|(byte, i)| u32::from(*byte) == i & 0xff));
}

// ---- reset, watchdog, faults ---------------------------------------------------------------

/// Raises D9, keeps a count of starts in memory, and feeds the watchdog (16 ms) while it lives.
const WATCHED: &str = "
    uint8_t cause __attribute__((section(\".noinit\")));
    uint8_t starts __attribute__((section(\".noinit\")));
    volatile uint8_t ticks;
    ISR(TIMER0_OVF_vect) { ticks++; }
    int main(void) {
        cause = MCUSR;
        MCUSR = 0;
        wdt_disable();
        if (cause & _BV(PORF)) starts = 0;
        starts++;
        DDRB = 2;
        PORTB = 2;
        TCCR0B = 1;
        TIMSK0 = 1;
        wdt_enable(WDTO_15MS);
        sei();
        for (;;) wdt_reset();
    }";

fn variable(uno: &mut Uno, name: &str) -> u8 {
    let address = u16::try_from(uno.symbol(name).unwrap()).unwrap();
    uno.peek(address)
}

#[test]
fn a_hanging_program_is_reset_by_the_watchdog() {
    for (hz, timeout) in [(128_000.0, 256_000), (140_800.0, 232_727), (115_200.0, 284_444)] {
        let mut uno = Program::c(WATCHED).uno();
        uno.set_watchdog_hz(hz);
        let _ = uno.run_until(1_000_000);
        assert_eq!((uno.resets(), uno.level(Pin::D9)), (0, true));
        assert_eq!((variable(&mut uno, "cause"), variable(&mut uno, "starts")), (1, 1));
        let _ = uno.hang(false).unwrap();
        let (hung, ticks) = (uno.cycle(), variable(&mut uno, "ticks"));
        let _ = uno.run_until(hung + 200_000);
        assert_ne!(variable(&mut uno, "ticks"), ticks, "interrupts are served");
        let _ = uno.run_until(hung + 400_000);
        assert_eq!((variable(&mut uno, "cause"), variable(&mut uno, "starts")), (8, 2));
        let fall = edges(&uno, Pin::D9)[1];
        assert!(!fall.1 && (timeout - 40..=timeout).contains(&(fall.0 - hung)), "{fall:?} {hung}");
        assert!(uno.level(Pin::D9), "it has started again");
    }
}

#[test]
fn a_deaf_program_hangs_without_interrupts() {
    let mut uno = Program::c(WATCHED).uno();
    let _ = uno.run_until(100_000);
    let _ = uno.hang(true).unwrap();
    let ticks = variable(&mut uno, "ticks");
    let _ = uno.run_for(100_000);
    assert_eq!(variable(&mut uno, "ticks"), ticks);
}

#[test]
fn a_reset_keeps_memory_and_tells_its_cause() {
    let mut uno = Program::c(WATCHED).uno();
    for (reset, cause, starts) in
        [(Reset::External, 2, 2), (Reset::BrownOut, 4, 3), (Reset::PowerOn, 1, 1)]
    {
        let _ = uno.run_for(10_000);
        uno.forget_edges();
        uno.reset(reset);
        let cycle = uno.cycle();
        assert_eq!(uno.edges(), [PinEdge { cycle, pin: Pin::D9, level: false }]);
        let _ = uno.run_for(10_000);
        assert_eq!((variable(&mut uno, "cause"), variable(&mut uno, "starts")), (cause, starts));
    }
}

#[test]
fn erased_flash_and_invalid_instructions_end_in_a_crash() {
    let mut uno = assembled("nop");
    assert!(matches!(uno.run_until(1_000_000), State::Crashed(_)));
    let mut uno = assembled(".word 0x0001");
    assert!(matches!(uno.run_until(1000), State::Crashed(why) if why.contains("Invalid")));
}

// ---- images and files ----------------------------------------------------------------------

/// A program with initialised data and a compare interrupt that works through it.
const LISTED: &str = "
    volatile uint16_t steps[] = {1000, 3000, 4500, 60000, 0};
    volatile uint8_t next;
    ISR(TIMER1_COMPA_vect) {
        OCR1A = steps[++next];
        TCCR1A ^= _BV(COM1A0);
        if (!steps[next]) TIMSK1 = 0;
    }
    int main(void) {
        DDRB = 2;
        OCR1A = steps[0];
        TCCR1A = _BV(COM1A1) | _BV(COM1A0);
        TIMSK1 = 2;
        TCCR1B = 1;
        sei();
        for (;;);
    }";

#[test]
fn elf_and_hex_run_alike() {
    let program = Program::c(LISTED);
    let (mut elf, mut hex) = (program.uno(), Uno::load(&program.file("program.hex")).unwrap());
    let _ = elf.run_until(100_000);
    let _ = hex.run_until(100_000);
    assert_eq!(elf.edges(), hex.edges());
    let cycles: Vec<u64> = elf.edges().iter().map(|edge| edge.cycle).collect();
    let gaps: Vec<u64> = cycles.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!(gaps, [2000, 1500, 55_500, 5536], "the last one is set for count 0");
    assert!(elf.symbol("main").is_some() && hex.symbol("main").is_none());
}

#[test]
fn damaged_images_are_refused() {
    let program = Program::assembly("nop");
    let elf = fs::read(program.file("program.elf")).unwrap();
    let hex = fs::read_to_string(program.file("program.hex")).unwrap();
    let refuse = |bytes: &[u8]| {
        let path = program.file("damaged");
        fs::write(&path, bytes).unwrap();
        assert!(Image::read(&path).is_err());
    };
    refuse(b"");
    refuse(b"text\n");
    refuse(&elf[..elf.len() / 2]);
    refuse(hex.replacen(":02", ":03", 1).as_bytes());
    refuse(hex.lines().next().unwrap().as_bytes());
    assert!(Image::read(&program.file("absent")).is_err());
}

#[test]
fn edges_are_written_for_viewers_and_tables() {
    let mut uno = assembled(&format!("{TIMER1_SET_AT_1000} {END}"));
    let _ = uno.run_until(2000);
    let folder = tempfile::tempdir().unwrap();
    let (vcd, csv) = (folder.path().join("e.vcd"), folder.path().join("e.csv"));
    write_vcd(&vcd, uno.edges()).unwrap();
    write_csv(&csv, uno.edges()).unwrap();
    let vcd = fs::read_to_string(vcd).unwrap();
    assert!(vcd.contains("$timescale 100 ps $end") && vcd.contains("$var wire 1 * D9 $end"));
    assert!(vcd.ends_with("#634375\n1*\n"), "{vcd}");
    assert_eq!(fs::read_to_string(csv).unwrap(), "cycle,pin,level\n1015,D9,1\n");
}

// ---- the program ---------------------------------------------------------------------------

/// `emulated-board`, running.
struct Running {
    child: Child,
    commands: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    port: PathBuf,
}

impl Running {
    fn start(program: &Program, options: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_emulated-board"));
        let _ = command.arg(program.file("program.elf")).args(options);
        let _ = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.current_dir(program.folder.path()).spawn().unwrap();
        let mut answers = BufReader::new(child.stdout.take().unwrap());
        let mut port = String::new();
        let _ = answers.read_line(&mut port).unwrap();
        let commands = child.stdin.take();
        Self { child, commands, answers, port: port.trim().into() }
    }

    fn ask(&mut self, line: &str) -> String {
        writeln!(self.commands.as_mut().unwrap(), "{line}").unwrap();
        let mut answer = String::new();
        let _ = self.answers.read_line(&mut answer).unwrap();
        answer.trim().to_owned()
    }

    fn open(&self) -> File {
        let flags = OFlag::O_NONBLOCK | OFlag::O_NOCTTY;
        let mut options = OpenOptions::new();
        options.read(true).write(true).custom_flags(flags.bits()).open(&self.port).unwrap()
    }

    fn end(mut self) -> ExitStatus {
        self.commands = None;
        self.child.wait().unwrap()
    }
}

/// Send bytes and wait for as many.
fn exchange(file: &mut File, bytes: &[u8]) -> Vec<u8> {
    file.write_all(bytes).unwrap();
    let (mut got, deadline) = (Vec::new(), Instant::now() + Duration::from_secs(10));
    while got.len() < bytes.len() && Instant::now() < deadline {
        let mut buffer = [0; 64];
        match file.read(&mut buffer) {
            Ok(count) => got.extend_from_slice(&buffer[..count]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                thread::sleep(Duration::from_millis(1));
            }
            Err(error) => panic!("{error}"),
        }
    }
    got
}

/// The program looks at its port every millisecond: give it time to.
fn pause() {
    thread::sleep(Duration::from_millis(50));
}

#[test]
fn the_program_is_a_serial_port_that_outlives_its_users() {
    let mut board = Running::start(&Program::c(ECHO), &["--reset-on-open"]);
    pause();
    for round in 1..=3 {
        let mut file = board.open();
        pause();
        assert_eq!(exchange(&mut file, b"\x00\x03\r\n\xffraw"), b"\x00\x03\r\n\xffraw");
        assert_eq!(board.ask("resets"), round.to_string());
        drop(file);
        pause();
    }
    assert_eq!(board.ask("overruns"), "0");
    assert!(board.end().success());
}

#[test]
fn the_program_keeps_the_wall_clock_and_writes_its_edges() {
    let program = Program::c(WATCHED);
    let options = ["--edges", "e.csv", "--vcd", "e.vcd", "--jumper", "D9-D8", "--not-ready"];
    let mut board = Running::start(&program, &options);
    let cycle = |board: &mut Running| board.ask("cycle").parse::<u64>().unwrap();
    let (first, start) = (cycle(&mut board), Instant::now());
    thread::sleep(Duration::from_millis(500));
    let (second, passed) = (cycle(&mut board), start.elapsed());
    let ratio = (second - first) as f64 / 16e6 / passed.as_secs_f64();
    assert!((0.5..1.2).contains(&ratio), "{ratio}");
    let levels = ["D2", "D4", "D8", "D9"].map(|pin| board.ask(&format!("level {pin}")));
    assert_eq!(levels, ["0", "0", "1", "1"]);
    assert_eq!((board.ask("drive D4 1"), board.ask("level D4")), ("ok".into(), "1".into()));
    assert_eq!((board.ask("stick D9 0"), board.ask("level D8")), ("ok".into(), "0".into()));
    assert_eq!((board.ask("unstick D9"), board.ask("level D8")), ("ok".into(), "1".into()));
    assert!(board.ask("drive D99 1").starts_with("error: "));
    assert!(board.ask("dance").starts_with("error: "));
    assert_eq!(board.ask("hang"), "ok");
    pause();
    assert_eq!(board.ask("resets"), "1", "the watchdog's");
    assert_eq!(board.ask("state"), "running");
    assert!(board.end().success());
    let table = fs::read_to_string(program.file("e.csv")).unwrap();
    assert!(table.ends_with('\n') && table.lines().count() > 1 + 2 * 5, "{table}");
    assert!(fs::read_to_string(program.file("e.vcd")).unwrap().contains(" D8 $end"));
}

#[test]
fn the_program_ends_at_a_signal_and_refuses_what_is_no_image() {
    let program = Program::c(WATCHED);
    let mut board = Running::start(&program, &["--edges", "e.csv"]);
    assert_eq!(board.ask("level D2"), "0");
    let id = board.child.id().to_string();
    program.run(Command::new("kill").args(["-TERM", &id]));
    assert!(board.child.wait().unwrap().success());
    assert!(fs::read_to_string(program.file("e.csv")).unwrap().contains(",D9,1\n"));
    let program = env!("CARGO_BIN_EXE_emulated-board");
    let refused = Command::new(program).arg(Path::new("/dev/null")).output().unwrap();
    assert_eq!((refused.status.code(), refused.stdout.len()), (Some(1), 0));
}

// ---- speed ---------------------------------------------------------------------------------

#[test]
fn it_is_faster_than_the_board() {
    let mut uno = Program::c(WATCHED).uno();
    let start = Instant::now();
    let _ = uno.run_until(16_000_000);
    let ratio = 1.0 / start.elapsed().as_secs_f64();
    println!("{ratio:.1} times real time");
    assert!(ratio > 1.0);
}
