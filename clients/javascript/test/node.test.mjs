// Tests of the API with a master.
import assert from "node:assert/strict";
import { once } from "node:events";
import { test } from "node:test";
import { Publisher, Pull } from "zeromq";
import * as nep from "../dist/index.mjs";
import { hasMaster } from "./support/master.mjs";

const { Node } = nep;

/** Returns a node that is closed at the end of the test: an open subscription would keep the process alive. */
function opened(t, name, options) {
  const node = new Node(name, options);
  t.after(() => node.close());
  return node;
}

process.on("unhandledRejection", (reason) => {
  throw new Error(`unhandled rejection: ${reason}`);
});

test("leaving the loop over a subscription closes it", hasMaster, async (t) => {
  const node = opened(t, "iterating");
  const publisher = await node.publisher("iterated");
  const subscriber = node.subscribe("iterated");
  await subscriber.ready;
  for (let n = 1; n <= 5; n++) publisher.publish({ n });
  const received = [];
  for await (const message of subscriber) {
    received.push(message.payload.n);
    if (received.length === 5) break;
  }
  assert.deepEqual(received, [1, 2, 3, 4, 5]);
  assert.ok(subscriber.isClosed);
  await node.close();
});

test("a signal ends the loop", hasMaster, async (t) => {
  const node = opened(t, "aborting");
  const controller = new AbortController();
  const subscriber = node.subscribe("aborted", { signal: controller.signal });
  setTimeout(() => controller.abort(), 20);
  for await (const message of subscriber) assert.fail(`received ${message.payload}`);
  assert.ok(subscriber.isClosed);
  const already = node.subscribe("aborted", { signal: AbortSignal.abort() });
  for await (const message of already) assert.fail(`received ${message.payload}`);
  await node.close();
});

test("the latest message replaces unread ones", hasMaster, async (t) => {
  const node = opened(t, "latest");
  const publisher = await node.publisher("newest");
  const subscriber = await node.subscribe("newest", { keep: "latest" }).ready;
  const other = await node.subscribe("newest", { maxMessages: 3 }).ready;
  for (let n = 1; n <= 100; n++) publisher.publish(n);
  while (other.received + other.lost < 100 || subscriber.received < 100)
    await new Promise((resolve) => setImmediate(resolve));
  assert.equal((await subscriber.receive(1)).payload, 100);
  assert.equal(subscriber.lost, 0);
  assert.deepEqual([other.received, other.lost], [3, 97]);
  assert.equal((await other.receive(1)).payload, 98);
  await node.close();
});

test("a throwing callback emits a warning and receives the next message", hasMaster, async (t) => {
  const node = opened(t, "throwing");
  const received = [];
  const subscriber = node.subscribe("thrown", (message) => {
    received.push(message.payload);
    throw new Error("broken callback");
  });
  await subscriber.ready;
  const publisher = await node.publisher("thrown");
  const warned = once(node, "warning");
  publisher.publish(1);
  publisher.publish(2);
  const [warning] = await warned;
  assert.match(warning, /broken callback/);
  while (received.length < 2) await new Promise((resolve) => setImmediate(resolve));
  await node.close();
});

test("payloads that can't be encoded are counted and reported", hasMaster, async (t) => {
  const node = opened(t, "rejecting");
  const warnings = [];
  node.on("warning", (warning) => warnings.push(warning));
  const publisher = await node.publisher("rejected");
  publisher.publish({ n: 1n });
  assert.equal(publisher.rejected, 1);
  assert.equal(warnings.length, 1);
  const strict = await node.publisher("strict", { strict: true });
  assert.throws(() => strict.publish(() => 1), nep.EncodeError);
  await node.close();
  assert.throws(() => publisher.publish(1), nep.ClosedError);
  assert.throws(() => node.subscribe("late"), nep.NepError);
});

test("calls are answered, rejected or time out", hasMaster, async (t) => {
  const node = opened(t, "calling");
  await node.serve("/twice", async (n) => 2 * n);
  await node.serve("/slow", () => new Promise((resolve) => setTimeout(resolve, 200, "late")));
  const client = node.client("/twice", { timeoutS: 5 });
  assert.deepEqual(await Promise.all([1, 2, 3].map((n) => client.call(n))), [2, 4, 6]);
  const slow = node.client("/slow");
  await assert.rejects(slow.call(1, { timeoutS: 0.05 }), nep.ServiceTimeoutError);
  await assert.rejects(slow.call(1, { signal: AbortSignal.timeout(30) }), { name: "TimeoutError" });
  await assert.rejects(client.call(1n), nep.EncodeError);
  await assert.rejects(node.client("/nobody").call(1, { timeoutS: 0.02 }), nep.NoServerError);
  await node.close();
  await assert.rejects(client.call(1), nep.ClosedError);
});

test("without a master, calls time out and a warning is emitted", async (t) => {
  const node = opened(t, "alone", { master: "127.0.0.1:1", masterWaitS: 0.05 });
  const warnings = [];
  node.on("warning", (warning) => warnings.push(warning));
  await assert.rejects(node.publisher("topic"), nep.MasterUnreachableError);
  await assert.rejects(async () => {
    for await (const message of node.subscribe("topic")) assert.fail(String(message));
  }, nep.MasterUnreachableError);
  node.subscribe("topic", () => undefined);
  await new Promise((resolve) => setTimeout(resolve, 100));
  assert.equal(warnings.length, 3);
  await node.close();
  assert.throws(() => new Node("x", { master: "no address" }), nep.NepError);
  assert.throws(() => new Node("a\nb"), nep.BadNameError);
});

test("a direct subscriber connects to a publisher whose port was used by another program's socket", { timeout: 30_000 }, async (t) => {
  const pull = new Pull();
  await pull.bind("tcp://127.0.0.1:*");
  const endpoint = pull.lastEndpoint;
  const isRejected = new Promise((resolve) => pull.events.on("disconnect", resolve));
  const node = opened(t, "direct");
  const received = new Promise((resolve) => {
    node.new_sub("t", "string", resolve, node.direct("127.0.0.1", endpoint.split(":").at(-1)));
  });
  await isRejected;
  pull.close();
  const publisher = new Publisher();
  t.after(() => publisher.close());
  while (publisher.lastEndpoint !== endpoint) await publisher.bind(endpoint).catch(() => undefined);
  const sending = setInterval(() => void publisher.send("t hello").catch(() => undefined), 20);
  t.after(() => clearInterval(sending));
  assert.equal(await received, "hello");
});

test("both module kinds have the same classes", async () => {
  const { createRequire } = await import("node:module");
  const required = createRequire(import.meta.url)("../dist/index.js");
  assert.equal(required.Node, Node);
  assert.equal(required.node, nep.node);
  assert.equal(nep.default.Node, Node);
});
