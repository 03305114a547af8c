// Options of tests that need a master, which tests/clients/test_javascript.py starts; skipped without NEP_MASTER.
import { Node } from "../../dist/index.mjs";

/** Options of tests that need a master: skipped without one, with a time limit. */
export const hasMaster = {
  skip: process.env.NEP_MASTER ? false : 'needs a master: start one with "nep master" and set NEP_MASTER to its address',
  timeout: 60_000,
};

if (process.env.NEP_MASTER) {
  const node = new Node("asking");
  await node.publisher("asking"); // fails if no master replies
  await node.close();
}
