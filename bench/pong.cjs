// Pong of the row "nep with nep.js" (bench/paper_ends.py): decodes each message and publishes it again.
//
//     node bench/pong.cjs PACKAGE TYPES    TYPES is a JSON object: kind to message type
"use strict";

const { run } = require("./pong_lines.cjs");
const [packagePath, types] = process.argv.slice(2);
const nep = require(packagePath);

run(async (master, echoed) => {
  const node = new nep.Node("pong", { master });
  const ends = Object.entries(JSON.parse(types)).map(([kind, type]) => {
    const publisher = node.new_pub(`pong_${kind}`, type);
    const subscriber = node.new_sub(`ping_${kind}`, type, (message) => {
      publisher.publish(message);
      echoed(kind);
    });
    return [publisher.ready, subscriber.ready];
  });
  await Promise.all(ends.flat());
});
