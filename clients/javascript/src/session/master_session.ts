import { type ClockDifference, toldDifference } from "../messages/clocks.js";
import { MasterUnreachableError, NepError } from "../errors.js";
import type {
  Answer,
  ExpectedSubscriber,
  NodeRecord,
  PublisherCount,
  PublisherRecord,
  RemotePublisher,
  SubscriberCount,
  SubscriberRecord,
} from "../protocol/requests.js";
import { hostTowards, isLoopback, LOOPBACK, nearestEndpoint } from "../system/addresses.js";
import { matchesPattern } from "../wire/pattern.js";
import { ClockSamples, type Moment } from "./clock_samples.js";
import { RpcClient } from "./rpc.js";

const RENEW_S = 1;
const MAX_RENEW_S = 30;
const ANSWER_MS = 1000; // a renewal without a reply is sent again after this time
const RESEND_MS = 300; // ... and then at this interval
const RECONNECT_MS = 3000; // ... over a new connection, if nothing was received for this time
const JOIN_AGAIN_MS = 500;
const MAX_TIMED_RENEWALS = 8;
const MAX_CPU_RATIO = 1024;
/** Default time that registrations wait for a master before they fail or warn. */
export const MASTER_WAIT_S = 2;

/** Interface of publishers and servers used by the session. */
export interface SessionPublisher {
  counts(): PublisherCount;
  /** Bind at exactly these addresses of this computer; resolves to the endpoints. */
  move(hosts: readonly string[]): Promise<string[]>;
}

/** Interface of subscribers and clients used by the session. */
export interface SessionSubscriber {
  counts(): SubscriberCount;
  /**
   * Connect to further publishers.
   *
   * @param areNew True if they were created after this subscriber was registered, so that losses count from seq 1.
   */
  connect(remotes: readonly ReachablePublisher[], areNew?: boolean): void;
  /** Handle the complete list of the publishers of one topic; a pattern has several topics. */
  reconcile(topic: string, remotes: readonly ReachablePublisher[]): void;
  /** Handle that a publisher is no longer listed. */
  gone(id: bigint, lastSeq: bigint, isClosed: boolean): void;
  /** Set the clock differences to other computers, by node, replacing all previous ones. */
  correct?(clocks: ReadonlyMap<string, ClockDifference>): void;
  /** Called after each renewal with the seqs of the publishers' newest messages, as known to the master. */
  tick(lastSeqs: ReadonlyMap<bigint, bigint>): void;
}

/** Publisher with the endpoint at which this node reaches it; undefined if there is none. */
export interface ReachablePublisher extends RemotePublisher {
  readonly endpoint: string | undefined;
}

interface Registered<R, T> {
  record: R;
  readonly owner: T;
  isConfirmed: boolean;
}

type Found = Extract<Answer, { is: "found" }>;

/** Registration of a node with one master: renews the lease, rejoins, and handles pushed changes. */
export class MasterSession {
  private readonly rpc: RpcClient;
  private readonly publishers = new Map<bigint, Registered<PublisherRecord, SessionPublisher>>();
  private readonly subscribers = new Map<bigint, Registered<SubscriberRecord, SessionSubscriber>>();
  private epoch = 0n;
  private revision = 0n;
  private renewS = RENEW_S;
  private timer: NodeJS.Timeout | undefined;
  /** True while the last renewal has no reply. */
  private isUnanswered = false;
  private joinAgainAt = -Infinity;
  private connectedAt = performance.now();
  private servedHosts: readonly string[] = [];
  private ownHost = LOOPBACK;
  private movedTo = "";
  private isClosed = false;
  private readonly clock = new ClockSamples();
  private clocks: ReadonlyMap<string, ClockDifference> = new Map();
  /** Times at which the last renewals were sent, by call. */
  private readonly renewals = new Map<number, Moment>();
  private cpu = process.cpuUsage();
  private cpuAt = performance.now();

