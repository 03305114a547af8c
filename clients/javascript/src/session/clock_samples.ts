/** Compares this computer's clock with the master's, by the times in renewals: docs/wire.md, *Clocks*. No sockets. */
import { abs, driftNs, isClock, MAX_UNCERTAINTY_NS } from "../messages/clocks.js";
import { nowNs, steadyNs } from "../system/clock.js";

const MAX_SAMPLES = 8;
const SLEW_PARTS = 2000n; // a clock that is adjusted slowly changes by one part of so many
const STEP_NS = 50_000n;
const RESOLUTION_NS = 1_000_000n; // of Date.now(), which nowNs() follows

/** One moment by both clocks; `slackNs` is how long it took to read them. */
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

/** Knows what to add to this computer's time for the master's, as NTP does. */
export class ClockSamples {
  private samples: Sample[] = [];
  private seen: Moment | undefined;

  constructor(
    private readonly wall = nowNs,
    private readonly steady = steadyNs,
  ) {}

  /** Return this moment. Everything is forgotten if this computer's clock was set since the last one. */
  now(): Moment {
    const before = this.steady();
    const wallNs = this.wall();
    const after = this.steady();
    const moment = { wallNs, steadyNs: (before + after) / 2n, slackNs: (after - before) / 2n + 1n };
    if (this.seen && !fits(this.seen, moment)) this.forget();
    this.seen = moment;
    return moment;
  }

  /** A renewal that was sent at `sent` was received and answered at these times, and the answer is here. */
  add(sent: Moment, receivedNs: bigint, answeredNs: bigint): boolean {
    const now = this.now();
    const awayNs = now.steadyNs - sent.steadyNs - (answeredNs - receivedNs);
    const slackNs = now.slackNs + sent.slackNs;
    if (answeredNs < receivedNs || awayNs < -slackNs || !fits(sent, now)) return false;
    const offsetNs = (receivedNs - sent.wallNs + answeredNs - now.wallNs) / 2n;
    const uncertaintyNs = (awayNs > 0n ? awayNs : 0n) / 2n + RESOLUTION_NS + slackNs;
    if (!isClock(offsetNs, uncertaintyNs)) return false;
    const best = this.best(now.steadyNs);
    if (best && abs(offsetNs - best.offsetNs) > uncertaintyNs + uncertaintyAt(best, now.steadyNs)) this.forget(); // both can't be true
    this.samples.push({ offsetNs, uncertaintyNs, steadyNs: now.steadyNs });
    if (this.samples.length > MAX_SAMPLES) this.samples.shift();
    return true;
  }

  /** Return offset and uncertainty for a renewal; empty if they are unknown. */
  offset(): readonly bigint[] {
    const { steadyNs: now } = this.now();
    const best = this.best(now);
    if (!best) return [];
    const uncertaintyNs = uncertaintyAt(best, now);
    return uncertaintyNs > MAX_UNCERTAINTY_NS ? [] : [best.offsetNs, uncertaintyNs];
  }

  /** Forget all samples: another master may have another clock. */
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

/** Whether both clocks went on by as much between two moments. */
function fits(then: Moment, now: Moment): boolean {
  const bySteady = now.steadyNs - then.steadyNs;
  const allowed = STEP_NS + then.slackNs + now.slackNs + 2n * RESOLUTION_NS;
  return abs(now.wallNs - then.wallNs - bySteady) <= allowed + (bySteady > 0n ? bySteady : 0n) / SLEW_PARTS;
}
