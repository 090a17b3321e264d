// The Uno's pins by name: edges that it makes, levels that it is given, jumper wires.

const NAMES = {
  B: ['D8', 'D9', 'D10', 'D11', 'D12', 'D13'],
  C: ['A0', 'A1', 'A2', 'A3', 'A4', 'A5'],
  D: ['D0', 'D1', 'D2', 'D3', 'D4', 'D5', 'D6', 'D7'],
};

export class Pins {
  /** `ports` by letter; `onInput(name, level, cycle)` hears every input that has changed. */
  constructor(ports, clock, onInput) {
    this.clock = clock;
    this.onInput = onInput;
    this.edges = [];
    this.pins = new Map();
    this.jumpers = []; // [output, input]
    for (const [letter, port] of Object.entries(ports)) {
      for (const [bit, name] of NAMES[letter].entries()) {
        this.pins.set(name, { name, port, bit, out: 0, input: 0, drive: null });
      }
      const own = [...this.pins.values()].filter((pin) => pin.port === port);
      port.addListener(() => this.portChanged(own));
    }
  }

  find(name) {
    const pin = this.pins.get(name);
    if (!pin) throw new Error(`no pin ${name}`);
    return pin;
  }

  portChanged(own) {
    const cycle = this.clock.stamp();
    for (const pin of own) {
      const level = (pin.port.driven >> pin.bit) & 1;
      if (level !== pin.out) {
        pin.out = level;
        this.record(cycle, pin.name, level);
        for (const [from, to] of this.jumpers) if (from === pin) this.settle(to, cycle);
      }
      this.settle(pin, cycle);
    }
  }

  /** In the order of time: a match may come to light after a write that it precedes. */
  record(cycle, pin, level) {
    let at = this.edges.length;
    while (at > 0 && this.edges[at - 1].cycle > cycle) at -= 1;
    this.edges.splice(at, 0, { cycle, pin, level });
  }

  /** A level from outside; null lets go. */
  drive(name, level, cycle) {
    const pin = this.find(name);
    pin.drive = level;
    this.settle(pin, cycle);
  }

  jumper(from, to, cycle) {
    const pair = [this.find(from), this.find(to)];
    this.jumpers.push(pair);
    this.settle(pair[1], cycle);
  }

  settle(pin, cycle) {
    const level = this.inputLevel(pin);
    if (level === pin.input) return;
    pin.input = level;
    pin.port.setPin(pin.bit, level === 1);
    this.onInput(pin.name, level, cycle);
  }

  inputLevel(pin) {
    if (pin.drive !== null) return pin.drive;
    const wires = this.jumpers.filter(([, to]) => to === pin);
    if (wires.length > 0) return wires.some(([from]) => from.out) ? 1 : 0;
    return (pin.port.pulledUp >> pin.bit) & 1;
  }
}
