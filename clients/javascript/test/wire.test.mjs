import assert from "node:assert/strict";
import { test } from "node:test";
import { unpack, pack, withWideIntegers } from "../dist/messages/packing.js";
import { codecFor } from "../dist/messages/codecs.js";
import { decodeAnswer, encodeRequest } from "../dist/protocol/requests.js";
import { CallKind, packCall, readCall } from "../dist/services/wire.js";
import { packBatch } from "../dist/wire/batch.js";
import { Flag, packHeader } from "../dist/wire/header.js";
import { idFrom, nodeIdFrom } from "../dist/wire/ids.js";
import { checkNodeName, checkTopic } from "../dist/wire/names.js";
import { helloPart, parseHello, parseRead, parseShares, readPart, sharesPart } from "../dist/wire/notices.js";
import { joinParts, onePart, readParts, topicPart } from "../dist/wire/parts.js";
import { isPattern, matchesPattern } from "../dist/wire/pattern.js";
import { bytes, codeOf, integersAsText, vectors } from "./support/vectors.mjs";

function described({ header, payload, extension }) {
  const { codec, flags, seq, stampNs, publisher } = header;
  return {
    codec,
    flags,
    seq: String(seq),
    stamp_ns: String(stampNs),
    publisher: String(publisher),
    payload: payload.toString("hex"),
    extension,
  };
}

test("messages are decoded as in the vectors", () => {
  for (const { name, parts, means, error } of vectors("messages")) {
    const read = () => readParts(parts.map(bytes));
    if (error) {
      assert.equal(codeOf(read), error, name);
      continue;
    }
    const { topic, messages } = read();
    const { size, ...expected } = means;
    assert.deepEqual({ topic, ...described(messages[0]) }, expected, name);
    if (size !== undefined) assert.equal(messages[0].header.size, size, name);
  }
});

test("messages are encoded as in the vectors", () => {
  for (const { name, parts, means } of vectors("messages")) {
    if (!means) continue;
    const { topic, codec, seq, stamp_ns, publisher, extension, size = 0 } = means;
    const flags = means.flags & ~Flag.EXTENSION;
    const header = { codec, flags, size, seq: BigInt(seq), stampNs: BigInt(stamp_ns), publisher: BigInt(publisher) };
    const payload = bytes(means.payload);
    const written =
      parts.length === 1
        ? [onePart(topicPart(topic), header, payload)]
        : joinParts(topic, header, payload, extension);
    assert.deepEqual(
      written.slice(0, 3).map((each) => each.toString("hex")),
      parts.slice(0, 3),
      name,
    );
    if (written[3]) assert.deepEqual(unpack(written[3]), extension, name);
  }
});

test("batches are decoded and encoded as in the vectors", () => {
  for (const { name, part, means, error } of vectors("batches")) {
    const read = () => readParts([bytes(part)]);
    if (error) {
      assert.equal(codeOf(read), error, name);
      continue;
    }
    const { topic, messages } = read();
    const expected = means.map((each) => ({ flags: 0, extension: {}, ...each }));
    assert.deepEqual(messages.map(described), expected, name);
    const entries = messages.map(({ header, payload }) => ({ stampNs: header.stampNs, payload }));
    assert.equal(packBatch(topicPart(topic), messages[0].header, entries).toString("hex"), part, name);
  }
});

test("each malformed message is rejected with its code", () => {
  for (const [code, ...parts] of vectors("malformed")) {
    assert.equal(
      codeOf(() => readParts(parts.map(bytes))),
      code,
      parts.join(" "),
    );
  }
});

test("filters are decoded and encoded as in the vectors", () => {
  for (const { name, filter, means, error } of vectors("filters")) {
    const part = bytes(filter);
    const hello = parseHello(part);
    const read = parseRead(part);
    const shares = parseShares(part);
    if (error || means.kind === "topic") {
      assert.deepEqual([hello, read, shares], [undefined, undefined, undefined], name);
      continue;
    }
    const { kind, ...expected } = means;
    const found = { hello, read, shares }[kind];
    const named = { bound_bytes: "boundBytes" };
    for (const [key, value] of Object.entries(expected)) {
      const own = found[named[key] ?? key] ?? found[key];
      assert.equal(String(own), String(value), `${name}: ${key}`);
    }
    const written = { hello: helloPart, read: readPart, shares: sharesPart }[kind](found).toString("hex");
    if (!/upper|capital/i.test(name)) assert.equal(written, filter, name);
  }
});

