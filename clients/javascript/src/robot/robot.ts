import { createInterface } from "node:readline";
import { parseArgs } from "node:util";
import { ClosedError, NepError } from "../errors.js";
import type { Message } from "../messages/message.js";
import { Node } from "../node.js";
import type { Publisher } from "../pubsub/publisher.js";
import type { Subscriber } from "../pubsub/subscriber.js";
import { type Clock, ManualClock, systemClock } from "./clock.js";
import { CommandDesk } from "./commands.js";
import { describe, type Description, type RobotSpec, sensedValue, topicOf } from "./description.js";
import { CommandReceiver, MessageQueue, RejectedMessages } from "./receiver.js";
import { BLACKBOARD, RIZE_ANSWERS, RIZE_COMMANDS, RIZE_EVENTS, RizeDialect } from "./rize_dialect.js";
import { problemsOf } from "./schema.js";
import { Tasks } from "./tasks.js";
import { errorText, type Members } from "./text.js";

const OWNER_CHECK_MS = 500;
const MAX_WARNED = 100;
const MAX_WORLD_BYTES = 1_000_000;
const USAGE = "usage: [--name NAME] [--master HOST:PORT] [--owner-pid PID] [--test-clock]";

/** Options of `Robot.start`. */
export interface StartOptions {
  /** Name of the robot, with which its topics begin. Default: the title in its declaration. */
  readonly name?: string;
  /** Host and port of the master. Default: `NEP_MASTER`, else `127.0.0.1:7780`. */
  readonly master?: string;
  /** Default: the computer's clock. */
  readonly clock?: Clock;
}

interface Running {
  readonly node: Node;
  readonly description: Description;
  readonly tasks: Tasks;
  readonly rejected: RejectedMessages;
  /** Publishers by topic. */
  readonly publishers: Map<string, Publisher>;
  readonly subscribers: Subscriber[];
}

/** Newest value for a topic that isn't open yet. */
interface UnsentValue {
  readonly topicOf: (name: string) => string;
  readonly value: unknown;
}

/** Callback for each message of a topic. */
export type MembersCallback = (message: Members) => void;

/** Additional topic joined by the robot. */
interface JoinedTopic {
  readonly topicOf: (name: string) => string;
  readonly changed: MembersCallback;
  /** Options of the robot's publisher; undefined if it only subscribes. */
  readonly sharing: { readonly latched: boolean } | undefined;
}

/**
 * Driver of one robot: publishes its description, executes commands, and stops the robot.
 *
 * @example
 * const robot = new Robot({
 *   model: "lamp",
 *   title: "Lamp",
 *   actions: {
 *     blink: {
 *       text: "blink %times times", category: "Lights", icon: "lightbulb",
 *       parameters: { times: { type: "integer", minimum: 1, maximum: 20, default: 3 } },
 *       async run({ times }, call) {
 *         for (let n = 0; n < times; n++) await call.wait(0.2);
 *       },
 *     },
 *   },
 *   stop: { run() {} },
 * });
 * await robot.main();
 */
export class Robot {
  private running: Running | undefined;
  private readonly unsent = new Map<string, UnsentValue>();
  private readonly joined: JoinedTopic[] = [];

  /** @throws {NepError} if the declaration is invalid. */
  constructor(readonly spec: RobotSpec) {
    describe(spec, spec.title);
  }

  /** Return the W3C Thing Description that a robot of this name publishes. */
  describe(name = this.spec.title): Members {
    return describe(this.spec, name).document;
  }

  /** Connect to a master, waiting for it without a time limit; accept commands, and publish the description. */
  async start({ name = this.spec.title, master, clock = systemClock }: StartOptions = {}): Promise<void> {
    if (this.running) throw new NepError(`${name} is already running.`);
    const description = describe(this.spec, name);
    const node = new Node(name, { master, masterWaitS: null });
    const warned = new Set<string>(); // without a master, each topic emits the same warning
    node.on("warning", (message) => {
      if (!warned.has(message)) warn(message);
      if (warned.size < MAX_WARNED) warned.add(message);
    });
    const tasks = this.tasksOf(name, clock, (...told) => desk.beat(...told));
    const rejected = new RejectedMessages(name, warn);
    this.running = { node, description, tasks, rejected, publishers: new Map(), subscribers: [] };
    const publish = (answer: Members): void => this.publish(topicOf(name, "answer"), answer);
    const desk = new CommandDesk(tasks, { description, rejected, publish });
    await Promise.all([this.openTopics(), this.takeCommands(desk), ...this.joined.map((each) => this.join(each))]);
    await this.openTopic(topicOf(name, "description"), "robot/description", true);
    this.publish(topicOf(name, "description"), description.document);
    this.publish(RIZE_EVENTS, { robot: "ready", name });
  }

