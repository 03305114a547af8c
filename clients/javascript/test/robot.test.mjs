import assert from "node:assert/strict";
import { after, test } from "node:test";
import { Node } from "../dist/index.mjs";
import { codecFor } from "../dist/messages/codecs.js";
import { Message } from "../dist/messages/message.js";
import { CommandDesk } from "../dist/robot/commands.js";
import { describe } from "../dist/robot/description.js";
import { Failed, ManualClock, Robot } from "../dist/robot/index.mjs";
import { CommandReceiver, RejectedMessages } from "../dist/robot/receiver.js";
import { Tasks } from "../dist/robot/tasks.js";
import { hasMaster } from "./support/master.mjs";

const FINAL = ["succeeded", "failed", "canceled"];
const node = new Node("tester");
const robots = [];
after(async () => {
  await Promise.all(robots.map((each) => each.close()));
  await node.close();
});
let lastName = 0;

/** Returns a robot with a manual clock, and functions that publish its commands and record its replies. */
async function bench(changes = {}) {
  const name = `Arm ${++lastName}`;
  const answers = [];
  const done = [];
  const waiters = new Set();
  const topic = `/Arm_${lastName}`;
  node.subscribe(`${topic}/answer`, ({ payload }) => {
    answers.push(payload);
    for (const each of waiters) each();
  });
  const robot = new Robot({
    model: "arm",
    title: "Arm",
    actions: {
      wave: {
        text: "wave", category: "Movement", icon: "hand", uses: ["arm"],
        async run(_input, call) {
          done.push("wave");
          await call.wait(60);
        },
      },
      say: {
        text: "say %words", category: "Speech", icon: "mic",
        parameters: { words: { type: "string", maxLength: 70_000 } },
        run: ({ words }) => words.length,
      },
      deaf: { text: "deaf", category: "Movement", icon: "hand", run: () => new Promise(() => undefined) },
      broken: {
        text: "broken", category: "Movement", icon: "x",
        run() {
          throw new TypeError("no such joint");
        },
      },
      ...changes.actions,
    },
    stop: { run: changes.stop ?? (() => done.push("stop")) },
  });
  robots.push(robot);
  const clock = new ManualClock();
  await robot.start({ name, clock });
  const command = await node.publisher(`${topic}/command`, { type: changes.type ?? "robot/command" });
  const of = (id) => answers.filter((each) => each.id === id);
  const until = (find) =>
    new Promise((resolve) => {
      const look = () => {
        const found = find();
        if (!found) return;
        waiters.delete(look);
        resolve(found);
      };
      waiters.add(look);
      look();
    });
  return {
    robot, clock, done, answers, of, until,
    send: (message) => command.publish(message),
    invoke: (id, action, input = {}) => command.publish({ id, op: "invoke", action, input }),
    running: (id) => until(() => of(id).some(({ state }) => state === "running")),
    final: (id) => until(() => of(id).find(({ state }) => FINAL.includes(state))),
  };
}

test("stop is executed before queued commands, which do not run afterwards", hasMaster, async () => {
  const { robot, done, send, invoke, final, of } = await bench();
  for (let n = 0; n < 300; n++) invoke(`w${n}`, "wave");
  send({ id: "s", op: "stop" });
  assert.equal((await final("s")).state, "succeeded");
  const last = await final("w299");
  assert.deepEqual([last.state, last.error], ["canceled", "the robot was stopped before this started"]);
  const begun = done.filter((each) => each === "wave").length;
  assert.ok(begun <= 1, `${begun} actions ran`);
  assert.equal(of("w299").length, 1);
  await robot.close();
});

test("stop is answered when the stop function has returned", hasMaster, async () => {
  let release;
  const { robot, send, invoke, final, of, until } = await bench({ stop: () => new Promise((end) => (release = end)) });
  send({ id: "s", op: "stop" });
  invoke("w", "wave"); // answered while the stop function runs
  const refused = await final("w");
  assert.match(refused.error, /is stopping/);
  assert.deepEqual(of("s"), []);
  await until(() => release);
  release();
  assert.equal((await final("s")).state, "succeeded");
  const closed = robot.close();
  release();
  await closed;
});

