// An Arduino Uno (ATmega328P at 16 MHz) on avr8js.
//
// Time is the number of clock cycles since power-on. What happens "at" cycle n happens at the clock
// edge that begins cycle n; what an instruction writes holds from its last cycle's end on.

import {
  AVRClock,
  AVRWatchdog,
  CPU,
  avrInstruction,
  portBConfig,
  portCConfig,
  portDConfig,
  timer0Config,
  timer1Config,
  timer2Config,
  watchdogConfig,
} from 'avr8js';
import { Agenda } from './agenda.mjs';
import { Pins } from './pins.mjs';
import { LatchedPort } from './port.mjs';
import { Serial } from './serial.mjs';
import { ExactTimer } from './timer.mjs';

export const HERTZ = 16e6;
const RAM_BYTES = 2048;
const GTCCR = 0x43;
const SMCR = 0x53;
const MCUSR = 0x54;
const SREG = 0x5f;
const INTERRUPTS_ON = 0x80;
const POWER_ON = 1;
const EXTERNAL = 2;
const BY_WATCHDOG = 8;
const WATCHDOG_ON = 8;
const OP_SLEEP = 0x9588;
const ENTRY_CYCLES = 4; // of an interrupt, before its vector's jump
const WAKE_CYCLES = 4;

export class Board {
  constructor(words) {
    this.cpu = new CPU(words, RAM_BYTES);
    this.agenda = new Agenda();
    this.began = 0; // cycle at which the instruction in execution began
    this.happening = null; // cycle of the hardware event being worked on
    this.uart = []; // bytes from the board: { cycle, value }
    this.resets = 0;
    this.lineFree = 0; // cycle from which the wire to the board is idle
    this.build();
    this.cpu.data[MCUSR] = POWER_ON;
  }

  build() {
    const { cpu } = this;
    this.ports = {
      B: new LatchedPort(cpu, portBConfig),
      C: new LatchedPort(cpu, portCConfig),
      D: new LatchedPort(cpu, portDConfig),
    };
    this.timers = [timer0Config, timer1Config, timer2Config].map(
      (config) => new ExactTimer(cpu, config, this),
    );
    this.hookPrescalers();
    this.serial = new Serial(cpu, this, (value, cycle) => this.uart.push({ cycle, value }));
    this.pins = new Pins(this.ports, this, (name, level, cycle) => {
      if (name === 'D8') this.timers[1].capture(cycle, level === 1);
    });
    this.watchdog = new AVRWatchdog(cpu, watchdogConfig, new AVRClock(cpu, HERTZ));
    this.forceWatchdog();
    this.restartCpu = cpu.reset.bind(cpu);
    cpu.reset = () => this.at(cpu.cycles, () => this.restart(BY_WATCHDOG)); // its only caller
  }

  /** GTCCR restarts the prescalers: bit 0 that of timers 0 and 1, bit 1 that of timer 2. */
  hookPrescalers() {
    this.cpu.writeHooks[GTCCR] = (value) => {
      for (const [index, timer] of this.timers.entries()) {
        if (!(value & (index === 2 ? 2 : 1))) continue;
        timer.countTo(this.end());
        timer.restartPrescaler(this.end());
      }
      return true; // the bits clear themselves; holding them (TSM) is left out
    };
  }

  /** While WDRF is set the watchdog cannot be turned off. */
  forceWatchdog() {
    const { cpu } = this;
    const hook = cpu.writeHooks[watchdogConfig.WDTCSR];
    cpu.writeHooks[watchdogConfig.WDTCSR] = (value, old, address, mask) => {
      const done = hook(value, old, address, mask);
      if (cpu.data[MCUSR] & BY_WATCHDOG && !(cpu.data[watchdogConfig.WDTCSR] & WATCHDOG_ON)) {
        this.startWatchdog();
      }
      return done;
    };
  }

  startWatchdog() {
    const { cpu, watchdog } = this;
    cpu.data[watchdogConfig.WDTCSR] |= WATCHDOG_ON;
    watchdog.enabledValue = true;
    watchdog.resetWatchdog();
    cpu.addClockEvent(watchdog.checkWatchdog, watchdog.watchdogTimeout - cpu.cycles);
  }

  /** avr8js leaves all peripherals as they were; a reset lets go of every pin at once. */
  restart(cause) {
    const { cpu } = this;
    const causes = cpu.data[MCUSR] | cause;
    this.resets += 1;
    for (const port of Object.values(this.ports)) {
      cpu.writeData(port.portConfig.DDR, 0);
      cpu.writeData(port.portConfig.PORT, 0);
    }
    cpu.data.fill(0, 0x20, 0x100); // the memory above is kept
    this.restartCpu();
    cpu.data[MCUSR] = causes;
    for (const timer of this.timers) timer.restart();
    for (const port of Object.values(this.ports)) port.restart();
    this.serial.restart();
    this.watchdog.enabledValue = false;
    if (causes & BY_WATCHDOG) this.startWatchdog();
  }