  constructor(
    readonly address: string,
    private readonly node: NodeRecord,
    private readonly warn: (message: string) => void,
    isHeld: () => boolean,
  ) {
    this.rpc = new RpcClient(
      address,
      (answer, call) => this.obey(answer, call),
      (error) => warn(error.message),
      isHeld,
    );
  }

  /** True once the master has replied. */
  get isKnown(): boolean {
    return this.epoch !== 0n;
  }

  /** Return the addresses of this computer at which publishers must be reachable. */
  async hosts(): Promise<string[]> {
    if (isLoopback(this.address)) return [LOOPBACK, ...this.servedHosts];
    this.ownHost = await hostTowards(this.address);
    return [this.ownHost];
  }

  wake(): void {
    this.rpc.wake();
  }

  /**
   * Register a publisher or server, and bind it at the hosts that the master serves.
   *
   * @param waitS Seconds to wait for the master; undefined waits without a time limit.
   * @returns the expected subscribers, and those that did not respond recently.
   * @throws {MasterUnreachableError | RequestRefusedError}
   */
  async addPublisher(
    record: Omit<PublisherRecord, "endpoints">,
    owner: SessionPublisher,
    waitS?: number,
  ): Promise<{ expected: ExpectedSubscriber[]; hung: ExpectedSubscriber[] }> {
    let endpoints = await owner.move(await this.hosts());
    for (;;) {
      const registered = { record: { ...record, endpoints }, owner, isConfirmed: false };
      this.publishers.set(record.id, registered);
      const added = await this.register(
        () => this.rpc.ask({ do: "publisher+", node: this.node, publisher: registered.record }, waitS),
        this.publishers,
        record.id,
      );
      registered.isConfirmed = true;
      const moved = await owner.move(await this.hosts());
      if (String(moved) === String(endpoints)) {
        return added.is === "added" ? added : { expected: [], hung: [] };
      }
      endpoints = moved;
    }
  }

  /**
   * Register a subscriber or client; `connect` is called with the registered publishers.
   *
   * @throws {MasterUnreachableError | RequestRefusedError}
   */
  async addSubscriber(record: SubscriberRecord, owner: SessionSubscriber, waitS?: number): Promise<void> {
    const registered = { record, owner, isConfirmed: false };
    this.subscribers.set(record.id, registered);
    const request = { do: "subscriber+", node: this.node, subscriber: record } as const;
    // Connect before the next push is handled, which may report that one of these publishers closed.
    const connect = (found: Answer): void => {
      if (found.is !== "found") return;
      registered.isConfirmed = true;
      owner.connect(found.publishers.map((each) => this.inReach(each)));
    };
    const found = await this.register(() => this.rpc.ask(request, waitS, connect), this.subscribers, record.id);
    if (record.pattern && found.is === "found" && !found.pattern) {
      this.removeSubscriber(record.id);
      throw new NepError(`The master at ${this.address} is too old to support wildcards. Start a newer one.`);
    }
  }

  private async register(ask: () => Promise<Answer>, registry: Map<bigint, unknown>, id: bigint): Promise<Answer> {
    this.schedule();
    try {
      return await ask();
    } catch (error) {
      registry.delete(id);
      throw error;
    }
  }

  removePublisher(id: bigint, lastSeq: bigint): void {
    if (this.publishers.delete(id)) this.rpc.tell({ do: "publisher-", node_id: this.node.id, id, last_seq: lastSeq });
  }

  removeSubscriber(id: bigint): void {
    if (this.subscribers.delete(id)) this.rpc.tell({ do: "subscriber-", node_id: this.node.id, id });
  }

  /** Report subscribers that did not connect to a new publisher. */
  reportMissing(publisherId: bigint, subscriberIds: readonly bigint[]): void {
    this.rpc.tell({ do: "missing", node_id: this.node.id, publisher_id: publisherId, subscriber_ids: subscriberIds });
  }

  /** Renew once more, to report the last seqs, and leave. Waits at most `timeoutS` seconds. */
  async leave(timeoutS: number): Promise<void> {
    if (this.isClosed) return;
    clearTimeout(this.timer);
    this.isClosed = true; // prevents rejoining
    if (this.isKnown) {
      this.renew();
      try {
        await this.rpc.ask({ do: "leave", node_id: this.node.id }, timeoutS);
      } catch (error) {
        if (!(error instanceof NepError)) throw error;
      }
    }
    this.rpc.close();
  }

