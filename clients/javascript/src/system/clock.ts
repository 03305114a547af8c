const RESET_NS = 2_000_000n;
const CHECK_NS = 1_000_000_000n;

let offsetNs = BigInt(Date.now()) * 1_000_000n - process.hrtime.bigint();
let checkAtNs = process.hrtime.bigint() + CHECK_NS;

/**
 * Return the time in nanoseconds since 1970. `Date.now()` has milliseconds only, so this adds the steady clock
 * to an offset, which follows when somebody sets the computer's clock.
 */
export function nowNs(): bigint {
  const steadyNs = process.hrtime.bigint();
  if (steadyNs >= checkAtNs) {
    checkAtNs = steadyNs + CHECK_NS;
    const exactNs = BigInt(Date.now()) * 1_000_000n - steadyNs;
    const driftNs = exactNs - offsetNs;
    if (driftNs > RESET_NS || driftNs < -RESET_NS) offsetNs = exactNs;
  }
  return steadyNs + offsetNs;
}
