/** The publishers that a subscriber hears, and how many of their messages were lost. No sockets. */
import { WireError } from "../errors.js";
import { type ClockDifference, type PublisherClock, SAME_CLOCK } from "../messages/clocks.js";
import { isLoopback } from "../system/addresses.js";
import { computerId } from "../system/computer.js";
import type { ReachablePublisher } from "../session/master_session.js";

const FAREWELL_MS = 3000; // so long after a publisher has unregistered its last messages may still come
const EARLY_MS = 5000;
const MAX_GAP = 2n ** 32n;
const MAX_UNLISTED = 1000;
const MIN_RECONNECT_MS = 2000;
const MAX_RECONNECT_MS = 30_000;

/** One publisher. */
export class Source {
  remote: ReachablePublisher | undefined;
  /** Its computer's clock. */
  readonly clock: PublisherClock = { difference: undefined };
  /** Where it is connected. */
  endpoint: string | undefined;
  /** Whether something was received since it was connected to `endpoint`. */
  isConnected = false;
  private reconnectMs = MIN_RECONNECT_MS;
  private reconnectAt = Infinity;
  /** Why it can't be connected to. */
  problem = "";
  /** Seq of its newest message, received or lost; undefined while unknown, 0 if all are still to come. */
  last: bigint | undefined;
  /** Whether a message, an echo or a bye has been received. */
  isHeard = false;
  hasEchoed = false;
  isLapsed = false;
  endsAt: number | undefined;
  /** Until then at most, what comes before the echo is left out. */
  earlyUntil: number | undefined;
  /** Highest seq that the master has reported. */
  promised = 0n;
  /** Messages in this range were counted as lost because they were promised, and may still come. */
  lateFrom = 0n;
  lateTo = 0n;
  /** Seq of a message that was refused because too many would be missing before it. */
  leaptTo = 0n;

  /** It is about to be connected to `endpoint`. */
  connecting(endpoint: string): void {
    this.reconnectMs = this.endpoint === endpoint ? Math.min(MAX_RECONNECT_MS, 2 * this.reconnectMs) : MIN_RECONNECT_MS;
    this.reconnectAt = performance.now() + this.reconnectMs;
    this.isConnected = false;
    this.hasEchoed = false;
  }

  /** Whether nothing was received for so long that the connection is to be made again. */
  get isSilent(): boolean {
    return this.endpoint !== undefined && !this.isConnected && performance.now() >= this.reconnectAt;
  }
}

/** Counts received and lost messages from sequence numbers. */
export class Sources {
  received = 0;
  lost = 0;
  readonly byId = new Map<bigint, Source>();
  private clocks: ReadonlyMap<string, ClockDifference> = new Map();
  private readonly unlisted = new Set<bigint>();

  /** The source of this id, made when it is new; the oldest that no master lists may go for it. */
  get(id: bigint): Source {
    let source = this.byId.get(id);
    if (!source) {
      source = new Source();
      this.byId.set(id, source);
      this.unlisted.add(id);
      if (this.unlisted.size > MAX_UNLISTED) this.remove(this.unlisted.values().next().value!);
    }
    return source;
  }

  /** Count losses from the first message of a new publisher. Has no effect once it was heard. */
  expectAllOf(id: bigint): void {
    this.get(id).last ??= 0n;
  }

  listed(remote: ReachablePublisher): Source {
    const source = this.get(remote.id);
    source.remote = remote;
    source.clock.difference = this.differenceTo(remote);
    this.unlisted.delete(remote.id);
    return source;
  }

  /** By node: how the clocks of other computers differ from this one's. No others are known. */
  correct(clocks: ReadonlyMap<string, ClockDifference>): void {
    this.clocks = clocks;
    for (const { remote, clock } of this.byId.values()) if (remote) clock.difference = this.differenceTo(remote);
  }

  private differenceTo(remote: ReachablePublisher): ClockDifference | undefined {
    return isHere(remote) ? SAME_CLOCK : this.clocks.get(remote.nodeId);
  }

  remove(id: bigint): Source | undefined {
    const source = this.byId.get(id);
    this.byId.delete(id);
    this.unlisted.delete(id);
    return source;
  }

  /** Number of publishers that have greeted. */
  get echoing(): number {
    let count = 0;
    for (const each of this.byId.values()) if (each.hasEchoed) count++;
    return count;
  }

