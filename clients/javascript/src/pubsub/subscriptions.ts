import { parseHello, parseRead, parseShares } from "../wire/notices.js";
import { topicPart } from "../wire/parts.js";
import { SendWindow } from "./byte_window.js";

const MAX_SUBSCRIBERS = 10_000;

/** A subscriber that said hello. */
interface Greeted {
  /** First part of what is sent to it alone. */
  readonly hello: Buffer;
  readonly readsBatches: boolean;
  /** Of a subscriber that tells what it has read. */
  readonly window: SendWindow | undefined;
}

/** A publisher's subscribers, from the subscriptions that its XPUB socket receives. */
export class Subscriptions {
  readonly greeted = new Map<bigint, Greeted>();
  /** Topic filters of subscribers that don't read messages of one part, with their number. */
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

  /** Whether the topic has subscribers, with or without a hello. */
  get isHeard(): boolean {
    return this.greeted.size > 0 || this.plainFilters.size > 0;
  }

  /** Whether all subscribers read messages of one part. */
  get readsOnePart(): boolean {
    return this.plainFilters.size === 0;
  }

  /** Whether all subscribers read batches. */
  get readsBatches(): boolean {
    if (this.plainFilters.size > 0) return false;
    for (const each of this.greeted.values()) if (!each.readsBatches) return false;
    return true;
  }

  /** Whether all subscribers answer echoes. */
  get tellsAll(): boolean {
    if (this.plainFilters.size > 0) return false;
    for (const each of this.greeted.values()) if (!each.window) return false;
    return true;
  }

  /** Take note of a subscription or its end. Returns the id of a subscriber that is to be greeted. */
  note(event: Buffer): bigint | undefined {
    const isAdded = event[0] === 1;
    const filter = event.subarray(1);
    const hello = parseHello(filter);
    if (hello) {
      if (hello.topic !== this.topic) return undefined; // a subscriber of the program that had this port before
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
      this.refuse(`the hello of one more than ${MAX_SUBSCRIBERS} subscribers`);
      return undefined;
    }
    if (level >= 1) this.removePlain(this.topicFilter); // its own filter came before
    this.greeted.set(subscriber, {
      hello: Buffer.from(filter),
      readsBatches: level >= 3,
      window: level >= 2 ? new SendWindow() : undefined, // a connection of its own: nothing is under way
    });
    return subscriber;
  }

  /** With XPUB_VERBOSE each addition of a filter is reported, but only the last removal of equal ones. */
  private notePlain(filter: Buffer, isAdded: boolean): void {
    if (!this.topicPart.subarray(0, filter.length).equals(filter)) {
      this.refuse(`${filter.length} bytes that are no subscription of it`);
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
