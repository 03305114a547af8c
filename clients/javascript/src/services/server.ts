import { DecodeError, EncodeError, WireError } from "../errors.js";
import { codecFor, codecNumbered, type Encoded } from "../messages/codecs.js";
import type { ExpectedSubscriber, PublisherCount } from "../protocol/requests.js";
import { Bindings } from "../sockets/bindings.js";
import { RouterSocket } from "../sockets/socket.js";
import { CallKind, type CallParts, MAX_PAYLOAD_BYTES, packCall, packFailure, readCall } from "./wire.js";

const MAX_CALLS = 1000;
const MAX_CALL_BYTES = 256 * 2 ** 20;
const CLOSE_S = 2;

/** Callback that handles a call. An error that it throws becomes a `ServiceError` at the client; `undefined` becomes an empty map. */
export type ServiceCallback<Request = unknown, Answer = unknown> = (request: Request) => Answer | Promise<Answer>;

/** Interface of the node used by a server. */
export interface ServerHost {
  readonly warn: (message: string) => void;
  register(server: Server): Promise<{ expected: ExpectedSubscriber[] }>;
  unregister(server: Server): void;
}

/**
 * Handles the calls of a service; returned by `Node.serve` and `Node.new_server`. Each call is handled on arrival; calls
 * of an asynchronous callback overlap.
 *
 * @example
 * await node.serve("/sum", ({ a, b }) => ({ sum: a + b }));
 */
export class Server {
  /** Resolves when the service is registered; rejects if registration fails. */
  readonly ready: Promise<this>;
  /** Number of calls that were answered, including those that failed. */
  calls = 0;
  /** Number of calls that failed. */
  errors = 0;
  /** Number of rejected calls: the server was closing or busy, or the call could not be decoded. */
  refused = 0;
  /** Number of malformed calls. */
  unreadable = 0;
  private readonly socket = new RouterSocket(MAX_PAYLOAD_BYTES);
  private readonly bindings = new Bindings(this.socket);
  private readonly running = new Set<Promise<void>>();
  private runningBytes = 0;
  private answeredBytes = 0;
  private closed: Promise<void> | undefined;

  /** @internal */
  constructor(
    readonly id: bigint,
    readonly service: string,
    private readonly callback: ServiceCallback,
    private readonly host: ServerHost,
  ) {
    this.socket.read(
      (parts) => this.read(parts),
      () => "long",
    );
    this.ready = this.begin();
    this.ready.catch(() => undefined); // also reported by the node's `warning` event
  }

  private async begin(): Promise<this> {
    try {
      await this.host.register(this);
      return this;
    } catch (error) {
      this.closed ??= Promise.resolve();
      this.socket.close();
      this.host.unregister(this);
      throw error;
    }
  }

  private read(parts: Buffer[]): void {
    const [client, ...rest] = parts;
    let call: CallParts;
    try {
      call = readCall(rest, "call");
    } catch (error) {
      if (!(error instanceof WireError)) throw error;
      this.unreadable++;
      this.host.warn(`"${this.service}": received a malformed call. ${error.message}`);
      return;
    }
    const reason = this.refusal(call);
    if (reason !== undefined) {
      this.refused++;
      this.send(client!, call, CallKind.REFUSED, { data: packFailure("", reason) });
      return;
    }
    this.runningBytes += call.payload.length;
    const answered = this.answer(client!, call).finally(() => {
      this.runningBytes -= call.payload.length;
      this.running.delete(answered);
    });
    this.running.add(answered);
  }

  private refusal(call: CallParts): string | undefined {
    if (this.closed) return `"${this.service}" is closing`;
    if (this.running.size >= MAX_CALLS || this.runningBytes + call.payload.length > MAX_CALL_BYTES) {
      return `"${this.service}" has too many pending calls`;
    }
    return codecNumbered(call.codec) ? undefined : `unknown codec ${call.codec}`;
  }

  private async answer(client: Buffer, call: CallParts): Promise<void> {
    const codec = codecNumbered(call.codec)!;
    let request: unknown;
    try {
      request = codec.decode(call.payload, {});
    } catch (error) {
      if (!(error instanceof DecodeError)) throw error;
      this.refused++;
      this.send(client, call, CallKind.REFUSED, { data: packFailure("", error.message) });
      return;
    }
    try {
      const answer = (await this.callback(request)) ?? {};
      const encoded = codec.encode(answer);
      if (encoded.data.length > MAX_PAYLOAD_BYTES)
        throw new EncodeError(`The reply has ${encoded.data.length} bytes; the limit is 64 MiB.`);
      this.calls++;
      this.send(client, call, CallKind.ANSWER, encoded);
    } catch (error) {
      this.calls++;
      this.errors++;
      const { name = "Error", message = String(error) } = error instanceof Error ? error : {};
      this.host.warn(
        `"${this.service}": a call failed. ${error instanceof Error ? (error.stack ?? message) : message}`,
      );
      this.send(client, call, CallKind.ERROR, { data: packFailure(name, message) });
    }
  }

  private send(client: Buffer, call: CallParts, kind: number, { data }: Encoded): void {
    const codec = kind === CallKind.ANSWER ? call.codec : codecFor("json").number;
    if (kind !== CallKind.REFUSED) this.answeredBytes += data.length;
    this.socket.send([client, ...packCall({ kind, codec, timeoutMs: 0, number: call.number, payload: data })]);
  }

  /** @internal */
  counts(): PublisherCount {
    const count = BigInt(this.calls);
    return { id: this.id, count, bytes: BigInt(this.answeredBytes), last_seq: count, errors: this.errors };
  }

  /** @internal */
  move(hosts: readonly string[]): Promise<string[]> {
    return this.bindings.move(hosts);
  }

  /**
   * Unregister, reject new calls, wait for running callbacks, and close.
   *
   * @param timeoutS Seconds to wait for callbacks. Default: 2.
   */
  close(timeoutS = CLOSE_S): Promise<void> {
    this.closed ??= this.finish(timeoutS);
    return this.closed;
  }

  private async finish(timeoutS: number): Promise<void> {
    this.host.unregister(this);
    let timer: NodeJS.Timeout | undefined;
    const expired = new Promise((resolve) => (timer = setTimeout(resolve, timeoutS * 1000)));
    await Promise.race([Promise.allSettled(this.running), expired]);
    clearTimeout(timer);
    await this.socket.flush();
    this.socket.close();
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
