/** How the clocks of two computers differ, and how surely that is known. */
import { steadyNs } from "../system/clock.js";

const MAX_OFFSET_NS = 2n ** 62n;
export const MAX_UNCERTAINTY_NS = 10_000_000_000n;
const DRIFT_PARTS = 20_000n; // clocks that nobody sets drift apart by one part of so many at most

/** What to add to times of another clock for those of this computer's, in nanoseconds. */
export interface ClockDifference {
  readonly addNs: bigint;
  readonly uncertaintyNs: bigint;
  /** When that was so, by the steady clock; undefined: both are the same clock. */
  readonly knownAtNs: bigint | undefined;
}

export const SAME_CLOCK: ClockDifference = { addNs: 0n, uncertaintyNs: 0n, knownAtNs: undefined };

/** Return how far two clocks may have drifted apart. */
export function driftNs(elapsedNs: bigint): bigint {
  return elapsedNs > 0n ? elapsedNs / DRIFT_PARTS : 0n;
}

/** The clock of a publisher: `difference` changes while its messages are kept, and is undefined while unknown. */
export interface PublisherClock {
  difference: ClockDifference | undefined;
}

/** Return the difference that a master tells; undefined for what no clock can be. */
export function toldDifference([addNs, uncertaintyNs, ...more]: readonly bigint[]): ClockDifference | undefined {
  if (addNs === undefined || uncertaintyNs === undefined || more.length > 0) return undefined;
  return isClock(addNs / 2n, uncertaintyNs / 2n) ? { addNs, uncertaintyNs, knownAtNs: steadyNs() } : undefined;
}

/** Whether a clock can be so wrong, known so surely. */
export function isClock(offsetNs: bigint, uncertaintyNs: bigint): boolean {
  return abs(offsetNs) <= MAX_OFFSET_NS && uncertaintyNs >= 0n && uncertaintyNs <= MAX_UNCERTAINTY_NS;
}

export function abs(value: bigint): bigint {
  return value < 0n ? -value : value;
}