test("the reply to a stop contains the reason if it failed or an action is still running", hasMaster, async () => {
  const failing = await bench({
    stop() {
      throw new Failed("the brake is stuck");
    },
  });
  failing.send({ id: "s", op: "stop" });
  assert.match((await failing.final("s")).error, /may still move: the brake is stuck/);
  await failing.robot.close();
  const { robot, clock, send, invoke, running, final, until, answers } = await bench();
  invoke("d", "deaf");
  await running("d");
  send({ id: "s", op: "stop" });
  send({ id: "x", op: "dance" });
  await final("x");
  clock.advance(0.6);
  assert.match((await final("s")).error, /may still move: deaf is still running/);
  assert.match((await final("d")).error, /may still move: deaf is still running/);
  await until(() => answers.some(({ op, not_ended }) => op === "alive" && not_ended.includes("deaf")));
  invoke("w", "wave");
  assert.match((await final("w")).error, /deaf is still running/);
  const closed = robot.close();
  clock.advance(0.6);
  await closed;
});

test("commands that are too large or too deep are rejected, and a large stop is executed", hasMaster, async () => {
  const { robot, invoke, final } = await bench();
  invoke("large", "say", { words: "x".repeat(65_000) });
  assert.match((await final("large")).error, /the limit is 64 kB/);
  let deep = [];
  for (let n = 0; n < 61; n++) deep = [deep];
  invoke("nearly", "say", { words: deep });
  assert.match((await final("nearly")).error, /words must be text/);
  await robot.close();
  const stopping = await bench();
  stopping.invoke("w", "wave");
  await stopping.running("w");
  stopping.send({ id: "s", op: "stop", ballast: "x".repeat(70_000) });
  assert.equal((await stopping.final("s")).state, "succeeded");
  assert.equal((await stopping.final("w")).state, "canceled");
  await stopping.robot.close();
});

test("messages that can't be decoded are counted, and the next one is handled", async () => {
  const answers = [];
  const spec = { model: "arm", title: "Arm", actions: {}, stop: { run() {} } };
  const host = { name: "Arm", clock: new ManualClock(), withinS: 0.2, watchdogS: 1, warn() {}, stop() {}, beat() {} };
  const description = describe(spec, "Arm");
  const handled = new Promise((resolve) => {
    const publish = (answer) => answers.push(answer) && resolve();
    const tasks = new Tasks(host);
    const rejected = new RejectedMessages("Arm", () => undefined);
    const desk = new CommandDesk(tasks, { description, rejected, publish });
    const receiver = new CommandReceiver("/Arm/command", tasks, desk, rejected, ["stop"]);
    const receive = (text) =>
      receiver.take(new Message("/Arm/command", Buffer.from(text), codecFor("json"), "robot/command", 1n, 0n, 9n, {}, false));
    receive(`{"id": "deep", "op": "invoke", "action": "say", "input": ${"[".repeat(70)}${"]".repeat(70)}}`);
    receive("no JSON");
    receive('{"id": "s", "op": "stop"');
    receive('{"id": "last", "op": "dance"}');
    host.rejected = () => rejected.count;
  });
  await handled;
  assert.equal(host.rejected(), 3);
  assert.deepEqual(answers.map(({ id }) => id), ["last"]);
});

test("no message ends the driver", hasMaster, async () => {
  const { robot, send, invoke, final } = await bench();
  const strange = [null, 7, "stop", [], {}, { op: "stop", id: 7 }, { id: "\ud800", op: "invoke" }, { op: [], id: "a" }];
  for (const each of strange) send(each);
  send(JSON.parse('{"id": "p", "op": "invoke", "action": "__proto__", "input": {"__proto__": {"words": 1}}}'));
  assert.match((await final("p")).error, /can't “__proto__”/);
  send(JSON.parse('{"id": "q", "op": "invoke", "action": "say", "input": {"__proto__": 1, "constructor": 2}}'));
  assert.match((await final("q")).error, /say: unknown name “__proto__”; say: unknown name “constructor”/);
  invoke("b", "broken");
  assert.match((await final("b")).error, /broken failed: no such joint/);
  invoke("ok", "say", { words: "four" });
  assert.deepEqual((await final("ok")).output, { value: 4 });
  await robot.close();
});

test("invalid declarations are rejected", () => {
  const stop = { run() {} };
  const make = (action, more) =>
    new Robot({
      model: "arm", title: "Arm", stop, ...more,
      actions: { wave: { text: "wave", category: "Movement", icon: "hand", run() {}, ...action } },
    });
  make({});
  assert.throws(() => make({ text: "wave %side" }), /%side/);
  assert.throws(() => make({ parameters: { times: { type: "integer", maximum: 3, default: 4 } } }), /invalid default/);
  assert.throws(() => make({ parameters: { by: { type: "number", unit: "degrees" } } }), /write "deg"/);
  assert.throws(() => make({}, { sensors: { state: { type: "number" } } }), /used twice or reserved/);
  assert.throws(() => make({}, { model: "my arm" }), /Invalid name/);
});
