/**
 * The only module that uses zeromq.js: wrappers of the sockets that the wire needs.
 *
 * zeromq.js 6 rejects a second `send` while one is in progress (EBUSY; zeromq.js #381, #406, #427), so each
 * socket has its own send queue. A pending `receive` keeps a Node.js process alive; a `Reader` therefore polls
 * with an unreferenced timer while its owner doesn't need the process to stay alive.
 */
import { Dealer, Router, Subscriber, XPublisher } from "zeromq";

const ZMQ_SNDHWM = 23;
const HELD_RECEIVE_MS = 1000;
const BRIEF_RECEIVE_MS = 20;
const POLL_MS = 10;
const MAX_UNREAD_CALLS = 100; // per client, in the server's libzmq; further calls stay in the client's queue
const LOOK_INTERVAL_MS = 0.5;
const RECONNECT_MS = 2000;
const MAX_TURN_MS = 10; // maximum time for consecutive messages, after which timers run, such as lease renewals

const immediate = (): Promise<void> => new Promise((resolve) => setImmediate(resolve));

type ReadableSocket = Dealer | Router | Subscriber | XPublisher;
type WritableSocket = Dealer | Router | XPublisher;

/** Part of a message to send; strings are sent as UTF-8. */
export type Part = Buffer | string;

/** How long a {@link Reader} keeps the process alive: not at all, briefly, or until it is closed. */
export type Hold = "none" | "brief" | "long";

/** Reads a socket until it is closed and passes each multipart message to `onParts`. */
class Reader {
  private isClosed = false;
  private isReading = false;
  /** Value of `hold` for which the socket's receive timeout is set. */
  private timedFor: Hold | undefined;
  private timer: NodeJS.Timeout | undefined;

  constructor(
    private readonly socket: ReadableSocket,
    private readonly onParts: (parts: Buffer[]) => void,
    private readonly hold: () => Hold,
  ) {
    this.wake();
  }

  /** Read now. Call it when `hold` may return a longer time than before. */
  wake(): void {
    if (this.isClosed || this.isReading) return;
    clearTimeout(this.timer);
    this.isReading = true;
    void this.read();
  }

  close(): void {
    this.isClosed = true;
    clearTimeout(this.timer);
  }

  private async read(): Promise<void> {
    try {
      while (!this.isClosed) {
        const hold = this.hold();
        if (hold === "none" && !this.socket.readable) break;
        await this.receive(hold);
      }
    } catch (error) {
      if (!this.isClosed && !this.socket.closed) process.emitWarning(error as Error);
    } finally {
      this.isReading = false;
    }
    if (!this.isClosed && !this.socket.closed) this.timer = setTimeout(() => this.wake(), POLL_MS).unref();
  }

  private async receive(hold: Hold): Promise<void> {
    if (hold !== this.timedFor) {
      this.timedFor = hold;
      this.socket.receiveTimeout = hold === "long" ? HELD_RECEIVE_MS : BRIEF_RECEIVE_MS;
    }
    const turnEnds = performance.now() + MAX_TURN_MS;
    try {
      do {
        this.onParts((await this.socket.receive()) as Buffer[]);
      } while (!this.isClosed && this.socket.readable && performance.now() < turnEnds);
      if (performance.now() >= turnEnds) await immediate();
    } catch (error) {
      const { code } = error as NodeJS.ErrnoException;
      if (code === "EBUSY")
        await immediate(); // the socket is being bound
      else if (code !== "EAGAIN") throw error;
    }
  }
}

/** Sends messages in order; `queue` holds those that zeromq.js can't accept yet. */
class Sender<T> {
  private readonly queue: T[] = [];
  /** Parts that zeromq.js rejected because another send is in progress. */
  private unsent: Part[] | undefined;
  private last: Promise<void> = Promise.resolve();
  private isInFlight = false;
  private readonly onSent = (): void => {
    this.isInFlight = false;
  };
  private waiting: Promise<void> | undefined;

  constructor(
    private readonly socket: WritableSocket,
    /** Remove entries from the queue, oldest first, and return the parts of the next message. */
    private readonly take: (queue: T[]) => Part[],
    /** Return true if input must be read before the next message is sent. */
    private readonly mustRead: () => boolean = () => false,
  ) {}

  get length(): number {
    return this.queue.length;
  }

  send(entry: T): void {
    this.queue.push(entry);
    if (!this.waiting) this.pump();
  }

