import { parseHello, parseRead, parseShares } from "../wire/notices.js";
import { topicPart } from "../wire/parts.js";
import { SendWindow } from "./byte_window.js";

const MAX_SUBSCRIBERS = 10_000;

/** Subscriber whose hello was received. */
interface Greeted {
  /** Hello, the first part of messages and notices sent to this subscriber alone. */
  readonly hello: Buffer;
  readonly readsBatches: boolean;
  /** Flow control; undefined if the subscriber doesn't acknowledge messages. */
  readonly window: SendWindow | undefined;
}

/** Subscribers of a publisher, derived from the subscriptions received by its XPUB socket. */
export class Subscriptions {
  readonly greeted = new Map<bigint, Greeted>();
  /** Number of subscribers that don't read messages of one part, by topic filter. */
  private readonly plainFilters = new Map<string, number>();
  private readonly topicPart: Buffer;
  private readonly topicFilter: string;

  constructor(
    private readonly topic: string,
    private readonly publisher: bigint,
    private readonly refuse: (reason: string) => void,
  ) {
    this.topicPart = topicPart(topic);
    this.topicFilter = this.topicPart.toString("latin1");
  }

  /** True if the topic has subscribers, with or without a hello. */
  get isHeard(): boolean {
    return this.greeted.size > 0 || this.plainFilters.size > 0;
  }

  /** True if all subscribers read messages of one part. */
  get readsOnePart(): boolean {
    return this.plainFilters.size === 0;
  }

  /** True if all subscribers read batches. */
  get readsBatches(): boolean {
    if (this.plainFilters.size > 0) return false;
    for (const each of this.greeted.values()) if (!each.readsBatches) return false;
    return true;
  }

  /** True if all subscribers acknowledge messages. */
  get tellsAll(): boolean {
    if (this.plainFilters.size > 0) return false;
    for (const each of this.greeted.values()) if (!each.window) return false;
    return true;
  }

  /** Handle a new or removed subscription. Return the id of the subscriber to which an echo must be sent, if any. */
  note(event: Buffer): bigint | undefined {
    const isAdded = event[0] === 1;
    const filter = event.subarray(1);
    const hello = parseHello(filter);
    if (hello) {
      if (hello.topic !== this.topic) return undefined; // meant for the program that used this port before
      if (isAdded) return this.greet(hello.subscriber, hello.level, filter);
      this.greeted.delete(hello.subscriber);
      return undefined;
    }
    const read = parseRead(filter);
    if (read) {
      if (isAdded && read.publisher === this.publisher)
        this.greeted.get(read.subscriber)?.window?.read(read.seq, read.boundBytes);
    } else if (!parseShares(filter)) {
      this.notePlain(filter, isAdded);
    }
    return undefined;
  }

  private greet(subscriber: bigint, level: number, filter: Buffer): bigint | undefined {
    if (this.greeted.size >= MAX_SUBSCRIBERS && !this.greeted.has(subscriber)) {
      this.refuse(`more than ${MAX_SUBSCRIBERS} subscribers`);
      return undefined;
    }
    if (level >= 1) this.removePlain(this.topicFilter); // its topic filter was counted before
    this.greeted.set(subscriber, {
      hello: Buffer.from(filter),
      readsBatches: level >= 3,
      window: level >= 2 ? new SendWindow() : undefined, // new connection: nothing is in flight
    });
    return subscriber;
  }

  /** Handle a topic filter. XPUB_VERBOSE reports each addition, but only the last removal of equal filters. */
  private notePlain(filter: Buffer, isAdded: boolean): void {
    if (!this.topicPart.subarray(0, filter.length).equals(filter)) {
      this.refuse(`an invalid filter of ${filter.length} bytes`);
      return;
    }
    const key = filter.toString("latin1");
    if (isAdded) this.plainFilters.set(key, (this.plainFilters.get(key) ?? 0) + 1);
    else this.plainFilters.delete(key);
  }

  private removePlain(key: string): void {
    const left = (this.plainFilters.get(key) ?? 0) - 1;
    if (left > 0) this.plainFilters.set(key, left);
    else this.plainFilters.delete(key);
  }
}
