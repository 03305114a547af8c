import { decode, encode } from "@msgpack/msgpack";
import { checkPacked } from "./packed_scan.js";

const DECODE_OPTIONS = {
  useBigInt64: true,
  // Maps with integer keys (`last_seqs`) decode to bigint keys, which objects don't have.
  mapKeyConverter: (key: unknown): string | number =>
    typeof key === "string" || typeof key === "number" ? key : String(key),
};
const MAX_DEPTH = 65; // one more than the wire allows, so that `isTooDeep` can report the reason

/** Encode as msgpack. Integers beyond 32 bits must be `bigint` to stay integers; see {@link asInteger}. */
export function pack(value: unknown): Buffer {
  const packed = encode(value, { useBigInt64: true, maxDepth: MAX_DEPTH, ignoreUndefined: true });
  return Buffer.from(packed.buffer, packed.byteOffset, packed.byteLength);
}

/** Decode msgpack. 64-bit integers become `bigint`. @throws {RangeError | Error} if malformed or nested too deep. */
export function unpack(packed: Uint8Array): unknown {
  checkPacked(packed);
  return decode(packed, DECODE_OPTIONS);
}

/** Decode msgpack whose maps have only string keys. @throws {RangeError | Error} if it is malformed. */
export function unpackWithTextKeys(packed: Uint8Array): unknown {
  checkPacked(packed);
  return decode(packed, { ...DECODE_OPTIONS, mapKeyConverter: textKey });
}

function textKey(key: unknown): string {
  if (typeof key !== "string") throw new RangeError(`The key ${String(key)} is not a string.`);
  return key;
}

/** Return true if a decoded value is a map. */
export function isMap(value: unknown): value is Record<string, unknown> {
  return (
    value !== null &&
    typeof value === "object" &&
    !Array.isArray(value) &&
    !(value instanceof Uint8Array) &&
    !(value instanceof Date)
  );
}

/** Return a copy whose integers beyond 32 bits are `bigint`; msgpack would encode them as floats otherwise. */
export function withWideIntegers(value: unknown): unknown {
  if (typeof value === "number") return asInteger(value);
  if (Array.isArray(value)) return value.map(withWideIntegers);
  if (value === null || typeof value !== "object") return value;
  const prototype: unknown = Object.getPrototypeOf(value);
  if (prototype !== Object.prototype && prototype !== null) return value;
  return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, withWideIntegers(each)]));
}

/** Return an integer beyond 32 bits as `bigint`, any other number unchanged. */
export function asInteger(value: number): number | bigint {
  return Number.isSafeInteger(value) && (value > 0xffffffff || value < -0x80000000) ? BigInt(value) : value;
}
