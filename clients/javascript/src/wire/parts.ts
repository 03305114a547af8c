import { BadTopicError, WireError } from "../errors.js";
import { isTooDeep } from "../messages/nesting.js";
import { pack, unpack } from "../messages/packing.js";
import { Flag, HEADER_BYTES, type Header, packHeader, readHeaderPart, writeHeader } from "./header.js";
import { checkTopic } from "./names.js";

/** Named values that travel beside a payload, such as an image's shape. */
export type Extension = Readonly<Record<string, unknown>>;

export const NO_EXTENSION: Extension = Object.freeze({});

/** A message as read from its parts. */
export interface WireMessage {
  readonly topic: string;
  readonly header: Header;
  readonly payload: Buffer;
  readonly extension: Extension;
}

const utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

/** Decode UTF-8 strictly. @throws {TypeError} if it is not UTF-8. */
export function decodeUtf8(bytes: Uint8Array): string {
  return utf8.decode(bytes);
}

/** First part of a topic's messages and the filter of its subscribers: the name and a zero byte. */
export function topicPart(topic: string): Buffer {
  return Buffer.from(`${topic}\0`, "utf8");
}

/** Encode the fourth part of a message. @throws {WireError} `extension` for a value without a msgpack form. */
export function packExtension(extension: Extension): Buffer {
  try {
    return pack(extension);
  } catch (error) {
    throw new WireError("extension", `The extension can't be packed: ${String(error)}`);
  }
}

/** Read the fourth part of a message. @throws {WireError} `extension` */
export function readExtension(part: Buffer): Extension {
  let value: unknown;
  try {
    value = unpack(part);
  } catch (error) {
    throw new WireError("extension", `The extension is no msgpack: ${String(error)}`);
  }
  if (value === null || typeof value !== "object" || Array.isArray(value) || value instanceof Uint8Array || value instanceof Date) {
    throw new WireError("extension", "The extension is no map.");
  }
  if (isTooDeep(value)) throw new WireError("extension", "The extension is nested too deeply.");
  return value as Extension;
}

/** Return the parts of a message; sets the flag EXTENSION if there is an extension. */
export function joinParts(topic: string, header: Header, payload: Buffer, extension?: Extension): Buffer[] {
  if (!extension || Object.keys(extension).length === 0) return [topicPart(topic), packHeader(header), payload];
  const flagged = { ...header, flags: header.flags | Flag.EXTENSION };
  return [topicPart(topic), packHeader(flagged), payload, packExtension(extension)];
}

/** Return a message in one part. */
export function onePart(topic: Buffer, header: Header, payload: Buffer): Buffer {
  const part = Buffer.allocUnsafe(topic.length + HEADER_BYTES + payload.length);
  topic.copy(part, 0);
  writeHeader(part, topic.length, header);
  payload.copy(part, topic.length + HEADER_BYTES);
  return part;
}

/** Split a message of one part into topic, header and payload. @throws {WireError} `part-count` if it is too short. */
export function splitOnePart(part: Buffer): [Buffer, Buffer, Buffer] {
  const cut = part.indexOf(0) + 1;
  if (cut === 0 || part.length < cut + HEADER_BYTES) {
    throw new WireError("part-count", "A message has 3 or 4 parts, this one has 1.");
  }
  return [part.subarray(0, cut), part.subarray(cut, cut + HEADER_BYTES), part.subarray(cut + HEADER_BYTES)];
}

/**
 * Read header, payload and extension of a message from the parts after the first.
 *
 * @throws {WireError} for everything that docs/wire.md does not allow.
 */
export function readRest(rest: readonly Buffer[]): Omit<WireMessage, "topic"> {
  const [head, payload, packed] = rest;
  if (!head) throw new WireError("part-count", "A message has 3 or 4 parts, this one has 1.");
  const header = readHeaderPart(head);
  const expected = header.flags & Flag.EXTENSION ? 3 : 2;
  if (rest.length !== 2 && rest.length !== 3) {
    throw new WireError("part-count", `A message has 3 or 4 parts, this one has ${rest.length + 1}.`);
  }
  if (rest.length !== expected || !payload) {
    throw new WireError("part-count", `The flags ask for ${expected + 1} parts, there are ${rest.length + 1}.`);
  }
  if (header.size !== 0 && header.size !== payload.length) {
    throw new WireError("payload-size", `The header says ${header.size} bytes, the payload has ${payload.length}.`);
  }
  return { header, payload, extension: packed ? readExtension(packed) : NO_EXTENSION };
}

/** Read a message from its parts. @throws {WireError} for everything that docs/wire.md does not allow. */
export function readParts(parts: readonly Buffer[]): WireMessage {
  if (parts.length === 0) throw new WireError("part-count", "A message has 3 or 4 parts, this one has none.");
  const [first, ...rest] = parts.length === 1 ? splitOnePart(parts[0]!) : parts;
  const read = readRest(rest);
  return { topic: readTopicPart(first!), ...read };
}

function readTopicPart(part: Buffer): string {
  if (part[part.length - 1] !== 0) throw new WireError("topic", "The topic does not end with a zero byte.");
  try {
    return checkTopic(decodeUtf8(part.subarray(0, -1)));
  } catch (error) {
    if (error instanceof BadTopicError || error instanceof TypeError) throw new WireError("topic", error.message);
    throw error;
  }
}
