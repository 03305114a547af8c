// Tests of counters, bounds and message forms, without a master.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Subscriber } from "zeromq";
import { codecFor } from "../dist/messages/codecs.js";
import { Message } from "../dist/messages/message.js";
import { SendWindow, STEP_BYTES, WINDOW_BYTES } from "../dist/pubsub/byte_window.js";
import { History } from "../dist/pubsub/history.js";
import { Inbox } from "../dist/pubsub/inbox.js";
import { Sources } from "../dist/pubsub/loss.js";
import { fromFrame, toFrame } from "../dist/pubsub/original.js";
import { Subscriptions } from "../dist/pubsub/subscriptions.js";
import { XpubTransport } from "../dist/pubsub/xpub_transport.js";
import { helloPart, readPart } from "../dist/wire/notices.js";
import { readParts, topicPart } from "../dist/wire/parts.js";
import { nearestEndpoint, masterAddress } from "../dist/system/addresses.js";

const ID = 7n;

test("gaps, echoes and byes count as lost", () => {
  const sources = new Sources();
  for (const seq of [3n, 4n, 7n]) assert.ok(sources.arrived(ID, seq, false));
  assert.deepEqual([sources.received, sources.lost], [3, 2]);
  assert.ok(!sources.arrived(ID, 7n, true), "duplicate latched message");
  assert.ok(sources.reached(ID, 9n));
  assert.deepEqual([sources.received, sources.lost], [3, 4]);
});

test("missing messages of the last renewal are lost until they arrive", () => {
  const sources = new Sources();
  sources.arrived(ID, 1n, false);
  sources.promised(ID, 3n);
  assert.equal(sources.lost, 0);
  sources.promised(ID, 3n);
  assert.equal(sources.lost, 2);
  sources.arrived(ID, 2n, false);
  sources.arrived(ID, 3n, false);
  assert.deepEqual([sources.received, sources.lost], [3, 0]);
  sources.promised(99n, 5n);
  assert.equal(sources.lost, 0, "unknown publisher without a first seq");
});

test("a jump of seq is rejected once, then accepted as a restart", () => {
  const sources = new Sources();
  sources.arrived(ID, 1n, false);
  assert.throws(() => sources.arrived(ID, 2n ** 40n, false), { code: "seq-leap" });
  assert.ok(sources.arrived(ID, 2n ** 40n + 1n, false));
  assert.deepEqual([sources.received, sources.lost], [2, 0]);
});

test("the oldest of more than a thousand unlisted publishers are evicted", () => {
  const sources = new Sources();
  for (let id = 1n; id <= 1500n; id++) sources.arrived(id, 1n, false);
  assert.equal(sources.byId.size, 1000);
});

/** Losses of a subscriber that was registered when publisher `ID` was created. */
function ofNewPublisher(history = 0) {
  const sources = new Sources();
  sources.expectAllOf(ID);
  sources.listed({ id: ID, topic: "t", endpoints: [], history, nodeName: "n" });
  return sources;
}

test("losses of a new publisher count from seq 1", () => {
  let sources = ofNewPublisher();
  assert.ok(sources.arrived(ID, 8n, false));
  assert.deepEqual([sources.received, sources.lost], [1, 7]);
  sources = ofNewPublisher();
  assert.ok(sources.reached(ID, 0n), "its echo");
  sources.arrived(ID, 1n, false);
  assert.deepEqual([sources.received, sources.lost], [1, 0]);
  sources = ofNewPublisher();
  assert.ok(!sources.reached(ID, 2n ** 32n + 1n), "implausible first seq");
  assert.equal(sources.lost, 0);
  sources.arrived(9n, 100n, false);
  sources.expectAllOf(9n);
  assert.deepEqual([sources.received, sources.lost], [1, 0], "publisher with previous messages");
});

test("losses of an unreachable new publisher grow with each renewal", () => {
  const sources = ofNewPublisher();
  sources.promised(ID, 100n);
  assert.equal(sources.lost, 0);
  sources.promised(ID, 250n);
  assert.equal(sources.lost, 100);
  sources.arrived(ID, 100n, false);
  assert.deepEqual([sources.received, sources.lost], [1, 99], "late, not lost");
  sources.settle(ID);
  assert.equal(sources.lost, 249);
});

