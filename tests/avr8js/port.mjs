// avr8js's port with the compare outputs' own latches.
//
// The hardware's OCnx latch is moved by matches and forces alone, and is kept while the output is
// disconnected; avr8js would take the port's bit when it is connected again.

import { AVRIOPort } from 'avr8js';

// avr8js's PinOverrideMode, which it does not export.
export const ENABLE = 1;
const SET = 2;
const CLEAR = 3;
const TOGGLE = 4;

export class LatchedPort extends AVRIOPort {
  constructor(cpu, config) {
    super(cpu, config);
    this.latches = 0;
    if (config.pinChange) this.hookPinChange(config.pinChange);
  }

  /** avr8js would take a write of PCMSKn for one of PCICR, and has no hook for PCICR itself. */
  hookPinChange({ PCMSK, PCICR }) {
    const { cpu } = this;
    cpu.writeHooks[PCMSK] = undefined;
    cpu.writeHooks[PCICR] = (value) => {
      for (const port of cpu.gpioPorts) cpu.updateInterruptEnable(port.PCINT, value);
    };
  }

  timerOverridePin(pin, mode) {
    const bit = 1 << pin;
    if (mode === TOGGLE) mode = this.latches & bit ? CLEAR : SET;
    if (mode === SET) this.latches |= bit;
    if (mode === CLEAR) this.latches &= ~bit;
    if (mode === ENABLE) mode = this.latches & bit ? SET : CLEAR;
    super.timerOverridePin(pin, mode);
  }

  /** The registers are already zero. */
  restart() {
    this.latches = 0;
    this.updatePinRegister(0);
  }

  /** Levels that the port puts out; a pin that is not driven counts as low. */
  get driven() {
    return this.lastValue & this.lastDdr;
  }

  /** Inputs with their pull-up on. */
  get pulledUp() {
    return this.cpu.data[this.portConfig.PORT] & ~this.cpu.data[this.portConfig.DDR] & 0xff;
  }
}
