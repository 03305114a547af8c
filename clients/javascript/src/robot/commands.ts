// Messages on a robot's command topic become tasks and stops; a stop is recognised when it arrives, before any
// other message is decoded.
import { createHash } from "node:crypto";
import { DecodeError } from "../errors.js";
import type { Message } from "../messages/message.js";
import { Failed } from "./call.js";
import type { Description, RobotAction } from "./description.js";
import { isRequired, problemsOf } from "./schema.js";
import { type Answer, isFinal, programId, type ProgramId, Task } from "./task.js";
import { NOTHING_RUNS, type Tasks } from "./tasks.js";
import {
  asMembers,
  checkSendable,
  errorText,
  hasSurrogates,
  isMembers,
  type Members,
  nearMiss,
  quotable,
  textOf,
} from "./text.js";

const MAX_COMMAND_BYTES = 64_000;
const MAX_BACKLOG = 2000;
const MAX_BACKLOG_BYTES = 16_000_000;
const MAX_TURN_MS = 5; // then the sockets are read: a stop may be there
const END_BYTES = 2048;
const MAX_ID_LENGTH = 200;
const MAX_ENDED = 100;
const WARN_INTERVAL_MS = 10_000;
const ID = /"id"\s*:\s*"([\w .:/-]{1,200})"/;
const OPERATION = /"op"\s*:\s*"(\w{1,20})"/;

/** What the command desk of a robot needs from it. */
export interface DeskHost {
  readonly description: Description;
  publish(answer: Members): void;
  warn(message: string): void;
}

interface Backlogged {
  readonly message: Message;
  readonly epoch: number;
}

/** Takes the commands of one robot. */
export class CommandDesk {
  /** Messages that were not handled. */
  rejected = 0;
  private readonly openIds = new Set<string>();
  private readonly ended: string[] = []; // programs
  private readonly backlog: Backlogged[] = [];
  private backlogBytes = 0;
  private isWorking = false;
  private warnedAt = -Infinity;
  private readonly stopWords: readonly Buffer[];

  constructor(
    private readonly tasks: Tasks,
    private readonly host: DeskHost,
  ) {
    const words = ["stop", host.description.stopAction];
    this.stopWords = words.map((each) => Buffer.from(JSON.stringify(each).slice(1, -1)));
  }

  /** Tell that the robot lives. */
  beat(notEnded: readonly string[], error: string | undefined): void {
    const told = { op: "alive", id: "", action: "", state: "running", not_ended: notEnded, error: error ?? null };
    const { rejected } = this;
    const { errors } = this.tasks;
    this.host.publish({ ...told, ...(rejected > 0 && { rejected }), ...(errors > 0 && { errors }) });
  }

  // ---- arrival

  /** Take a message: carry out a stop at once, queue everything else. Throws nothing. */
  readonly take = (message: Message): void => {
    if (message.data.length > MAX_COMMAND_BYTES) {
      this.takeTooLarge(message);
      return;
    }
    const stop = this.stopIn(message);
    if (stop) this.tasks.act(() => this.stop(stop));
    else this.enqueue({ message, epoch: this.tasks.epoch });
  };

  private stopIn(message: Message): Members | undefined {
    if (!this.stopWords.some((each) => message.data.includes(each))) return undefined;
    try {
      const command = asMembers(message.payload);
      return this.isStop(command) ? command : undefined;
    } catch {
      return undefined; // reported when its turn comes
    }
  }

  private isStop({ op, action }: Members): boolean {
    return op === "stop" || (op === "invoke" && action === this.host.description.stopAction);
  }

  private takeTooLarge(message: Message): void {
    const [id, op] = [found(ID, message.data), found(OPERATION, message.data)];
    if (op === "stop") {
      this.tasks.act(() => this.stop({ op, id }));
      return;
    }
    const size = (message.data.length / 1000).toFixed(0);
    const error = `the message has ${size} kB; at most ${MAX_COMMAND_BYTES / 1000} kB are read`;
    this.reject(error);
    if (id && op === "invoke" && !this.openIds.has(id)) this.answerer(id, op, "")({ state: "failed", error });
  }

