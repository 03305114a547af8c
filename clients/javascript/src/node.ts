import { EventEmitter } from "node:events";
import { hostname } from "node:os";
import {
  attachment,
  type Configuration,
  type DirectConfiguration,
  directConfiguration,
  type DirectOptions,
  type HybridConfiguration,
  type OriginalConfiguration,
} from "./configuration.js";
import { NepError } from "./errors.js";
import { Publisher, type PublisherHost, type PublisherOptions } from "./pubsub/publisher.js";
import {
  type MessageCallback,
  type Attachable,
  type SubscribeOptions,
  Subscriber,
  type SubscriberHost,
} from "./pubsub/subscriber.js";
import type { NodeRecord } from "./protocol/requests.js";
import { Client, type ClientHost, type ClientOptions } from "./services/client.js";
import { Server, type ServerHost, type ServiceCallback } from "./services/server.js";
import { SERVICE_TYPE, topicOfService } from "./services/wire.js";
import type { Hold } from "./sockets/socket.js";
import { MASTER_WAIT_S, MasterSession } from "./session/master_session.js";
import { hostOf, LOOPBACK, masterAddress } from "./system/addresses.js";
import { nowNs } from "./system/clock.js";
import { computerId } from "./system/computer.js";
import { idFrom, newKey, nodeIdFrom } from "./wire/ids.js";
import { checkNodeName, checkTopic } from "./wire/names.js";
import { isPattern } from "./wire/pattern.js";

const LEAVE_S = 0.3;
const DIRECT_WAIT_MS = 300; // without a master the number of peers is unknown

/** Options of a node. */
export interface NodeOptions {
  /** Host and port of the master, such as `192.168.1.10:7780`. Default: `NEP_MASTER`, else `127.0.0.1:7780`. */
  readonly master?: string;
  /** Seconds that `publisher` and `subscribe` wait for a master; `null` waits until there is one. Default: 2. */
  readonly masterWaitS?: number | null;
}

/** Called with each decoded payload. */
export type PayloadCallback<T = unknown> = (payload: T) => void;

interface Closable {
  close(timeoutS?: number): Promise<void>;
}

const openNodes = new Set<Node>();

// Emitted when only unreferenced timers are left, at the end of the program: deliver pending messages and leave.
process.on("beforeExit", () => {
  for (const each of openNodes) void each.close();
});

/**
 * Participant of the graph: creates publishers and subscribers, and renews its lease with the master.
 *
 * A program that only publishes exits when everything is delivered; one that subscribes runs until `close`.
 * Before `process.exit()`, await `close()`. Problems that no call can report are emitted as the event
 * `warning`, one sentence each; without a listener they go to `process.emitWarning`.
 *
 * @example
 * import { Node } from "nep-js";
 *
 * await using node = new Node("display");
 * for await (const message of node.subscribe("odometry")) console.log(message.payload);
 */
export class Node extends EventEmitter<{ warning: [string] }> {
  /** Id of the node: 16 hexadecimal digits. */
  readonly id: string;
  private readonly record: NodeRecord;
  private readonly masterOf: string;
  private readonly masterWaitS: number | undefined;
  private readonly sessions = new Map<string, MasterSession>();
  private readonly open = new Set<Closable>();
  private readonly holders = new Set<object>();
  private lastNumber = 0;
  private closed: Promise<void> | undefined;

  /**
   * @param name 1 to 200 bytes without control characters. Two nodes may have the same name.
   * @throws {BadNameError | NepError} if the name or the master's address is invalid.
   */
  constructor(
    readonly name: string,
    options: NodeOptions | string = {},
  ) {
    super();
    const { master, masterWaitS = MASTER_WAIT_S } = typeof options === "string" ? {} : options;
    this.masterOf = masterAddress(master);
    this.masterWaitS = masterWaitS ?? undefined;
    const key = newKey();
    this.id = nodeIdFrom(key);
    this.record = {
      id: this.id,
      name: checkNodeName(name),
      host: hostname(),
      pid: process.pid,
      language: "JavaScript",
      since_ns: nowNs(),
      key,
      computer: computerId(),
    };
    openNodes.add(this);
  }

  get isClosed(): boolean {
    return this.closed !== undefined;
  }

  // ---- publishers and subscribers

