// A board that is driven line by line over stdin and stdout; the lines are listed in README.md.

import { createInterface } from 'node:readline';
import { parseBytes } from './script.mjs';

export async function servePipe(board) {
  const session = { board, bytesTold: 0, bytesListed: 0, edgesListed: 0 };
  say(`ready ${board.cpu.cycles}`);
  for await (const line of createInterface({ input: process.stdin })) {
    const [name, ...args] = line.trim().split(/\s+/);
    if (name === 'quit') return;
    say(answer(session, name, args));
  }
}

function say(text) {
  process.stdout.write(`${text}\n`);
}

function answer(session, name, args) {
  try {
    if (!Object.hasOwn(COMMANDS, name)) throw new Error(`unknown command ${name}`);
    return COMMANDS[name](session, ...args);
  } catch (error) {
    return `error ${error.message}`;
  }
}

const COMMANDS = {
  run(session, until) {
    session.board.run(number(until));
    return position(session);
  },
  // Until the board has sent a byte of this value: the end of a frame.
  await(session, until, byte) {
    const { board } = session;
    const wanted = parseBytes(byte)[0];
    const search = { at: session.bytesTold, found: false };
    board.run(number(until), () => {
      while (!search.found && search.at < board.uart.length) {
        search.found = board.uart[search.at].value === wanted;
        search.at += 1;
      }
      return search.found;
    });
    return position(session);
  },
  send({ board }, hex, cycle, cyclesPerByte) {
    return `ok ${board.send(notBefore(board, cycle), parseBytes(hex), optional(cyclesPerByte))}`;
  },
  flood({ board }, from, to, hex, cyclesPerByte) {
    const start = notBefore(board, from);
    board.flood(start, number(to), parseBytes(hex), optional(cyclesPerByte));
    return `ok ${start}`;
  },
  drive({ board }, pin, level, cycle) {
    if (!['0', '1', 'z'].includes(level)) throw new Error('level is 0, 1 or z');
    const when = notBefore(board, cycle);
    board.drive(when, pin, level === 'z' ? null : Number(level));
    if (when === board.cpu.cycles) board.catchUp();
    return `ok ${when}`;
  },
  jumper({ board }, from, to) {
    board.jumper(from, to);
    return `ok ${board.cpu.cycles}`;
  },
  reset({ board }) {
    board.reset();
    return `ok ${board.cpu.cycles}`;
  },
  level({ board }, pin) {
    return `level ${board.pins.find(pin).out}`;
  },
  edges(session) {
    const fresh = session.board.pins.edges.slice(session.edgesListed);
    session.edgesListed += fresh.length;
    return list('edges', fresh.map(({ cycle, pin, level }) => `${cycle},${pin},${level}`));
  },
  uart(session) {
    const fresh = session.board.uart.slice(session.bytesListed);
    session.bytesListed += fresh.length;
    return list('uart', fresh.map(({ cycle, value }) => `${cycle},${hexByte(value)}`));
  },
  state({ board }) {
    const { cpu, resets, serial } = board;
    return `state cycle=${cpu.cycles} resets=${resets} overruns=${serial.overruns}`;
  },
};

function position(session) {
  const fresh = session.board.uart.slice(session.bytesTold);
  session.bytesTold += fresh.length;
  return `at ${session.board.cpu.cycles} ${fresh.map(({ value }) => hexByte(value)).join('') || '-'}`;
}

function list(name, lines) {
  return [`${name} ${lines.length}`, ...lines].join('\n');
}

function number(text) {
  const value = Number(text);
  if (text === undefined || !Number.isSafeInteger(value)) throw new Error(`not a number: ${text}`);
  return value;
}

function optional(text) {
  return text === undefined ? undefined : number(text);
}

function notBefore(board, text) {
  return Math.max(board.cpu.cycles, optional(text) ?? 0);
}

export function hexByte(value) {
  return value.toString(16).padStart(2, '0');
}
