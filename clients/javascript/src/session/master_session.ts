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
const ANSWER_MS = 1000; // a renewal without an answer is sent again after this, ...
const RESEND_MS = 300; // ... then at this interval, ...
const RECONNECT_MS = 3000; // ... and over a new connection when nothing was heard for so long
const JOIN_AGAIN_MS = 500;
const MAX_TIMED_RENEWALS = 8;
const MAX_CPU_RATIO = 1024;
/** How long `publisher` and `subscriber` wait for a master before they fail or warn. */
export const MASTER_WAIT_S = 2;

/** A publisher or server as its session needs it. */
export interface SessionPublisher {
  counts(): PublisherCount;
  /** Be reached at these hosts of this computer from now on; returns the endpoints. */
  move(hosts: readonly string[]): Promise<string[]>;
}

/** A subscriber or client as its session needs it. */
export interface SessionSubscriber {
  counts(): SubscriberCount;
  /**
   * These publishers are there, too. `endpoint` of each is the one to connect to. `areNew`: they have sent nothing
   * before, and the subscriber was registered already.
   */
  connect(remotes: readonly ReachablePublisher[], areNew?: boolean): void;
  /** These are all publishers of `topic`; with a pattern there are several topics. */
  reconcile(topic: string, remotes: readonly ReachablePublisher[]): void;
  /** A publisher is not listed any more. */
  gone(id: bigint, lastSeq: bigint, isClosed: boolean): void;
  /** By node: how the clocks of other computers differ from this one's. No others are known. */
  correct?(clocks: ReadonlyMap<string, ClockDifference>): void;
  /** Called with each renewal: the newest messages of publishers that the master knows. */
  tick(lastSeqs: ReadonlyMap<bigint, bigint>): void;
}

/** A publisher with the endpoint at which this node reaches it; undefined when there is none. */
export interface ReachablePublisher extends RemotePublisher {
  readonly endpoint: string | undefined;
}

interface Registered<R, T> {
  record: R;
  readonly owner: T;
  isConfirmed: boolean;
}

type Found = Extract<Answer, { is: "found" }>;

/** What a node has registered with its master: renews the lease, joins again, hears of publishers. */
export class MasterSession {
  private readonly rpc: RpcClient;
  private readonly publishers = new Map<bigint, Registered<PublisherRecord, SessionPublisher>>();
  private readonly subscribers = new Map<bigint, Registered<SubscriberRecord, SessionSubscriber>>();
  private epoch = 0n;
  private revision = 0n;
  private renewS = RENEW_S;
  private timer: NodeJS.Timeout | undefined;
  /** Whether the newest renewal has no answer yet. */
  private isUnanswered = false;
  private joinAgainAt = -Infinity;
  private connectedAt = performance.now();
  private servedHosts: readonly string[] = [];
  private ownHost = LOOPBACK;
  private movedTo = "";
  private isClosed = false;
  private readonly clock = new ClockSamples();
  private clocks: ReadonlyMap<string, ClockDifference> = new Map();
  /** When the newest renewals were sent, by call. */
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

  /** Whether the master has answered at all. */
  get isKnown(): boolean {
    return this.epoch !== 0n;
  }

  /** The addresses of this computer at which publishers are to be reached. */
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
   * @param waitS Seconds to wait for the master; undefined waits until there is one.
   * @returns the subscribers to expect and those known not to answer.
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
   * Register a subscriber or client; `connect` is called with the publishers that are there.
   *
   * @throws {MasterUnreachableError | RequestRefusedError}
   */
  async addSubscriber(record: SubscriberRecord, owner: SessionSubscriber, waitS?: number): Promise<void> {
    const registered = { record, owner, isConfirmed: false };
    this.subscribers.set(record.id, registered);
    const request = { do: "subscriber+", node: this.node, subscriber: record } as const;
    // Connects before the next push is read, which may say that one of these publishers closes.
    const connect = (found: Answer): void => {
      if (found.is !== "found") return;
      registered.isConfirmed = true;
      owner.connect(found.publishers.map((each) => this.inReach(each)));
    };
    const found = await this.register(() => this.rpc.ask(request, waitS, connect), this.subscribers, record.id);
    if (record.pattern && found.is === "found" && !found.pattern) {
      this.removeSubscriber(record.id);
      throw new NepError(`The master at ${this.address} is older and knows no wildcards. Start a newer one.`);
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

  /** Tell the master which subscribers did not answer a new publisher. */
  reportMissing(publisherId: bigint, subscriberIds: readonly bigint[]): void {
    this.rpc.tell({ do: "missing", node_id: this.node.id, publisher_id: publisherId, subscriber_ids: subscriberIds });
  }

  /** Renew once more, so that subscribers learn what was sent last; then leave. Waits at most `timeoutS`. */
  async leave(timeoutS: number): Promise<void> {
    if (this.isClosed) return;
    clearTimeout(this.timer);
    this.isClosed = true; // nothing is joined from now on
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

  // ---- the lease

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

  /** Move publishers when the master serves other addresses, or this computer has another one. */
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
        this.movedTo = ""; // tried again with the next renewal
        this.warn(`Can't serve ${String(hosts)}: ${String(error)}`);
      }
    }
  }

  // ---- what the master says

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
    if (this.clock.add(sent, receivedNs, answeredNs) && !wasKnown) setImmediate(() => this.renew()); // others wait for it
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

  /** Register everything again, once at a time. */
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
