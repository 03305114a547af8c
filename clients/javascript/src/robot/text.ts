import { EncodeError } from "../errors.js";
import { codecFor } from "../messages/codecs.js";

const QUOTED = 200;
const MAX_ERROR = 1000;
// Characters that move the cursor, change the writing direction or are invisible.
const CONTROLS = /[\u0000-\u001f\u007f-\u009f\u061c\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb]/gu;
const SURROGATES = /[\ud800-\udfff]/gu;

export type Members = Readonly<Record<string, unknown>>;

/** Return the value if it is an object with named members, otherwise an empty object. */
export function asMembers(value: unknown): Members {
  return isMembers(value) ? value : {};
}

export function isMembers(value: unknown): value is Members {
  return typeof value === "object" && value !== null && !Array.isArray(value) && !ArrayBuffer.isView(value);
}

/** Return a nonempty string; undefined for other values. */
export function textOf(value: unknown): string | undefined {
  return typeof value === "string" && value !== "" ? value : undefined;
}

export function hasSurrogates(text: string): boolean {
  return text.search(SURROGATES) >= 0;
}

/** Return an untrusted value as text that can be quoted in a message: shortened, without control characters. */
export function quotable(value: unknown): string {
  let text: string | undefined;
  try {
    text = typeof value === "string" ? value : JSON.stringify(value);
  } catch {
    text = undefined;
  }
  return shortened(text ?? typeof value, QUOTED).replace(CONTROLS, escaped);
}

/** Return the message of an error, shortened. Never throws. */
export function errorText(error: unknown): string {
  try {
    const text = error instanceof Error ? error.message || error.name : String(error);
    return shortened(text, MAX_ERROR);
  } catch {
    return "unknown error";
  }
}

function shortened(text: string, most: number): string {
  return (text.length > most ? `${text.slice(0, most)}…` : text).replace(SURROGATES, escaped);
}

function escaped(character: string): string {
  return `\\u${character.charCodeAt(0).toString(16).padStart(4, "0")}`;
}

/** Return the known word that is most similar to a wrong one, if any. */
export function nearMiss(wrong: string, known: Iterable<string>): string | undefined {
  if (wrong.length > 100) return undefined;
  let best: string | undefined;
  let least = Math.max(1, Math.floor(wrong.length / 3)) + 1;
  for (const each of known) {
    const distance = editDistance(wrong, each);
    if (distance < least) [best, least] = [each, distance];
  }
  return best;
}

function editDistance(a: string, b: string): number {
  let row = Array.from({ length: b.length + 1 }, (_, at) => at);
  for (let i = 1; i <= a.length; i++) {
    const next = [i];
    for (let j = 1; j <= b.length; j++) {
      const changed = row[j - 1]! + (a[i - 1] === b[j - 1] ? 0 : 1);
      next.push(Math.min(changed, row[j]! + 1, next[j - 1]! + 1));
    }
    row = next;
  }
  return row[b.length]!;
}

/** @throws {EncodeError} if a value can't be encoded as an object in JSON. */
export function checkSendable(value: unknown): void {
  if (value !== undefined && !isMembers(value)) throw new EncodeError("The value must be an object with named values.");
  codecFor("json").encode(value ?? {});
}
