import { createInterface } from "node:readline";
import { parseArgs } from "node:util";
import { ClosedError, NepError } from "../errors.js";
import { Node } from "../node.js";
import type { Publisher } from "../pubsub/publisher.js";
import type { Subscriber } from "../pubsub/subscriber.js";
import { type Clock, ManualClock, systemClock } from "./clock.js";
import { CommandDesk } from "./commands.js";
import { describe, type Description, type RobotSpec, sensedValue, topicOf } from "./description.js";
import { problemsOf } from "./schema.js";
import { Tasks } from "./tasks.js";
import { errorText, type Members } from "./text.js";

const OWNER_CHECK_MS = 500;
const MAX_WARNED = 100;
const USAGE = "usage: [--name NAME] [--master HOST:PORT] [--owner-pid PID] [--test-clock]";

/** How a robot is started. */
export interface StartOptions {
  /** The robot's name; its topics begin with it. Default: the title of its kind. */
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
  readonly publishers: Map<string, Publisher>;
  readonly commands: Subscriber;
}

/**
 * The driver of one robot: announces it, carries out its commands, and stops it.
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
  private readonly sensed = new Map<string, unknown>(); // before the topics are open

  /** @throws {NepError} for a declaration that is wrong. */
  constructor(readonly spec: RobotSpec) {
    describe(spec, spec.title);
  }

  /** Return the W3C Thing Description that the robot announces under a name. */
  describe(name = this.spec.title): Members {
    return describe(this.spec, name).document;
  }

  /** Connect to a master (waiting for one), take commands, and announce the robot. */
  async start({ name = this.spec.title, master, clock = systemClock }: StartOptions = {}): Promise<void> {
    if (this.running) throw new NepError(`${name} runs already.`);
    const description = describe(this.spec, name);
    const node = new Node(name, { master, masterWaitS: null });
    const warned = new Set<string>(); // each topic of the robot warns that there is no master
    node.on("warning", (message) => {
      if (!warned.has(message)) warn(message);
      if (warned.size < MAX_WARNED) warned.add(message);
    });
    const { withinS = 0.2, watchdogS = 1 } = this.spec.stop;
    const beat = (...told: Parameters<CommandDesk["beat"]>): void => desk.beat(...told);
    const tasks = new Tasks({ name, clock, withinS, watchdogS, stop: () => this.spec.stop.run(), beat, warn });
    const desk = new CommandDesk(tasks, { description, publish: (answer) => this.publish("answer", answer), warn });
    const commands = node.subscribe(topicOf(name, "command"), { type: "robot/command", sink: desk.take });
    this.running = { node, description, tasks, publishers: new Map(), commands };
    await Promise.all([this.openTopics(), commands.ready]);
    await this.openTopic("description", "robot/description", true);
    this.publish("description", description.document);
  }

  /** Stop the robot, answer what is open, and leave the network. */
  async close(): Promise<void> {
    const { running } = this;
    if (!running) return;
    void running.commands.close();
    await running.tasks.close();
    await this.spec.close?.();
    await running.node.close();
    this.running = undefined;
  }

  /**
   * Publish a sensor's new value; a camera takes what a publisher of type `image` takes.
   *
   * @throws {NepError} when it is not of the sensor's type.
   */
  sense(sensor: string, value: unknown): void {
    const { sensors = {} } = this.spec;
    if (!Object.hasOwn(sensors, sensor)) throw new NepError(`There is no sensor "${sensor}".`);
    const told = sensedValue(sensor, sensors[sensor]!, value);
    if (this.running?.publishers.has(sensor)) this.publish(sensor, told);
    else this.sensed.set(sensor, told);
  }

  /** Publish an event. @throws {NepError} when its values are not as declared. */
  happen(event: string, data: Members = {}): void {
    const { events = {} } = this.spec;
    if (!Object.hasOwn(events, event)) throw new NepError(`There is no event "${event}".`);
    const [problem] = problemsOf(events[event]!.fields ?? {}, data);
    if (problem) throw new NepError(`The event "${event}": ${problem}.`);
    this.publish(event, data);
  }

  /** Publish on a topic of the robot that its description doesn't name, such as `state`. */
  async tell(leaf: string, value: unknown): Promise<void> {
    if (this.running && !this.running.publishers.has(leaf)) await this.openTopic(leaf);
    this.publish(leaf, value);
  }

  /** Number of subscribers of a sensor: nobody needs a picture that nobody sees. */
  watchers(sensor: string): number {
    return this.running?.publishers.get(sensor)?.subscribers ?? 0;
  }

  /**
   * Be the robot's program: read the command line, run until Ctrl+C or SIGTERM, then stop the robot and end.
   *
   * Errors that reach the top of the program stop the robot and are printed; the program goes on.
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
      () => console.log(`${name}: the robot is ready, Ctrl+C ends it`),
      (error: unknown) => {
        console.error(`${name}: ${errorText(error)}`);
        process.exit(1);
      },
    );
    await Promise.race([started.then(() => ended), ended]);
    await this.close();
    process.exit(0);
  }

  private async openTopics(): Promise<void> {
    const { sensors = {}, events = {} } = this.spec;
    await Promise.all([
      this.openTopic("answer", "robot/answer"),
      ...Object.entries(sensors).map(([name, { type }]) =>
        this.openTopic(name, type === "camera" ? "image" : "json", type !== "camera"),
      ),
      ...Object.keys(events).map((name) => this.openTopic(name)),
    ]);
  }

  private async openTopic(leaf: string, type = "json", latched = false): Promise<void> {
    const { node, description, publishers } = this.running!;
    publishers.set(leaf, await node.publisher(topicOf(description.name, leaf), { type, latched }));
    if (this.sensed.has(leaf)) this.publish(leaf, this.sensed.get(leaf));
    this.sensed.delete(leaf);
  }

  private publish(leaf: string, value: unknown): void {
    try {
      this.running?.publishers.get(leaf)?.publish(value);
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

/** Call back on Ctrl+C, SIGTERM, or when the process that started this one is gone. */
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

/** A clock for tests: each line on stdin is a number of seconds to advance, and is answered by the new time. */
function clockOnStdin(): Clock {
  const clock = new ManualClock();
  createInterface({ input: process.stdin }).on("line", (line) => {
    clock.advance(Number(line));
    console.log(JSON.stringify({ clock: clock.now() }));
  });
  return clock;
}
