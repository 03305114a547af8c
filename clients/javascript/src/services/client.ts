import {
  ClosedError,
  EncodeError,
  type NepError,
  NoServerError,
  RequestRefusedError,
  ServerGoneError,
  ServiceError,
  ServiceTimeoutError,
  WireError,
} from "../errors.js";
import { codecFor, codecNumbered } from "../messages/codecs.js";
import type { SubscriberCount } from "../protocol/requests.js";
import type { ReachablePublisher, SessionSubscriber } from "../session/master_session.js";
import { DealerSocket } from "../sockets/socket.js";
import {
  CallKind,
  type CallParts,
  MAX_PAYLOAD_BYTES,
  packCall,
  readCall,
  readFailure,
  SERVICE_TYPE,
  timeoutMs,
} from "./wire.js";

const DEFAULT_TIMEOUT_S = 5;
const IDLE_MS = 200; // idle connections are closed, because they keep the process alive
const DRAIN_MS = 20; // time to read replies that arrived before the connection ended
const RETRY_MS = 100; // after a failed handshake, for example with a PUB socket of another program

/** Options of a client. */
export interface ClientOptions {
  /** `json` (default), `msgpack`, `string` or `bytes`. */
  readonly type?: string;
  /** Seconds that a call waits for a server and its reply; `null` waits without a time limit. Default: 5. */
  readonly timeoutS?: number | null;
}

export interface CallOptions {
  readonly timeoutS?: number | null;
  /** Signal that ends the wait; the server may still execute the call. */
  readonly signal?: AbortSignal;
}

/** Interface of the node used by a client. */
export interface ClientHost {
  readonly warn: (message: string) => void;
  register(client: SessionSubscriber): Promise<void>;
  unregister(client: SessionSubscriber): void;
}

interface PendingCall {
  readonly number: bigint;
  readonly codec: number;
  readonly payload: Buffer;
  readonly timeoutS: number | null;
  readonly endsAt: number;
  connection: Connection | undefined;
  settle(outcome: { readonly answer: unknown } | { readonly error: Error }): void;
}

/** Connection to one server. */
interface Connection {
  readonly server: bigint;
  readonly socket: DealerSocket;
  readonly calls: Map<bigint, PendingCall>;
  /** True after a successful handshake, when calls may have been sent. */
  isOpen: boolean;
  idle: NodeJS.Timeout | undefined;
}

/**
 * Calls a service; returned by `Node.client`. Any number of calls may be in progress.
 *
 * @example
 * const { sum } = await node.client("/sum").call({ a: 2, b: 3 });
 */
export class Client<Request = unknown, Answer = unknown> implements SessionSubscriber {
  /** Resolves when the client is registered; rejects if registration fails. */
  readonly ready: Promise<this>;
  /** Number of calls that received a reply, including errors. */
  answered = 0;
  /** Number of calls without a reply. */
  failed = 0;
  /** Number of late and malformed replies. */
  late = 0;
  private readonly servers = new Map<bigint, ReachablePublisher>();
  private readonly connections = new Map<bigint, Connection>();
  /** Retry timers of servers whose handshake failed. */
  private readonly retries = new Map<bigint, NodeJS.Timeout>();
  private readonly waiting = new Set<PendingCall>();
  private lastNumber = 0n;
  private closed: Promise<void> | undefined;

  /** @internal */
  constructor(
    readonly id: bigint,
    readonly service: string,
    private readonly options: ClientOptions,
    private readonly host: ClientHost,
  ) {
    this.ready = this.begin();
    this.ready.catch(() => undefined); // reported by each call
  }

  private async begin(): Promise<this> {
    try {
      await this.host.register(this);
      return this;
    } catch (error) {
      for (const each of this.waiting) each.settle({ error: error as NepError });
      await this.close();
      throw error;
    }
  }

