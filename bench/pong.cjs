// Pong of the row "nep with nep.js" (bench/paper_ends.py): decodes each message and publishes it again.
//
//     node bench/pong.cjs PACKAGE TYPES    TYPES is a JSON object: kind to message type
"use strict";

const readline = require("node:readline");
const [packagePath, types] = process.argv.slice(2);
const nep = require(packagePath);

const write = (answer) => process.stdout.write(`${JSON.stringify(answer)}\n`);
const echoed = {};
const requested = {};

function answerIfDone(kind) {
  if (requested[kind] !== undefined && echoed[kind] >= requested[kind]) {
    echoed[kind] -= requested[kind];
    delete requested[kind];
    write({ taken: [] });
  }
}

async function connect(master) {
  const node = new nep.Node("pong", { master });
  const ends = Object.entries(JSON.parse(types)).map(([kind, type]) => {
    echoed[kind] = 0;
    const publisher = node.new_pub(`pong_${kind}`, type);
    const subscriber = node.new_sub(`ping_${kind}`, type, (message) => {
      publisher.publish(message);
      echoed[kind] += 1;
      answerIfDone(kind);
    });
    return [publisher.ready, subscriber.ready];
  });
  await Promise.all(ends.flat());
  write({ ready: true });
}

let isConnected = false;
const lines = readline.createInterface({ input: process.stdin });
lines.on("line", (line) => {
  const request = JSON.parse(line);
  if (!isConnected) {
    isConnected = true;
    connect(request).catch((error) => {
      write({ "not run": String(error) });
      process.exit(1);
    });
    return;
  }
  const [kind, , count] = request;
  requested[kind] = count;
  answerIfDone(kind);
});
lines.on("close", () => process.exit(0));
write({ end: "" });
