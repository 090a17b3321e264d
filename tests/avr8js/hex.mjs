// Intel HEX, as avr-objcopy writes it.

export const FLASH_BYTES = 32768;

/** Program memory of an ATmega328P; what the image leaves out is erased (0xFF). */
export function parseHex(text) {
  const bytes = new Uint8Array(FLASH_BYTES).fill(0xff);
  let base = 0;
  let size = 0;
  for (const [number, line] of text.split(/\r?\n/).entries()) {
    if (line === '') continue;
    const record = readRecord(line, number + 1);
    if (record.type === 1) return { words: new Uint16Array(bytes.buffer), size };
    if (record.type === 2) base = record.data.readUInt16BE(0) * 16;
    if (record.type === 4) base = record.data.readUInt16BE(0) * 65536;
    if (record.type !== 0) continue;
    const start = base + record.address;
    if (start + record.data.length > FLASH_BYTES) throw new Error('image exceeds 32 KB');
    bytes.set(record.data, start);
    size = Math.max(size, start + record.data.length);
  }
  throw new Error('image has no end record');
}

function readRecord(line, number) {
  const raw = Buffer.from(line.slice(1), 'hex');
  const sound =
    /^:([0-9A-Fa-f]{2}){5,}$/.test(line) &&
    raw.length === raw[0] + 5 &&
    raw.reduce((sum, byte) => (sum + byte) & 0xff, 0) === 0;
  if (!sound) throw new Error(`image line ${number} is damaged`);
  return { type: raw[3], address: raw.readUInt16BE(1), data: raw.subarray(4, 4 + raw[0]) };
}
