import { ClosedError, DecodeError } from "../errors.js";
import type { Message } from "../messages/message.js";
import { problemText, type SubscriberCount } from "../protocol/requests.js";
import type { ClockDifference } from "../messages/clocks.js";
import type { ReachablePublisher, SessionSubscriber } from "../session/master_session.js";
import type { Hold } from "../sockets/socket.js";
import { isPattern } from "../wire/pattern.js";
import { Inbox } from "./inbox.js";
import { OriginalReader } from "./original.js";
import { TopicReader, type TopicReaderHost } from "./topic_reader.js";

const HANDSHAKE_MS = 500;
const MAX_MESSAGES = 10_000;
const MAX_BYTES = 256 * 2 ** 20;
const MAX_TURN_MS = 10; // maximum time for consecutive callbacks, after which timers run
const WARN_INTERVAL_MS = 10_000;

/** Options of a subscriber. */
export interface SubscribeOptions {
  /** Type under which the subscriber is registered. Default: `json`. Messages are decoded by their own codec. */
  readonly type?: string;
  /** `all` (default), or `latest`: a newer message replaces the unread one. */
  readonly keep?: "all" | "latest";
  /** Inbox size in messages; the oldest ones are dropped and counted in `lost`. Default: 10 000. */
  readonly maxMessages?: number;
  /** Inbox size in bytes. Default: 256 MiB. */
  readonly maxBytes?: number;
  /**
   * Called with each message on arrival, without queuing, instead of a callback; must return quickly.
   *
   * @internal
   */
  readonly sink?: (message: Message) => void;
  /** Signal that closes the subscriber when aborted. */
  readonly signal?: AbortSignal;
}

export interface SubscriberSpec extends SubscribeOptions {
  readonly id: bigint;
  readonly number: number;
  readonly topic: string;
}

/** Interface of subscribers that can be connected without a master. */
export interface Attachable {
  attach(endpoint: string, how: "bind" | "connect"): Promise<void>;
  /** Wait until an echo of a publisher has been received. */
  waitForAnybody(timeoutMs: number): Promise<void>;
}

/** Interface of the node used by a subscriber. */
export interface SubscriberHost {
  readonly hold: () => Hold;
  readonly warn: (message: string) => void;
  /** Whether the wire of the original NEP is used instead of the native one. */
  readonly isOriginal?: boolean;
  /** Register; calls `connect` with the registered publishers. */
  register(subscriber: SessionSubscriber & Attachable): Promise<void>;
  unregister(subscriber: SessionSubscriber): void;
}

/** Callback for each message. */
export type MessageCallback<T = unknown> = (message: Message<T>) => void;

/**
 * Receives the messages of a topic; returned by `Node.subscribe`. Iterate over it, or pass a callback. A topic
 * with the level `*` or `**` is a pattern.
 *
 * @example
 * for await (const message of node.subscribe("odometry")) {
 *   console.log(message.payload, message.stampNs);
 * }
 */
export class Subscriber<T = unknown> implements AsyncIterable<Message<T>>, SessionSubscriber, Attachable {
  /** Resolves when all publishers of the topic are connected, after at most 0.5 s; rejects if registration fails. */
  readonly ready: Promise<this>;
  readonly isPattern: boolean;
  private readonly readers = new Map<string, TopicReader>();
  private readonly original: OriginalReader | undefined;
  private readonly inbox: Inbox;
  private clocks: ReadonlyMap<string, ClockDifference> = new Map();
  private readonly readerHost: TopicReaderHost;
  private readonly waiters: ((message: Message<T> | undefined) => void)[] = [];
  private onGreeted: (() => void) | undefined;
  private isDelivering = false;
  private turnEnds = 0;
  private closed: Promise<void> | undefined;
  private failure: Error | undefined;
  private problem = "";
  private refusal = "";
  private warnedAt = -Infinity;
  private readonly totals = { received: 0, lost: 0, refused: 0 };
  private readonly close_ = (): void => void this.close();

  /** @internal */
  constructor(
    readonly spec: SubscriberSpec,
    private readonly host: SubscriberHost,
    private readonly callback?: MessageCallback<T>,
  ) {
    this.isPattern = isPattern(spec.topic);
    this.inbox = new Inbox(spec.keep !== "latest", spec.maxMessages ?? MAX_MESSAGES, spec.maxBytes ?? MAX_BYTES);
    this.readerHost = {
      hold: host.hold,
      onMessage: (message, reader) => this.arrived(message as Message<T>, reader),
      onRefused: (reason) => this.warnRefused(reason),
      onGreeted: () => this.onGreeted?.(),
    };
    this.original = host.isOriginal ? this.originalReader() : undefined;
    if (!this.original && !this.isPattern) this.reader(spec.topic);
    this.ready = this.begin();
    this.ready.catch(() => undefined); // also reported by the node's `warning` event
    if (spec.signal?.aborted) this.close_();
    else spec.signal?.addEventListener("abort", this.close_, { once: true });
  }

