import { Bindings } from "../sockets/bindings.js";
import { type Hold, type Part, XpubSocket } from "../sockets/socket.js";
import { nowNs } from "../system/clock.js";
import { MAX_BATCH, packBatch } from "../wire/batch.js";
import { Flag, HEADER_BYTES, packHeader } from "../wire/header.js";
import { onePart, packExtension, topicPart } from "../wire/parts.js";
import type { Encoded } from "../messages/codecs.js";
import { Backlog, BACKLOG_STEP_BYTES, STEP_BYTES } from "./byte_window.js";
import { History } from "./history.js";
import { Subscriptions } from "./subscriptions.js";
import type { PublisherTransport } from "./transports.js";

const SEND_MARK = 50_000;
const MAX_SUBSCRIPTION_BYTES = 4096;
const SMALL_BYTES = 16_384; // for larger messages, copying into one part costs more than several parts
const MAX_SENT_TOGETHER = 64;
/**
 * zeromq.js copies buffers up to this size; for each larger one its thread wakes Node.js to release it. Strings are
 * always copied, so text is sent as a string in a separate part, which takes a third less time for 1 kB.
 */
const MAX_COPIED_BYTES = 128;
const FULL_BATCH_BYTES = 65_536;

/** Entry of the send queue: a message that may be batched, or the parts of a finished message. */
type Entry =
  | { readonly payload: Buffer; readonly text: string | undefined; readonly seq: number; readonly stampNs: bigint }
  | { readonly parts: Part[] };

export interface XpubSpec {
  readonly id: bigint;
  readonly topic: string;
  readonly codecNumber: number;
  readonly latched: boolean;
  /** Number of messages kept for late subscribers. */
  readonly history: number;
  readonly batch: boolean;
}

/**
 * XPUB socket of a publisher: sends echoes to new subscribers, sends each message in a form that all subscribers
 * read, and drops messages for subscribers whose send window is full.
 */
export class XpubTransport implements PublisherTransport {
  /** Number of messages sent or skipped, which is the seq of the newest one. */
  count = 0;
  bytes = 0;
  lastStampNs: bigint | undefined;
  private readonly subscriptions: Subscriptions;
  private readonly socket: XpubSocket<Entry>;
  private readonly topic: Buffer;
  private readonly history: History;
  private readonly backlog = new Backlog();
  private readonly bindings: Bindings;
  private settledBytes = 0;
  private settleAt = 0; // total bytes from which send windows must be checked before sending

  constructor(
    private readonly spec: XpubSpec,
    hold: () => Hold,
    private readonly onSubscribers: () => void,
    refuse: (reason: string) => void,
  ) {
    this.topic = topicPart(spec.topic);
    this.history = new History(spec.history);
    this.subscriptions = new Subscriptions(spec.topic, spec.id, refuse);
    this.socket = new XpubSocket<Entry>(SEND_MARK, MAX_SUBSCRIPTION_BYTES, (queue) => this.take(queue));
    this.bindings = new Bindings(this.socket);
    this.socket.read((event) => this.noteSubscription(event), hold);
  }

  get isHeard(): boolean {
    return this.subscriptions.isHeard;
  }

  get subscribers(): number {
    return this.subscriptions.greeted.size;
  }

  hasGreeted(subscriber: bigint): boolean {
    return this.subscriptions.greeted.has(subscriber);
  }

  // ---- endpoints

  /** Bind at exactly these hosts, each with its own port. Resolves to the endpoints. */
  move(hosts: readonly string[]): Promise<string[]> {
    return this.bindings.move(hosts);
  }

  /** Bind or connect to one endpoint without a master. */
  async attach(endpoint: string, how: "bind" | "connect"): Promise<void> {
    if (how === "bind") await this.socket.bind(endpoint);
    else this.socket.connect(endpoint);
  }

  wake(): void {
    this.socket.wake();
  }

  // ---- sending

  /** Count a message without sending it, because the topic has no subscribers. */
  skip(): void {
    this.count++;
    this.lastStampNs = nowNs();
  }

  /** Send a message. */
  send(encoded: Encoded, stampNs = nowNs()): void {
    const { data, text, extension } = encoded;
    const size = data.length;
    const seq = ++this.count;
    this.bytes += size;
    this.lastStampNs = stampNs;
    if (this.spec.latched || extension || this.bytes >= this.settleAt) {
      this.sendSettled(this.tail(data, extension && packExtension(extension), seq, stampNs), size);
    } else if (size < SMALL_BYTES) {
      this.socket.send({ payload: data, text, seq, stampNs });
    } else {
      this.socket.send({ parts: [this.topic, ...this.tail(data, undefined, seq, stampNs)] });
    }
  }

