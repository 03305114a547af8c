/** Return a copy in memory that isn't zeroed before, as `Buffer.from` does: for 1 MB that takes longer than copying. */
export function copied(bytes: Uint8Array): Buffer {
  const copy = Buffer.allocUnsafe(bytes.length);
  copy.set(bytes);
  return copy;
}
