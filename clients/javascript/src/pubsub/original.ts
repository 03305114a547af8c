/**
 * Wire of the original NEP for direct connections: one part without a header. Up to version 0.5.4.5
 * (generation A) the frame starts with the topic (`topic {"a":1}`), from 0.5.4.8 on (B) it doesn't. Messages have
 * no sequence numbers, so losses can't be counted.
 */
import { WireError } from "../errors.js";
import { type Codec, codecFor, type Encoded } from "../messages/codecs.js";
import { Message } from "../messages/message.js";
import { type Hold, SubSocket, XpubSocket } from "../sockets/socket.js";
import { nowNs } from "../system/clock.js";
import { NO_EXTENSION } from "../wire/parts.js";
import { Backlog, BACKLOG_STEP_BYTES } from "./byte_window.js";
import type { PublisherTransport } from "./transports.js";

export type Generation = "A" | "B";

const ALWAYS_PREFIXED = new Set(["dictionary", "image"]);
const NEVER_PREFIXED = new Set(["bytes", "msgpack", "images"]);
const JSON_STARTS = new Set(Buffer.from('{["-0123456789tfnNI'));
const BASE64 = /^[A-Za-z0-9+/]*={0,2}$/;
const SEND_MARK = 10_000;
const RECEIVE_MARK = 1000;
const MAX_PREFIX_BYTES = 300;

/** Return the message as a frame. */
export function toFrame(topic: string, generation: Generation, type: string, codec: string, data: Buffer): Buffer {
  const body = codec === "image" ? Buffer.from(data.toString("base64"), "latin1") : data;
  const isPrefixed = ALWAYS_PREFIXED.has(type) || (generation === "A" && !NEVER_PREFIXED.has(type));
  return isPrefixed ? Buffer.concat([Buffer.from(`${topic} `, "utf8"), body]) : body;
}

/** Return the payload of a frame of either generation; undefined if it is of another topic. @throws {WireError} */
export function fromFrame(topic: string, type: string, codec: string, frame: Buffer): Buffer | undefined {
  if (NEVER_PREFIXED.has(type) && codec !== "image") return frame;
  const prefix = Buffer.from(`${topic} `, "utf8");
  let body = frame;
  if (frame.subarray(0, prefix.length).equals(prefix)) body = frame.subarray(prefix.length);
  else if (codec === "json" && frame.length > 0 && !JSON_STARTS.has(frame[0]!)) return undefined;
  else if (codec === "image" && frame.subarray(0, MAX_PREFIX_BYTES).includes(" ")) return undefined;
  if (codec !== "image") return body;
  const text = body.toString("latin1");
  if (!BASE64.test(text)) throw new WireError("malformed", "The image is not valid base64.");
  return Buffer.from(text, "base64");
}

/** XPUB socket of a publisher that is compatible with the PUB socket of original programs. */
export class OriginalTransport implements PublisherTransport {
  count = 0;
  bytes = 0;
  lastStampNs: bigint | undefined;
  subscribers = 0;
  private readonly socket: XpubSocket<Buffer>;
  private readonly backlog = new Backlog();
  private untrackedBytes = 0;

  constructor(
    private readonly topic: string,
    private readonly type: string,
    private readonly codec: Codec,
    private readonly generation: Generation,
    hold: () => Hold,
    onSubscribers: () => void,
  ) {
    this.socket = new XpubSocket<Buffer>(SEND_MARK, 4096, (queue) => [queue.shift()!], "allSubsUnsubs");
    this.socket.read((event) => {
      this.subscribers += event[0] === 1 ? 1 : -1;
      onSubscribers();
    }, hold);
  }

  get isHeard(): boolean {
    return this.subscribers > 0;
  }

  hasGreeted(): boolean {
    return this.isHeard;
  }

  move(): Promise<string[]> {
    return Promise.resolve([]);
  }

  async attach(endpoint: string, how: "bind" | "connect"): Promise<void> {
    if (how === "bind") await this.socket.bind(endpoint);
    else this.socket.connect(endpoint);
  }

  wake(): void {
    this.socket.wake();
  }

  skip(): void {
    this.count++;
    this.lastStampNs = nowNs();
  }

  send({ data }: Encoded): void {
    this.skip();
    this.bytes += data.length;
    const frame = toFrame(this.topic, this.generation, this.type, this.codec.name, data);
    if (!this.backlog.hasRoom(frame.length)) return;
    this.untrackedBytes += frame.length;
    if (this.untrackedBytes >= BACKLOG_STEP_BYTES) {
      this.backlog.sent(frame, this.untrackedBytes);
      this.untrackedBytes = 0;
    }
    this.socket.send(frame);
  }

  sayBye(): boolean {
    return false;
  }

  flush(): Promise<void> {
    return this.socket.flush();
  }

  close(lingerMs = 0): void {
    this.socket.close(lingerMs);
  }
}

/** SUB socket of a subscriber that accepts frames of both generations. */
export class OriginalReader {
  private readonly socket = new SubSocket(RECEIVE_MARK);
  private readonly codec: Codec;

  constructor(
    private readonly topic: string,
    private readonly type: string,
    hold: () => Hold,
    private readonly onMessage: (message: Message) => void,
    private readonly onRefused: (reason: string) => void,
  ) {
    this.codec = codecFor(type);
    this.socket.filter(Buffer.alloc(0));
    this.socket.read((parts) => this.read(parts), hold);
  }

  async attach(endpoint: string, how: "bind" | "connect"): Promise<void> {
    if (how === "bind") await this.socket.bind(endpoint);
    else this.socket.connectWatched(endpoint);
  }

  private read(parts: Buffer[]): void {
    try {
      if (parts.length !== 1)
        throw new WireError(
          "part-count",
          `A message of the original NEP has one part, this one has ${parts.length}.`,
        );
      const data = fromFrame(this.topic, this.type, this.codec.name, parts[0]!);
      if (data)
        this.onMessage(new Message(this.topic, data, this.codec, this.type, 0n, nowNs(), 0n, NO_EXTENSION, false));
    } catch (error) {
      if (!(error instanceof WireError)) throw error;
      this.onRefused(error.message);
    }
  }

  close(): void {
    this.socket.close();
  }
}