  /** Resolves when all messages have been passed to libzmq. */
  async flush(): Promise<void> {
    while (this.waiting) await this.waiting;
    await this.last;
  }

  private pump(): void {
    while ((this.unsent || this.queue.length > 0) && !this.socket.closed) {
      if (!this.unsent && this.mustRead()) {
        this.pumpAfter(immediate());
        return;
      }
      const parts = this.unsent ?? this.take(this.queue);
      if (!this.trySend(parts)) {
        this.unsent = parts;
        // EBUSY without a send in progress: the socket is being bound.
        this.pumpAfter(this.isInFlight ? this.last : immediate());
        return;
      }
      this.unsent = undefined;
    }
  }

  private pumpAfter(event: Promise<void>): void {
    this.waiting = event.then(() => {
      this.waiting = undefined;
      this.pump();
    });
  }

  private trySend(parts: Part[]): boolean {
    try {
      // Rejections are ignored: EHOSTUNREACH of a ROUTER, or the socket is being closed.
      this.isInFlight = true;
      this.last = (this.socket as XPublisher).send(parts).then(this.onSent, this.onSent);
      return true;
    } catch (error) {
      if ((error as NodeJS.ErrnoException).code === "EBUSY") return false;
      if (this.socket.closed) return true;
      throw error;
    }
  }
}

const firstEntry = (queue: Buffer[][]): Buffer[] => queue.shift()!;

/** Observer of the start and end of a connection. */
export interface ConnectionWatcher {
  onOpen(): void;
  /** Also called after a failed handshake, without a previous `onOpen`. */
  onEnd(): void;
}

/** DEALER socket: connection of a node to the master, or of a client to a server. */
export class DealerSocket {
  private readonly socket = new Dealer({ linger: 0 });
  private readonly sender = new Sender<Buffer[]>(this.socket, firstEntry);
  private readonly reader: Reader;

  constructor(endpoint: string, onParts: (parts: Buffer[]) => void, hold: () => Hold, watcher?: ConnectionWatcher) {
    if (watcher) {
      this.socket.events.on("handshake", watcher.onOpen);
      this.socket.events.on("disconnect", watcher.onEnd);
    }
    this.socket.connect(endpoint);
    this.reader = new Reader(this.socket, onParts, hold);
  }

  send(parts: Buffer[]): void {
    this.sender.send(parts);
    this.wake();
  }

  wake(): void {
    this.reader.wake();
  }

  /** Resolves when all messages have been passed to libzmq. */
  flush(): Promise<void> {
    return this.sender.flush();
  }

  close(): void {
    this.reader.close();
    if (!this.socket.closed) this.socket.close();
  }
}

/** ROUTER socket of a server. */
export class RouterSocket {
  private readonly socket: Router;
  private readonly sender: Sender<Buffer[]>;
  private reader: Reader | undefined;

  /** @param maxBytes Peers that send a larger part are disconnected. */
  constructor(maxBytes: number) {
    this.socket = new Router({ linger: 1000, maxMessageSize: maxBytes, receiveHighWaterMark: MAX_UNREAD_CALLS });
    this.sender = new Sender<Buffer[]>(this.socket, firstEntry);
  }

  bind(endpoint: string): Promise<string> {
    return bindTo(this.socket, endpoint);
  }

  unbind(endpoint: string): Promise<void> {
    return this.socket.unbind(endpoint);
  }

  read(onParts: (parts: Buffer[]) => void, hold: () => Hold): void {
    this.reader = new Reader(this.socket, onParts, hold);
  }

  send(parts: Buffer[]): void {
    this.sender.send(parts);
  }

  flush(): Promise<void> {
    return this.sender.flush();
  }

  close(): void {
    this.reader?.close();
    if (!this.socket.closed) this.socket.close();
  }
}

/** SUB socket of a subscriber. */
export class SubSocket {
  private readonly socket: Subscriber;
  private reader: Reader | undefined;

  /** @param receiveMark High-water mark in messages. */
  constructor(receiveMark: number) {
    this.socket = new Subscriber({ linger: 0, receiveHighWaterMark: receiveMark });
    // zeromq.js has no property for this option; otherwise libzmq silently drops filters beyond 1000.
    (this.socket as unknown as { setInt32Option(option: number, value: number): void }).setInt32Option(ZMQ_SNDHWM, 0);
  }

  read(onParts: (parts: Buffer[]) => void, hold: () => Hold): void {
    this.reader = new Reader(this.socket, onParts, hold);
  }

  wake(): void {
    this.reader?.wake();
  }