test("notices are decoded and encoded as in the vectors", () => {
  for (const { name, parts, means } of vectors("notices")) {
    const [first, head, payload] = parts.map(bytes);
    assert.equal(String(parseHello(first).subscriber), means.subscriber, name);
    if (payload) continue; // an ordinary message
    const { codec, flags, seq, stamp_ns, publisher, generation } = means;
    const written = packHeader({
      codec,
      flags,
      size: Number(generation ?? 0),
      seq: BigInt(seq),
      stampNs: BigInt(stamp_ns),
      publisher: BigInt(publisher),
    });
    assert.equal(written.toString("hex"), head.toString("hex"), name);
  }
});

test("ids are derived from the node's key as in the vectors", () => {
  for (const { key, node_id, ids } of vectors("ids").nodes) {
    assert.equal(nodeIdFrom(key), node_id);
    for (const [number, id] of Object.entries(ids)) assert.equal(String(idFrom(key, BigInt(number))), id);
  }
});

test("replies and pushes of the master are decoded as in the vectors", () => {
  const { asked, pushed } = vectors("master");
  for (const { name, answer, answer_means } of [...asked, ...pushed].filter((each) => each.answer)) {
    assert.deepEqual(integersAsText(unpack(bytes(answer))), answer_means, name);
    const { call, answer: read } = decodeAnswer(bytes(answer));
    assert.equal(String(call), answer_means.re, name);
    assert.equal(read.is, answer_means.is, name);
    if (answer_means.what.epoch) assert.equal(String(read.epoch), answer_means.what.epoch, name);
    if (answer_means.what.code) assert.equal(read.code, answer_means.what.code, name);
    if (answer_means.is === "publisher+") assert.equal(read.isNew, answer_means.what.is_new ?? false, name);
    for (const [id, seq] of Object.entries(answer_means.what.last_seqs ?? {}))
      assert.equal(String(read.lastSeqs.get(BigInt(id))), seq, name);
  }
});

test("requests are encoded as in the vectors", () => {
  const toIntegers = (value) => {
    if (typeof value === "string" && /^-?\d+$/.test(value)) return BigInt(value);
    if (Array.isArray(value)) return value.map(toIntegers);
    if (value === null || typeof value !== "object") return value;
    return Object.fromEntries(
      Object.entries(value).map(([key, each]) => [
        key,
        ["key", "name", "id"].includes(key) && typeof each === "string" && !/^\d{17,}$/.test(each)
          ? each
          : toIntegers(each),
      ]),
    );
  };
  for (const { name, request } of vectors("master").asked) {
    const means = unpack(bytes(request));
    if (typeof means?.do !== "string" || means.what === undefined) continue;
    const written = encodeRequest({ do: means.do, ...toIntegers(means.what) }, means.call);
    assert.deepEqual(integersAsText(unpack(written)), integersAsText(means), name);
  }
});

test("service calls are decoded and encoded as in the vectors", () => {
  for (const { name, parts, means, error } of vectors("services")) {
    if (!parts) continue; // plain TCP
    const kind = Number(bytes(parts[0])[1]) === CallKind.CALL ? "call" : "answer";
    if (error) {
      assert.equal(
        codeOf(() => readCall(parts.map(bytes), kind)),
        error,
        name,
      );
      continue;
    }
    const read = readCall(parts.map(bytes), kind);
    assert.deepEqual(
      { ...read, number: String(read.number), payload: read.payload.toString("hex") },
      {
        kind: means.kind,
        codec: means.codec,
        timeoutMs: means.timeout_ms,
        number: means.number,
        payload: means.payload,
      },
      name,
    );
    assert.deepEqual(
      packCall(read).map((each) => each.toString("hex")),
      parts,
      name,
    );
  }
});

