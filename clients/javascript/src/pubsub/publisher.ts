import { ClosedError, EncodeError } from "../errors.js";
import { type Codec, codecFor, type Encoded } from "../messages/codecs.js";
import { type ExpectedSubscriber, problemText, type PublisherCount } from "../protocol/requests.js";
import type { Hold } from "../sockets/socket.js";
import { nowNs } from "../system/clock.js";
import { WINDOW_BYTES } from "./byte_window.js";
import { MAX_HISTORY } from "./history.js";
import { type Generation, OriginalTransport } from "./original.js";
import type { PublisherTransport } from "./transports.js";
import { XpubTransport } from "./xpub_transport.js";

/** Wait for a promise; resolve to false if it rejects or the timeout expires. */
function within(timeoutMs: number, awaited: Promise<unknown>): Promise<boolean> {
  return new Promise((resolve) => {
    const timer = setTimeout(() => resolve(false), timeoutMs);
    awaited
      .then(
        () => resolve(true),
        () => resolve(false),
      )
      .finally(() => clearTimeout(timer));
  });
}

const HANDSHAKE_MS = 500;
const BYE_AGAIN_MS = 50;
const CLOSE_S = 2;
const VALIDATE_INTERVAL_MS = 1000;
const WARN_INTERVAL_MS = 10_000;
const MAX_EARLY_MESSAGES = 50_000;

/** Options of a publisher. */
export interface PublisherOptions {
  /** `json` (default), `string`, `bytes`, `msgpack`, `image`, or a name of your own, which is encoded as JSON. */
  readonly type?: string;
  /** Keep the newest message and send it to late subscribers. */
  readonly latched?: boolean;
  /** Number of messages to keep for late subscribers (0 to 1000). */
  readonly history?: number;
  /** Whether small messages that wait for the socket may be sent as one batch. Default: true. */
  readonly batch?: boolean;
  /** Throw `EncodeError` for a payload that can't be encoded, instead of counting it in `rejected`. */
  readonly strict?: boolean;
}

export interface PublisherSpec extends PublisherOptions {
  readonly id: bigint;
  readonly number: number;
  readonly topic: string;
}

/** Interface of the node used by a publisher. */
export interface PublisherHost {
  readonly hold: () => Hold;
  readonly warn: (message: string) => void;
  /** Bind and register; return the subscribers to wait for. */
  register(
    publisher: Publisher,
    transport: PublisherTransport,
  ): Promise<{ expected: ExpectedSubscriber[]; hung: ExpectedSubscriber[] }>;
  /** Generation of the original NEP's wire, if it replaces the native one. */
  readonly generation?: Generation;
  reportMissing(subscribers: readonly bigint[]): void;
  unregister(publisher: Publisher): void;
}

/**
 * Publishes messages on one topic; returned by `Node.publisher` and `Node.new_pub`.
 *
 * A payload that can't be encoded is dropped, counted in `rejected` and reported by the node's `warning` event.
 *
 * @example
 * const publisher = await node.publisher("odometry", { type: "json" });
 * publisher.publish({ x: 1.5, y: 0 });
 */
export class Publisher<T = unknown> {
  /** Resolves when all registered subscribers are connected, after at most 0.5 s; rejects if registration fails. */
  readonly ready: Promise<this>;
  /** Number of payloads that could not be encoded. */
  rejected = 0;
  /** Number of messages in which NaN or infinity was sent as `null`, because JSON has neither. */
  nanCount = 0;
  /** Number of messages dropped for lack of room before the handshake was complete. */
  dropped = 0;
  /** Number of malformed subscriptions. */
  refused = 0;
  private readonly codec: Codec;
  private readonly transport: PublisherTransport;
  private readonly waitedFor = new Map<bigint, string>();
  private early: { readonly encoded: Encoded; readonly stampNs: bigint }[] | undefined = [];
  private earlyBytes = 0;
  private isBusy = true;
  private closing: Promise<void> | undefined;
  private onSubscribers: (() => void) | undefined;
  private problem = "";
  private validatedAt = -Infinity;
  private warnedAt = -Infinity;