  /** True if input is pending. */
  get hasInput(): boolean {
    return !this.socket.closed && this.socket.readable;
  }

  filter(filter: Buffer): void {
    this.socket.subscribe(filter);
  }

  /** Send a notice to all publishers by subscribing to a filter and unsubscribing at once. */
  say(filter: Buffer): void {
    if (this.socket.closed) return;
    this.socket.subscribe(filter);
    this.socket.unsubscribe(filter);
  }

  connect(endpoint: string): void {
    this.socket.connect(endpoint);
  }

  /** Connect without a master; reconnects if a socket of another type was bound at the address before. */
  connectWatched(endpoint: string): void {
    let timer: NodeJS.Timeout | undefined;
    const reconnect = (): void => {
      if (this.socket.closed) return;
      this.disconnect(endpoint);
      this.connect(endpoint);
    };
    // libzmq reconnects after each disconnection, except after a failed handshake.
    this.socket.events.on("disconnect", () => {
      clearTimeout(timer);
      timer = setTimeout(reconnect, RECONNECT_MS).unref();
    });
    this.socket.events.on("connect:retry", () => clearTimeout(timer));
    this.connect(endpoint);
  }

  bind(endpoint: string): Promise<string> {
    return bindTo(this.socket, endpoint);
  }

  disconnect(endpoint: string): void {
    try {
      if (!this.socket.closed) this.socket.disconnect(endpoint);
    } catch (error) {
      if ((error as NodeJS.ErrnoException).code !== "ENOENT") throw error; // the peer has already disconnected
    }
  }

  close(): void {
    this.reader?.close();
    if (!this.socket.closed) this.socket.close();
  }
}

/** XPUB socket of a publisher, which reports each subscription. */
export class XpubSocket<T> {
  private readonly socket: XPublisher;
  private readonly sender: Sender<T>;
  private reader: Reader | undefined;
  private lookedAt = -Infinity;

  /**
   * @param sendMark High-water mark in messages for each connection.
   * @param maxSubscriptionBytes Peers that send a longer subscription are disconnected.
   * @param take Removes queued entries, oldest first, and returns the parts of the next message.
   * @param verbosity Which duplicate subscriptions are reported: additions only, or also removals.
   */
  constructor(
    sendMark: number,
    maxSubscriptionBytes: number,
    take: (queue: T[]) => Part[],
    verbosity: "allSubs" | "allSubsUnsubs" = "allSubs",
  ) {
    this.socket = new XPublisher({ linger: 0, sendHighWaterMark: sendMark, maxMessageSize: maxSubscriptionBytes });
    this.socket.verbosity = verbosity;
    this.sender = new Sender<T>(this.socket, take, () => this.hasSubscriptions());
  }

  /** Return true if subscriptions are pending, which determine the form of the next message. */
  private hasSubscriptions(): boolean {
    const now = performance.now();
    if (now < this.lookedAt + LOOK_INTERVAL_MS) return false;
    this.lookedAt = now;
    if (!this.socket.readable) return false;
    this.reader?.wake();
    return true;
  }

  get isClosed(): boolean {
    return this.socket.closed;
  }

  /** Number of entries that have not been passed to libzmq yet. */
  get queueLength(): number {
    return this.sender.length;
  }

  read(onEvent: (event: Buffer) => void, hold: () => Hold): void {
    this.reader = new Reader(this.socket, (parts) => onEvent(parts[0]!), hold);
  }

  wake(): void {
    this.reader?.wake();
  }

  bind(endpoint: string): Promise<string> {
    return bindTo(this.socket, endpoint);
  }

  connect(endpoint: string): void {
    this.socket.connect(endpoint);
  }

  async unbind(endpoint: string): Promise<void> {
    if (!this.socket.closed) await this.socket.unbind(endpoint);
  }

  send(entry: T): void {
    if (!this.socket.closed) this.sender.send(entry);
  }

  /** Resolves when all messages have been passed to libzmq. */
  flush(): Promise<void> {
    return this.sender.flush();
  }

  /** Close; libzmq sends queued messages for at most `lingerMs`. */
  close(lingerMs = 0): void {
    this.reader?.close();
    if (this.socket.closed) return;
    this.socket.linger = lingerMs;
    this.socket.close();
  }
}

async function bindTo(socket: Router | Subscriber | XPublisher, endpoint: string): Promise<string> {
  await socket.bind(endpoint);
  return socket.lastEndpoint ?? endpoint;
}
