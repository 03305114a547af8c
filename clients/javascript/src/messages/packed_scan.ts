import { MAX_LEVELS } from "./nesting.js";

/** Size of a value after its first byte, for first bytes 0xc0 to 0xdf; 0 for those that `next` handles itself. */
const FIXED_BYTES = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 8, 1, 2, 4, 8, 1, 2, 4, 8, 2, 3, 5, 9, 17, 0, 0, 0, 0, 0, 0, 0];

/**
 * Check the structure of msgpack without decoding it. A decoder allocates as many items as a list declares, so a
 * few malicious bytes could take gigabytes.
 *
 * @throws {RangeError} if the data is truncated, has trailing bytes, or is nested more than 64 levels deep.
 */
export function checkPacked(packed: Uint8Array): void {
  const view = new DataView(packed.buffer, packed.byteOffset, packed.byteLength);
  const open: number[] = []; // remaining values of the enclosing lists and maps, outermost first
  let at = 0;
  let missing = 1; // remaining values of the innermost one
  while (missing > 0 || open.length > 0) {
    if (missing === 0) {
      missing = open.pop()!;
      continue;
    }
    missing--;
    const { end, items } = next(view, at);
    at = end;
    if (items > view.byteLength - at) throw new RangeError("The list or map declares more items than the data contains.");
    if (items < 0) continue;
    open.push(missing);
    missing = items;
    if (open.length > MAX_LEVELS)
      throw new RangeError(`Lists and maps are nested more than ${MAX_LEVELS} levels deep.`);
  }
  if (at !== view.byteLength) throw new RangeError("The value is followed by other bytes.");
}

/** Return the end of the value or header at `at` and its number of items; -1 if it isn't a list or map. */
function next(view: DataView, at: number): { end: number; items: number } {
  const first = view.getUint8(at++);
  if (first < 0x80 || first >= 0xe0) return { end: at, items: -1 };
  if (first < 0x90) return { end: at, items: 2 * (first & 0x0f) };
  if (first < 0xa0) return { end: at, items: first & 0x0f };
  if (first < 0xc0) return within(view, at + (first & 0x1f));
  switch (first) {
    case 0xc4:
    case 0xd9:
      return within(view, at + 1 + view.getUint8(at));
    case 0xc5:
    case 0xda:
      return within(view, at + 2 + view.getUint16(at));
    case 0xc6:
    case 0xdb:
      return within(view, at + 4 + view.getUint32(at));
    case 0xc7:
      return within(view, at + 2 + view.getUint8(at));
    case 0xc8:
      return within(view, at + 3 + view.getUint16(at));
    case 0xc9:
      return within(view, at + 5 + view.getUint32(at));
    case 0xdc:
      return { end: at + 2, items: view.getUint16(at) };
    case 0xdd:
      return { end: at + 4, items: view.getUint32(at) };
    case 0xde:
      return { end: at + 2, items: 2 * view.getUint16(at) };
    case 0xdf:
      return { end: at + 4, items: 2 * view.getUint32(at) };
    default:
      return within(view, at + FIXED_BYTES[first - 0xc0]!);
  }
}

function within(view: DataView, end: number): { end: number; items: number } {
  if (end > view.byteLength) throw new RangeError("The msgpack is truncated.");
  return { end, items: -1 };
}