  private tasksOf(name: string, clock: Clock, beat: CommandDesk["beat"]): Tasks {
    const { withinS = 0.2, watchdogS = 1 } = this.spec.stop;
    return new Tasks({ name, clock, withinS, watchdogS, stop: () => this.spec.stop.run(), beat, warn });
  }

  private async takeCommands(desk: CommandDesk): Promise<void> {
    const { description, tasks, rejected } = this.running!;
    const publish = (answer: Members): void => this.publish(RIZE_ANSWERS, answer);
    const rize = new RizeDialect(tasks, { description, specs: this.spec.actions, desk, publish });
    const words = ["stop", description.stopAction];
    const command = topicOf(description.name, "command");
    await Promise.all([
      this.subscribe(command, "robot/command", new CommandReceiver(command, tasks, desk, rejected, words).take),
      this.subscribe(RIZE_COMMANDS, "json", new CommandReceiver(RIZE_COMMANDS, tasks, rize, rejected, words, true).take),
    ]);
  }

  /** Stop the robot, reply to pending commands, and close the node. */
  async close(): Promise<void> {
    const { running } = this;
    if (!running) return;
    for (const each of running.subscribers) void each.close();
    await running.tasks.close();
    await this.spec.close?.();
    await running.node.close();
    this.running = undefined;
  }

  /**
   * Publish a new value of a sensor; for a camera, an image as for publishers of type `image`.
   *
   * @throws {NepError} if the value doesn't match the sensor's type.
   */
  sense(sensor: string, value: unknown): void {
    const { sensors = {} } = this.spec;
    if (!Object.hasOwn(sensors, sensor)) throw new NepError(`Unknown sensor "${sensor}".`);
    this.publishWhenOpen((name) => topicOf(name, sensor), sensedValue(sensor, sensors[sensor]!, value));
  }

  /** Publish an event, also to RIZE's blackboard if declared. @throws {NepError} if its values don't match the declaration. */
  happen(event: string, data: Members = {}): void {
    const { events = {} } = this.spec;
    if (!Object.hasOwn(events, event)) throw new NepError(`Unknown event "${event}".`);
    const [problem] = problemsOf(events[event]!.fields ?? {}, data);
    if (problem) throw new NepError(`Event "${event}": ${problem}.`);
    if (!this.running) return;
    const { name } = this.running.description;
    this.publish(topicOf(name, event), data);
    const told = events[event]!.rize?.(data);
    if (told) this.publish(BLACKBOARD, { primitive: told[0], input: told[1], robot: name });
  }

  /** Publish on a topic of the robot that isn't in its description, such as `state`. */
  async tell(leaf: string, value: unknown): Promise<void> {
    if (!this.running) return;
    const topic = topicOf(this.running.description.name, leaf);
    if (!this.running.publishers.has(topic)) await this.openTopic(topic);
    this.publish(topic, value);
  }

  /** Return the number of subscribers of a sensor, for example to skip images that nobody receives. */
  watchers(sensor: string): number {
    if (!this.running) return 0;
    const { description, publishers } = this.running;
    return publishers.get(topicOf(description.name, sensor))?.subscribers ?? 0;
  }

  /** Call `changed` with each message of `/NAME/world`, by which people change a virtual robot's world. */
  onWorld(changed: MembersCallback): void {
    this.add({ topicOf: (name) => topicOf(name, "world"), changed, sharing: undefined });
  }

  /**
   * Join a topic that several robots share.
   *
   * @param changed Called with each message, including those of this robot.
   * @returns a function that publishes a message. Until the topic is open, only the newest message is kept.
   */
  share(topic: string, changed: MembersCallback, { latched = false } = {}): MembersCallback {
    this.add({ topicOf: () => topic, changed, sharing: { latched } });
    return (message) => this.publishWhenOpen(() => topic, message);
  }

  /**
   * Main function of a driver program: parse the command line, run until Ctrl+C or SIGTERM, stop the robot and exit.
   *
   * Uncaught errors are printed and stop the robot; the program continues.
   */
  async main(argv: readonly string[] = process.argv.slice(2)): Promise<void> {
    const options = chosen(argv);
    if (options.help) {
      console.log(USAGE);
      return;
    }
    const name = options.name ?? this.spec.title;
    for (const problem of ["uncaughtException", "unhandledRejection"]) {
      process.on(problem, (error) => {
        console.error(error);
        this.running?.tasks.stop(undefined, "its driver had an internal error");
      });
    }
    const ended = new Promise<void>((resolve) => endsOn(resolve, options["owner-pid"]));
    const clock = options["test-clock"] ? clockOnStdin() : systemClock;
    const started = this.start({ name, master: options.master, clock }).then(
      () => console.log(`${name}: the robot is ready; press Ctrl+C to stop it`),
      (error: unknown) => {
        console.error(`${name}: ${errorText(error)}`);
        process.exit(1);
      },
    );
    await Promise.race([started.then(() => ended), ended]);
    await this.close();
    process.exit(0);
  }