test("names follow the grammar", () => {
  for (const topic of ["a", "/robot/camera", "größe", "😀", "a*b", "x".repeat(200)])
    assert.equal(checkTopic(topic), topic);
  for (const topic of ["", "a b", "a\u3000b", "a{b", "a\u0085", "a\u001c", "a\u200b", "\ud800", "x".repeat(201)]) {
    assert.throws(() => checkTopic(topic), { name: "BadTopicError" }, JSON.stringify(topic));
  }
  assert.equal(checkNodeName("my node"), "my node");
  for (const name of ["", "a\nb", "\ufeffa", "x\udc00"])
    assert.throws(() => checkNodeName(name), { name: "BadNameError" });
});

test("patterns match whole levels", () => {
  const matching = [
    ["/*/camera", "/a/camera"],
    ["**", "a/b/c"],
    ["/robot/**", "/robot"],
    ["a/**/z", "a/z"],
    ["a/**/z", "a/b/c/z"],
    ["a*b", "a*b"],
  ];
  const others = [
    ["/*/camera", "//camera"],
    ["/*/camera", "/a/b/camera"],
    ["a/**/z", "a/b"],
    ["a*b", "axb"],
    ["*", "a/b"],
  ];
  for (const [pattern, topic] of matching) assert.ok(matchesPattern(pattern, topic), `${pattern} ${topic}`);
  for (const [pattern, topic] of others) assert.ok(!matchesPattern(pattern, topic), `${pattern} ${topic}`);
  assert.deepEqual(["a*b", "/a/*", "**"].map(isPattern), [false, true, true]);
});

test("payloads are unchanged after encoding and decoding", () => {
  const payloads = {
    json: { a: [1, "ü", null] },
    string: "grüß",
    msgpack: { big: 2n ** 60n, small: 2 ** 40, bytes: new Uint8Array([1, 2]), nan: NaN },
  };
  for (const [name, payload] of Object.entries(payloads)) {
    const codec = codecFor(name);
    const decoded = codec.decode(codec.encode(payload).data, {});
    if (name !== "msgpack") assert.deepEqual(decoded, payload);
    else assert.deepEqual({ ...decoded, bytes: new Uint8Array(decoded.bytes) }, { ...payload, small: 2n ** 40n });
  }
  assert.equal(codecFor("robot/description").name, "json");
  assert.deepEqual(unpack(pack(withWideIntegers({ id: 2 ** 53 - 1 }))), { id: 2n ** 53n - 1n });
});

test("payloads that a codec can't encode are rejected with a reason", () => {
  let deep = [];
  for (let level = 0; level < 64; level++) deep = [deep];
  for (const [type, payload] of [
    ["json", { n: 1n }],
    ["json", undefined],
    ["json", { a: "x".repeat(200), deep }],
    ["string", 5],
    ["bytes", "text"],
    ["msgpack", deep],
    ["image", { data: Buffer.alloc(5), encoding: "mono8", shape: [2, 2, 1] }],
  ]) {
    assert.throws(() => codecFor(type).encode(payload), { name: "EncodeError" }, type);
  }
  assert.equal(codecFor("json").encode({ a: NaN, b: [Infinity, 1, null] }).nonFinite, 2);
  assert.throws(() => codecFor("json").decode(Buffer.from("[".repeat(65) + "]".repeat(65)), {}), {
    name: "DecodeError",
  });
  assert.throws(() => codecFor("string").decode(Buffer.from([0xff]), {}), { name: "DecodeError" });
});