  /**
   * Call the service and return its reply.
   *
   * @throws {NoServerError} if no server was reached before the timeout; nothing was sent.
   * @throws {ServiceTimeoutError} if the call was sent and no reply arrived before the timeout.
   * @throws {ServerGoneError} if the server exited during the call.
   * @throws {ServiceError} if the server's callback threw an error.
   * @throws {RequestRefusedError} if the server rejected the call.
   * @throws {EncodeError | DecodeError} if the request can't be encoded or the reply can't be decoded.
   */
  call(request: Request, options: CallOptions = {}): Promise<Answer> {
    const codec = codecFor(this.options.type ?? "json");
    return new Promise<Answer>((resolve, reject) => {
      if (this.closed) throw new ClosedError(`The client of "${this.service}" is closed.`);
      options.signal?.throwIfAborted();
      const payload = codec.encode(request).data;
      if (payload.length > MAX_PAYLOAD_BYTES)
        throw new EncodeError(`The request has ${payload.length} bytes; the limit is 64 MiB.`);
      const { timeoutS = this.options.timeoutS === undefined ? DEFAULT_TIMEOUT_S : this.options.timeoutS } = options;
      const pending: PendingCall = {
        number: ++this.lastNumber,
        codec: codec.number,
        payload,
        timeoutS,
        endsAt: timeoutS === null ? Infinity : performance.now() + timeoutS * 1000,
        connection: undefined,
        settle: (outcome) => {
          clearTimeout(timer);
          options.signal?.removeEventListener("abort", abort);
          this.forget(pending);
          if ("answer" in outcome) resolve(outcome.answer as Answer);
          else reject(outcome.error);
        },
      };
      const abort = (): void => this.fail(pending, options.signal!.reason as Error);
      const timer = timeoutS === null ? undefined : setTimeout(() => this.expire(pending), timeoutS * 1000);
      options.signal?.addEventListener("abort", abort, { once: true });
      this.waiting.add(pending);
      this.send(pending);
    });
  }

  private expire(pending: PendingCall): void {
    const name = `"${this.service}"`;
    const error = pending.connection?.isOpen
      ? new ServiceTimeoutError(
          `${name} did not reply within ${pending.timeoutS} s; it may still execute the call.`,
        )
      : new NoServerError(`No server of ${name} was reached within ${pending.timeoutS} s.`);
    this.fail(pending, error);
  }

  private fail(pending: PendingCall, error: Error): void {
    this.failed++;
    pending.settle({ error });
  }

  private forget(pending: PendingCall): void {
    this.waiting.delete(pending);
    const { connection } = pending;
    if (!connection) return;
    connection.calls.delete(pending.number);
    if (connection.calls.size === 0) this.endWhenIdle(connection);
  }

  // ---- connections

  private send(pending: PendingCall): void {
    const server = [...this.servers.values()].find(
      (each) => each.codec === SERVICE_TYPE && each.endpoint && !this.retries.has(each.id),
    );
    if (!server || pending.connection) return;
    const connection = this.connections.get(server.id) ?? this.connectTo(server);
    clearTimeout(connection.idle);
    pending.connection = connection;
    connection.calls.set(pending.number, pending);
    const leftS = pending.endsAt === Infinity ? null : (pending.endsAt - performance.now()) / 1000;
    const { number, codec, payload } = pending;
    connection.socket.send(packCall({ kind: CallKind.CALL, codec, timeoutMs: timeoutMs(leftS), number, payload }));
  }

  private connectTo(server: ReachablePublisher): Connection {
    const calls = new Map<bigint, PendingCall>();
    const socket = new DealerSocket(
      server.endpoint!,
      (parts) => this.read(parts, connection),
      () => (calls.size > 0 ? "brief" : "none"),
      {
        onOpen: () => (connection.isOpen = true),
        onEnd: () => void setTimeout(() => this.ended(connection), DRAIN_MS),
      },
    );
    const connection: Connection = { server: server.id, socket, calls, isOpen: false, idle: undefined };
    this.connections.set(server.id, connection);
    return connection;
  }

