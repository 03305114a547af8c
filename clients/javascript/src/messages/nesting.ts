/** Maximum nesting depth of lists and maps in a payload; deeper ones are rejected by sender and receiver. */
export const MAX_LEVELS = 64;

/** Return true if lists and maps are nested more than {@link MAX_LEVELS} deep. */
export function isTooDeep(value: unknown, levels = MAX_LEVELS): boolean {
  if (value === null || typeof value !== "object" || ArrayBuffer.isView(value)) return false;
  if (levels === 0) return true;
  if (Array.isArray(value)) {
    for (const each of value) if (typeof each === "object" && isTooDeep(each, levels - 1)) return true;
    return false;
  }
  for (const key in value) {
    const each = (value as Record<string, unknown>)[key];
    if (typeof each === "object" && isTooDeep(each, levels - 1)) return true;
  }
  return false;
}

/** Count NaN and infinite numbers in lists and maps. JSON has neither; they are encoded as `null`. */
export function countNonFinite(value: unknown, levels = MAX_LEVELS): number {
  if (typeof value === "number") return Number.isFinite(value) ? 0 : 1;
  if (value === null || typeof value !== "object" || levels === 0) return 0;
  let count = 0;
  for (const each of Array.isArray(value) ? value : Object.values(value)) {
    if (typeof each === "number" || typeof each === "object") count += countNonFinite(each, levels - 1);
  }
  return count;
}
