/** Return a copy in uninitialized memory: zeroing 1 MB, as `Buffer.from` does, takes longer than copying it. */
export function copied(bytes: Uint8Array): Buffer {
  const copy = Buffer.allocUnsafe(bytes.length);
  copy.set(bytes);
  return copy;
}

const MIN_SHARED_BYTES = 65_536;
/** Large received payloads. Programs must not modify them, so they are republished without a copy. */
const received = new WeakSet<Buffer>();

/** Return the payload of a received message, marked for {@link isShared}. */
export function shared(data: Buffer): Buffer {
  if (data.length >= MIN_SHARED_BYTES) received.add(data);
  return data;
}

/** Return true if the bytes are the payload of a received message, which must not be modified. */
export function isShared(bytes: unknown): bytes is Buffer {
  return received.has(bytes as Buffer);
}
