// Run an image: node run.mjs IMAGE.hex SCRIPT.json OUT.csv, or node run.mjs IMAGE.hex --pipe.

import { readFileSync, writeFileSync } from 'node:fs';
import { Board, HERTZ } from './board.mjs';
import { parseHex } from './hex.mjs';
import { hexByte, servePipe } from './pipe.mjs';
import { applyScript } from './script.mjs';

const USAGE = 'usage: node run.mjs IMAGE.hex SCRIPT.json OUT.csv | IMAGE.hex --pipe';

async function main([image, script, out]) {
  if (!image || !script || (script !== '--pipe' && !out)) {
    console.error(USAGE);
    return 2;
  }
  const board = new Board(parseHex(readFileSync(image, 'utf8')).words);
  if (script === '--pipe') await servePipe(board);
  else runScript(board, script, out);
  return 0;
}

function runScript(board, script, out) {
  const until = applyScript(board, script);
  const started = process.hrtime.bigint();
  board.run(until);
  const seconds = Number(process.hrtime.bigint() - started) / 1e9;
  writeTable(out, 'cycle,pin,level', board.pins.edges, (e) => `${e.cycle},${e.pin},${e.level}`);
  writeTable(`${out}.uart`, 'cycle,hex', board.uart, (b) => `${b.cycle},${hexByte(b.value)}`);
  const rate = board.cpu.cycles / seconds;
  console.error(
    `${board.cpu.cycles} cycles, ${(rate / 1e6).toFixed(1)}e6 per second ` +
      `(${(rate / HERTZ).toFixed(2)} of real time); ${board.pins.edges.length} edges, ` +
      `${board.resets} resets, ${board.serial.overruns} bytes overrun`,
  );
}

function writeTable(path, head, rows, format) {
  writeFileSync(path, [head, ...rows.map(format), ''].join('\n'));
}

try {
  process.exitCode = await main(process.argv.slice(2));
} catch (error) {
  console.error(`error: ${error.message}`);
  process.exitCode = 1;
}
