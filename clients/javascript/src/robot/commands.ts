// Conversion of commands on a robot's command topic to tasks and stops.
import { createHash } from "node:crypto";
import { Failed } from "./call.js";
import type { Description, RobotAction } from "./description.js";
import type { Dialect, RejectedMessages } from "./receiver.js";
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

const MAX_ID_LENGTH = 200;
const MAX_ENDED = 100;

/** Interface of the robot used by its command desk. */
export interface DeskHost {
  readonly description: Description;
  readonly rejected: RejectedMessages;
  publish(answer: Members): void;
}

/** Sender of a command. */
interface TaskOrigin {
  readonly program?: ProgramId | undefined;
  readonly publisher?: bigint | undefined;
  readonly epoch: number;
}

/** Commands of one robot in the native dialect. */
export class CommandDesk implements Dialect {
  private readonly openIds = new Set<string>();
  private readonly ended: string[] = []; // programs

  constructor(
    private readonly tasks: Tasks,
    private readonly host: DeskHost,
  ) {}

  /** Publish the heartbeat. */
  beat(notEnded: readonly string[], error: string | undefined): void {
    const told = { op: "alive", id: "", action: "", state: "running", not_ended: notEnded, error: error ?? null };
    const { count: rejected } = this.host.rejected;
    const { errors } = this.tasks;
    this.host.publish({ ...told, ...(rejected > 0 && { rejected }), ...(errors > 0 && { errors }) });
  }

  isStop({ op, action }: Members): boolean {
    return op === "stop" || (op === "invoke" && action === this.host.description.stopAction);
  }

  refuse(id: string, op: string, error: string): void {
    this.fail(id, op, error);
  }

  stop(command: Members): void {
    const ended = textOf(command["ends"]);
    if (ended !== undefined) {
      this.ended.push(programOf(ended));
      if (this.ended.length > MAX_ENDED) this.ended.shift();
    }
    const [id, op] = [idOf(command), String(command["op"])];
    if (id === undefined || (op === "invoke" && this.openIds.has(id))) this.tasks.stop(undefined);
    else this.tasks.stop(this.answerer(id, op, this.host.description.stopAction));
  }

  receive(command: Members, publisher: bigint | undefined, epoch: number): void {
    const [id, op, from] = [idOf(command), command["op"], textOf(command["from"])];
    if (from !== undefined && from.length > MAX_ID_LENGTH) {
      this.fail(id, quotable(op), `“from” is longer than ${MAX_ID_LENGTH} characters`);
      return;
    }
    const program = from === undefined ? undefined : programId(from, publisher);
    if (program !== undefined) this.tasks.signOfLife(program, op === "invoke");
    if (op === "alive" || id === undefined) return;
    if (op === "cancel") this.cancel(id, quotable(command["action"] ?? ""), publisher);
    else if (op === "invoke") this.invoke(id, command, { program, publisher, epoch });
    else {
      const shown = quotable(op ?? null);
      this.fail(id, shown, `unknown operation “${shown}”; use invoke, cancel, stop or alive`);
    }
  }

  private fail(id: string | undefined, op: string, error: string): void {
    if (id !== undefined && !this.openIds.has(id)) this.answerer(id, op, "")({ state: "failed", error });
  }

  private cancel(id: string, name: string, publisher: bigint | undefined): void {
    let error = this.tasks.cancel(({ spec }) => spec.id === id && spec.publisher === publisher);
    if (error === NOTHING_RUNS && this.openIds.has(id))
      error = `only the program that started “${name || id}” can cancel it; any program can stop the robot`;
    if (error !== undefined) this.answerer(id, "cancel", name)({ state: "failed", error });
  }

  private invoke(id: string, command: Members, origin: TaskOrigin): void {
    if (this.openIds.has(id)) return; // duplicate command
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
    this.tasks.submit(this.task(id, action, asMembers(input), answer, origin));
  }

  private unknown(name: unknown): string {
    const { name: robot, actions } = this.host.description;
    const close = typeof name === "string" ? nearMiss(name, actions.keys()) : undefined;
    return `${robot} can't “${quotable(name ?? "")}”${close === undefined ? "" : `; did you mean “${close}”?`}`;
  }

  /** Return a task that runs an action; the caller has validated the input. */
  task(
    id: string,
    action: RobotAction,
    input: Members,
    answer: (answer: Answer) => void,
    { program, publisher, epoch }: TaskOrigin,
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

/** Return the name in `from` of the program whose key is `key`; a stop with the key ends this program. */
function programOf(key: string): string {
  return `program-${createHash("sha256").update(key, "utf8").digest("hex").slice(0, 16)}`;
}

/** Return the id of a command if a reply can contain it. */
function idOf({ id }: Members): string | undefined {
  const text = textOf(id);
  return text === undefined || text.length > MAX_ID_LENGTH || hasSurrogates(text) ? undefined : text;
}

/** Return the input with defaults for missing parameters. */
function complete({ parameters }: RobotAction, input: Members): Record<string, unknown> {
  const completed: Record<string, unknown> = {};
  for (const [name, parameter] of Object.entries(parameters)) {
    const value = Object.hasOwn(input, name) ? input[name] : isRequired(parameter) ? undefined : parameter.default;
    completed[name] = value ?? (parameter.optional ? null : value);
  }
  return completed;
}

/** Return the output of an action's reply. @throws {Failed} if the returned value is invalid or can't be encoded. */
function outputOf({ name, output }: RobotAction, returned: unknown): Members {
  const value = returned === undefined || returned === null ? {} : returned;
  const members = isMembers(value) ? value : { value };
  try {
    checkSendable(members);
    const problems = output && Object.keys(members).length > 0 ? problemsOf(output, members) : [];
    if (problems.length > 0) throw new Failed(problems.join("; "));
  } catch (error) {
    throw new Failed(`${name} finished, but its result is invalid: ${errorText(error)}`);
  }
  return members;
}
