// JSON encoder for payloads with long lists of numbers, such as sensor data. V8 is two to six times slower
// on them because it searches for the shortest text of each number, although most have few decimals.
import { copied } from "./copying.js";

const MIN_LIST_LENGTH = 128;
const MAX_KEYS = 100;
const MAX_SCRATCH_BYTES = 2 ** 22;
const MAX_NUMBER = 1e9;
const MAX_NUMBER_BYTES = 18; // sign, nine digits, point, six decimals, comma
const MILLION = 1e6;
const [COMMA, MINUS, POINT, ZERO] = [0x2c, 0x2d, 0x2e, 0x30];

/** Digits of the numbers 0 to 999, three each. */
const DIGITS = new Uint8Array(3000);
/** Number of digits of 0 to 999 without leading zeros, and of decimals without trailing zeros. */
const LENGTHS = new Uint8Array(1000);
const DECIMALS = new Uint8Array(1000);
for (let number = 0; number < 1000; number++) {
  const text = String(number).padStart(3, "0");
  for (let place = 0; place < 3; place++) DIGITS[3 * number + place] = text.charCodeAt(place);
  LENGTHS[number] = String(number).length;
  DECIMALS[number] = text.replace(/0+$/, "").length;
}
let scratch = Buffer.alloc(0);

/** Encode a payload like `JSON.stringify`, with the same exceptions; return undefined if it has no JSON. */
export function encodeJson(payload: unknown): { data: Buffer; text?: string } | undefined {
  const quick = encodeLists(payload);
  if (quick) return { data: quick };
  const text = JSON.stringify(payload) as string | undefined;
  return text === undefined ? undefined : { data: Buffer.from(text, "utf8"), text };
}

/** Return the JSON of a long list of numbers or of a plain object with such lists; undefined for other values. */
function encodeLists(payload: unknown): Buffer | undefined {
  if (isNumberList(payload)) return finished(writeList(payload, 0));
  if (!isPlain(payload)) return undefined;
  const keys = Object.keys(payload);
  if (keys.length > MAX_KEYS || !keys.some((key) => isNumberList(payload[key]))) return undefined;
  let at = 0;
  for (const key of keys) {
    const value = payload[key];
    const isList = isNumberList(value);
    const text = isList ? "" : plainText(value);
    if (text === undefined) return undefined;
    at = writeText(`${at > 0 ? "," : "{"}${JSON.stringify(key)}:${text}`, at);
    if (isList) at = writeList(value, at);
    if (at < 0) return undefined;
  }
  return finished(writeText("}", at));
}

function isNumberList(value: unknown): value is readonly number[] {
  if (!Array.isArray(value) || value.length < MIN_LIST_LENGTH || "toJSON" in value) return false;
  return typeof value[0] === "number" && typeof value[value.length - 1] === "number";
}

function isPlain(value: unknown): value is Readonly<Record<string, unknown>> {
  if (typeof value !== "object" || value === null || "toJSON" in value) return false;
  const prototype: unknown = Object.getPrototypeOf(value);
  return prototype === Object.prototype || prototype === null;
}

/** Return the JSON of a member; undefined if it depends on the member's name or the member would be omitted. */
function plainText(value: unknown): string | undefined {
  if (typeof value === "bigint" || (typeof value === "object" && value !== null && "toJSON" in value)) return undefined;
  return JSON.stringify(value) as string | undefined;
}

/** Reserve more bytes in `scratch`. Return false if the limit would be exceeded. */
function reserve(bytes: number): boolean {
  if (bytes > MAX_SCRATCH_BYTES) return false;
  if (bytes <= scratch.length) return true;
  const grown = Buffer.allocUnsafe(Math.min(MAX_SCRATCH_BYTES, 2 * bytes));
  grown.set(scratch);
  scratch = grown;
  return true;
}

/** Write a text to `scratch` at an offset. Return the end offset, or -1 if there is no room. */
function writeText(text: string, at: number): number {
  if (at < 0 || !reserve(at + 3 * text.length)) return -1;
  return at + scratch.write(text, at, "utf8");
}

/** Write a list of numbers to `scratch` at an offset. Return the end offset, or -1 if `JSON.stringify` is needed. */
function writeList(values: readonly number[], at: number): number {
  if (!reserve(at + 2 + values.length * MAX_NUMBER_BYTES)) return -1;
  const out: Uint8Array = scratch;
  out[at++] = 0x5b;
  for (let index = 0; index < values.length; index++) {
    let value = values[index]!;
    if (typeof value !== "number") return -1;
    if (value < 0) {
      out[at++] = MINUS;
      value = -value;
    }
    if (!(value < MAX_NUMBER)) return -1; // also NaN
    const whole = value | 0;
    at = writeWhole(out, at, whole);
    if (whole !== value) at = writeDecimals(out, at, whole, value);
    if (at < 0) return -1;
    out[at++] = COMMA;
  }
  out[at - 1] = 0x5d;
  return at;
}

function writeWhole(out: Uint8Array, at: number, number: number): number {
  let rest = number;
  let length: number;
  if (number >= 1000) {
    const thousands = (number / 1000) | 0;
    at = writeWhole(out, at, thousands);
    rest = number - thousands * 1000;
    length = 3;
  } else {
    length = LENGTHS[number]!;
  }
  if (length === 1) {
    out[at] = ZERO + rest;
    return at + 1;
  }
  for (let place = 3 - length; place < 3; place++) out[at++] = DIGITS[3 * rest + place]!;
  return at;
}

/**
 * Write up to six decimals if they represent the number exactly; then they are also its shortest text.
 * Return the end offset, or -1.
 */
function writeDecimals(out: Uint8Array, at: number, whole: number, value: number): number {
  const millionths = Math.floor((value - whole) * MILLION + 0.5) | 0;
  if ((whole * MILLION + millionths) / MILLION !== value) return -1;
  const high = (millionths / 1000) | 0;
  const low = millionths - high * 1000;
  out[at] = POINT;
  for (let place = 0; place < 3; place++) out[at + 1 + place] = DIGITS[3 * high + place]!;
  if (low === 0) return at + 1 + DECIMALS[high]!;
  for (let place = 0; place < 3; place++) out[at + 4 + place] = DIGITS[3 * low + place]!;
  return at + 4 + DECIMALS[low]!;
}

function finished(at: number): Buffer | undefined {
  return at < 0 ? undefined : copied(scratch.subarray(0, at));
}
