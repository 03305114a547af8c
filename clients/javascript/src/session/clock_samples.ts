/** Comparison of this computer's clock with the master's, from the times in renewals: docs/wire.md, *Clocks*. No sockets. */
import { abs, driftNs, isClock, MAX_UNCERTAINTY_NS } from "../messages/clocks.js";
import { nowNs, steadyNs } from "../system/clock.js";

const MAX_SAMPLES = 8;
const SLEW_PARTS = 2000n; // a clock adjusted by slewing deviates by at most 1/2000
const STEP_NS = 50_000n;
const RESOLUTION_NS = 1_000_000n; // of Date.now(), on which nowNs() is based

/** A moment by both clocks; `slackNs` is the maximum difference between the two readings. */
export interface Moment {
  readonly wallNs: bigint;
  readonly steadyNs: bigint;
  readonly slackNs: bigint;
}

interface Sample {
  readonly offsetNs: bigint;
  readonly uncertaintyNs: bigint;
  readonly steadyNs: bigint;
}

/** Estimator of the offset from this computer's clock to the master's, as in NTP. */
export class ClockSamples {
  private samples: Sample[] = [];
  private seen: Moment | undefined;

  constructor(
    private readonly wall = nowNs,
    private readonly steady = steadyNs,
  ) {}

  /** Return the current moment. Discards all samples if this computer's clock was set since the last call. */
  now(): Moment {
    const before = this.steady();
    const wallNs = this.wall();
    const after = this.steady();
    const moment = { wallNs, steadyNs: (before + after) / 2n, slackNs: (after - before) / 2n + 1n };
    if (this.seen && !fits(this.seen, moment)) this.forget();
    this.seen = moment;
    return moment;
  }

  /**
   * Add a sample when the reply to a renewal is received. Return false if it is invalid.
   *
   * @param sent When the renewal was sent.
   * @param receivedNs When the master received it, by the master's clock.
   * @param answeredNs When the master replied, by the master's clock.
   */
  add(sent: Moment, receivedNs: bigint, answeredNs: bigint): boolean {
    const now = this.now();
    const awayNs = now.steadyNs - sent.steadyNs - (answeredNs - receivedNs);
    const slackNs = now.slackNs + sent.slackNs;
    if (answeredNs < receivedNs || awayNs < -slackNs || !fits(sent, now)) return false;
    const offsetNs = (receivedNs - sent.wallNs + answeredNs - now.wallNs) / 2n;
    const uncertaintyNs = (awayNs > 0n ? awayNs : 0n) / 2n + RESOLUTION_NS + slackNs;
    if (!isClock(offsetNs, uncertaintyNs)) return false;
    const best = this.best(now.steadyNs);
    if (best && abs(offsetNs - best.offsetNs) > uncertaintyNs + uncertaintyAt(best, now.steadyNs)) this.forget(); // contradiction: the master's clock was set
    this.samples.push({ offsetNs, uncertaintyNs, steadyNs: now.steadyNs });
    if (this.samples.length > MAX_SAMPLES) this.samples.shift();
    return true;
  }

  /** Return offset and uncertainty for a renewal; empty if unknown. */
  offset(): readonly bigint[] {
    const { steadyNs: now } = this.now();
    const best = this.best(now);
    if (!best) return [];
    const uncertaintyNs = uncertaintyAt(best, now);
    return uncertaintyNs > MAX_UNCERTAINTY_NS ? [] : [best.offsetNs, uncertaintyNs];
  }

  /** Discard all samples: another master may have another clock. */
  forget(): void {
    this.samples = [];
  }

  private best(now: bigint): Sample | undefined {
    let best: Sample | undefined;
    for (const each of this.samples)
      if (!best || uncertaintyAt(each, now) < uncertaintyAt(best, now)) best = each;
    return best;
  }
}

function uncertaintyAt(sample: Sample, now: bigint): bigint {
  return sample.uncertaintyNs + driftNs(now - sample.steadyNs);
}

/** Return true if both clocks advanced by the same time between two moments. */
function fits(then: Moment, now: Moment): boolean {
  const bySteady = now.steadyNs - then.steadyNs;
  const allowed = STEP_NS + then.slackNs + now.slackNs + 2n * RESOLUTION_NS;
  return abs(now.wallNs - then.wallNs - bySteady) <= allowed + (bySteady > 0n ? bySteady : 0n) / SLEW_PARTS;
}