  /**
   * Return a publisher that is connected to all registered subscribers: they receive the next message.
   *
   * @throws {MasterUnreachableError} if no master replies before the timeout.
   * @throws {BadTopicError | RequestRefusedError}
   */
  publisher<T = unknown>(topic: string, options: PublisherOptions = {}): Promise<Publisher<T>> {
    return this.makePublisher<T>(topic, options, this.masterWaitS).ready;
  }

  /**
   * Subscribe to a topic or to a pattern such as `/robot/**`. Iterate over the result, or pass a callback.
   * Await `ready` to be sure that all publishers are connected.
   *
   * @example
   * node.subscribe("odometry", { keep: "latest" }, (message) => console.log(message.payload));
   */
  subscribe<T = unknown>(topic: string, options?: SubscribeOptions, callback?: MessageCallback<T>): Subscriber<T>;
  subscribe<T = unknown>(topic: string, callback: MessageCallback<T>): Subscriber<T>;
  subscribe<T = unknown>(
    topic: string,
    second: SubscribeOptions | MessageCallback<T> = {},
    callback?: MessageCallback<T>,
  ): Subscriber<T> {
    const [options, onMessage] = typeof second === "function" ? [{}, second] : [second, callback];
    return this.makeSubscriber<T>(topic, options, onMessage, this.masterWaitS);
  }

  private makePublisher<T>(
    topic: string,
    options: PublisherOptions,
    waitS: number | undefined,
    configuration?: Configuration,
  ): Publisher<T> {
    this.checkOpen();
    checkTopic(topic);
    const number = this.nextNumber();
    const id = idFrom(this.record.key, number);
    const common = { hold: () => this.hold(), warn: (message: string) => this.warn(message) };
    const host: PublisherHost =
      configuration?.kind === "direct"
        ? { ...common, ...this.directPublishing(configuration) }
        : {
            ...common,
            ...this.masteredPublishing(this.session(configuration), { id, number, topic }, options, waitS),
          };
    const publisher = new Publisher<T>({ ...options, id, number, topic }, host);
    this.open.add(publisher);
    return publisher;
  }

  private masteredPublishing(
    session: MasterSession,
    named: { readonly id: bigint; readonly number: number; readonly topic: string },
    { history = 0, latched = false }: PublisherOptions,
    waitS: number | undefined,
  ): Omit<PublisherHost, "hold" | "warn"> {
    return {
      register: (owner, transport) => {
        const record = {
          ...named,
          msg_type: owner.type,
          codec: owner.codecName,
          latched: latched || history > 0,
          history,
        };
        const registered = {
          counts: () => owner.counts(),
          move: (hosts: readonly string[]) => transport.move(hosts),
        };
        return this.patiently(session, waitS, session.addPublisher(record, registered, waitS));
      },
      reportMissing: (subscribers) => session.reportMissing(named.id, subscribers),
      unregister: (owner) => {
        session.removePublisher(named.id, BigInt(owner.sent));
        this.open.delete(owner);
      },
    };
  }

  private directPublishing(direct: DirectConfiguration): Omit<PublisherHost, "hold" | "warn"> {
    return {
      ...(direct.wire === "original" && { generation: direct.generation }),
      register: async (owner, transport) => {
        const { endpoint, how } = attachment(direct, true);
        await transport.attach(endpoint, how);
        await owner.waitForAnybody(DIRECT_WAIT_MS);
        return { expected: [], hung: [] };
      },
      reportMissing: () => undefined,
      unregister: (owner) => this.open.delete(owner),
    };
  }

  private makeSubscriber<T>(
    topic: string,
    options: SubscribeOptions,
    callback: MessageCallback<T> | undefined,
    waitS: number | undefined,
    configuration?: Configuration,
  ): Subscriber<T> {
    this.checkOpen();
    checkTopic(topic);
    const number = this.nextNumber();
    const id = idFrom(this.record.key, number);
    const session = configuration?.kind === "direct" ? undefined : this.session(configuration);
    const record = { id, number, topic, msg_type: options.type ?? "json", pattern: isPattern(topic) };
    const host: SubscriberHost = {
      hold: () => "long",
      warn: (message) => this.warn(message),
      isOriginal: configuration?.kind === "direct" && configuration.wire === "original",
      register: (owner) => {
        this.holders.add(owner);
        this.wake();
        if (session) return this.patiently(session, waitS, session.addSubscriber(record, owner, waitS));
        return this.attachSubscriber(owner, configuration as DirectConfiguration);
      },
      unregister: (owner) => {
        this.holders.delete(owner);
        session?.removeSubscriber(id);
        this.open.delete(owner as Subscriber);
      },
    };
    const subscriber = new Subscriber<T>({ ...options, id, number, topic }, host, callback);
    if (!subscriber.isClosed) this.open.add(subscriber);
    return subscriber;
  }

