// avr8js's timer, exact to the cycle in normal mode.
//
// avr8js counts at the end of each instruction and acts when the count *reaches* OCRnx. The
// hardware sets the flag and moves the output one timer clock later, when the count leaves OCRnx.
// Here each match carries the hardware's cycle, whatever instruction it falls into.

import { AVRTimer } from 'avr8js';
import { ENABLE } from './port.mjs';

const NORMAL = 0;
const CAPTURE_FLAG = 0x20;
const CAPTURE_RISING = 0x40;

export class ExactTimer extends AVRTimer {
  /** `clock.end()` is the cycle at which the instruction in execution ends. */
  constructor(cpu, config, clock) {
    super(cpu, config);
    this.clock = clock;
    this.matched = null; // the count just reached, while a match is worked on
    this.justWritten = false; // a write of the count suppresses the match at the next clock
    this.prescalerZero = 0;
    this.ICF = {
      address: config.captureInterrupt,
      flagRegister: config.TIFR,
      flagMask: CAPTURE_FLAG,
      enableRegister: config.TIMSK,
      enableMask: CAPTURE_FLAG,
    };
    this.interrupts = [this.OVF, this.OCFA, this.OCFB];
    if (config.captureInterrupt) this.interrupts.push(this.ICF);
    this.planEvents();
    this.hookWrites();
    this.hookFlags();
    if (config.bits === 16) this.shareTemporary();
  }

  /** An event per match and overflow in place of one per count: faster, and none is skipped. */
  planEvents() {
    const step = this.count;
    this.count = (reschedule = true, external = false) => {
      if (this.updateDivider) {
        step(false, external);
        return this.align();
      }
      if (this.timerMode !== NORMAL) return step(reschedule, external);
      step(false, external);
      if (reschedule && this.divider) this.cpu.addClockEvent(this.count, this.delay());
    };
  }

  /** The prescaler runs freely since `zero`; avr8js would start it with the timer. */
  align() {
    const { cpu, divider } = this;
    cpu.clearClockEvent(this.count);
    if (!divider) return;
    this.lastCycle = cpu.cycles - ((cpu.cycles - this.prescalerZero) % divider);
    cpu.addClockEvent(this.count, this.lastCycle + divider - cpu.cycles);
  }

  /** The prescaler starts anew at `cycle`, up to which the timer has counted. */
  restartPrescaler(cycle) {
    this.prescalerZero = cycle;
    if (this.divider > 1) this.lastCycle = cycle;
    this.cpu.updateClockEvent(this.count, 0); // plans anew
  }

  delay() {
    const laps = this.MAX + 1;
    const toLeave = (value) => ((value - this.tcnt + laps) % laps) + 1;
    const counts = Math.min(toLeave(this.ocrA), toLeave(this.ocrB), laps - this.tcnt);
    return this.lastCycle + counts * this.divider - this.cpu.cycles;
  }

  /** Count up to a cycle that may lie ahead within the instruction in execution. */
  countTo(cycle) {
    const { cpu } = this;
    const now = cpu.cycles;
    cpu.cycles = cycle;
    this.count(false);
    cpu.cycles = now;
  }

  /** What is written holds from the end of the instruction; until then the old values do. */
  hookWrites() {
    const { cpu, config } = this;
    for (const register of [config.OCRA, config.OCRB, config.TCNT, config.TCCRA, config.TCCRB]) {
      const hook = cpu.writeHooks[register];
      cpu.writeHooks[register] = (value, old, address, mask) => {
        this.countTo(this.clock.end());
        if (register === config.TCNT) this.justWritten = true;
        const done = hook(value, old, address, mask);
        if (register !== config.TCCRB) cpu.updateClockEvent(this.count, 0); // plans anew
        return done;
      };
    }
  }

  /** avr8js forgets the flags that are not written; and knows no capture. */
  hookFlags() {
    const { cpu, config } = this;
    cpu.readHooks[config.TIFR] = () => {
      this.count(false);
      return cpu.data[config.TIFR];
    };
    cpu.writeHooks[config.TIFR] = (value, _old, _address, mask) => {
      // A flag set at the very clock that clears it stays set.
      this.countTo(this.clock.end() - 1);
      for (const interrupt of this.interrupts) cpu.clearInterruptByFlag(interrupt, value & mask);
      return true;
    };
    cpu.writeHooks[config.TIMSK] = (value) => {
      for (const interrupt of this.interrupts) cpu.updateInterruptEnable(interrupt, value);
    };
  }

  /** All 16-bit registers share one TEMP: an interrupt may spoil a half-done access. */
  shareTemporary() {
    const { cpu, config } = this;
    const readCount = cpu.readHooks[config.TCNT];
    cpu.readHooks[config.TCNT] = (address) => {
      const low = readCount(address);
      this.highByteTemp = this.tcnt >> 8;
      return low;
    };
    cpu.readHooks[config.ICR] = () => {
      this.highByteTemp = cpu.data[config.ICR + 1];
      return cpu.data[config.ICR];
    };
    cpu.readHooks[config.TCNT + 1] = () => this.highByteTemp;
    cpu.readHooks[config.ICR + 1] = () => this.highByteTemp;
  }

  // avr8js calls this with every new count. One count later is the hardware's time.
  timerUpdated(value, previous) {
    if (this.timerMode !== NORMAL) return super.timerUpdated(value, previous);
    if (value === previous) return;
    const after = this.justWritten ? previous : previous - 1;
    this.justWritten = false;
    this.matched = value;
    super.timerUpdated((value - 1) & this.MAX, after & this.MAX);
    this.matched = null;
  }

  updateCompA(mode) {
    this.moveOutput(mode, this.compA, this.ocrA, () => super.updateCompA(mode));
  }

  updateCompB(mode) {
    this.moveOutput(mode, this.compB, this.ocrB, () => super.updateCompB(mode));
  }

  moveOutput(mode, com, ocr, move) {
    if (mode === ENABLE && !com) return; // a force strobe without an output
    if (this.matched === null) return move();
    const late = (this.matched - ocr - 1) & this.MAX;
    this.clock.at(this.lastCycle - late * this.divider, move);
  }

  /** ICP1 has changed at `cycle`. The synchroniser's two or three cycles are left out. */
  capture(cycle, rising) {
    const { cpu, config } = this;
    if (!this.divider || rising !== !!(this.TCCRB & CAPTURE_RISING)) return;
    this.count(false);
    const count = (this.tcnt - Math.ceil((this.lastCycle - cycle) / this.divider)) & this.MAX;
    this.icr = count;
    cpu.data[config.ICR] = count & 0xff;
    cpu.data[config.ICR + 1] = count >> 8;
    cpu.setInterruptFlag(this.ICF);
  }

  /** The registers are already zero. */
  restart() {
    this.reset();
    this.updateDivider = false;
    this.prescalerZero = this.cpu.cycles;
    this.countingUp = true;
    this.highByteTemp = 0;
    this.justWritten = false;
    this.updateWGMConfig();
  }
}
