// A session from a file: what is done to the board, and until when it runs.

import { readFileSync } from 'node:fs';

/** Enter the script into the board's agenda; the cycle at which it ends. */
export function applyScript(board, path) {
  const script = JSON.parse(readFileSync(path, 'utf8'));
  const offset = script.start_cycle_offset ?? 0;
  for (const [from, to] of script.jumpers ?? []) board.jumper(from, to);
  for (const { cycle, pin, level } of script.drive ?? []) board.drive(offset + cycle, pin, level);
  const sends = [...(script.send ?? [])].sort((a, b) => a.cycle - b.cycle);
  for (const { cycle, hex, cycles_per_byte } of sends) {
    board.send(offset + cycle, parseBytes(hex), cycles_per_byte);
  }
  if (script.flood) {
    const { from, to, hex, cycles_per_byte } = script.flood;
    board.flood(offset + from, offset + to, parseBytes(hex), cycles_per_byte);
  }
  if (!Number.isSafeInteger(script.until_cycle)) throw new Error('until_cycle is missing');
  return offset + script.until_cycle;
}

export function parseBytes(hex) {
  if (!/^([0-9a-fA-F]{2})+$/.test(hex)) throw new Error(`not bytes in hexadecimal: ${hex}`);
  return Buffer.from(hex, 'hex');
}
