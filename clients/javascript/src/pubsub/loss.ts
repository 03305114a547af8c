/** Publishers of a subscriber and the number of their lost messages. No sockets. */
import { WireError } from "../errors.js";
import { type ClockDifference, type PublisherClock, SAME_CLOCK } from "../messages/clocks.js";
import { isLoopback } from "../system/addresses.js";
import { computerId } from "../system/computer.js";
import type { ReachablePublisher } from "../session/master_session.js";

const FAREWELL_MS = 3000; // time to wait for the last messages of a publisher that has unregistered
const EARLY_MS = 5000;
const MAX_GAP = 2n ** 32n;
const MAX_UNLISTED = 1000;
const MIN_RECONNECT_MS = 2000;
const MAX_RECONNECT_MS = 30_000;

/** State of one publisher. */
export class Source {
  remote: ReachablePublisher | undefined;
  /** Clock of the publisher's computer. */
  readonly clock: PublisherClock = { difference: undefined };
  /** Endpoint to which it is connected. */
  endpoint: string | undefined;
  /** Whether something has been received since the connection to `endpoint`. */
  isConnected = false;
  private reconnectMs = MIN_RECONNECT_MS;
  private reconnectAt = Infinity;
  /** Reason why the connection fails. */
  problem = "";
  /** Seq of the newest message, received or lost; undefined while unknown, 0 if no message has been sent yet. */
  last: bigint | undefined;
  /** Whether a message, an echo or a bye has been received. */
  isHeard = false;
  hasEchoed = false;
  isLapsed = false;
  endsAt: number | undefined;
  /** Deadline until which messages before the echo are ignored. */
  earlyUntil: number | undefined;
  /** Highest seq reported by the master. */
  promised = 0n;
  /** Range of messages counted as lost because the master reported them; they may still arrive. */
  lateFrom = 0n;
  lateTo = 0n;
  /** Seq of a message rejected because the gap before it was too large. */
  leaptTo = 0n;

  /** Prepare a connection to `endpoint`. */
  connecting(endpoint: string): void {
    this.reconnectMs = this.endpoint === endpoint ? Math.min(MAX_RECONNECT_MS, 2 * this.reconnectMs) : MIN_RECONNECT_MS;
    this.reconnectAt = performance.now() + this.reconnectMs;
    this.isConnected = false;
    this.hasEchoed = false;
  }

  /** True if the subscriber should reconnect, because nothing was received for a long time. */
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

  /** Return the source with this id; create it if needed, evicting the oldest unlisted one if there are too many. */
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

  /** Count losses from the first message of a new publisher. No effect after its first message. */
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

  /** Set the clock differences to other nodes, replacing all previous ones. */
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

  /** Number of publishers whose echo has been received. */
  get echoing(): number {
    let count = 0;
    for (const each of this.byId.values()) if (each.hasEchoed) count++;
    return count;
  }

  /**
   * Count a message. Return false if it is a duplicate.
   *
   * @throws {WireError} if the gap before it is too large.
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
      source.lateFrom = seq + 1n; // it was late, not lost
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
      throw new WireError("seq-leap", `The sequence number jumps from ${last} to ${seq}.`);
    }
    source.leaptTo = 0n; // the sequence continues after the gap: restart counting
    source.promised = 0n;
    source.last = seq;
    this.received++;
    return true;
  }

  /** Return true if a message received before the echo will be repeated with the history. */
  isEarly(id: bigint): boolean {
    const source = this.byId.get(id);
    if (!source?.remote || source.hasEchoed || source.isHeard || source.remote.history <= 1) return false;
    source.earlyUntil ??= performance.now() + EARLY_MS;
    return performance.now() < source.earlyUntil;
  }

  /** Handle an echo or a bye, sent after the messages up to `seq`. Return false if `seq` is implausible. */
  reached(id: bigint, seq: bigint): boolean {
    const source = this.get(id);
    source.isHeard = source.isConnected = true;
    if (source.last !== undefined && seq - source.last > MAX_GAP) return false;
    if (source.last !== undefined && seq > source.last) this.lost += Number(seq - source.last);
    if (source.last === undefined || seq > source.last) source.last = seq;
    return true;
  }

  /** Handle the seq reported by the master; messages reported one renewal ago and not received are lost. */
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

  /** Count received messages that were dropped for lack of room as lost. */
  dropped(count: number): void {
    this.received -= count;
    this.lost += count;
  }

  /** Handle that a publisher has unregistered or was replaced; its last message was `final`. */
  closing(id: bigint, final: bigint): void {
    const source = this.byId.get(id);
    if (!source || source.endsAt !== undefined) return;
    source.endsAt = performance.now() + FAREWELL_MS;
    if (final > source.promised) source.promised = final;
  }

  /** Handle that a publisher is no longer listed; the master knew messages up to `final`. */
  lapsed(id: bigint, final: bigint): void {
    const source = this.byId.get(id);
    if (!source) return;
    source.isLapsed = true;
    if (final > source.promised) source.promised = final;
  }

  /** Count the reported messages of a publisher that were not received as lost, before disconnecting from it. */
  settle(id: bigint): void {
    const source = this.byId.get(id);
    if (source?.last !== undefined) this.reached(id, source.promised);
  }

  /** Return publishers to disconnect from: their bye did not arrive, or there are too many silent ones. */
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

  /** Return silent publishers whose program was restarted as `remote`. */
  replacedBy(remote: ReachablePublisher): bigint[] {
    const isReplaced = ([id, source]: [bigint, Source]): boolean =>
      source.isLapsed && id !== remote.id && source.remote?.nodeName === remote.nodeName;
    return [...this.byId].filter(isReplaced).map(([id]) => id);
  }
}

/** Return true if a publisher is on this computer; judged by its endpoint if its computer is unknown. */
function isHere({ computer, endpoint }: ReachablePublisher): boolean {
  const own = computerId();
  if (own && computer) return own === computer;
  return endpoint !== undefined && isLoopback(endpoint.slice("tcp://".length));
}