  private endWhenIdle(connection: Connection): void {
    clearTimeout(connection.idle);
    connection.idle = setTimeout(() => this.drop(connection), IDLE_MS);
  }

  private drop(connection: Connection): void {
    clearTimeout(connection.idle);
    if (this.connections.get(connection.server) === connection) this.connections.delete(connection.server);
    connection.socket.close();
  }

  private ended(connection: Connection): void {
    if (!connection.isOpen) {
      this.retryLater(connection);
      return;
    }
    const error = new ServerGoneError(
      `The server of "${this.service}" exited during the call, which may or may not have been executed.`,
    );
    for (const each of [...connection.calls.values()]) this.fail(each, error);
    this.drop(connection);
  }

  /** Handle a failed handshake: calls, which were not sent, go to other servers, or wait for this one. */
  private retryLater(connection: Connection): void {
    const { server, calls } = connection;
    if (this.connections.get(server) !== connection) return;
    this.drop(connection);
    const retry = (): void => {
      this.retries.delete(server);
      for (const each of this.waiting) this.send(each);
    };
    this.retries.set(server, setTimeout(retry, RETRY_MS));
    for (const each of calls.values()) {
      each.connection = undefined;
      this.send(each);
    }
  }

  private read(parts: Buffer[], connection: Connection): void {
    let answer: CallParts;
    try {
      answer = readCall(parts, "answer");
    } catch (error) {
      if (!(error instanceof WireError)) throw error;
      this.late++;
      this.host.warn(`"${this.service}": received a malformed reply. ${error.message}`);
      return;
    }
    const pending = connection.calls.get(answer.number);
    if (!pending) {
      this.late++;
      return;
    }
    if (answer.kind === CallKind.REFUSED) {
      this.fail(
        pending,
        new RequestRefusedError(`The server of "${this.service}" rejected the call: ${readFailure(answer.payload).reason}`),
      );
      return;
    }
    this.answered++;
    pending.settle(this.outcome(answer));
  }

  private outcome(answer: CallParts): { answer: unknown } | { error: Error } {
    if (answer.kind === CallKind.ERROR) {
      const { kind, reason } = readFailure(answer.payload);
      return { error: new ServiceError(kind, reason) };
    }
    try {
      const codec = codecNumbered(answer.codec);
      if (!codec)
        throw new WireError("codec", `The reply has codec ${answer.codec}, which this version of nep-js doesn't support.`);
      return { answer: codec.decode(answer.payload, {}) };
    } catch (error) {
      return { error: error as Error };
    }
  }

  // ---- session

  /** @internal */
  counts(): SubscriberCount {
    return { id: this.id, received: BigInt(this.answered), lost: BigInt(this.failed) };
  }

  /** @internal */
  connect(remotes: readonly ReachablePublisher[]): void {
    for (const each of remotes) this.servers.set(each.id, each);
    for (const each of this.waiting) this.send(each);
  }

  /** @internal */
  reconcile(_topic: string, remotes: readonly ReachablePublisher[]): void {
    this.servers.clear();
    this.connect(remotes);
  }

  /** @internal Send no further calls to a server; calls in progress end with the connection. */
  gone(id: bigint): void {
    this.servers.delete(id);
  }

  /** @internal */
  tick(): void {
    // Replies have no seqs.
  }

  /** Unregister; calls in progress reject with `ClosedError`. */
  close(): Promise<void> {
    this.closed ??= this.finish();
    return this.closed;
  }

  private finish(): Promise<void> {
    this.host.unregister(this);
    for (const each of [...this.waiting])
      this.fail(each, new ClosedError(`The client of "${this.service}" is closed.`));
    for (const each of [...this.connections.values()]) this.drop(each);
    for (const each of this.retries.values()) clearTimeout(each);
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