test("the history of a new publisher is received after the master has reported its seqs", () => {
  const sources = ofNewPublisher(3);
  sources.promised(ID, 9n);
  sources.promised(ID, 9n);
  assert.equal(sources.lost, 9);
  assert.ok(sources.isEarly(ID), "repeated by the history");
  for (const seq of [8n, 9n, 10n]) assert.ok(sources.arrived(ID, seq, true));
  assert.deepEqual([sources.received, sources.lost], [3, 7]);
});

test("a send window closes at its limit and opens after acknowledgements", () => {
  const window = new SendWindow();
  const size = 6 * 2 ** 20;
  let seq = 0;
  while (window.hasRoom(size)) window.sent(++seq, size);
  assert.ok(window.underWay <= WINDOW_BYTES && window.underWay > WINDOW_BYTES - size);
  window.missed();
  assert.ok(!window.takeMissed());
  window.read(BigInt(seq - 2), 0xffffffffffffffffn);
  assert.ok(window.hasRoom(size));
  assert.ok(window.takeMissed());
  window.read(BigInt(seq), 0n);
  assert.equal(window.underWay, 0);
  window.sent(seq + 1, 2 * STEP_BYTES);
  assert.ok(!window.hasRoom(STEP_BYTES), "the requested bound is 24 MiB");
});

test("the inbox drops its oldest messages", () => {
  const message = (seq) =>
    new Message("t", Buffer.alloc(10), codecFor("bytes"), "bytes", BigInt(seq), 0n, ID, {}, false);
  const byCount = new Inbox(true, 3, 1000);
  const byBytes = new Inbox(true, 1000, 25);
  const latest = new Inbox(false, 1000, 1000);
  const dropped = [byCount, byBytes, latest].map((each) =>
    [1, 2, 3, 4, 5].reduce((sum, seq) => sum + each.put(message(seq)), 0),
  );
  assert.deepEqual(dropped, [2, 3, 0]);
  assert.deepEqual(
    [byCount, byBytes, latest].map((each) => each.take().seq),
    [3n, 4n, 5n],
  );
  for (let seq = 0; seq < 5000; seq++) {
    byCount.put(message(seq));
    assert.ok(byCount.take());
  }
});

test("a history is bounded in messages and bytes", () => {
  const history = new History(3);
  for (let n = 0; n < 5; n++) history.add([Buffer.from([n])], 1);
  assert.deepEqual(
    history.kept.map((each) => each.parts[0][0]),
    [2, 3, 4],
  );
  history.add([Buffer.alloc(0)], 65 * 2 ** 20);
  assert.equal(history.kept.length, 1);
});

test("the form of messages depends on the subscribers", () => {
  const refused = [];
  const subscriptions = new Subscriptions("t", ID, (reason) => refused.push(reason));
  const note = (isAdded, filter) => subscriptions.note(Buffer.concat([Buffer.from([isAdded ? 1 : 0]), filter]));
  const hello = (level, topic = "t", subscriber = BigInt(level + 1)) => helloPart({ subscriber, topic, level });
  const forms = () => [
    subscriptions.isHeard,
    subscriptions.readsOnePart,
    subscriptions.readsBatches,
    subscriptions.tellsAll,
  ];
  note(true, topicPart("t"));
  assert.equal(note(true, hello(3)), 4n);
  assert.deepEqual(forms(), [true, true, true, true]);
  note(true, topicPart("t"));
  note(true, hello(1));
  assert.deepEqual(forms(), [true, true, false, false]);
  note(true, topicPart("t"));
  assert.deepEqual(forms(), [true, false, false, false]);
  note(false, topicPart("t"));
  note(false, hello(1));
  assert.deepEqual(forms(), [true, true, true, true]);
  assert.equal(note(true, hello(3, "other")), undefined);
  note(true, Buffer.from("nonsense"));
  assert.equal(refused.length, 1);
  subscriptions.greeted.get(4n).window.sent(5, 100);
  note(true, readPart({ subscriber: 4n, publisher: ID, seq: 5n, boundBytes: 0n }));
  assert.equal(subscriptions.greeted.get(4n).window.underWay, 0);
  note(false, hello(3));
  assert.ok(!subscriptions.isHeard);
});

