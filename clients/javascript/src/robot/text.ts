import { EncodeError } from "../errors.js";
import { codecFor } from "../messages/codecs.js";

const QUOTED = 200;
const MAX_ERROR = 1000;
// What moves a cursor, turns the direction of writing, hides, or is half a letter.
const CONTROLS = /[\u0000-\u001f\u007f-\u009f\u061c\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb]/gu;
const SURROGATES = /[\ud800-\udfff]/gu;

export type Members = Readonly<Record<string, unknown>>;

/** Return the value if it is an object with named members, else an empty one. */
export function asMembers(value: unknown): Members {
  return isMembers(value) ? value : {};
}

export function isMembers(value: unknown): value is Members {
  return typeof value === "object" && value !== null && !Array.isArray(value) && !ArrayBuffer.isView(value);
}

/** Return the text, or undefined for something else and for an empty one. */
export function textOf(value: unknown): string | undefined {
  return typeof value === "string" && value !== "" ? value : undefined;
}

export function hasSurrogates(text: string): boolean {
  return text.search(SURROGATES) >= 0;
}

/** Return a stranger's word or value as a sentence may quote it. */
export function quotable(value: unknown): string {
  let text: string | undefined;
  try {
    text = typeof value === "string" ? value : JSON.stringify(value);
  } catch {
    text = undefined;
  }
  return shortened(text ?? typeof value, QUOTED).replace(CONTROLS, escaped);
}

/** Return the sentence of an error, shortened. Never throws. */
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

/** Return the known word that is close to a wrong one, if any. */
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

/** @throws {EncodeError} for what no JSON message can hold. */
export function checkSendable(value: unknown): void {
  if (value !== undefined && !isMembers(value)) throw new EncodeError("These are no named values.");
  codecFor("json").encode(value ?? {});
}
