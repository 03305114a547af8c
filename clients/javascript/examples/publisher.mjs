// Publishes ten times a second until Ctrl+C.
import { Node } from "nep-js";

const node = new Node("thermometer");
const publisher = await node.publisher("temperature");

setInterval(() => {
  publisher.publish({ celsius: 20 + Math.random(), room: "lab" });
}, 100);
