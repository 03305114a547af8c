// Tests of clock comparison, with simulated clocks.
import assert from "node:assert/strict";
import { test } from "node:test";
import { SAME_CLOCK, toldDifference } from "../dist/messages/clocks.js";
import { codecFor } from "../dist/messages/codecs.js";
import { Message } from "../dist/messages/message.js";
import { Sources } from "../dist/pubsub/loss.js";
import { ClockSamples } from "../dist/session/clock_samples.js";
import { nowNs } from "../dist/system/clock.js";
import { computerId } from "../dist/system/computer.js";

const MS = 1_000_000n;
const S = 1000n * MS;

/** Two simulated computers; the clock of the one with `samples` is `apartNs` ahead of the master's. */
class Pair {
  steadyNs = 5n * S;

  constructor(apartNs) {
    this.apartNs = apartNs;
    this.samples = new ClockSamples(
      () => this.masterNs + this.apartNs,
      () => this.steadyNs,
    );
  }

  get masterNs() {
    return 1_700_000_000n * S + this.steadyNs;
  }

  renew(thereNs, backNs) {
    const sent = this.samples.now();
    this.steadyNs += thereNs;
    const receivedNs = this.masterNs;
    this.steadyNs += backNs;
    return this.samples.add(sent, receivedNs, receivedNs);
  }

  /** Checks that the true offset is within the uncertainty; returns the uncertainty. */
  check() {
    const [offsetNs, uncertaintyNs] = this.samples.offset();
    const error = offsetNs + this.apartNs;
    assert.ok((error < 0n ? -error : error) <= uncertaintyNs, `${error} ± ${uncertaintyNs}`);
    return uncertaintyNs;
  }
}

test("the true offset is within the uncertainty of the fastest of eight renewals", () => {
  for (const apartNs of [0n, 3n * S, -(2n ** 60n)]) {
    const pair = new Pair(apartNs);
    assert.deepEqual(pair.samples.offset(), []);
    for (const [there, back] of [[40n, 2n], [0n, 90n], [1n, 1n], [90n, 5n]]) {
      assert.ok(pair.renew(there * MS, back * MS));
      pair.check();
      pair.steadyNs += S;
    }
    assert.ok(pair.check() < 3n * MS);
    for (let n = 0; n < 8; n++) pair.renew(100n * MS, 0n);
    assert.ok(pair.check() >= 50n * MS);
    pair.steadyNs += 10n ** 6n * S;
    assert.deepEqual(pair.samples.offset(), [], "too uncertain because of drift");
  }
});

test("samples are discarded when a clock is set", () => {
  const pair = new Pair(0n);
  pair.renew(MS, MS);
  pair.apartNs = 60n * S;
  assert.deepEqual(pair.samples.offset(), []);
  pair.renew(MS, MS);
  pair.check();
  const sent = pair.samples.now();
  assert.ok(pair.samples.add(sent, pair.masterNs - 3600n * S, pair.masterNs - 3600n * S), "the master's clock was set");
  pair.apartNs = 60n * S;
  assert.equal(pair.samples.offset()[0], -3660n * S);
  assert.ok(!pair.samples.add(pair.samples.now(), 5n, 4n), "reply before reception");
  assert.ok(!pair.samples.add(pair.samples.now(), 0n, S), "longer than the round trip");
});

test("message latency is corrected by the clock difference of the publisher's computer", () => {
  const sources = new Sources();
  const publisher = { id: 5n, topic: "t", endpoints: [], history: 0, nodeId: "n", nodeName: "name" };
  const { clock } = sources.listed({ ...publisher, computer: "elsewhere", endpoint: "tcp://10.0.0.1:1" });
  const stamped = () => new Message("t", Buffer.from("1"), codecFor("json"), "json", 1n, nowNs() - 60n * S, 5n, {}, false, clock);
  const near = (message, expected) => assert.ok(Math.abs(message.latencyS - expected) < 5, String(message.latencyS));
  near(stamped(), 60);
  assert.equal(stamped().latencyUncertaintyS, undefined);
  sources.correct(new Map([["n", toldDifference([60n * S, MS])]]));
  near(stamped(), 0);
  assert.ok(stamped().latencyUncertaintyS >= 0.001);
  assert.ok(stamped().latencyUncertaintyS < 0.1);
  sources.correct(new Map());
  near(stamped(), 60);
  assert.equal(sources.listed({ ...publisher, computer: computerId() }).clock.difference, SAME_CLOCK);
  for (const told of [[], [1n], [1n, -2n], [2n ** 64n, 1n], [0n, 30n * S], [1n, 2n, 3n]])
    assert.equal(toldDifference(told), undefined);
});

test("nowNs agrees with Date.now()", () => {
  for (let n = 0; n < 1000; n++) {
    const [before, now, after] = [Date.now(), nowNs(), Date.now()];
    assert.ok(Number(now / MS) >= before - 1 && Number(now / MS) <= after + 1);
  }
});
