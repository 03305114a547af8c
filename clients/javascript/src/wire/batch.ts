import { WireError } from "../errors.js";
import { Flag, HEADER_BYTES, type Header, writeHeader } from "./header.js";

export const MAX_BATCH = 256;

/** Message of a batch. */
export interface BatchEntry {
  readonly stampNs: bigint;
  readonly payload: Buffer;
}

/**
 * Encode several messages of one publisher as one part.
 *
 * @param topic The topic part.
 * @param first Codec, publisher and seq of the first message; the others have consecutive seqs.
 * @param entries 1 to 256 messages.
 */
export function packBatch(
  topic: Buffer,
  first: Pick<Header, "codec" | "seq" | "publisher">,
  entries: readonly BatchEntry[],
): Buffer {
  const tableBytes = 4 + 12 * entries.length;
  const size = entries.reduce((sum, each) => sum + each.payload.length, tableBytes);
  const part = Buffer.allocUnsafe(topic.length + HEADER_BYTES + size);
  topic.copy(part, 0);
  writeHeader(part, topic.length, { ...first, flags: Flag.BATCH, size, stampNs: entries[0]!.stampNs });
  let at = topic.length + HEADER_BYTES;
  at = part.writeUInt32LE(entries.length, at);
  for (const each of entries) at = part.writeUInt32LE(each.payload.length, at);
  for (const each of entries) at = part.writeBigUInt64LE(each.stampNs, at);
  for (const each of entries) at += each.payload.copy(part, at);
  return part;
}

/** Decode the messages after the header of a batch. @throws {WireError} */
export function readBatchBody(body: Buffer): BatchEntry[] {
  const count = body.length >= 4 ? body.readUInt32LE(0) : 0;
  if (count < 1 || count > MAX_BATCH) {
    throw new WireError("batch-count", `A batch has 1 to ${MAX_BATCH} messages, this one has ${count}.`);
  }
  let at = 4 + 12 * count;
  if (body.length < at) throw new WireError("batch-table", "The batch ends within its table.");
  const entries: BatchEntry[] = [];
  for (let index = 0; index < count; index++) {
    const end = at + body.readUInt32LE(4 + 4 * index);
    if (end > body.length) break;
    const stampNs = body.readBigUInt64LE(4 + 4 * count + 8 * index);
    entries.push({ stampNs, payload: body.subarray(at, end) });
    at = end;
  }
  if (entries.length !== count || at !== body.length) {
    throw new WireError("batch-sizes", "The sizes of the batch's messages don't match its table.");
  }
  return entries;
}