  private enqueue(received: Backlogged): void {
    const size = received.message.data.length;
    if (this.backlog.length >= MAX_BACKLOG || this.backlogBytes + size > MAX_BACKLOG_BYTES) {
      this.reject("messages come faster than they are handled");
      return;
    }
    this.backlog.push(received);
    this.backlogBytes += size;
    if (!this.isWorking) {
      this.isWorking = true;
      setImmediate(() => this.work());
    }
  }

  private work(): void {
    const endMs = performance.now() + MAX_TURN_MS;
    let next = 0;
    while (next < this.backlog.length && performance.now() < endMs) {
      const { message, epoch } = this.backlog[next++]!;
      this.backlogBytes -= message.data.length;
      this.tasks.act(() => this.receive(message, epoch));
    }
    this.backlog.splice(0, next);
    this.isWorking = this.backlog.length > 0;
    if (this.isWorking) setImmediate(() => this.work());
  }

  private reject(reason: string): void {
    this.rejected++;
    const now = performance.now();
    if (now < this.warnedAt + WARN_INTERVAL_MS) return;
    this.warnedAt = now;
    const { name } = this.host.description;
    this.host.warn(`${name}: a command was rejected (${this.rejected} so far): ${reason}`);
  }

  // ---- commands

  private stop(command: Members): void {
    const ended = textOf(command["ends"]);
    if (ended !== undefined) {
      this.ended.push(programOf(ended));
      if (this.ended.length > MAX_ENDED) this.ended.shift();
    }
    const [id, op] = [idOf(command), String(command["op"])];
    if (id === undefined || (op === "invoke" && this.openIds.has(id))) this.tasks.stop(undefined);
    else this.tasks.stop(this.answerer(id, op, this.host.description.stopAction));
  }

  private receive(message: Message, epoch: number): void {
    let payload: unknown;
    try {
      payload = message.payload;
    } catch (error) {
      if (!(error instanceof DecodeError)) throw error;
      this.reject(error.message);
      return;
    }
    const command = asMembers(payload);
    const [id, op, from] = [idOf(command), command["op"], textOf(command["from"])];
    if (from !== undefined && from.length > MAX_ID_LENGTH) {
      this.fail(id, quotable(op), `“from” is longer than ${MAX_ID_LENGTH} characters`);
      return;
    }
    const program = from === undefined ? undefined : programId(from, message.publisher);
    if (program !== undefined) this.tasks.signOfLife(program, op === "invoke");
    if (op === "alive" || id === undefined) return;
    if (op === "cancel") this.cancel(id, quotable(command["action"] ?? ""), message.publisher);
    else if (op === "invoke") this.invoke(id, command, program, message.publisher, epoch);
    else {
      const shown = quotable(op ?? null);
      this.fail(id, shown, `there is no “${shown}”; a command is invoke, cancel, stop or alive`);
    }
  }

  private fail(id: string | undefined, op: string, error: string): void {
    if (id !== undefined && !this.openIds.has(id)) this.answerer(id, op, "")({ state: "failed", error });
  }

  private cancel(id: string, name: string, publisher: bigint | undefined): void {
    let error = this.tasks.cancel(({ spec }) => spec.id === id && spec.publisher === publisher);
    if (error === NOTHING_RUNS && this.openIds.has(id))
      error = `only who asked for “${name || id}” can cancel it; a stop is for everybody`;
    if (error !== undefined) this.answerer(id, "cancel", name)({ state: "failed", error });
  }

