// Serves a service and calls it.
import { Node } from "nep-js";

const node = new Node("calculator");
await node.serve("/sum", ({ a, b }) => ({ sum: a + b }));

const client = node.client("/sum", { timeoutS: 1 });
console.log(await client.call({ a: 2, b: 3 }));
await node.close();
