import { BadTopicError, WireError } from "../errors.js";
import { isTooDeep } from "../messages/nesting.js";
import { codecNumbered } from "../messages/codecs.js";
import { isMap, pack, unpackWithTextKeys } from "../messages/packing.js";
import { readBatchBody } from "./batch.js";
import type { Extension } from "./extension.js";
import { decodeUtf8 } from "./utf8.js";
import {
  Flag,
  HEADER_BYTES,
  type Header,
  packHeader,
  readHeaderAt,
  readHeaderPart,
  VERSION,
  writeHeader,
} from "./header.js";
import { checkTopic } from "./names.js";

export const NO_EXTENSION: Extension = Object.freeze({});

/** Decoded message. */
export interface WireMessage {
  readonly header: Header;
  readonly payload: Buffer;
  readonly extension: Extension;
}

/** Return the topic part, which is also the filter of subscribers: the name and a zero byte. */
export function topicPart(topic: string): Buffer {
  return Buffer.from(`${topic}\0`, "utf8");
}

/** Encode the fourth part of a message. @throws {WireError} `extension` for a value that msgpack doesn't support. */
export function packExtension(extension: Extension): Buffer {
  try {
    return pack(extension);
  } catch (error) {
    throw new WireError("extension", `The extension can't be encoded: ${String(error)}`);
  }
}

/** Decode the fourth part of a message. @throws {WireError} `extension` */
export function readExtension(part: Buffer): Extension {
  let value: unknown;
  try {
    value = unpackWithTextKeys(part);
  } catch (error) {
    throw new WireError("extension", `The extension is not msgpack with text keys: ${String(error)}`);
  }
  if (!isMap(value)) throw new WireError("extension", "The extension is not a map.");
  if (isTooDeep(value)) throw new WireError("extension", "The extension is nested too deeply.");
  return value;
}

/** Return the parts of a message, with the flag EXTENSION if there is an extension. */
export function joinParts(topic: string, header: Header, payload: Buffer, extension?: Extension): Buffer[] {
  if (!extension || Object.keys(extension).length === 0) return [topicPart(topic), packHeader(header), payload];
  const flagged = { ...header, flags: header.flags | Flag.EXTENSION };
  return [topicPart(topic), packHeader(flagged), payload, packExtension(extension)];
}

/** Encode a message as one part. */
export function onePart(topic: Buffer, header: Header, payload: Buffer): Buffer {
  const part = Buffer.allocUnsafe(topic.length + HEADER_BYTES + payload.length);
  topic.copy(part, 0);
  writeHeader(part, topic.length, header);
  payload.copy(part, topic.length + HEADER_BYTES);
  return part;
}

/**
 * Fast path for a message in one part that is not split into three. Return undefined in all other cases, which
 * {@link splitParts} and {@link readRest} decode or reject.
 *
 * @param topic The topic part.
 */
export function readOnePart(topic: Buffer, part: Buffer): WireMessage | undefined {
  const at = topic.length;
  const start = at + HEADER_BYTES;
  if (part.length < start || part[at] !== VERSION) return undefined;
  for (let index = 0; index < at; index++) if (part[index] !== topic[index]) return undefined;
  const header = readHeaderAt(part, at);
  if (header.flags & (Flag.EXTENSION | Flag.BATCH) || !codecNumbered(header.codec)) return undefined;
  if (header.size !== 0 && header.size !== part.length - start) return undefined;
  return { header, payload: part.subarray(start), extension: NO_EXTENSION };
}

/** Split the parts of a message into the first one and the rest; one part counts as three. @throws {WireError} `part-count` */
export function splitParts(parts: readonly Buffer[]): { first: Buffer; rest: readonly Buffer[] } {
  const [first, ...rest] = parts;
  if (!first) throw new WireError("part-count", "A message has 3 or 4 parts, this one has none.");
  if (rest.length > 0) return { first, rest };
  const cut = first.indexOf(0) + 1;
  if (cut === 0 || first.length < cut + HEADER_BYTES) {
    throw new WireError("part-count", "A message has 3 or 4 parts, this one has 1.");
  }
  return {
    first: first.subarray(0, cut),
    rest: [first.subarray(cut, cut + HEADER_BYTES), first.subarray(cut + HEADER_BYTES)],
  };
}

/**
 * Decode the parts after the first one: one message, or those of a batch.
 *
 * @param isOnePart True if the message had one part, as batches have.
 * @throws {WireError} if docs/wire.md doesn't allow the message, in its order of checks.
 */
export function readRest(rest: readonly Buffer[], isOnePart: boolean): WireMessage[] {
  const [head, payload, packed] = rest;
  const header = readHeaderPart(head!);
  const expected = header.flags & Flag.EXTENSION ? 3 : 2;
  if (rest.length !== expected || !payload) {
    throw new WireError("part-count", `The message has ${rest.length + 1} parts, but its flags require ${expected + 1}.`);
  }
  const found =
    header.flags & Flag.BATCH ? readBatch(header, payload, isOnePart) : [readOne(header, payload, packed)];
  if (!codecNumbered(header.codec)) {
    throw new WireError(
      "codec",
      `The message has codec ${header.codec}, which this nep-js doesn't support. Update nep-js.`,
    );
  }
  return found;
}

function readOne(header: Header, payload: Buffer, packed: Buffer | undefined): WireMessage {
  if (header.size !== 0 && header.size !== payload.length) {
    throw new WireError("payload-size", `The header declares ${header.size} bytes, the payload has ${payload.length}.`);
  }
  return { header, payload, extension: packed ? readExtension(packed) : NO_EXTENSION };
}

function readBatch(header: Header, body: Buffer, isOnePart: boolean): WireMessage[] {
  if (!isOnePart || header.flags !== Flag.BATCH)
    throw new WireError("batch-form", "A batch must have one part and no other flags.");
  if (header.size !== body.length) {
    throw new WireError("payload-size", `The header declares ${header.size} bytes, the batch has ${body.length}.`);
  }
  return readBatchBody(body).map(({ stampNs, payload }, index) => ({
    header: { ...header, flags: 0, seq: header.seq + BigInt(index), stampNs, size: payload.length },
    payload,
    extension: NO_EXTENSION,
  }));
}

/** Decode the messages in `parts` and their topic. @throws {WireError} if docs/wire.md doesn't allow them. */
export function readParts(parts: readonly Buffer[]): { topic: string; messages: WireMessage[] } {
  const { first, rest } = splitParts(parts);
  return { topic: readTopicPart(first), messages: readRest(rest, parts.length === 1) };
}

function readTopicPart(part: Buffer): string {
  if (part[part.length - 1] !== 0) throw new WireError("topic-end", "The topic does not end with a zero byte.");
  try {
    return checkTopic(decodeUtf8(part.subarray(0, -1)));
  } catch (error) {
    if (error instanceof BadTopicError || error instanceof TypeError) throw new WireError("topic", error.message);
    throw error;
  }
}
