// What happens to the board from outside, in the order of cycles. It outlives a reset of the board.

export class Agenda {
  constructor() {
    this.items = [];
    this.next = Infinity;
  }

  /** `act(cycle)` at `cycle`; those of one cycle in the order of entry. */
  add(cycle, act) {
    let at = this.items.length;
    while (at > 0 && this.items[at - 1].cycle > cycle) at -= 1;
    this.items.splice(at, 0, { cycle, act });
    this.next = this.items[0].cycle;
  }

  runTo(cycle) {
    while (this.next <= cycle) {
      const item = this.items.shift();
      this.next = this.items.length > 0 ? this.items[0].cycle : Infinity;
      item.act(item.cycle);
    }
  }
}