  private invoke(
    id: string,
    command: Members,
    program: ProgramId | undefined,
    publisher: bigint | undefined,
    epoch: number,
  ): void {
    if (this.openIds.has(id)) return; // the same command a second time
    const { action: name, input = null } = command;
    const answer = this.answerer(id, "invoke", quotable(name ?? ""));
    if (this.ended.includes(textOf(command["from"]) ?? "")) {
      answer({ state: "canceled", error: "its program was stopped" });
      return;
    }
    const action = typeof name === "string" ? this.host.description.actions.get(name) : undefined;
    if (!action) {
      answer({ state: "failed", error: this.unknown(name) });
      return;
    }
    const problems = problemsOf(action.parameters, input ?? {});
    if (problems.length > 0) {
      answer({ state: "failed", error: problems.map((each) => `${action.name}: ${each}`).join("; ") });
      return;
    }
    this.openIds.add(id);
    this.tasks.submit(this.task(id, action, asMembers(input), answer, program, publisher, epoch));
  }

  private unknown(name: unknown): string {
    const { name: robot, actions } = this.host.description;
    const close = typeof name === "string" ? nearMiss(name, actions.keys()) : undefined;
    return `${robot} can't “${quotable(name ?? "")}”${close === undefined ? "" : `; did you mean “${close}”?`}`;
  }

  private task(
    id: string,
    action: RobotAction,
    input: Members,
    answer: (answer: Answer) => void,
    program: ProgramId | undefined,
    publisher: bigint | undefined,
    epoch: number,
  ): Task {
    return new Task({
      id,
      action: action.name,
      title: action.title,
      run: async (call) => outputOf(action, await action.run(complete(action, input), call)),
      answer,
      uses: action.uses,
      onBusy: action.onBusy,
      timeoutS: action.timeoutS,
      isCancellable: action.cancellable,
      program,
      publisher,
      goesOn: action.repeatS !== undefined,
      epoch,
    });
  }

  private answerer(id: string, op: string, action: string): (answer: Answer) => void {
    return (answer) => {
      if (isFinal(answer) && op === "invoke") this.openIds.delete(id);
      const { state, output = {}, feedback = {}, error = null, waitsFor = [], replaces = [] } = answer;
      this.host.publish({
        ...{ id, op, action, state, output, feedback, error },
        ...(waitsFor.length > 0 && { waits_for: waitsFor }),
        ...(replaces.length > 0 && { replaces }),
      });
    };
  }
}

/** The name in `from` of the program that is ended by who knows `key`. */
function programOf(key: string): string {
  return `program-${createHash("sha256").update(key, "utf8").digest("hex").slice(0, 16)}`;
}

/** The id to which an answer can be sent. */
function idOf({ id }: Members): string | undefined {
  const text = textOf(id);
  return text === undefined || text.length > MAX_ID_LENGTH || hasSurrogates(text) ? undefined : text;
}

/** The member of a command that is too large to decode, if it is in the first or last 2 kB. */
function found(pattern: RegExp, data: Buffer): string {
  const ends = [data.subarray(0, END_BYTES), data.subarray(-END_BYTES)];
  for (const each of ends) {
    const match = pattern.exec(each.toString("latin1"));
    if (match) return match[1]!;
  }
  return "";
}

/** The input with the defaults of what it leaves out. */
function complete({ parameters }: RobotAction, input: Members): Record<string, unknown> {
  const completed: Record<string, unknown> = {};
  for (const [name, parameter] of Object.entries(parameters)) {
    const value = Object.hasOwn(input, name) ? input[name] : isRequired(parameter) ? undefined : parameter.default;
    completed[name] = value ?? (parameter.optional ? null : value);
  }
  return completed;
}

/** What an action returned, as the output of its answer. @throws {Failed} if no message can hold it. */
function outputOf({ name, output }: RobotAction, returned: unknown): Members {
  const value = returned === undefined || returned === null ? {} : returned;
  const members = isMembers(value) ? value : { value };
  try {
    checkSendable(members);
    const problems = output && Object.keys(members).length > 0 ? problemsOf(output, members) : [];
    if (problems.length > 0) throw new Failed(problems.join("; "));
  } catch (error) {
    throw new Failed(`${name} was done, but its result is wrong: ${errorText(error)}`);
  }
  return members;
}
