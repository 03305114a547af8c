/** Offset between the clocks of two computers, with its uncertainty. */
import { steadyNs } from "../system/clock.js";

const MAX_OFFSET_NS = 2n ** 62n;
export const MAX_UNCERTAINTY_NS = 10_000_000_000n;
const DRIFT_PARTS = 20_000n; // unsynchronized clocks drift apart by at most 1/20000 (50 ppm)

/** Offset that converts times of another clock to this computer's clock, in nanoseconds. */
export interface ClockDifference {
  readonly addNs: bigint;
  readonly uncertaintyNs: bigint;
  /** Time of the measurement by the steady clock; undefined if both are the same clock. */
  readonly knownAtNs: bigint | undefined;
}

export const SAME_CLOCK: ClockDifference = { addNs: 0n, uncertaintyNs: 0n, knownAtNs: undefined };

/** Return the maximum drift between two clocks after a time. */
export function driftNs(elapsedNs: bigint): bigint {
  return elapsedNs > 0n ? elapsedNs / DRIFT_PARTS : 0n;
}

/** Clock of a publisher. `difference` is updated while its messages are stored; undefined while unknown. */
export interface PublisherClock {
  difference: ClockDifference | undefined;
}

/** Return the difference reported by a master; undefined if it is malformed or out of range. */
export function toldDifference([addNs, uncertaintyNs, ...more]: readonly bigint[]): ClockDifference | undefined {
  if (addNs === undefined || uncertaintyNs === undefined || more.length > 0) return undefined;
  return isClock(addNs / 2n, uncertaintyNs / 2n) ? { addNs, uncertaintyNs, knownAtNs: steadyNs() } : undefined;
}

/** Return true if a clock offset and its uncertainty are within the valid range. */
export function isClock(offsetNs: bigint, uncertaintyNs: bigint): boolean {
  return abs(offsetNs) <= MAX_OFFSET_NS && uncertaintyNs >= 0n && uncertaintyNs <= MAX_UNCERTAINTY_NS;
}

export function abs(value: bigint): bigint {
  return value < 0n ? -value : value;
}