/** Returns the transport of a publisher, and a ZeroMQ socket that has received its echo. */
async function connected(t, codecNumber) {
  const spec = { id: ID, topic: "t", codecNumber, latched: false, history: 0, batch: true };
  const transport = new XpubTransport(
    spec,
    () => "brief",
    () => undefined,
    assert.fail,
  );
  t.after(() => transport.close());
  const [endpoint] = await transport.move(["127.0.0.1"]);
  const socket = new Subscriber({ receiveTimeout: 5000 });
  t.after(() => socket.close());
  socket.subscribe(topicPart("t"));
  socket.subscribe(helloPart({ subscriber: 1n, topic: "t", level: 3 }));
  socket.connect(endpoint);
  const [, echo] = await socket.receive();
  assert.equal(echo.length, 32);
  return { transport, socket };
}

test("texts have the same bytes in every form", async (t) => {
  const { transport, socket } = await connected(t, 2);
  const { encode, decode } = codecFor("string");
  for (const text of ["", "short", "é".repeat(100), "\0 and 😀".repeat(50), `lone \ud800${"x".repeat(200)}`, "x".repeat(20_000)]) {
    transport.send(encode(text));
    const [{ header, payload }] = readParts(await socket.receive()).messages;
    assert.equal(header.size, payload.length);
    assert.equal(decode(payload, {}), text.replace("\ud800", "\ufffd"));
  }
});

test("queued messages are batched and reach every subscriber", async (t) => {
  const { transport, socket } = await connected(t, 1);
  const count = 3000;
  for (let n = 1; n <= count; n++) transport.send({ data: Buffer.from(String(n)) });
  const received = [];
  let parts = 0;
  while (received.length < count) {
    received.push(...readParts(await socket.receive()).messages);
    parts++;
  }
  assert.ok(parts < count, `${parts} parts`);
  assert.deepEqual(
    received.map((each) => Number(each.payload.toString())),
    Array.from({ length: count }, (_, index) => index + 1),
  );
  assert.deepEqual(
    received.map((each) => Number(each.header.seq)),
    Array.from({ length: count }, (_, index) => index + 1),
  );
});

test("frames of the original NEP", () => {
  const data = Buffer.from('{"a":1}');
  assert.equal(String(toFrame("t", "A", "json", "json", data)), 't {"a":1}');
  assert.equal(String(toFrame("t", "B", "json", "json", data)), '{"a":1}');
  assert.equal(String(toFrame("t", "B", "dictionary", "json", data)), 't {"a":1}');
  for (const generation of ["A", "B"])
    assert.deepEqual(fromFrame("t", "json", "json", toFrame("t", generation, "json", "json", data)), data);
  assert.equal(fromFrame("x", "json", "json", Buffer.from('y {"a":1}')), undefined);
  assert.deepEqual(fromFrame("t", "image", "image", toFrame("t", "A", "image", "image", data)), data);
  assert.throws(() => fromFrame("t", "image", "image", Buffer.from("t !!")), { code: "malformed" });
});

test("the nearest endpoint depends on where the master is", () => {
  const endpoints = ["tcp://127.0.0.1:1000", "nanomsg://127.0.0.1:1", "tcp://0.0.0.0:2000"];
  assert.equal(nearestEndpoint(endpoints, "127.0.0.1:7780"), "tcp://127.0.0.1:1000");
  assert.equal(nearestEndpoint(endpoints, "10.0.0.5:7780"), "tcp://10.0.0.5:2000");
  assert.equal(nearestEndpoint(["udp://a:1", "tcp://a:99999"], "127.0.0.1:7780"), undefined);
  assert.equal(masterAddress("10.0.0.5"), "10.0.0.5:7780");
  for (const wrong of ["a b", "host:0", "::1", "host:70000"])
    assert.throws(() => masterAddress(wrong), { name: "NepError" });
});
