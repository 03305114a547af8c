// The names of the original NEP. Messages published before the node is connected are queued.
const nep = require("nep-js");

const node = new nep.Node("greeter");
const publisher = node.new_pub("greetings", "json");
publisher.publish({ message: "hello world" });