  private async attachSubscriber(owner: Attachable, direct: DirectConfiguration): Promise<void> {
    const { endpoint, how } = attachment(direct, false);
    await owner.attach(endpoint, how);
    if (direct.wire === "native") await owner.waitForAnybody(DIRECT_WAIT_MS);
  }

  // ---- services

  /**
   * Handle the calls of a service. Resolves when the service is registered.
   *
   * @throws {MasterUnreachableError | BadTopicError | RequestRefusedError}
   */
  serve<Request = unknown, Answer = unknown>(
    service: string,
    callback: ServiceCallback<Request, Answer>,
  ): Promise<Server> {
    return this.makeServer(service, callback as ServiceCallback, this.masterWaitS).ready;
  }

  /** Return a client of a service; no server needs to exist yet. */
  client<Request = unknown, Answer = unknown>(service: string, options: ClientOptions = {}): Client<Request, Answer> {
    return this.makeClient<Request, Answer>(service, options);
  }

  private makeServer(service: string, callback: ServiceCallback, waitS: number | undefined): Server {
    this.checkOpen();
    const topic = topicOfService(service);
    const number = this.nextNumber();
    const id = idFrom(this.record.key, number);
    const session = this.session();
    const host: ServerHost = {
      warn: (message) => this.warn(message),
      register: (owner) => {
        this.holders.add(owner);
        this.wake();
        const record = { id, number, topic, msg_type: SERVICE_TYPE, codec: SERVICE_TYPE };
        return this.patiently(session, waitS, session.addPublisher(record, owner, waitS));
      },
      unregister: (owner) => {
        this.holders.delete(owner);
        session.removePublisher(id, BigInt(owner.calls));
        this.open.delete(owner);
      },
    };
    const server = new Server(id, service, callback, host);
    this.open.add(server);
    return server;
  }

  private makeClient<Request, Answer>(service: string, options: ClientOptions): Client<Request, Answer> {
    this.checkOpen();
    const topic = topicOfService(service);
    const number = this.nextNumber();
    const id = idFrom(this.record.key, number);
    const session = this.session();
    const host: ClientHost = {
      warn: (message) => this.warn(message),
      register: (owner) =>
        this.patiently(
          session,
          this.masterWaitS,
          session.addSubscriber({ id, number, topic, msg_type: SERVICE_TYPE }, owner, this.masterWaitS),
        ),
      unregister: (owner) => {
        session.removeSubscriber(id);
        this.open.delete(owner as Client);
      },
    };
    const client = new Client<Request, Answer>(id, service, options, host);
    this.open.add(client);
    return client;
  }

  /** Await a registration; emit a warning if there is no master or the registration fails. */
  private async patiently<R>(session: MasterSession, waitS: number | undefined, registered: Promise<R>): Promise<R> {
    const warnAfter = (): void =>
      this.warn(
        `No master is reachable at ${session.address}; waiting for one. Start it with "nep master", or set NEP_MASTER to its address.`,
      );
    const timer = waitS === undefined ? setTimeout(warnAfter, MASTER_WAIT_S * 1000) : undefined;
    try {
      return await registered;
    } catch (error) {
      if (!this.isClosed) this.warn((error as Error).message);
      throw error;
    } finally {
      clearTimeout(timer);
    }
  }

  // ---- names of the original NEP

  /** Return a publisher immediately. Messages are queued until it is connected, also while there is no master. */
  new_pub<T = unknown>(topic: string, type = "json", configuration?: Configuration | OriginalConfiguration): Publisher<T> {
    return this.makePublisher<T>(topic, { type }, undefined, this.configured(configuration));
  }

  /** Same as {@link new_pub}. */
  new_publisher<T = unknown>(topic: string, type = "json", configuration?: Configuration | OriginalConfiguration): Publisher<T> {
    return this.new_pub<T>(topic, type, configuration);
  }

  /** Subscribe; `callback` receives each decoded payload. Waits for a master without a time limit. */
  new_sub<T = unknown>(
    topic: string,
    type = "json",
    callback?: PayloadCallback<T>,
    configuration?: Configuration | OriginalConfiguration,
  ): Subscriber<T> {
    const onMessage = callback && ((message: { readonly payload: T }): void => callback(message.payload));
    return this.makeSubscriber<T>(topic, { type }, onMessage, undefined, this.configured(configuration));
  }

