// A program of the original nep-js, driven by a test over its pipes: see python_peer.py.
const nep = require("nep-js");
const readline = require("readline");

const [role, topic, type, , name] = process.argv.slice(2);
const say = (value) => process.stdout.write("\x1e" + JSON.stringify(value) + "\n");
const node = new nep.Node(name);

if (role === "publisher") {
  const publisher = node.new_pub(topic, type);
  readline.createInterface({ input: process.stdin }).on("line", (line) => publisher.publish(JSON.parse(line)));
} else {
  node.new_sub(topic, type, (message) => say({ got: message }));
  process.stdin.resume();
}
say("ready");