  /**
   * Count a message. Returns false when it was heard already.
   *
   * @throws {WireError} when too many would be missing before it.
   */
  arrived(id: bigint, seq: bigint, isAlone: boolean): boolean {
    const source = this.get(id);
    source.isHeard = source.isConnected = true;
    const { last } = source;
    if (last !== undefined && seq - last > MAX_GAP) return this.leapt(source, last, seq);
    if (last === undefined || seq > last) {
      if (last !== undefined) this.lost += Number(seq - last - 1n);
      source.last = seq;
    } else if (source.lateTo !== 0n && source.lateTo === last && source.lateFrom <= seq) {
      source.lateFrom = seq + 1n; // it was only late
      this.lost--;
    } else if (isAlone) {
      return false;
    }
    this.received++;
    return true;
  }

  private leapt(source: Source, last: bigint, seq: bigint): boolean {
    if (source.leaptTo === 0n || source.leaptTo !== seq - 1n) {
      source.leaptTo = seq;
      throw new WireError("seq-leap", `The message's number leaps from ${last} to ${seq}.`);
    }
    source.leaptTo = 0n; // it goes on from there: counting begins anew
    source.promised = 0n;
    source.last = seq;
    this.received++;
    return true;
  }

  /** Whether a message, not for this subscriber alone, comes again with the history before the echo. */
  isEarly(id: bigint): boolean {
    const source = this.byId.get(id);
    if (!source?.remote || source.hasEchoed || source.isHeard || source.remote.history <= 1) return false;
    source.earlyUntil ??= performance.now() + EARLY_MS;
    return performance.now() < source.earlyUntil;
  }

  /** An echo or a bye: messages up to `seq` were sent before it. False when that can't be. */
  reached(id: bigint, seq: bigint): boolean {
    const source = this.get(id);
    source.isHeard = source.isConnected = true;
    if (source.last !== undefined && seq - source.last > MAX_GAP) return false;
    if (source.last !== undefined && seq > source.last) this.lost += Number(seq - source.last);
    if (source.last === undefined || seq > source.last) source.last = seq;
    return true;
  }

  /** The master says that `seq` was sent; what it said one renewal ago and has not come is lost. */
  promised(id: bigint, seq: bigint): void {
    const source = this.byId.get(id);
    if (source?.last === undefined || seq - source.last > MAX_GAP) return;
    if (source.promised > source.last) {
      if (source.lateTo !== source.last) source.lateFrom = source.last + 1n;
      this.lost += Number(source.promised - source.last);
      source.last = source.promised;
      source.lateTo = source.promised;
    }
    source.promised = seq;
  }

  /** So many messages that had been received were dropped for lack of room. */
  dropped(count: number): void {
    this.received -= count;
    this.lost += count;
  }

  /** A publisher has unregistered, or was replaced; its last message was `final`. */
  closing(id: bigint, final: bigint): void {
    const source = this.byId.get(id);
    if (!source || source.endsAt !== undefined) return;
    source.endsAt = performance.now() + FAREWELL_MS;
    if (final > source.promised) source.promised = final;
  }

  /** A publisher is not listed any more; the master knew of messages up to `final`. */
  lapsed(id: bigint, final: bigint): void {
    const source = this.byId.get(id);
    if (!source) return;
    source.isLapsed = true;
    if (final > source.promised) source.promised = final;
  }

  /** A publisher is about to be left: what has not come of what was promised is lost for good. */
  settle(id: bigint): void {
    const source = this.byId.get(id);
    if (source?.last !== undefined) this.reached(id, source.promised);
  }

  /** Publishers to leave: their bye has not come, or too many have fallen silent. */
  ended(): bigint[] {
    const now = performance.now();
    const silent: bigint[] = [];
    const over: bigint[] = [];
    for (const [id, source] of this.byId) {
      if (source.endsAt === undefined && source.isLapsed) silent.push(id);
      else if (source.endsAt !== undefined && now >= source.endsAt) over.push(id);
    }
    return [...silent.slice(0, Math.max(0, silent.length - MAX_UNLISTED)), ...over];
  }

  /** Silent publishers whose program has been started again, as `remote`. */
  replacedBy(remote: ReachablePublisher): bigint[] {
    const isReplaced = ([id, source]: [bigint, Source]): boolean =>
      source.isLapsed && id !== remote.id && source.remote?.nodeName === remote.nodeName;
    return [...this.byId].filter(isReplaced).map(([id]) => id);
  }
}

/** Whether a publisher is on this computer; of one that doesn't tell, its endpoint says so. */
function isHere({ computer, endpoint }: ReachablePublisher): boolean {
  const own = computerId();
  if (own && computer) return own === computer;
  return endpoint !== undefined && isLoopback(endpoint.slice("tcp://".length));
}
