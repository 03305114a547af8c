/** Return a copy in memory that isn't zeroed before, as `Buffer.from` does: for 1 MB that takes longer than copying. */
export function copied(bytes: Uint8Array): Buffer {
  const copy = Buffer.allocUnsafe(bytes.length);
  copy.set(bytes);
  return copy;
}

const MIN_SHARED_BYTES = 65_536;
/** Large payloads as they were received: programs must not write into them, so they are published again without a copy. */
const received = new WeakSet<Buffer>();

/** Return the payload of a received message, marked for {@link isShared}. */
export function shared(data: Buffer): Buffer {
  if (data.length >= MIN_SHARED_BYTES) received.add(data);
  return data;
}

/** Whether these are the bytes of a received message, which nobody may write into. */
export function isShared(bytes: unknown): bytes is Buffer {
  return received.has(bytes as Buffer);
}
