// The board against the data sheet: node --test check.mjs (needs avr-gcc).

import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import test from 'node:test';
import { Board } from './board.mjs';
import { parseHex } from './hex.mjs';

function exercise(number) {
  const folder = mkdtempSync(join(tmpdir(), 'check-'));
  try {
    const [elf, hex] = [join(folder, 'a.elf'), join(folder, 'a.hex')];
    const source = new URL('check.S', import.meta.url).pathname;
    const flags = ['-mmcu=atmega328p', '-nostartfiles', `-DEXERCISE=${number}`];
    execFileSync('avr-gcc', [...flags, source, '-o', elf]);
    execFileSync('avr-objcopy', ['-O', 'ihex', elf, hex]);
    return new Board(parseHex(readFileSync(hex, 'utf8')).words);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

function edgesOf(board, pin) {
  return board.pins.edges.filter((e) => e.pin === pin).map((e) => [e.cycle, e.level]);
}

test('compare outputs move when the count leaves OCRnx, whatever instruction that falls into', () => {
  const board = exercise(1);
  board.run(2000);
  assert.deepEqual(edgesOf(board, 'D9'), [[26 + 200 + 1, 1]]);
  assert.deepEqual(edgesOf(board, 'D10'), [[26 + 456 + 1, 1]]);
  assert.deepEqual(edgesOf(board, 'D6'), [[27 + 200 + 1, 1]]);
  assert.deepEqual(edgesOf(board, 'D5'), [[27 + 1 + 1, 1]]);
});

test('reads of the count take it from the cycle of the access', () => {
  const board = exercise(1);
  board.run(100);
  assert.equal(board.cpu.data[20], 0);
  assert.equal(board.cpu.data[21], 29 - 26);
  assert.equal(board.cpu.data[22], 31 - 27);
});

test('a write of the port holds from the end of the instruction', () => {
  const board = exercise(1);
  board.run(100);
  assert.deepEqual(edgesOf(board, 'D13'), [[34, 1]]);
});

test('capture takes the count of the cycle at which the pin changes', () => {
  for (const cycle of [100, 101, 102, 103, 1000]) {
    const board = exercise(1);
    board.drive(cycle, 'D8', 1);
    board.run(2000);
    assert.equal(board.cpu.data[24] | (board.cpu.data[25] << 8), cycle - 26);
  }
});

test('an interrupt takes four cycles, and four more out of sleep', () => {
  const flag = 18 + 50 + 1;
  const awake = exercise(2);
  awake.run(500);
  assert.deepEqual(edgesOf(awake, 'D12'), [[flag + 4 + 2, 1]]);
  const asleep = exercise(3);
  asleep.run(500);
  assert.deepEqual(edgesOf(asleep, 'D12'), [[flag + 4 + 4 + 2, 1]]);
});

test('a change of D2 interrupts, INT0 before PCINT2', () => {
  const board = exercise(7);
  board.drive(200, 'D2', 1);
  board.run(250);
  assert.deepEqual(edgesOf(board, 'D11'), [[200 + 4 + 2, 1]]);
  // RETI takes four cycles, and one more instruction is executed before the second entry.
  assert.deepEqual(edgesOf(board, 'D12'), [[206 + 4 + 1 + 4 + 2, 1]]);
});

test('an output latch outlives disconnection, and flags are cleared one by one', () => {
  const board = exercise(4);
  board.run(1000);
  const edges = edgesOf(board, 'D9');
  assert.deepEqual(edges, [[13, 1], [15, 0], [18, 1], [21, 0]]);
  assert.equal(board.cpu.data[24] & 6, 6);
  assert.equal(board.cpu.data[25] & 6, 4);
});

test('the watchdog resets after 16 ms, and every pin is low', () => {
  const board = exercise(5);
  board.run(600_000);
  const [[rise], [fall, level]] = edgesOf(board, 'D6');
  assert.equal(level, 0);
  assert.ok(Math.abs(fall - rise - 256_000) < 10);
  assert.equal(board.cpu.data[24] & 8, 8);
  assert.equal(board.resets, 2); // it stays on while WDRF is set
});

test('reception holds three bytes and tells of the fourth', () => {
  const board = exercise(6);
  assert.equal(board.send(1000, [1, 2, 3, 4]), 1000 + 4 * 640);
  board.drive(5000, 'D2', 1);
  board.run(50_000);
  assert.deepEqual(board.uart.map((byte) => byte.value), [1, 2, 4]);
  assert.equal(board.serial.overruns, 1);
  const [first, second] = board.uart;
  assert.equal(second.cycle - first.cycle, 640);
});

test('a jumper leads an output to an input at the same cycle', () => {
  const board = exercise(1);
  board.jumper('D10', 'D8');
  board.run(2000);
  assert.equal(board.cpu.data[24] | (board.cpu.data[25] << 8), 456 + 1);
});