  /** Return header, payload and extension of a message. */
  private tail(data: Buffer, extension: Buffer | undefined, seq: number, stampNs: bigint): Buffer[] {
    const flags = (this.spec.latched ? Flag.LATCHED : 0) | (extension ? Flag.EXTENSION : 0);
    const header = this.header(flags, data.length, seq, stampNs);
    return extension ? [header, data, extension] : [header, data];
  }

  private header(flags: number, size: number, seq: number, stampNs: bigint): Buffer {
    return packHeader({
      codec: this.spec.codecNumber,
      flags,
      size,
      seq: BigInt(seq),
      stampNs,
      publisher: this.spec.id,
    });
  }

  /** Send to all subscribers at once; if the window of one is full, to each of the others separately. */
  private sendSettled(tail: Buffer[], size: number): void {
    this.history.add(tail, size);
    const windows = [...this.subscriptions.greeted.values()].filter((each) => each.window);
    const since = this.bytes - size - this.settledBytes; // sent to all subscribers
    if (since > 0) for (const each of windows) each.window!.sent(this.count - 1, since);
    this.settledBytes = this.bytes;
    const { tellsAll } = this.subscriptions;
    const roomy = windows.filter((each) => each.window!.hasRoom(size));
    if (roomy.length === windows.length && (tellsAll || this.backlog.hasRoom(size))) {
      this.socket.send({ parts: [this.topic, ...tail] });
      if (!tellsAll) this.backlog.sent(tail[1]!, size + since);
      this.settleAt = this.bytes + (tellsAll ? STEP_BYTES : BACKLOG_STEP_BYTES);
    } else {
      this.settleAt = 0; // check each message until all windows have room again
      for (const each of roomy) this.socket.send({ parts: [each.hello, ...tail] });
      for (const each of windows) if (!roomy.includes(each)) each.window!.missed();
    }
    for (const each of roomy) each.window!.sent(this.count, size);
    const now = performance.now();
    for (const each of windows) if (each.window!.takeAsk(now, roomy.includes(each))) this.notify(each.hello, 0);
  }

  /** Return the parts of the next message; queued messages are batched if all subscribers read batches. */
  private take(queue: Entry[]): Part[] {
    const first = queue.shift()!;
    if ("parts" in first) return first.parts;
    if (!this.subscriptions.readsOnePart)
      return [this.topic, ...this.tail(first.payload, undefined, first.seq, first.stampNs)];
    const together = [first];
    let bytes = first.payload.length;
    const most = this.spec.batch && this.subscriptions.readsBatches ? Math.min(MAX_SENT_TOGETHER, MAX_BATCH) : 1;
    for (
      let next = queue[0];
      next && "payload" in next && together.length < most && bytes < FULL_BATCH_BYTES;
      next = queue[0]
    ) {
      if (next.seq !== first.seq + together.length) break;
      together.push(next);
      bytes += next.payload.length;
      queue.shift();
    }
    const header = { codec: this.spec.codecNumber, seq: BigInt(first.seq), publisher: this.spec.id };
    if (together.length > 1) return [packBatch(this.topic, header, together)];
    if (first.text !== undefined && this.topic.length + HEADER_BYTES + bytes > MAX_COPIED_BYTES)
      return [this.topic, this.header(0, bytes, first.seq, first.stampNs), first.text];
    return [
      onePart(this.topic, { ...header, flags: 0, size: first.payload.length, stampNs: first.stampNs }, first.payload),
    ];
  }

  /** Resolves when all messages have been passed to libzmq. */
  flush(): Promise<void> {
    return this.socket.flush();
  }

  // ---- subscribers

  private noteSubscription(event: Buffer): void {
    const subscriber = this.subscriptions.note(event);
    if (subscriber !== undefined) this.greet(subscriber);
    if (this.settleAt === 0) {
      for (const each of this.subscriptions.greeted.values())
        if (each.window?.takeMissed()) this.notify(each.hello, 0);
    }
    this.onSubscribers();
  }

  /** Send the history and then the echo, from which the subscriber counts losses. */
  private greet(subscriber: bigint): void {
    const greeted = this.subscriptions.greeted.get(subscriber)!;
    for (const each of this.history.kept) this.socket.send({ parts: [greeted.hello, ...each.parts] });
    if (this.history.kept.length > 0) greeted.window?.sent(this.count, this.history.bytes);
    this.notify(greeted.hello, 0);
  }

  private notify(hello: Buffer, flags: number): void {
    this.socket.send({ parts: [hello, this.header(flags, 0, this.count, nowNs())] });
  }

  /** Send a bye to all subscribers. */
  sayBye(): boolean {
    for (const each of this.subscriptions.greeted.values()) this.notify(each.hello, Flag.BYE);
    return true;
  }

  close(lingerMs = 0): void {
    this.socket.close(lingerMs);
  }
}
