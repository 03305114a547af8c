import { driftNs, type PublisherClock } from "./clocks.js";
import { nowNs, steadyNs } from "../system/clock.js";
import { type Codec } from "./codecs.js";
import type { Extension } from "../wire/extension.js";

const NOT_COMPARED: PublisherClock = { difference: undefined };

/** A received message. */
export class Message<T = unknown> {
  private decoded: { readonly value: T } | undefined;
  private seenNs: bigint | undefined;

  /** @internal */
  constructor(
    readonly topic: string,
    /** The payload as it was received. Don't write into it. */
    readonly data: Buffer,
    private readonly codecOf: Codec,
    /** Type as the publisher calls it, such as `json` or `sensor_msgs/Image`. */
    readonly type: string,
    /** Counts the publisher's messages from 1. */
    readonly seq: bigint,
    /** When it was published, by the publisher's clock: nanoseconds since 1970. */
    readonly stampNs: bigint,
    /** The publisher's id. */
    readonly publisher: bigint,
    /** Named values that came beside the payload. */
    readonly extension: Extension,
    /** Whether the publisher keeps it for late subscribers. */
    readonly latched: boolean,
    private readonly clock = NOT_COMPARED,
  ) {}

  /** `json`, `string`, `bytes`, `msgpack` or `image`. */
  get codec(): string {
    return this.codecOf.name;
  }

  /** When it was published, by the publisher's clock. */
  get date(): Date {
    return new Date(Number(this.stampNs / 1_000_000n));
  }

  /**
   * Seconds from its publication until this was first asked for; ask as soon as a message arrives.
   *
   * Between two computers it is corrected by the difference of their clocks, so it may be a little below 0.
   */
  get latencyS(): number {
    this.seenNs ??= nowNs();
    return Number(this.seenNs - this.stampNs - (this.clock.difference?.addNs ?? 0n)) / 1e9;
  }

  /** By how many seconds `latencyS` may be wrong because clocks differ: 0 on one computer, undefined if nobody has compared them. */
  get latencyUncertaintyS(): number | undefined {
    const { difference } = this.clock;
    if (!difference) return undefined;
    const { uncertaintyNs, knownAtNs } = difference;
    return Number(uncertaintyNs + (knownAtNs === undefined ? 0n : driftNs(steadyNs() - knownAtNs))) / 1e9;
  }

  /** The decoded payload. @throws {DecodeError} if it is none of its codec. */
  get payload(): T {
    this.decoded ??= { value: this.codecOf.decode(this.data, this.extension) as T };
    return this.decoded.value;
  }
}