  get topic(): string {
    return this.spec.topic;
  }

  get type(): string {
    return this.spec.type ?? "json";
  }

  /** Number of received messages. */
  get received(): number {
    return this.sum((each) => each.sources.received, this.totals.received);
  }

  /** Number of messages that were not received, or were dropped because the inbox was full. */
  get lost(): number {
    return this.sum((each) => each.sources.lost, this.totals.lost);
  }

  /** Number of malformed messages that were rejected. */
  get refused(): number {
    return this.sum((each) => each.refused, this.totals.refused);
  }

  /** Number of publishers whose echo was received. */
  get publishers(): number {
    return this.sum((each) => each.sources.echoing, 0);
  }

  get isClosed(): boolean {
    return this.closed !== undefined;
  }

  private sum(of: (reader: TopicReader) => number, start: number): number {
    let total = start;
    for (const each of this.readers.values()) total += of(each);
    return total;
  }

  // ---- handshake

  private async begin(): Promise<this> {
    try {
      await this.host.register(this);
    } catch (error) {
      this.failure = error as Error;
      await this.close();
      throw error;
    }
    await this.waitForEchoes();
    return this;
  }

  private waitForEchoes(): Promise<void> {
    const listed = [...this.readers.values()]
      .flatMap((each) => [...each.sources.byId.values()])
      .filter((each) => each.remote);
    return this.waitUntil(
      () => listed.every((each) => each.hasEchoed || each.problem || each.endsAt !== undefined),
      HANDSHAKE_MS,
    );
  }

  /** @internal */
  waitForAnybody(timeoutMs: number): Promise<void> {
    return this.waitUntil(() => this.publishers > 0 || this.received > 0, timeoutMs);
  }

  private waitUntil(isMet: () => boolean, timeoutMs: number): Promise<void> {
    if (isMet() || this.isClosed) return Promise.resolve();
    return new Promise((resolve) => {
      const finish = (): void => {
        clearTimeout(timer);
        this.onGreeted = undefined;
        resolve();
      };
      const timer = setTimeout(finish, timeoutMs);
      this.onGreeted = () => {
        if (isMet() || this.isClosed) finish();
      };
    });
  }

  private originalReader(): OriginalReader {
    const onMessage = (message: Message): void => {
      this.totals.received++;
      this.arrived(message as Message<T>);
    };
    const onRefused = (reason: string): void => {
      this.totals.refused++;
      this.warnRefused(reason);
    };
    return new OriginalReader(this.topic, this.type, this.host.hold, onMessage, onRefused);
  }

  private reader(topic: string): TopicReader {
    let reader = this.readers.get(topic);
    if (!reader) {
      reader = new TopicReader(this.spec.id, topic, this.type, this.readerHost);
      reader.sources.correct(this.clocks);
      this.readers.set(topic, reader);
    }
    return reader;
  }

  /** @internal Bind or connect without a master. */
  attach(endpoint: string, how: "bind" | "connect"): Promise<void> {
    return (this.original ?? this.reader(this.topic)).attach(endpoint, how);
  }

  // ---- reading

  private arrived(message: Message<T>, reader?: TopicReader): void {
    if (this.isClosed) return;
    if (this.spec.sink) {
      this.spec.sink(message as Message);
      return;
    }
    const waiter = this.inbox.length === 0 ? this.waiters.shift() : undefined;
    if (waiter) {
      waiter(message);
      return;
    }
    if (this.callback && this.inbox.length === 0 && !this.isDelivering && performance.now() < this.turnEnds) {
      this.deliver(message);
      return;
    }
    const dropped = this.inbox.put(message as Message);
    if (dropped > 0) {
      this.countDropped(dropped, reader);
      this.warnRarely(`"${this.topic}": messages arrive faster than they are read; the oldest ones are dropped.`);
    }
    if (this.callback) this.deliverSoon();
  }

  private countDropped(count: number, reader?: TopicReader): void {
    if (reader) {
      reader.sources.dropped(count);
    } else {
      this.totals.received -= count;
      this.totals.lost += count;
    }
  }

  /** Run callbacks now if the time for callbacks is not used up, otherwise in the next turn of the event loop. */
  private deliverSoon(): void {
    if (this.isDelivering) return;
    this.isDelivering = true;
    if (performance.now() >= this.turnEnds + MAX_TURN_MS) this.deliverInbox();
    else setImmediate(() => this.deliverInbox());
  }

  private deliverInbox(): void {
    this.turnEnds = performance.now() + MAX_TURN_MS;
    while (!this.isClosed) {
      const message = this.inbox.take();
      if (!message) break;
      this.deliver(message as Message<T>);
      if (performance.now() >= this.turnEnds && this.inbox.length > 0) {
        setImmediate(() => this.deliverInbox());
        return;
      }
    }
    this.isDelivering = false;
  }

