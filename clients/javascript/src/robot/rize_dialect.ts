// Dialect of RIZE: commands on `robot_action`, replies on `action_state`. A command is {"node": "action",
// "primitives": {...} or [...], "robots": "Pepper", "state": "idle", ...}; a list of primitives runs in parallel. The
// reply is the same object with the state "success" or "failure".
import type { Call } from "./call.js";
import type { CommandDesk } from "./commands.js";
import type { ActionSpec, Description, RobotAction } from "./description.js";
import type { Dialect } from "./receiver.js";
import { type Parameter, problemsOf } from "./schema.js";
import { type Answer, isFinal, Task } from "./task.js";
import type { Tasks } from "./tasks.js";
import { asMembers, type Members, quotable, textOf } from "./text.js";

export const RIZE_COMMANDS = "robot_action";
export const RIZE_ANSWERS = "action_state";
export const RIZE_EVENTS = "rize_event";
export const BLACKBOARD = "/blackboard";
const MAX_WAIT_S = 3600;
const MAX_PRIMITIVES = 100;

/** Interface of the robot used by the dialect. */
export interface RizeHost {
  readonly description: Description;
  readonly specs: Readonly<Record<string, ActionSpec>>;
  readonly desk: CommandDesk;
  publish(answer: Members): void;
}

/** RIZE commands for one robot. */
export class RizeDialect implements Dialect {
  /** Names of actions by RIZE primitive. */
  private readonly byPrimitive = new Map<string, string>();
  private readonly begun = new WeakSet<Task>();
  private lastNumber = 0;

  constructor(
    private readonly tasks: Tasks,
    private readonly host: RizeHost,
  ) {
    for (const [name, { rize }] of Object.entries(host.specs)) if (rize) this.byPrimitive.set(rize, name);
  }

  isStop(command: Members): boolean {
    return (
      this.isForMe(command) &&
      command["node"] === "action" &&
      primitivesOf(command).some((each) => this.actionOf(asMembers(each)) === this.host.description.stopAction)
    );
  }

  /** Stop the robot at once; `receive` replies to the message later. */
  stop(): void {
    this.tasks.stop(undefined);
  }

  receive(command: Members, _publisher: bigint | undefined, epoch: number): void {
    if (!this.isForMe(command)) return;
    if (command["node"] === "cancel") this.tasks.cancel((task) => this.begun.has(task));
    else if (command["node"] === "action") this.run(command, epoch);
  }

  /** Do nothing: a RIZE reply repeats the whole command, which was not decoded. */
  refuse(): void {
    // no reply
  }

  private isForMe({ robots }: Members): boolean {
    const { name } = this.host.description;
    return robots === name || (Array.isArray(robots) && robots.includes(name));
  }

  private actionOf({ primitive }: Members): string {
    const name = textOf(primitive) ?? "";
    return this.byPrimitive.get(name) ?? name;
  }

  private run(command: Members, epoch: number): void {
    const primitives = primitivesOf(command);
    let open = primitives.length;
    let isGood = open > 0 && open <= MAX_PRIMITIVES;
    const publish = (): void => this.host.publish({ ...command, state: isGood ? "success" : "failure" });
    if (!isGood) {
      publish();
      return;
    }
    const answered = (answer: Answer): void => {
      if (!isFinal(answer)) return;
      isGood &&= answer.state === "succeeded";
      if (--open === 0) publish();
    };
    for (const each of primitives) this.start(asMembers(each), answered, epoch);
  }

  private start(primitive: Members, answer: (answer: Answer) => void, epoch: number): void {
    const name = this.actionOf(primitive);
    const given = inputText(primitive["input"]);
    const { actions, stopAction } = this.host.description;
    if (name === stopAction) {
      this.tasks.stop(answer);
      return;
    }
    const id = `rize:${++this.lastNumber}`;
    const action = actions.get(name);
    const options = asMembers(primitive["options"]); // "none" without options
    const input = action && this.inputOf(action, given, options);
    let task: Task | undefined;
    if (input && problemsOf(action.parameters, input).length === 0)
      task = this.host.desk.task(id, action, input, answer, { epoch });
    else if (!action && name === "wait") task = waiting(id, given, answer, epoch);
    if (!task) {
      answer({ state: "failed" });
      return;
    }
    this.begun.add(task);
    this.tasks.submit(task);
  }

  /** Convert RIZE's input and options to the input of an action; return undefined if they are invalid. */
  private inputOf(action: RobotAction, given: string, options: Members): Members | undefined {
    const { fromRize } = this.host.specs[action.name]!;
    if (!fromRize) return inputByName(action, given, options);
    try {
      return asMembers(fromRize(given, options));
    } catch {
      return undefined;
    }
  }
}

function primitivesOf({ primitives }: Members): readonly unknown[] {
  return Array.isArray(primitives) ? (primitives as unknown[]) : [primitives];
}

/** Return RIZE's input as text; other programs also send numbers. */
function inputText(input: unknown): string {
  if (typeof input === "string") return input;
  return input === undefined || input === null || input === false || input === 0 ? "" : quotable(input);
}

/** Convert a number, or a number sent as text; NaN for other values. */
function numberOf(value: unknown): number {
  if (typeof value === "number") return value;
  return typeof value === "string" && value.trim() !== "" ? Number(value) : NaN;
}

/** Assign the input to the first parameter and options to the parameters of the same names; ignore other options. */
function inputByName({ parameters }: RobotAction, given: string, options: Members): Members {
  const [first] = Object.entries(parameters);
  const input: [string, unknown][] = first && given ? [[first[0], converted(first[1], given)]] : [];
  for (const [name, value] of Object.entries(options))
    if (Object.hasOwn(parameters, name)) input.push([name, converted(parameters[name]!, value)]);
  return Object.fromEntries(input);
}

/** Convert a value to the parameter's type: RIZE sends numbers as text, and booleans as text or booleans. */
function converted({ type, choices }: Parameter, value: unknown): unknown {
  if (typeof value !== "string" || choices) return value;
  if (type === "number" || type === "integer") {
    const number = numberOf(value);
    return Number.isNaN(number) ? value : number;
  }
  if (type === "boolean") return { true: true, false: false }[value.toLowerCase()] ?? value;
  return value;
}

function waiting(id: string, given: string, answer: (answer: Answer) => void, epoch: number): Task | undefined {
  const seconds = numberOf(given);
  if (!(seconds >= 0 && seconds <= MAX_WAIT_S)) return undefined;
  const run = async (call: Call): Promise<Members> => {
    await call.wait(seconds);
    return {};
  };
  return new Task({
    ...{ id, action: "wait", title: "wait", run, answer, epoch },
    ...{ uses: [], onBusy: "queue", isCancellable: true, goesOn: false },
    ...{ timeoutS: undefined, program: undefined, publisher: undefined },
  });
}