  /** The reset button, or DTR. */
  reset() {
    this.at(this.cpu.cycles, () => this.restart(EXTERNAL));
  }

  /** The cycle at which the instruction in execution ends its access. */
  end() {
    const out = (this.cpu.progMem[this.cpu.pc] & 0xf800) === 0xb800;
    return this.began + (out ? 1 : 2);
  }

  /** Work on something that happens at `cycle`, which may be past. */
  at(cycle, work) {
    const outer = this.happening;
    this.happening = cycle;
    work();
    this.happening = outer;
  }

  /** The cycle of what is being worked on. */
  stamp() {
    return this.happening ?? this.end();
  }

  /** Run to the first end of an instruction at or after `cycle`, or until `enough()`. */
  run(cycle, enough = () => false) {
    const { cpu } = this;
    while (cpu.cycles < cycle && !enough()) {
      const mayInterrupt = cpu.data[SREG] & INTERRUPTS_ON;
      const opcode = cpu.progMem[cpu.pc];
      this.began = cpu.cycles;
      avrInstruction(cpu);
      this.catchUp();
      if (opcode === OP_SLEEP && cpu.data[SMCR] & 1) this.sleep(cycle, enough);
      // One instruction is always executed after the one that turns interrupts on.
      if (cpu.nextInterrupt >= 0 && mayInterrupt && cpu.data[SREG] & INTERRUPTS_ON) {
        this.interrupt();
      }
    }
    return cpu.cycles;
  }

  /** Everything that is due. avr8js would do one event per instruction. */
  catchUp() {
    const { cpu } = this;
    this.happening = cpu.cycles;
    if (this.agenda.next <= cpu.cycles) this.agenda.runTo(cpu.cycles);
    let event = cpu.nextClockEvent;
    while (event && event.cycles <= cpu.cycles) {
      cpu.nextClockEvent = event.next;
      event.callback();
      event = cpu.nextClockEvent;
    }
    this.happening = null;
  }

  /** avr8js enters in two cycles; the data sheet says four. */
  interrupt() {
    const { cpu } = this;
    const interrupt = cpu.pendingInterrupts[cpu.nextInterrupt];
    const sp = cpu.SP;
    cpu.data[sp] = cpu.pc & 0xff;
    cpu.data[sp - 1] = cpu.pc >> 8;
    cpu.SP = sp - 2;
    cpu.data[SREG] &= ~INTERRUPTS_ON;
    cpu.cycles += ENTRY_CYCLES;
    cpu.pc = interrupt.address;
    if (!interrupt.constant) cpu.clearInterrupt(interrupt);
    this.catchUp();
  }

  /** Idle until an interrupt; all clocks run on, whatever the sleep mode. avr8js does not sleep. */
  sleep(until, enough) {
    const { cpu, resets } = this;
    let slept = false;
    while (cpu.nextInterrupt < 0 && cpu.cycles < until && !enough()) {
      const event = cpu.nextClockEvent ? cpu.nextClockEvent.cycles : Infinity;
      cpu.cycles = Math.max(cpu.cycles + 1, Math.min(event, this.agenda.next, until));
      this.catchUp();
      if (this.resets !== resets) return;
      slept = true;
    }
    if (cpu.nextInterrupt < 0) cpu.pc -= 1; // sleeps on when it is run again
    else if (slept) cpu.cycles += WAKE_CYCLES;
  }

  /** A level from outside at a cycle; null lets go of the pin. */
  drive(cycle, name, level) {
    this.pins.find(name);
    this.agenda.add(cycle, (when) => this.at(when, () => this.pins.drive(name, level, when)));
  }

  jumper(from, to) {
    const now = this.cpu.cycles;
    this.at(now, () => this.pins.jumper(from, to, now));
  }

  /** Bytes to the board, from `cycle` on or when the wire is free; the end of the last one. */
  send(cycle, bytes, cyclesPerByte = 640) {
    let start = Math.max(cycle, this.lineFree);
    for (const value of bytes) {
      this.agenda.add(start, (when) => this.serial.startBit(value, when));
      start += cyclesPerByte;
    }
    this.lineFree = start;
    return start;
  }

  /** Bytes without a gap between two cycles, over and over. */
  flood(from, to, bytes, cyclesPerByte = 640) {
    const next = (cycle, index) => {
      if (cycle >= to) return;
      this.agenda.add(cycle, () => {
        this.serial.startBit(bytes[index % bytes.length], cycle);
        next(cycle + cyclesPerByte, index + 1);
      });
    };
    next(from, 0);
  }
}
