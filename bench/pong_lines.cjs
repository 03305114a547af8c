// What both pongs in JavaScript share: they talk in lines of JSON with bench/paper.py (see bench/paper_ends.py).
"use strict";

const fs = require("node:fs");
const readline = require("node:readline");

const STANDARD_OUTPUT = 1;
process.stdout.write = process.stderr.write.bind(process.stderr); // what a library prints is no answer

/**
 * Reads lines from standard input until it ends.
 * @param connect called with what the other end said and with `echoed(kind)`, to be called for each message
 *     that was sent back; returns a promise that is fulfilled when messages pass.
 */
function run(connect) {
  const write = (answer) => fs.writeSync(STANDARD_OUTPUT, `${JSON.stringify(answer)}\n`);
  const sentBack = {};
  const requested = {};
  let isConnected = false;

  function answerIfDone(kind) {
    if (requested[kind] !== undefined && (sentBack[kind] ?? 0) >= requested[kind]) {
      sentBack[kind] -= requested[kind];
      delete requested[kind];
      write({ taken: [] });
    }
  }

  function echoed(kind) {
    sentBack[kind] = (sentBack[kind] ?? 0) + 1;
    answerIfDone(kind);
  }

  async function begin(other) {
    try {
      await connect(other, echoed);
      write({ ready: true });
    } catch (error) {
      write({ "not run": String(error) });
      process.exit(1);
    }
  }

  const lines = readline.createInterface({ input: process.stdin });
  lines.on("line", (line) => {
    const said = JSON.parse(line);
    if (!isConnected) {
      isConnected = true;
      begin(said);
      return;
    }
    const [kind, , count] = said;
    requested[kind] = count;
    answerIfDone(kind);
  });
  lines.on("close", () => process.exit(0));
  write({ end: "" });
}

module.exports = { run };
