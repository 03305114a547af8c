import { WireError } from "../errors.js";

export const VERSION = 1;
export const HEADER_BYTES = 32;
export const MAX_SIZE = 2 ** 32 - 1;

/** Bits of {@link Header.flags}. */
export const Flag = {
  /** The publisher keeps the message for late subscribers. */
  LATCHED: 1,
  /** A fourth part follows: a msgpack map. */
  EXTENSION: 2,
  /** In notices: the publisher is closing and sends no more messages. */
  BYE: 4,
  /** The part contains several messages. */
  BATCH: 8,
  /** The payload is in shared memory. */
  SHARED: 16,
  /** In notices: the publisher offers shared memory. */
  OFFER: 32,
} as const;

/** Second part of a message. */
export interface Header {
  readonly codec: number;
  readonly flags: number;
  /** Sequence number, counted from 1 by the publisher. */
  readonly seq: bigint;
  /** Time by the publisher's clock, in nanoseconds since 1970. */
  readonly stampNs: bigint;
  /** The publisher's id. */
  readonly publisher: bigint;
  /** Payload size in bytes; 0 if unknown. */
  readonly size: number;
}

// Buffer's methods for 64-bit numbers process single bytes with bigints; DataView's compile to one load or store.
const scratch = new Uint8Array(HEADER_BYTES);
const scratchView = new DataView(scratch.buffer);

/** Write a header to `buffer` at `offset`. A size beyond 32 bits is written as 0 (unknown). */
export function writeHeader(buffer: Buffer, offset: number, header: Header): void {
  scratch[0] = VERSION;
  scratch[1] = header.codec;
  scratchView.setUint16(2, header.flags, true);
  scratchView.setUint32(4, header.size <= MAX_SIZE ? header.size : 0, true);
  scratchView.setBigUint64(8, header.seq, true);
  scratchView.setBigUint64(16, header.stampNs, true);
  scratchView.setBigUint64(24, header.publisher, true);
  for (let index = 0; index < HEADER_BYTES; index++) buffer[offset + index] = scratch[index]!;
}

/** Return the 32 bytes of a header. */
export function packHeader(header: Header): Buffer {
  const packed = Buffer.allocUnsafe(HEADER_BYTES);
  writeHeader(packed, 0, header);
  return packed;
}

/** Read a header from its part. @throws {WireError} `header-size`, or `version` for an unsupported version. */
export function readHeaderPart(part: Buffer): Header {
  if (part.length !== HEADER_BYTES) {
    throw new WireError("header-size", `A header has ${HEADER_BYTES} bytes, this one has ${part.length}.`);
  }
  const version = part[0];
  if (version !== VERSION) {
    throw new WireError(
      "version",
      `The message has version ${version}; this nep-js supports version ${VERSION}. Update nep-js.`,
    );
  }
  return readHeaderAt(part, 0);
}

/** Read the header at `offset`; the caller has checked its size and version. */
export function readHeaderAt(part: Buffer, offset: number): Header {
  for (let index = 0; index < HEADER_BYTES; index++) scratch[index] = part[offset + index]!;
  return {
    codec: scratch[1]!,
    flags: scratchView.getUint16(2, true),
    size: scratchView.getUint32(4, true),
    seq: scratchView.getBigUint64(8, true),
    stampNs: scratchView.getBigUint64(16, true),
    publisher: scratchView.getBigUint64(24, true),
  };
}