  /** @internal */
  constructor(
    readonly spec: PublisherSpec,
    private readonly host: PublisherHost,
  ) {
    this.codec = codecFor(spec.type ?? "json");
    this.transport = this.makeTransport();
    this.ready = this.begin();
    this.ready.catch(() => undefined); // also reported by the node's `warning` event
  }

  private makeTransport(): PublisherTransport {
    const { id, topic, batch = true, latched = false } = this.spec;
    const hold = (): Hold => (this.isBusy ? "brief" : this.host.hold());
    const onSubscribers = (): void => this.onSubscribers?.();
    const { generation } = this.host;
    if (generation) return new OriginalTransport(topic, this.type, this.codec, generation, hold, onSubscribers);
    const history = Math.min(MAX_HISTORY, Math.max(this.spec.history ?? 0, latched ? 1 : 0));
    const spec = { id, topic, codecNumber: this.codec.number, latched: history > 0, history, batch };
    return new XpubTransport(spec, hold, onSubscribers, () => this.refused++);
  }

  get topic(): string {
    return this.spec.topic;
  }

  /** Message type under which the topic is registered. */
  get type(): string {
    return this.spec.type ?? "json";
  }

  /** Name of the codec. */
  get codecName(): string {
    return this.codec.name;
  }

  /** Number of messages published so far, with or without subscribers. */
  get sent(): number {
    return this.transport.count + (this.early?.length ?? 0);
  }

  /** Number of connected subscribers. */
  get subscribers(): number {
    return this.transport.subscribers;
  }

  /** Names of subscribed nodes that are not connected: they are starting up or not responding. */
  get unconnectedSubscribers(): string[] {
    const names = [...this.waitedFor].filter(([id]) => !this.transport.hasGreeted(id)).map(([, name]) => name);
    return [...new Set(names)].sort();
  }

  get isClosed(): boolean {
    return this.closing !== undefined;
  }

  // ---- handshake

  private async begin(): Promise<this> {
    try {
      const { expected, hung } = await this.host.register(this, this.transport);
      for (const each of [...expected, ...hung]) this.waitedFor.set(each.id, each.nodeName);
      const absent = await this.waitForSubscribers(new Set(expected.map((each) => each.id)));
      if (absent.length > 0) this.host.reportMissing(absent);
    } catch (error) {
      this.early = undefined;
      this.transport.close();
      this.closing ??= Promise.resolve();
      this.host.unregister(this);
      throw error;
    } finally {
      this.isBusy = false;
    }
    const early = this.early ?? [];
    this.early = undefined;
    for (const { encoded, stampNs } of early) this.transport.send(encoded, stampNs);
    return this;
  }

  private waitForSubscribers(expected: ReadonlySet<bigint>): Promise<bigint[]> {
    const absent = (): bigint[] => [...expected].filter((each) => !this.transport.hasGreeted(each));
    return this.waitUntil(() => absent().length === 0, HANDSHAKE_MS).then(absent);
  }

  private waitUntil(isMet: () => boolean, timeoutMs: number): Promise<void> {
    if (isMet()) return Promise.resolve();
    this.transport.wake();
    return new Promise((resolve) => {
      const finish = (): void => {
        clearTimeout(timer);
        this.onSubscribers = undefined;
        resolve();
      };
      const timer = setTimeout(finish, timeoutMs);
      this.onSubscribers = () => {
        if (isMet()) finish();
      };
    });
  }

  // ---- publishing

