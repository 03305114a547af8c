// Tests with a master, which tests/clients/test_javascript.py starts; they are skipped without NEP_MASTER.
import { Node } from "../../dist/index.mjs";

/** Options of tests that need a master: without one they are skipped, and none waits for ever. */
export const hasMaster = {
  skip: process.env.NEP_MASTER ? false : 'needs a master: start one with "nep master" and set NEP_MASTER to its address',
  timeout: 60_000,
};

if (process.env.NEP_MASTER) {
  const node = new Node("asking");
  await node.publisher("asking"); // fails if none answers
  await node.close();
}
