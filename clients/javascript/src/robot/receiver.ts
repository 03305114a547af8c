// Reception of messages to a robot: stops are executed on arrival, before any other message is decoded; all other
// messages are queued.
import { DecodeError } from "../errors.js";
import type { Message } from "../messages/message.js";
import type { Tasks } from "./tasks.js";
import { asMembers, type Members } from "./text.js";

const MAX_COMMAND_BYTES = 64_000;
const MAX_BACKLOG = 2000;
const MAX_BACKLOG_BYTES = 16_000_000;
const MAX_TURN_MS = 5; // maximum time for consecutive messages, after which sockets are read, because of stops
const END_BYTES = 2048;
const WARN_INTERVAL_MS = 10_000;
const ID = /"id"\s*:\s*"([\w .:/-]{1,200})"/;
const OPERATION = /"op"\s*:\s*"(\w{1,20})"/;

/** Interpretation of the commands on one topic. */
export interface Dialect {
  /** Return true if a command stops the robot. */
  isStop(command: Members): boolean;
  /** Execute a stop. */
  stop(command: Members): void;
  /** Handle a command; `epoch` is `Tasks.epoch` when it was received. */
  receive(command: Members, publisher: bigint | undefined, epoch: number): void;
  /** Reply to a command that was not decoded. */
  refuse(id: string, operation: string, error: string): void;
}

/** Counter of rejected messages to one robot; warns at intervals. */
export class RejectedMessages {
  count = 0;
  private warnedAt = -Infinity;

  constructor(
    private readonly robot: string,
    private readonly warn: (message: string) => void,
  ) {}

  add(topic: string, reason: string): void {
    this.count++;
    const now = performance.now();
    if (now < this.warnedAt + WARN_INTERVAL_MS) return;
    this.warnedAt = now;
    this.warn(`${this.robot}: a message on "${topic}" was rejected (${this.count} so far): ${reason}`);
  }
}

interface Backlogged {
  readonly message: Message;
  readonly use: (members: Members, message: Message) => void;
}

/** Bounded queue that decodes the messages of one topic in short turns, so that stops are not delayed. */
export class MessageQueue {
  private readonly backlog: Backlogged[] = [];
  private backlogBytes = 0;
  private isWorking = false;

  constructor(
    private readonly topic: string,
    private readonly tasks: Tasks,
    private readonly rejected: RejectedMessages,
    private readonly maxMessageBytes: number,
  ) {}

  /** Queue a message; `use` is called with its members. Return an error message if it is too large. */
  put(message: Message, use: (members: Members, message: Message) => void): string | undefined {
    const size = message.data.length;
    if (size > this.maxMessageBytes) {
      const limit = this.maxMessageBytes / 1000;
      const error = `the message is ${(size / 1000).toFixed(0)} kB in size; the limit is ${limit} kB`;
      this.rejected.add(this.topic, error);
      return error;
    }
    if (this.backlog.length >= MAX_BACKLOG || this.backlogBytes + size > MAX_BACKLOG_BYTES) {
      this.rejected.add(this.topic, "messages arrive faster than they are handled");
      return undefined;
    }
    this.backlog.push({ message, use });
    this.backlogBytes += size;
    if (!this.isWorking) {
      this.isWorking = true;
      setImmediate(() => this.work());
    }
    return undefined;
  }

  private work(): void {
    const endMs = performance.now() + MAX_TURN_MS;
    let next = 0;
    while (next < this.backlog.length && performance.now() < endMs) {
      const { message, use } = this.backlog[next++]!;
      this.backlogBytes -= message.data.length;
      this.tasks.act(() => this.decode(message, use));
    }
    this.backlog.splice(0, next);
    this.isWorking = this.backlog.length > 0;
    if (this.isWorking) setImmediate(() => this.work());
  }

  private decode(message: Message, use: Backlogged["use"]): void {
    let payload: unknown;
    try {
      payload = message.payload;
    } catch (error) {
      if (!(error instanceof DecodeError)) throw error;
      this.rejected.add(this.topic, error.message);
      return;
    }
    use(asMembers(payload), message);
  }
}

/** Receiver of the commands on one topic. */
export class CommandReceiver {
  private readonly queue: MessageQueue;
  private readonly stopWords: readonly Buffer[];

  /**
   * @param stopWords Texts of which every stop command contains at least one.
   * @param queuesStops True to also queue executed stops, so that `Dialect.receive` can reply to them.
   */
  constructor(
    topic: string,
    private readonly tasks: Tasks,
    private readonly dialect: Dialect,
    rejected: RejectedMessages,
    stopWords: readonly string[],
    private readonly queuesStops = false,
  ) {
    this.queue = new MessageQueue(topic, tasks, rejected, MAX_COMMAND_BYTES);
    this.stopWords = stopWords.map((each) => Buffer.from(JSON.stringify(each).slice(1, -1)));
  }

  /** Handle a message: execute a stop at once, queue other commands. Never throws. */
  readonly take = (message: Message): void => {
    const stop = this.stopIn(message);
    if (stop) this.tasks.act(() => this.dialect.stop(stop));
    if (stop && !this.queuesStops) return;
    const { epoch } = this.tasks;
    const error = this.queue.put(message, (command) => this.dialect.receive(command, message.publisher, epoch));
    if (error === undefined) return;
    const [id, operation] = [found(ID, message.data), found(OPERATION, message.data)];
    if (id && operation === "invoke") this.tasks.act(() => this.dialect.refuse(id, operation, error));
  };

  private stopIn(message: Message): Members | undefined {
    if (message.data.length > MAX_COMMAND_BYTES) {
      if (found(OPERATION, message.data) !== "stop") return undefined;
      return { op: "stop", id: found(ID, message.data) };
    }
    if (!this.stopWords.some((each) => message.data.includes(each))) return undefined;
    try {
      const command = asMembers(message.payload);
      return this.dialect.isStop(command) ? command : undefined;
    } catch {
      return undefined; // reported when it is dequeued
    }
  }
}

/** Return a member of a command that is too large to decode, if it is in the first or last 2 kB. */
function found(pattern: RegExp, data: Buffer): string {
  const ends = [data.subarray(0, END_BYTES), data.subarray(-END_BYTES)];
  for (const each of ends) {
    const match = pattern.exec(each.toString("latin1"));
    if (match) return match[1]!;
  }
  return "";
}
