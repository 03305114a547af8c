// The test vectors that all languages share: tests/data/wire of the repository.
import { readFileSync } from "node:fs";

const FOLDER = new URL("../../../../tests/data/wire/", import.meta.url);

export function vectors(name) {
  return JSON.parse(readFileSync(new URL(`${name}.json`, FOLDER), "utf8"));
}

export function bytes(hexadecimal) {
  return Buffer.from(hexadecimal, "hex");
}

/** Integers as text, as the vectors have them. */
export function integersAsText(value) {
  if (typeof value === "bigint" || Number.isInteger(value)) return String(value);
  if (Array.isArray(value)) return value.map(integersAsText);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, integersAsText(each)]));
}

/** The code of the error that `action` throws; undefined when it throws none. */
export function codeOf(action) {
  try {
    action();
  } catch (error) {
    return error.code ?? String(error);
  }
  return undefined;
}
