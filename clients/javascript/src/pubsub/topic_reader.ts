import { WireError } from "../errors.js";
import { codecNumbered } from "../messages/codecs.js";
import { Message } from "../messages/message.js";
import type { ReachablePublisher } from "../session/master_session.js";
import { SubSocket, type Hold } from "../sockets/socket.js";
import { Flag, type Header, readHeaderPart } from "../wire/header.js";
import { helloPart, readPart } from "../wire/notices.js";
import { readOnePart, readRest, splitParts, topicPart, type WireMessage } from "../wire/parts.js";
import { WINDOW_BYTES } from "./byte_window.js";
import { Sources, type Source } from "./loss.js";

const RECEIVE_MARK = 1000;
const RECEIVE_MARK_IMAGES = 64;

export interface TopicReaderHost {
  readonly hold: () => Hold;
  onMessage(message: Message, reader: TopicReader): void;
  /** Called for each malformed message with the reason. */
  onRefused(reason: string): void;
  /** Called for each echo, and for each publisher to which no connection is possible. */
  onGreeted(): void;
}

/** Receiver for one topic: a SUB socket connected to all publishers, and the counters of their messages. */
export class TopicReader {
  readonly sources = new Sources();
  /** Number of malformed messages and notices. */
  refused = 0;
  private readonly socket: SubSocket;
  private readonly topicPart: Buffer;
  private readonly hello: Buffer;

  constructor(
    private readonly id: bigint,
    readonly topic: string,
    private readonly type: string,
    private readonly host: TopicReaderHost,
  ) {
    this.topicPart = topicPart(topic);
    this.hello = helloPart({ subscriber: id, topic, level: 3 });
    this.socket = new SubSocket(type === "image" ? RECEIVE_MARK_IMAGES : RECEIVE_MARK);
    this.socket.filter(this.topicPart);
    this.socket.filter(this.hello); // sorts after the topic: a publisher that receives it has the topic filter
    this.socket.read((parts) => this.read(parts), host.hold);
  }

  // ---- connections

  /** Connect to a publisher, unless connected already. Losses of a new publisher count from its first message. */
  connect(remote: ReachablePublisher, isNew = false): void {
    for (const old of this.sources.replacedBy(remote)) this.sources.closing(old, 0n);
    const { endpoint } = remote;
    const source = this.sources.listed(remote);
    if (isNew && endpoint) this.sources.expectAllOf(remote.id);
    source.isLapsed = false;
    source.endsAt = undefined;
    if (!endpoint || endpoint === source.endpoint) return;
    for (const [id, other] of this.sources.byId) {
      if (other !== source && other.endpoint === endpoint) this.leave(id); // its port belongs to another publisher now
    }
    this.connectTo(source, endpoint);
  }

  private connectTo(source: Source, endpoint: string): void {
    if (source.endpoint) this.socket.disconnect(source.endpoint);
    source.connecting(endpoint);
    source.endpoint = undefined;
    source.problem = "";
    try {
      this.socket.connect(endpoint);
      source.endpoint = endpoint;
    } catch (error) {
      source.problem = `Can't connect to ${endpoint} of "${source.remote?.nodeName ?? ""}": ${String(error)}`;
      this.refuse(source.problem);
      this.host.onGreeted();
    }
  }

  /** Bind or connect without a master. */
  async attach(endpoint: string, how: "bind" | "connect"): Promise<void> {
    if (how === "bind") await this.socket.bind(endpoint);
    else this.socket.connectWatched(endpoint);
  }

  /** Handle the complete list of publishers: connect to new ones and mark the others as unlisted. */
  reconcile(remotes: readonly ReachablePublisher[]): void {
    for (const each of remotes) this.connect(each);
    const listed = new Set(remotes.map((each) => each.id));
    for (const [id, source] of this.sources.byId) if (source.remote && !listed.has(id)) source.isLapsed = true;
  }

  /** Handle that a publisher is no longer listed. Its connection stays until its bye, or until it is replaced. */
  gone(id: bigint, lastSeq: bigint, isClosed: boolean): void {
    if (isClosed) this.sources.closing(id, lastSeq);
    else this.sources.lapsed(id, lastSeq);
  }

  /** Disconnect from publishers that closed without a bye, and count losses by the seqs reported by the master. */
  tick(lastSeqs: ReadonlyMap<bigint, bigint>): void {
    for (const id of this.sources.ended()) {
      this.sources.settle(id);
      this.leave(id);
    }
    if (this.socket.hasInput) return;
    // libzmq doesn't reconnect after a failed handshake, for example with a PULL socket of another program.
    for (const source of this.sources.byId.values()) if (source.isSilent) this.connectTo(source, source.endpoint!);
    for (const [id, seq] of lastSeqs) this.sources.promised(id, seq);
  }

  private leave(id: bigint): void {
    const source = this.sources.remove(id);
    if (source?.endpoint) this.socket.disconnect(source.endpoint);
  }

  close(): void {
    this.socket.close();
  }

  // ---- reading

  private read(parts: Buffer[]): void {
    try {
      this.parse(parts);
    } catch (error) {
      if (!(error instanceof WireError)) throw error;
      this.refuse(error.message);
    }
  }

  private refuse(reason: string): void {
    this.refused++;
    this.host.onRefused(reason);
  }

  private parse(parts: Buffer[]): void {
    const message = parts.length === 1 ? readOnePart(this.topicPart, parts[0]!) : undefined;
    if (message) {
      this.message(message, false);
      return;
    }
    if (parts.length === 2 && parts[0]!.equals(this.hello)) {
      this.notice(readHeaderPart(parts[1]!));
      return;
    }
    const { first, rest } = splitParts(parts);
    const isAlone = first.equals(this.hello);
    if (!isAlone && !first.equals(this.topicPart)) {
      throw new WireError("first-part", "The first part is neither the topic nor the hello.");
    }
    for (const each of readRest(rest, parts.length === 1)) this.message(each, isAlone);
  }

  private message({ header, payload, extension }: WireMessage, isAlone: boolean): void {
    const { publisher, seq, flags } = header;
    if (flags & Flag.SHARED) {
      throw new WireError("shared-memory", "The payload is in shared memory, which was not offered.");
    }
    if (!isAlone && this.sources.isEarly(publisher)) return;
    if (!this.sources.arrived(publisher, seq, isAlone)) return;
    const source = this.sources.byId.get(publisher);
    const type = source?.remote?.msgType ?? this.type;
    const codec = codecNumbered(header.codec)!;
    const isLatched = (flags & Flag.LATCHED) !== 0;
    this.host.onMessage(
      new Message(this.topic, payload, codec, type, seq, header.stampNs, publisher, extension, isLatched, source?.clock),
      this,
    );
  }

  /** Handle an echo, a bye or an offer. */
  private notice(header: Header): void {
    const { publisher, seq } = header;
    const source = this.sources.get(publisher);
    const isPossible = this.sources.reached(publisher, seq);
    if (header.flags & Flag.BYE) {
      this.leave(publisher);
    } else if (!(header.flags & Flag.OFFER)) {
      if (source.hasEchoed) {
        const boundBytes = BigInt(Math.floor(WINDOW_BYTES / Math.max(1, this.sources.echoing)));
        this.socket.say(readPart({ subscriber: this.id, publisher, seq, boundBytes }));
      } else {
        source.hasEchoed = true;
      }
    }
    this.host.onGreeted();
    if (!isPossible) throw new WireError("seq-leap", `The sequence number jumps from ${source.last} to ${seq}.`);
  }
}