  private add(joined: JoinedTopic): void {
    this.joined.push(joined);
    if (this.running) this.join(joined).catch((error: unknown) => warn(errorText(error)));
  }

  private async join({ topicOf, changed, sharing }: JoinedTopic): Promise<void> {
    const { description, tasks, rejected } = this.running!;
    const topic = topicOf(description.name);
    const queue = new MessageQueue(topic, tasks, rejected, MAX_WORLD_BYTES);
    await Promise.all([
      this.subscribe(topic, "json", (message) => void queue.put(message, changed)),
      sharing && this.openTopic(topic, "json", sharing.latched),
    ]);
  }

  private async subscribe(topic: string, type: string, sink: (message: Message) => void): Promise<void> {
    const { node, subscribers } = this.running!;
    const subscriber = node.subscribe(topic, { type, sink });
    subscribers.push(subscriber);
    await subscriber.ready;
  }

  private async openTopics(): Promise<void> {
    const { name } = this.running!.description;
    const { sensors = {}, events = {} } = this.spec;
    const openOwn = (leaf: string, type?: string, latched?: boolean): Promise<void> =>
      this.openTopic(topicOf(name, leaf), type, latched);
    await Promise.all([
      openOwn("answer", "robot/answer"),
      ...Object.entries(sensors).map(([leaf, { type }]) =>
        openOwn(leaf, type === "camera" ? "image" : "json", type !== "camera"),
      ),
      ...Object.keys(events).map((leaf) => openOwn(leaf)),
      this.openTopic(RIZE_ANSWERS),
      this.openTopic(RIZE_EVENTS, "json", true),
      Object.values(events).some(({ rize }) => rize) && this.openTopic(BLACKBOARD),
    ]);
  }

  private async openTopic(topic: string, type = "json", latched = false): Promise<void> {
    const { node, publishers } = this.running!;
    publishers.set(topic, await node.publisher(topic, { type, latched }));
    for (const [key, { topicOf, value }] of this.unsent) {
      if (topicOf(this.running!.description.name) !== topic) continue;
      this.unsent.delete(key);
      this.publish(topic, value);
    }
  }

  private publishWhenOpen(topicOf: UnsentValue["topicOf"], value: unknown): void {
    const topic = this.running && topicOf(this.running.description.name);
    if (topic !== undefined && this.running!.publishers.has(topic)) this.publish(topic, value);
    else this.unsent.set(topicOf(""), { topicOf, value });
  }

  private publish(topic: string, value: unknown): void {
    try {
      this.running?.publishers.get(topic)?.publish(value);
    } catch (error) {
      if (!(error instanceof ClosedError)) throw error;
    }
  }
}

function warn(message: string): void {
  console.error(message);
}

function chosen(argv: readonly string[]) {
  const options = {
    name: { type: "string" },
    master: { type: "string" },
    "owner-pid": { type: "string" },
    "test-clock": { type: "boolean" },
    help: { type: "boolean" },
  } as const;
  try {
    return parseArgs({ args: [...argv], options }).values;
  } catch (error) {
    console.error(`${errorText(error)}\n${USAGE}`);
    process.exit(2);
  }
}

/** Call `end` on Ctrl+C, SIGTERM, or when the owner process has exited. */
function endsOn(end: () => void, ownerPid: string | undefined): void {
  for (const signal of ["SIGINT", "SIGTERM"]) process.on(signal, end);
  if (ownerPid === undefined) return;
  const isThere = (): boolean => {
    try {
      return process.kill(Number(ownerPid), 0);
    } catch {
      return false;
    }
  };
  setInterval(() => {
    if (!isThere()) end();
  }, OWNER_CHECK_MS).unref();
}

/** Return a clock for tests: each line on stdin advances it by a number of seconds; the new time is printed. */
function clockOnStdin(): Clock {
  const clock = new ManualClock();
  createInterface({ input: process.stdin }).on("line", (line) => {
    clock.advance(Number(line));
    console.log(JSON.stringify({ clock: clock.now() }));
  });
  return clock;
}