test("hostile msgpack is rejected without allocating memory", () => {
  const codec = codecFor("msgpack");
  const huge = Buffer.from("dd01ffffff".repeat(200), "hex");
  const deep = Buffer.concat([Buffer.alloc(65, 0x91), Buffer.from([0xc0])]);
  const before = process.memoryUsage().rss;
  for (const data of [
    huge,
    deep,
    Buffer.from("df7fffffff", "hex"),
    Buffer.from("a5ab", "hex"),
    Buffer.from("c0c0", "hex"),
    Buffer.alloc(0),
    Buffer.from("c1", "hex"),
    Buffer.alloc(300_000, 0x91),
  ]) {
    assert.throws(() => codec.decode(data, {}), { name: "DecodeError" }, data.toString("hex", 0, 10));
  }
  assert.ok(process.memoryUsage().rss - before < 100e6);
  const allowed = Buffer.concat([Buffer.alloc(64, 0x91), Buffer.from([0xc0])]);
  assert.doesNotThrow(() => codec.decode(allowed, {}));
  const everything = {
    n: [null, true, 1, -1, 200, 2 ** 20, 2n ** 63n, -(2n ** 40n), 1.5],
    text: ["", "a".repeat(40), "b".repeat(300), "c".repeat(70000)],
    bin: [new Uint8Array(3), new Uint8Array(300), new Uint8Array(70000)],
    list: Array(70000).fill(0),
    date: new Date(1234567890123),
    map: Object.fromEntries(Array.from({ length: 20 }, (_, n) => [`k${n}`, n])),
  };
  const decoded = codec.decode(codec.encode(everything).data, {});
  assert.equal(decoded.list.length, 70000);
  assert.equal(decoded.date.getTime(), 1234567890123);
});

test("images keep their bytes and shape", () => {
  const codec = codecFor("image");
  const raw = { data: Buffer.from([1, 2, 3, 4, 5, 6]), encoding: "rgb8", shape: [1, 2, 3] };
  const { data, extension } = codec.encode(raw);
  assert.deepEqual(codec.decode(data, extension), raw);
  const png = Buffer.from("89504e470d0a1a0a0000000d494844520000000200000003080200000000000000", "hex");
  assert.deepEqual(codec.encode(png).extension, { shape: [3, 2, 3], encoding: "png" });
  const jpeg = Buffer.from("ffd8ffe00004abcdffc0000b080010002003011100", "hex");
  assert.deepEqual(codec.encode(jpeg).extension, { shape: [16, 32, 3], encoding: "jpeg" });
  assert.throws(() => codec.decode(Buffer.from("none"), {}), { name: "DecodeError" });
});

test("lists of numbers have the JSON of JSON.stringify", () => {
  const list = (next) => Array.from({ length: 200 }, (_, index) => next(index));
  const random = (index) => {
    const decimals = 10 ** (index % 8);
    return Math.round((Math.random() - 0.5) * 10 ** (index % 15)) / decimals;
  };
  const payloads = [
    list(random),
    list((index) => index - 100),
    list(() => Math.random()),
    list(() => -0),
    [...list(random), 1e-6, 1e-7, 1.5e9, 2 ** 53, 999_999_999.999_999, 0.999_999_9, NaN, -Infinity, 7],
    [...list(random), "text", null, undefined, 1],
    list((index) => (index === 7 ? undefined : index)),
    { name: 'quoted "é"', stamp: 1.25, ranges: list(random), "7": null, nested: { x: [1] }, last: list(random) },
    { gone: undefined, ranges: list(random) },
    { date: new Date(0), ranges: list(random) },
    Object.assign(list(random), { toJSON: () => "replaced" }),
    { ranges: new Array(200) },
  ];
  const { encode, decode } = codecFor("json");
  for (const payload of payloads) assert.equal(encode(payload).data.toString(), JSON.stringify(payload));
  assert.equal(encode({ ranges: [...list(random), NaN], low: -Infinity }).nonFinite, 2);
  assert.throws(() => encode({ ranges: list(random), wide: 1n }), { name: "EncodeError" });
  const own = list(random);
  const first = encode(own).data;
  encode(list(random));
  assert.deepEqual(decode(first, {}), JSON.parse(JSON.stringify(own)), "a message that waits is not overwritten by the next one");
});

test("received bytes are republished without a copy, other bytes are copied", () => {
  for (const [type, large] of [["bytes", Buffer.alloc(100_000)], ["image", Buffer.alloc(100_000, "\xff\xd8\xff", "latin1")]]) {
    const { encode, decode } = codecFor(type);
    const { data, extension } = encode(large);
    assert.notEqual(data, large);
    const payload = decode(data, extension ?? {});
    assert.equal(encode(payload).data, data);
    assert.notEqual(encode(Buffer.from(large)).data, large);
  }
});