  // ---- lease

  private schedule(): void {
    if (this.timer || this.isClosed) return;
    this.connectedAt = performance.now();
    this.tickAfter(RENEW_S * 1000);
  }

  private tickAfter(delayMs: number): void {
    clearTimeout(this.timer);
    if (!this.isClosed) this.timer = setTimeout(() => this.tick(), delayMs).unref();
  }

  private tick(): void {
    const now = performance.now();
    if (this.isUnanswered) {
      if (Math.max(this.connectedAt, this.rpc.heardAt) < now - RECONNECT_MS) {
        this.connectedAt = now;
        this.rpc.reconnect();
      } else {
        this.rpc.resend();
      }
    }
    void this.followHosts();
    this.renew();
    this.tickAfter(this.isUnanswered ? RESEND_MS : ANSWER_MS);
    this.isUnanswered = true;
  }

  private renew(): void {
    if (!this.isKnown) return;
    const confirmed = <R, T>(registry: Map<bigint, Registered<R, T>>): T[] =>
      [...registry.values()].filter((each) => each.isConfirmed).map((each) => each.owner);
    const clock = this.clock.offset();
    if (clock.length === 0) this.correct(new Map()); // also when this computer's clock was set
    const call = this.rpc.tell({
      do: "renew",
      node_id: this.node.id,
      epoch: this.epoch,
      revision: this.revision,
      publishers: confirmed(this.publishers).map((each) => each.counts()),
      subscribers: confirmed(this.subscribers).map((each) => each.counts()),
      cpu_ratio: this.cpuRatio(),
      clock,
    });
    this.renewals.set(call, this.clock.now());
    if (this.renewals.size > MAX_TIMED_RENEWALS) this.renewals.delete(this.renewals.keys().next().value!);
  }

  private cpuRatio(): number {
    const used = process.cpuUsage(this.cpu);
    const now = performance.now();
    const ratio = (used.user + used.system) / 1000 / Math.max(1, now - this.cpuAt);
    this.cpu = process.cpuUsage();
    this.cpuAt = now;
    return Math.min(MAX_CPU_RATIO, ratio);
  }

  /** Rebind publishers if the addresses served by the master or those of this computer have changed. */
  private async followHosts(): Promise<void> {
    const hosts = await this.hosts();
    if (String(hosts) === this.movedTo || this.isClosed) return;
    this.movedTo = String(hosts);
    for (const each of this.publishers.values()) {
      if (!each.isConfirmed) continue;
      try {
        const endpoints = await each.owner.move(hosts);
        if (String(endpoints) === String(each.record.endpoints) || this.isClosed) continue;
        each.record = { ...each.record, endpoints };
        this.rpc.tell({ do: "publisher+", node: this.node, publisher: each.record });
      } catch (error) {
        this.movedTo = ""; // retried at the next renewal
        this.warn(`Can't bind at ${String(hosts)}: ${String(error)}`);
      }
    }
  }

  // ---- replies and pushes

  private obey(answer: Answer, call: number): void {
    this.compareClocks(answer, call);
    if ("hosts" in answer && String(answer.hosts) !== String(this.servedHosts)) {
      this.servedHosts = answer.hosts;
      void this.followHosts();
    }
    switch (answer.is) {
      case "publisher+":
        this.publisherCame(this.inReach(answer.publisher), answer.isNew);
        break;
      case "publisher-":
        for (const { owner } of this.subscribersOf(answer.topic)) owner.gone(answer.id, answer.lastSeq, answer.isClosed);
        break;
      case "renewed":
        this.renewed(answer);
        break;
      case "added":
      case "found":
        if (!this.isKnown) this.epoch = answer.epoch;
        break;
      default:
    }
    if (this.isKnown && answer.epoch !== this.epoch) this.join();
  }

