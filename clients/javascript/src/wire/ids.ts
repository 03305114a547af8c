import { createHash, randomBytes } from "node:crypto";

/** Return a new random key: 32 hexadecimal digits. */
export function newKey(): string {
  return randomBytes(16).toString("hex");
}

/** Return the id of the node with this key: 16 hexadecimal digits. */
export function nodeIdFrom(key: string): string {
  return createHash("sha256").update(key, "utf8").digest("hex").slice(0, 16);
}

/** Return the id of a publisher or subscriber from the node's key and its number, counted from 1. */
export function idFrom(key: string, number: number | bigint): bigint {
  const digest = createHash("sha256").update(`${key}/${number}`, "utf8").digest();
  return digest.readBigUInt64LE(0) >> 1n || 1n;
}
