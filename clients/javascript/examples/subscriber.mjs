// Prints messages until Ctrl+C.
import { Node } from "nep-js";

const node = new Node("display");
const stop = new AbortController();
process.once("SIGINT", () => stop.abort());

const subscriber = node.subscribe("temperature", { signal: stop.signal });
for await (const message of subscriber) {
  console.log(message.date.toISOString(), message.payload);
}
console.log(`${subscriber.received} received, ${subscriber.lost} lost`);
await node.close();
