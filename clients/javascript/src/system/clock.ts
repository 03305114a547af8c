const MS = 1_000_000n;
const CHECK_NS = 20_000_000n;

let offsetNs = BigInt(Math.round(performance.timeOrigin * 1e6)) + BigInt(Math.round(performance.now() * 1e6)) - steadyNs();
let checkAtNs = 0n;

/** Return the time of a monotonic clock in nanoseconds. */
export function steadyNs(): bigint {
  return process.hrtime.bigint();
}

/**
 * Return the time in nanoseconds since 1970. `Date.now()` has a resolution of milliseconds, so this adds the steady
 * clock to an offset, which is updated when the computer's clock is set or adjusted.
 */
export function nowNs(): bigint {
  const now = steadyNs();
  if (now >= checkAtNs) {
    checkAtNs = now + CHECK_NS;
    const leastNs = BigInt(Date.now()) * MS - now; // the true offset is at most 1 ms larger
    if (offsetNs < leastNs) offsetNs = leastNs;
    else if (offsetNs > leastNs + MS) offsetNs = leastNs + MS;
  }
  return now + offsetNs;
}
