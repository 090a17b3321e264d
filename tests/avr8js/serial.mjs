// The USART at the level of bytes, with the hardware's buffers: transmit buffer and shift register,
// two bytes and a shift register for reception, and the overrun flag. avr8js's own USART has one
// byte in each direction.

const UCSRA = 0xc0;
const UCSRB = 0xc1;
const UCSRC = 0xc2;
const UBRRL = 0xc4;
const UBRRH = 0xc5;
const UDR = 0xc6;

const RXC = 0x80;
const TXC = 0x40;
const UDRE = 0x20;
const DOR = 0x08;
const U2X = 0x02;
const MPCM = 0x01;
const RXEN = 0x10;
const TXEN = 0x08;
const BUFFER = 2;

export class Serial {
  /** `onByte(value, cycle)` hears every byte sent, at the end of its stop bit. */
  constructor(cpu, clock, onByte) {
    this.cpu = cpu;
    this.clock = clock;
    this.onByte = onByte;
    this.overruns = 0;
    const interrupt = (address, mask, constant) => ({
      address,
      flagRegister: UCSRA,
      flagMask: mask,
      enableRegister: UCSRB,
      enableMask: mask,
      constant, // a level: stays until its cause is gone
    });
    this.received = interrupt(0x24, RXC, true);
    this.empty = interrupt(0x26, UDRE, true);
    this.complete = interrupt(0x28, TXC, false);
    this.restart();
    this.hookRegisters();
  }

  restart() {
    this.cpu.data[UCSRA] = UDRE;
    this.cpu.data[UCSRC] = 0x06;
    this.queue = []; // received and not yet read; the third is in the shift register
    this.receiving = false;
    this.shifting = null;
    this.waiting = null;
  }

  get cyclesPerBit() {
    const { data } = this.cpu;
    const rate = ((data[UBRRH] & 0x0f) << 8) | data[UBRRL];
    return (rate + 1) * (data[UCSRA] & U2X ? 8 : 16);
  }

  /** Start bit, eight data bits, perhaps parity, one or two stop bits. */
  get cyclesPerByte() {
    const { data } = this.cpu;
    const bits = 10 + (data[UCSRC] & 0x20 ? 1 : 0) + (data[UCSRC] & 0x08 ? 1 : 0);
    return this.cyclesPerBit * bits;
  }

  hookRegisters() {
    const { cpu } = this;
    cpu.writeHooks[UCSRA] = (value) => {
      cpu.data[UCSRA] = (cpu.data[UCSRA] & ~(U2X | MPCM)) | (value & (U2X | MPCM));
      cpu.clearInterruptByFlag(this.complete, value);
      return true;
    };
    cpu.writeHooks[UCSRB] = (value) => {
      for (const interrupt of [this.received, this.empty, this.complete]) {
        cpu.updateInterruptEnable(interrupt, value);
      }
      if (!(value & RXEN)) this.flush();
    };
    cpu.readHooks[UDR] = () => this.read();
    cpu.writeHooks[UDR] = (value) => {
      this.write(value);
      return true;
    };
  }

  flush() {
    this.queue = [];
    this.cpu.data[UCSRA] &= ~DOR;
    this.cpu.clearInterrupt(this.received);
  }

  read() {
    const value = this.queue.shift() ?? 0;
    this.cpu.data[UCSRA] &= ~DOR;
    if (this.queue.length === 0) this.cpu.clearInterrupt(this.received);
    return value;
  }

  write(value) {
    const { cpu } = this;
    if (!(cpu.data[UCSRB] & TXEN)) return;
    cpu.clearInterrupt(this.complete);
    if (this.shifting === null) {
      this.shift(value, this.clock.end());
    } else {
      this.waiting = value;
      cpu.clearInterrupt(this.empty);
    }
  }

  shift(value, cycle) {
    const done = cycle + this.cyclesPerByte;
    this.shifting = value;
    this.cpu.addClockEvent(() => this.shifted(done), done - this.cpu.cycles);
  }

  shifted(cycle) {
    const value = this.shifting;
    this.shifting = null;
    if (this.waiting === null) {
      this.cpu.setInterruptFlag(this.complete);
    } else {
      this.shift(this.waiting, cycle);
      this.waiting = null;
      this.cpu.setInterruptFlag(this.empty);
    }
    this.onByte(value, cycle);
  }

  /** A start bit at `cycle`. A byte that still waits in the shift register is lost. */
  startBit(value, cycle) {
    const { cpu } = this;
    if (!(cpu.data[UCSRB] & RXEN) || this.receiving) return;
    this.receiving = true;
    if (this.queue.length > BUFFER) {
      this.queue.pop();
      this.overruns += 1;
      cpu.data[UCSRA] |= DOR;
    }
    // Complete in the middle of the (first) stop bit, where the hardware samples it.
    const length = this.cyclesPerByte - this.cyclesPerBit / 2;
    cpu.addClockEvent(() => this.stopBit(value), cycle + length - cpu.cycles);
  }

  stopBit(value) {
    this.receiving = false;
    if (!(this.cpu.data[UCSRB] & RXEN)) return;
    this.queue.push(value);
    this.cpu.setInterruptFlag(this.received);
  }
}