  private compareClocks(answer: Answer, call: number): void {
    const sent = this.renewals.get(call);
    this.renewals.delete(call);
    if (!sent || answer.is !== "renewed" || answer.epoch !== this.epoch || answer.times.length !== 2) return;
    const wasKnown = this.clock.offset().length > 0;
    const [receivedNs, answeredNs] = answer.times as [bigint, bigint];
    if (this.clock.add(sent, receivedNs, answeredNs) && !wasKnown) setImmediate(() => this.renew()); // other nodes need the offset
  }

  private correct(clocks: ReadonlyMap<string, ClockDifference>): void {
    if (clocks.size === 0 && this.clocks.size === 0) return;
    this.clocks = clocks;
    for (const { owner } of this.subscribers.values()) owner.correct?.(clocks);
  }

  private publisherCame(remote: ReachablePublisher, isNew: boolean): void {
    for (const { owner, isConfirmed } of this.subscribersOf(remote.topic)) owner.connect([remote], isNew && isConfirmed);
  }

  private renewed(answer: Extract<Answer, { is: "renewed" }>): void {
    this.isUnanswered = false;
    if (answer.again) {
      this.join();
      return;
    }
    this.revision = answer.revision;
    this.renewS = Math.min(MAX_RENEW_S, Math.max(RENEW_S, answer.nextS));
    for (const each of answer.topics) {
      const remotes = each.publishers.map((remote) => this.inReach(remote));
      for (const { owner } of this.subscribersOf(each.topic)) owner.reconcile(each.topic, remotes);
    }
    const clocks = [...answer.clocks].map(([id, told]) => [id, toldDifference(told)] as const);
    this.correct(new Map(clocks.filter((each): each is [string, ClockDifference] => each[1] !== undefined)));
    this.tickAfter(this.renewS * 1000);
    for (const each of this.subscribers.values()) each.owner.tick(answer.lastSeqs);
  }

  /** Register the node again with all its publishers and subscribers, unless a join is in progress. */
  private join(): void {
    this.renewS = RENEW_S;
    const now = performance.now();
    if (now < this.joinAgainAt || this.isClosed) return;
    this.joinAgainAt = now + JOIN_AGAIN_MS;
    const publishers = [...this.publishers.values()];
    const subscribers = [...this.subscribers.values()];
    const request = {
      do: "join",
      node: this.node,
      epoch: this.epoch,
      publishers: publishers.map((each) => each.record),
      subscribers: subscribers.map((each) => each.record),
    } as const;
    this.rpc.ask(request, MASTER_WAIT_S).then(
      (found) => {
        if (found.is === "found") this.joined(found, [...publishers, ...subscribers]);
      },
      (error: unknown) => {
        if (!(error instanceof MasterUnreachableError)) this.warn(String(error));
      },
    );
  }

  private joined(found: Found, registered: { isConfirmed: boolean }[]): void {
    this.epoch = found.epoch;
    this.revision = found.revision;
    this.clock.forget(); // the master may be on another computer now
    this.joinAgainAt = -Infinity;
    for (const each of registered) each.isConfirmed = true;
    const byTopic = new Map<string, ReachablePublisher[]>();
    for (const each of found.publishers) {
      byTopic.set(each.topic, [...(byTopic.get(each.topic) ?? []), this.inReach(each)]);
    }
    for (const { record, owner } of this.subscribers.values()) {
      if (!record.pattern) owner.reconcile(record.topic, byTopic.get(record.topic) ?? []);
      else
        for (const [topic, remotes] of byTopic)
          if (matchesPattern(record.topic, topic)) owner.reconcile(topic, remotes);
    }
  }

  private subscribersOf(topic: string): Registered<SubscriberRecord, SessionSubscriber>[] {
    return [...this.subscribers.values()].filter(
      ({ record }) => record.topic === topic || (record.pattern && matchesPattern(record.topic, topic)),
    );
  }

  private inReach(remote: RemotePublisher): ReachablePublisher {
    return { ...remote, endpoint: nearestEndpoint(remote.endpoints, this.address) };
  }
}
