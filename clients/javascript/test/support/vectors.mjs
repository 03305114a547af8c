// Test vectors shared by all languages: tests/data/wire of the repository.
import { readFileSync } from "node:fs";

const FOLDER = new URL("../../../../tests/data/wire/", import.meta.url);

export function vectors(name) {
  return JSON.parse(readFileSync(new URL(`${name}.json`, FOLDER), "utf8"));
}

export function bytes(hexadecimal) {
  return Buffer.from(hexadecimal, "hex");
}

/** Converts integers to text, as in the vectors. */
export function integersAsText(value) {
  if (typeof value === "bigint" || Number.isInteger(value)) return String(value);
  if (Array.isArray(value)) return value.map(integersAsText);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, integersAsText(each)]));
}

/** Returns the code of the error thrown by `action`, or undefined. */
export function codeOf(action) {
  try {
    action();
  } catch (error) {
    return error.code ?? String(error);
  }
  return undefined;
}
