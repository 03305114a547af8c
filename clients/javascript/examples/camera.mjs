// Publishes a JPEG or PNG file as an image on the topic "camera".
import { readFile } from "node:fs/promises";
import { Node } from "nep-js";

const [file] = process.argv.slice(2);
if (!file) {
  console.error("usage: node camera.mjs FILE.jpg");
  process.exit(2);
}
const node = new Node("camera");
const publisher = await node.publisher("camera", { type: "image", latched: true });
publisher.publish(await readFile(file));
console.log("Published. Late subscribers get it as well; end with Ctrl+C.");
setInterval(() => undefined, 1000);
