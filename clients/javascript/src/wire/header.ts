import { WireError } from "../errors.js";

export const VERSION = 1;
export const HEADER_BYTES = 32;
export const MAX_SIZE = 2 ** 32 - 1;

/** Bits of {@link Header.flags}. */
export const Flag = {
  /** The publisher keeps this message and sends it to late subscribers. */
  LATCHED: 1,
  /** A fourth part follows: a msgpack map. */
  EXTENSION: 2,
  /** Of notices: the publisher closes and has sent everything. */
  BYE: 4,
  /** The part holds several messages. */
  BATCH: 8,
  /** The payload lies in shared memory. */
  SHARED: 16,
  /** Of notices: payloads may lie in shared memory. */
  OFFER: 32,
} as const;

/** Second part of a message. */
export interface Header {
  readonly codec: number;
  readonly flags: number;
  /** Counts the publisher's messages from 1. */
  readonly seq: bigint;
  /** The publisher's clock, nanoseconds since 1970. */
  readonly stampNs: bigint;
  /** The publisher's id. */
  readonly publisher: bigint;
  /** Payload size in bytes; 0 if unknown. */
  readonly size: number;
}

/** Write a header into `buffer` at `offset`. A size beyond 32 bits is written as 0 ("unknown"). */
export function writeHeader(buffer: Buffer, offset: number, header: Header): void {
  buffer[offset] = VERSION;
  buffer[offset + 1] = header.codec;
  buffer.writeUInt16LE(header.flags, offset + 2);
  buffer.writeUInt32LE(header.size <= MAX_SIZE ? header.size : 0, offset + 4);
  buffer.writeBigUInt64LE(header.seq, offset + 8);
  buffer.writeBigUInt64LE(header.stampNs, offset + 16);
  buffer.writeBigUInt64LE(header.publisher, offset + 24);
}

/** Return the 32 bytes of a header. */
export function packHeader(header: Header): Buffer {
  const packed = Buffer.allocUnsafe(HEADER_BYTES);
  writeHeader(packed, 0, header);
  return packed;
}

/** Read a header from its part. @throws {WireError} `header-size`, or `version` for another version than ours. */
export function readHeaderPart(part: Buffer): Header {
  if (part.length !== HEADER_BYTES) {
    throw new WireError("header-size", `A header has ${HEADER_BYTES} bytes, this one has ${part.length}.`);
  }
  const version = part[0];
  if (version !== VERSION) {
    throw new WireError(
      "version",
      `The message has version ${version}; this nep-js reads version ${VERSION}. Update nep-js.`,
    );
  }
  return {
    codec: part[1]!,
    flags: part.readUInt16LE(2),
    size: part.readUInt32LE(4),
    seq: part.readBigUInt64LE(8),
    stampNs: part.readBigUInt64LE(16),
    publisher: part.readBigUInt64LE(24),
  };
}
