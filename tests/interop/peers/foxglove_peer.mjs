// The client library of Foxglove's WebSocket protocol, driven by a test over its pipes: see python_peer.py.
import protocol from "@foxglove/ws-protocol";
import { createInterface } from "readline";
import { WebSocket } from "ws";

const { FoxgloveClient } = protocol;  // CommonJS without named exports

const say = (value) => process.stdout.write("\x1e" + JSON.stringify(value) + "\n");
const got = (value) => say({ got: value });
const client = new FoxgloveClient({
  ws: new WebSocket(process.argv[2], [FoxgloveClient.SUPPORTED_SUBPROTOCOL]),
});
const channels = new Map(), subscriptions = new Map(), services = new Map();
const text = (view) => new TextDecoder().decode(view);
const bytes = (value) => new TextEncoder().encode(JSON.stringify(value));

client.on("error", (error) => got({ error: String(error) }));
client.on("serverInfo", () => say("ready"));
client.on("status", ({ level, message }) => got({ status: level, message }));
client.on("advertise", (found) => {
  for (const each of found) channels.set(each.topic, each);
  got({ topics: [...channels.keys()].sort() });
});
client.on("unadvertise", (ids) => {
  for (const [topic, { id }] of channels) if (ids.includes(id)) channels.delete(topic);
  got({ topics: [...channels.keys()].sort() });
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, encoding } = subscriptions.get(subscriptionId);
  got({ topic, isNow: timestamp > 0n, value: encoding === "json" ? JSON.parse(text(data)) : data.byteLength });
});
client.on("advertiseServices", (found) => {
  for (const each of found) services.set(each.name, each.id);
  got({ services: [...services.keys()].sort() });
});
client.on("serviceCallResponse", ({ callId, encoding, data }) => got({ callId, encoding, value: JSON.parse(text(data)) }));
client.on("serviceCallFailure", ({ callId, message }) => got({ callId, message }));
client.on("connectionGraphUpdate", ({ publishedTopics }) => got({ published: publishedTopics }));
client.on("close", ({ code }) => {
  got({ closed: code });
  process.exit(0);
});

const published = new Map();
const steps = {
  listen: ([topic]) => subscriptions.set(client.subscribe(channels.get(topic).id), channels.get(topic)),
  talk: ([topic, schemaName, message]) => {
    if (!published.has(topic)) published.set(topic, client.advertise({ topic, encoding: "json", schemaName }));
    client.sendMessage(published.get(topic), bytes(message));
  },
  call: ([name, callId, request]) =>
    client.sendServiceCallRequest({ serviceId: services.get(name), callId, encoding: "json", data: bytes(request) }),
  graph: () => client.subscribeConnectionGraph(),
};
createInterface({ input: process.stdin }).on("line", (line) => {
  const [step, ...given] = JSON.parse(line);
  steps[step](given);
});