  /**
   * Publish a message. Returns immediately; messages are queued until the handshake is complete.
   *
   * @throws {ClosedError} after `close`.
   * @throws {EncodeError} with the option `strict`, if the payload can't be encoded.
   */
  publish(payload: T): void {
    if (this.closing) throw new ClosedError(`The publisher of "${this.topic}" is closed.`);
    const isWanted =
      this.early || this.spec.latched || this.spec.history || this.spec.strict || this.transport.isHeard;
    if (!isWanted && performance.now() < this.validatedAt + VALIDATE_INTERVAL_MS) {
      this.transport.skip();
      return;
    }
    const encoded = this.encode(payload);
    if (!encoded) return;
    if (this.early) this.keepEarly(encoded);
    else if (isWanted) this.transport.send(encoded);
    else {
      this.validatedAt = performance.now(); // reports encoding errors without subscribers too
      this.transport.skip();
    }
  }

  private encode(payload: T): Encoded | undefined {
    try {
      const encoded = this.codec.encode(payload);
      this.problem = "";
      if (encoded.nonFinite) {
        this.nanCount++;
        this.warnRarely(`"${this.topic}": NaN or infinity was sent as null, because JSON has neither.`);
      }
      return encoded;
    } catch (error) {
      if (!(error instanceof EncodeError) || this.spec.strict) throw error;
      this.rejected++;
      this.problem = error.message;
      this.warnRarely(`"${this.topic}": a message was rejected. ${error.message}`);
      return undefined;
    }
  }

  private keepEarly(encoded: Encoded): void {
    const bytes = encoded.data.length;
    if (this.early!.length >= MAX_EARLY_MESSAGES || (this.earlyBytes + bytes > WINDOW_BYTES && this.earlyBytes > 0)) {
      this.dropped++;
      this.warnRarely(`"${this.topic}": messages are dropped because the publisher isn't connected yet.`);
      return;
    }
    this.earlyBytes += bytes;
    this.early!.push({ encoded, stampNs: nowNs() });
  }

  private warnRarely(message: string): void {
    const now = performance.now();
    if (now < this.warnedAt + WARN_INTERVAL_MS) return;
    this.warnedAt = now;
    this.host.warn(message);
  }

  // ---- lease and close

  /** @internal */
  counts(): PublisherCount {
    const { count, bytes, lastStampNs } = this.transport;
    return {
      id: this.spec.id,
      count: BigInt(count),
      bytes: BigInt(bytes),
      last_seq: BigInt(count),
      ...(lastStampNs !== undefined && { last_stamp_ns: lastStampNs }),
      ...(this.problem && { problem: problemText(this.problem) }),
    };
  }

  /** @internal */
  move(hosts: readonly string[]): Promise<string[]> {
    return this.transport.move(hosts);
  }

  /** @internal Read subscriptions now. */
  wake(): void {
    this.transport.wake();
  }

  /**
   * Unregister, deliver pending messages, and close.
   *
   * @param timeoutS Seconds to wait until subscribers have received everything. Default: 2.
   */
  close(timeoutS = CLOSE_S): Promise<void> {
    this.closing ??= this.finish(timeoutS);
    return this.closing;
  }

  private async finish(timeoutS: number): Promise<void> {
    const isReady = await within(timeoutS * 1000, this.ready);
    this.host.unregister(this);
    if (!isReady) {
      this.transport.close();
      return;
    }
    this.isBusy = true;
    const deadline = performance.now() + timeoutS * 1000;
    if (this.transport.sayBye()) await this.waitForFarewells(deadline);
    await this.transport.flush();
    this.transport.close(Math.max(0, deadline - performance.now()));
  }

  private async waitForFarewells(deadline: number): Promise<void> {
    const haveLeft = (): boolean => this.transport.subscribers === 0;
    while (!haveLeft() && performance.now() < deadline) {
      await this.waitUntil(haveLeft, Math.min(BYE_AGAIN_MS, deadline - performance.now()));
      this.transport.sayBye(); // repeated, because a full queue drops it
    }
    if (!haveLeft())
      this.host.warn(`"${this.topic}" was closed before ${this.subscribers} subscriber(s) had received all messages.`);
  }

  /** @internal Wait for the first subscriber; without a master the expected number is unknown. */
  waitForAnybody(timeoutMs: number): Promise<void> {
    return this.waitUntil(() => this.transport.isHeard, timeoutMs);
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
