// Adapter for `nep wire check -- node clients/javascript/conformance/adapter.mjs`: carries out requests from stdin and
// writes replies to stdout, one JSON object per line. 64-bit numbers are decimal strings.
import { createInterface } from "node:readline";
import nep from "../dist/index.mjs";

const { Node } = nep;
const FEATURES = [
  "hello1",
  "hello2",
  "hello3",
  "losses",
  "latched",
  "history",
  "patterns",
  "services",
  "latest",
  "statistics",
  "keys",
];
const publishers = new Map();
const subscribers = new Map();
const clients = new Map();
let node;
let lastNumber = 0;

function write(value) {
  process.stdout.write(`${JSON.stringify(value)}\n`);
}

/** Returns a decoded payload as a JSON value; undefined if not representable. */
function jsonForm(message) {
  if (message.codec === "bytes" || message.codec === "image") return undefined;
  try {
    return JSON.parse(
      JSON.stringify(message.payload, (_key, value) => (typeof value === "bigint" ? String(value) : value)),
    );
  } catch {
    return undefined;
  }
}

function report(sub, message) {
  const { topic, codec, seq, stampNs, publisher, data } = message;
  const payload = data.toString("base64");
  write({
    event: "message",
    sub,
    topic,
    codec,
    seq: String(seq),
    stamp_ns: String(stampNs),
    publisher: String(publisher),
    payload,
    value: jsonForm(message),
  });
}

function payloadOf({ value, text, bytes }) {
  if (bytes !== undefined) return Buffer.from(bytes, "base64");
  return text ?? value;
}

const actions = {
  features: () => ({ language: "JavaScript", version: "0.2.0", features: FEATURES }),

  node({ name }) {
    node = new Node(name, { masterWaitS: null });
    node.on("warning", (message) => process.stderr.write(`${message}\n`));
    return {};
  },

  async publisher({ topic, type, latched = false, history = 0 }) {
    const publisher = await node.publisher(topic, { type, latched, history });
    const pub = ++lastNumber;
    publishers.set(pub, publisher);
    return { pub, missing: publisher.unconnectedSubscribers };
  },

  publish({ pub, count, ...given }) {
    const payload = payloadOf(given);
    const isMap =
      payload !== null && typeof payload === "object" && !Buffer.isBuffer(payload) && !Array.isArray(payload);
    for (let n = 1; n <= (count ?? 1); n++) {
      publishers.get(pub).publish(count !== undefined && isMap ? { ...payload, n } : payload);
    }
    return {};
  },

  async subscriber({ topic, type, latest = false }) {
    const sub = ++lastNumber;
    const subscriber = node.subscribe(topic, { type, keep: latest ? "latest" : "all" }, (message) =>
      report(sub, message),
    );
    subscribers.set(sub, subscriber);
    await subscriber.ready;
    return { sub };
  },

  counts({ pub, sub }) {
    if (pub !== undefined) {
      const { sent, subscribers: count } = publishers.get(pub);
      return { sent: String(sent), subscribers: count };
    }
    const { received, lost, refused } = subscribers.get(sub);
    return { received: String(received), lost: String(lost), refused: String(refused) };
  },

  async close_publisher({ pub }) {
    await publishers.get(pub).close();
    return {};
  },

  async close_subscriber({ sub }) {
    await subscribers.get(sub).close();
    return {};
  },

  async serve({ service }) {
    await node.serve(service, (request) => request);
    return {};
  },

  async call({ service, value, timeout_s: timeoutS }) {
    if (!clients.has(service)) clients.set(service, node.client(service));
    return { value: await clients.get(service).call(value, { timeoutS }) };
  },

  /** Blocks the event loop, for tests of this package. */
  hang({ seconds }) {
    const end = performance.now() + seconds * 1000;
    while (performance.now() < end);
    return {};
  },

  async close() {
    await node?.close();
    return {};
  },
};

async function obey({ id, do: name, ...members }) {
  try {
    write({ re: id, ...(await actions[name](members)) });
  } catch (error) {
    write({ re: id, error: String(error?.message ?? error) });
  }
  if (name === "close") process.exit(0);
}

const lines = createInterface({ input: process.stdin });
lines.on("line", (line) => void obey(JSON.parse(line)));
lines.on("close", () => void obey({ do: "close" }));