  /** Same as {@link new_sub}, with a callback. */
  new_callback<T = unknown>(
    topic: string,
    type: string,
    callback: PayloadCallback<T>,
    configuration?: Configuration | OriginalConfiguration,
  ): Subscriber<T> {
    return this.new_sub<T>(topic, type, callback, configuration);
  }

  /** Handle the calls of a service. Waits for a master without a time limit. */
  new_server<Request = unknown, Answer = unknown>(
    service: string,
    callback: ServiceCallback<Request, Answer>,
  ): Server {
    return this.makeServer(service, callback as ServiceCallback, undefined);
  }

  /** Same as {@link client}. */
  new_client<Request = unknown, Answer = unknown>(
    service: string,
    options: ClientOptions = {},
  ): Client<Request, Answer> {
    return this.client<Request, Answer>(service, options);
  }

  /** Connect through the master at `ip`; `127.0.0.1` means the node's own master. */
  hybrid(ip = LOOPBACK): HybridConfiguration {
    return { kind: "hybrid", master: ip === LOOPBACK ? this.masterOf : masterAddress(ip) };
  }

  /**
   * Connect to `ip:port` without a master, with the frames of the original NEP unless `options` specify others.
   *
   * @param mode `one2many`: the publisher binds the port; `many2one`: the subscriber does; `many2many`: both
   *   connect to a proxy, subscribers to `port + 1`. Without a mode both connect to `port`, as in nep-js 0.1.1:
   *   the other program binds it.
   * @throws {NepError} if the address, port or mode is invalid.
   */
  direct(
    ip = LOOPBACK,
    port: number | string = 9000,
    mode?: string,
    options: DirectOptions = {},
  ): DirectConfiguration {
    return directConfiguration(ip, port, mode, options);
  }

  /** Same as {@link hybrid}. */
  master(ip = LOOPBACK): HybridConfiguration {
    return this.hybrid(ip);
  }

  // ---- close

  /**
   * Close all publishers and subscribers, deliver pending messages, and leave the master.
   *
   * @param timeoutS Seconds to wait until subscribers have received everything. Default: 2.
   */
  close(timeoutS?: number): Promise<void> {
    this.closed ??= this.finish(timeoutS);
    return this.closed;
  }

  private async finish(timeoutS?: number): Promise<void> {
    openNodes.delete(this);
    await Promise.all([...this.open].map((each) => each.close(timeoutS)));
    await Promise.all([...this.sessions.values()].map((each) => each.leave(LEAVE_S)));
  }

  /** Close at the end of an `await using` block. */
  [Symbol.asyncDispose](): Promise<void> {
    return this.close();
  }

  /** Start to close at the end of a `using` block. */
  [Symbol.dispose](): void {
    void this.close();
  }

  // ---- internal

  private hold(): Hold {
    return this.holders.size > 0 ? "long" : "none";
  }

  private wake(): void {
    for (const each of this.sessions.values()) each.wake();
    for (const each of this.open) if (each instanceof Publisher) each.wake();
  }

  private session(configuration?: HybridConfiguration): MasterSession {
    const address = configuration?.master ?? this.masterOf;
    let session = this.sessions.get(address);
    if (!session) {
      session = new MasterSession(
        address,
        this.record,
        (message) => this.warn(`Master at ${hostOf(address)}: ${message}`),
        () => this.holders.size > 0,
      );
      this.sessions.set(address, session);
    }
    return session;
  }

  private configured(given?: Configuration | OriginalConfiguration): Configuration | undefined {
    if (given === undefined || "kind" in given) return given;
    if (given.network === "broker") return this.hybrid(given.master_ip);
    if (given.network === "direct") return this.direct(given.ip, given.port);
    throw new NepError(`Unknown network "${given.network}". Use node.hybrid(ip) or node.direct(ip, port, mode).`);
  }

  private nextNumber(): number {
    return ++this.lastNumber;
  }

  private checkOpen(): void {
    if (this.closed) throw new NepError(`The node "${this.name}" is closed.`);
  }

  private warn(message: string): void {
    if (this.listenerCount("warning") > 0) this.emit("warning", message);
    else process.emitWarning(message, "NepWarning");
  }
}
