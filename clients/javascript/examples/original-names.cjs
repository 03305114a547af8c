// The names of the original NEP: what is published before the node is connected waits.
const nep = require("nep-js");

const node = new nep.Node("greeter");
const publisher = node.new_pub("greetings", "json");
publisher.publish({ message: "hello world" });