  private deliver(message: Message<T>): void {
    try {
      this.callback!(message);
      this.problem = "";
    } catch (error) {
      if (error instanceof DecodeError) this.problem = error.message;
      this.warnRarely(
        `"${this.topic}": the callback failed. ${error instanceof Error ? (error.stack ?? error.message) : String(error)}`,
      );
    }
  }

  /**
   * Return the next message.
   *
   * @param timeoutS Seconds to wait; undefined waits without a time limit.
   * @returns undefined after the timeout, or if the subscriber is closed.
   * @throws {ClosedError} if the subscriber has a callback.
   */
  receive(timeoutS?: number): Promise<Message<T> | undefined> {
    if (this.callback) return Promise.reject(new ClosedError(`The subscriber of "${this.topic}" has a callback.`));
    const message = this.inbox.take() as Message<T> | undefined;
    if (message || this.isClosed) return Promise.resolve(message);
    return new Promise((resolve) => {
      const settle = (received: Message<T> | undefined): void => {
        clearTimeout(timer);
        resolve(received);
      };
      const expire = (): void => {
        this.waiters.splice(this.waiters.indexOf(settle), 1);
        resolve(undefined);
      };
      const timer = timeoutS === undefined ? undefined : setTimeout(expire, timeoutS * 1000);
      this.waiters.push(settle);
    });
  }

  /** Iterate over messages as they arrive; leaving the loop closes the subscriber. Throws if registration fails. */
  async *[Symbol.asyncIterator](): AsyncIterator<Message<T>, void, undefined> {
    try {
      await Promise.race([this.ready.catch(() => undefined), this.closedEarly()]);
      if (this.failure) throw this.failure;
      for (let message = await this.receive(); message; message = await this.receive()) yield message;
    } finally {
      await this.close();
    }
  }

  private closedEarly(): Promise<void> {
    return new Promise((resolve) => {
      if (this.isClosed) resolve();
      else this.onClosed.push(resolve);
    });
  }

  private readonly onClosed: (() => void)[] = [];

  private warnRefused(reason: string): void {
    this.refusal = reason;
    this.warnRarely(`"${this.topic}": received a malformed message. ${reason}`);
  }

  private warnRarely(message: string): void {
    const now = performance.now();
    if (now < this.warnedAt + WARN_INTERVAL_MS) return;
    this.warnedAt = now;
    this.host.warn(message);
  }

  // ---- session

  /** @internal */
  counts(): SubscriberCount {
    const bounded = (count: number): bigint => BigInt(Math.max(0, count));
    const refusal = this.refusal && `${this.refused} messages were rejected. ${this.refusal}`;
    const problem = problemText(this.problem || refusal);
    return {
      id: this.spec.id,
      received: bounded(this.received),
      lost: bounded(this.lost),
      ...(problem && { problem }),
    };
  }

  /** @internal */
  connect(remotes: readonly ReachablePublisher[], areNew = false): void {
    if (!this.isClosed) for (const each of remotes) this.reader(each.topic).connect(each, areNew);
  }

  /** @internal */
  reconcile(topic: string, remotes: readonly ReachablePublisher[]): void {
    if (!this.isClosed && (remotes.length > 0 || this.readers.has(topic))) this.reader(topic).reconcile(remotes);
  }

  /** @internal */
  gone(id: bigint, lastSeq: bigint, isClosed: boolean): void {
    for (const each of this.readers.values()) each.gone(id, lastSeq, isClosed);
  }

  /** @internal */
  correct(clocks: ReadonlyMap<string, ClockDifference>): void {
    this.clocks = clocks;
    for (const each of this.readers.values()) each.sources.correct(clocks);
  }

  /** @internal */
  tick(lastSeqs: ReadonlyMap<bigint, bigint>): void {
    for (const [topic, reader] of this.readers) {
      reader.tick(lastSeqs);
      if (!this.isPattern || reader.sources.byId.size > 0) continue;
      this.readers.delete(topic); // the topic has no publishers left
      this.totals.received += reader.sources.received;
      this.totals.lost += reader.sources.lost;
      this.totals.refused += reader.refused;
      reader.close();
    }
  }

  /** Unregister and discard unread messages. */
  close(): Promise<void> {
    this.closed ??= this.finish();
    return this.closed;
  }

  private finish(): Promise<void> {
    this.spec.signal?.removeEventListener("abort", this.close_);
    this.host.unregister(this);
    this.inbox.clear();
    for (const each of this.readers.values()) each.close();
    this.original?.close();
    for (const waiter of this.waiters.splice(0)) waiter(undefined);
    for (const each of this.onClosed.splice(0)) each();
    this.onGreeted?.();
    return Promise.resolve();
  }

  /** Close at the end of an `await using` block. */
  [Symbol.asyncDispose](): Promise<void> {
    return this.close();
  }

  /** Start to close at the end of a `using` block. */
  [Symbol.dispose](): void {
    void this.close();
  }
}
