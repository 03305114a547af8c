/** Codecs: payload ↔ bytes. A codec has a name (in the graph) and a number (on the wire). */
import { DecodeError, EncodeError } from "../errors.js";
import type { Extension } from "../wire/extension.js";
import { decodeUtf8 } from "../wire/utf8.js";
import { copied, isShared, shared } from "./copying.js";
import { decodeImage, encodeImage } from "./image.js";
import { encodeJson } from "./json_text.js";
import { countNonFinite, isTooDeep, MAX_LEVELS } from "./nesting.js";
import { pack, unpack, withWideIntegers } from "./packing.js";

/** An encoded payload. */
export interface Encoded {
  readonly data: Buffer;
  /** The data as a string, if it was encoded from one. */
  readonly text?: string;
  readonly extension?: Extension;
  /** Number of NaN and infinite values encoded as `null`. */
  readonly nonFinite?: number;
}

export interface Codec {
  readonly name: string;
  readonly number: number;
  /** @throws {EncodeError} */
  encode(payload: unknown): Encoded;
  /** @throws {DecodeError} */
  decode(data: Buffer, extension: Extension): unknown;
}

const TOO_DEEP = `lists and maps are nested more than ${MAX_LEVELS} levels deep`;
const NULL = Buffer.from("null");

const json: Codec = {
  name: "json",
  number: 1,
  encode(payload) {
    let encoded: Encoded | undefined;
    try {
      encoded = encodeJson(payload);
    } catch (error) {
      throw new EncodeError(`The payload can't be encoded as JSON: ${(error as Error).message}`);
    }
    if (!encoded) throw new EncodeError(`A value of type "${typeof payload}" can't be encoded as JSON.`);
    const { data } = encoded;
    if (data.length > 2 * MAX_LEVELS && isTooDeep(payload))
      throw new EncodeError(`The payload can't be encoded: ${TOO_DEEP}.`);
    const nonFinite = data.includes(NULL) ? countNonFinite(payload) : 0;
    return { ...encoded, nonFinite };
  },
  decode(data) {
    let value: unknown;
    try {
      value = JSON.parse(data.toString("utf8"));
    } catch (error) {
      throw new DecodeError(`The payload of ${data.length} bytes is not valid JSON: ${(error as Error).message}`);
    }
    if (data.length > 2 * MAX_LEVELS && isTooDeep(value)) throw new DecodeError(`The JSON is rejected: ${TOO_DEEP}.`);
    return value;
  },
};

const string: Codec = {
  name: "string",
  number: 2,
  encode(payload) {
    if (typeof payload !== "string")
      throw new EncodeError(`A topic of type "string" takes strings, not "${typeof payload}".`);
    return { data: Buffer.from(payload, "utf8"), text: payload };
  },
  decode(data) {
    try {
      return decodeUtf8(data);
    } catch {
      throw new DecodeError(`The payload of ${data.length} bytes is not valid UTF-8.`);
    }
  },
};

const bytes: Codec = {
  name: "bytes",
  number: 3,
  encode(payload) {
    return { data: copyOf(payload) };
  },
  decode(data) {
    return shared(data);
  },
};

const msgpack: Codec = {
  name: "msgpack",
  number: 4,
  encode(payload) {
    if (isTooDeep(payload)) throw new EncodeError(`The payload can't be encoded: ${TOO_DEEP}.`);
    try {
      return { data: pack(withWideIntegers(payload)) };
    } catch (error) {
      throw new EncodeError(`The payload can't be encoded as msgpack: ${(error as Error).message}`);
    }
  },
  decode(data) {
    try {
      return unpack(data);
    } catch (error) {
      throw new DecodeError(`The payload of ${data.length} bytes is not valid msgpack: ${(error as Error).message}`);
    }
  },
};

const image: Codec = { name: "image", number: 5, encode: encodeImage, decode: decodeImage };

const CODECS: readonly Codec[] = [json, string, bytes, msgpack, image];

/** Return the codec of a message type: the one with that name, `image` for `images`, JSON otherwise. */
export function codecFor(msgType: string): Codec {
  const name = msgType === "images" ? "image" : msgType;
  return CODECS.find((each) => each.name === name) ?? json;
}

/** Return the codec with this wire number; undefined if there is none. */
export function codecNumbered(number: number): Codec | undefined {
  return CODECS[number - 1];
}

/** Return a copy of the bytes, so that the caller may reuse its buffer while the message is queued. */
export function copyOf(payload: unknown): Buffer {
  if (isShared(payload)) return payload;
  if (ArrayBuffer.isView(payload))
    return copied(new Uint8Array(payload.buffer, payload.byteOffset, payload.byteLength));
  if (payload instanceof ArrayBuffer || payload instanceof SharedArrayBuffer) return copied(new Uint8Array(payload));
  throw new EncodeError(
    `A topic of type "bytes" takes a Buffer, typed array or ArrayBuffer, not "${typeof payload}".`,
  );
}
