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
    /** The received payload. Don't modify it. */
    readonly data: Buffer,
    private readonly codecOf: Codec,
    /** Type declared by the publisher, such as `json` or `sensor_msgs/Image`. */
    readonly type: string,
    /** Sequence number, counted from 1 by the publisher. */
    readonly seq: bigint,
    /** Time of publication by the publisher's clock, in nanoseconds since 1970. */
    readonly stampNs: bigint,
    /** Id of the publisher. */
    readonly publisher: bigint,
    /** Named values sent with the payload. */
    readonly extension: Extension,
    /** Whether the publisher keeps the message for late subscribers. */
    readonly latched: boolean,
    private readonly clock = NOT_COMPARED,
  ) {}

  /** Name of the codec: `json`, `string`, `bytes`, `msgpack` or `image`. */
  get codec(): string {
    return this.codecOf.name;
  }

  /** Time of publication by the publisher's clock. */
  get date(): Date {
    return new Date(Number(this.stampNs / 1_000_000n));
  }

  /**
   * Seconds from publication until the first read of this property; read it as soon as a message arrives.
   *
   * Between computers it is corrected by the difference of their clocks, so it may be slightly negative.
   */
  get latencyS(): number {
    this.seenNs ??= nowNs();
    return Number(this.seenNs - this.stampNs - (this.clock.difference?.addNs ?? 0n)) / 1e9;
  }

  /** Uncertainty of `latencyS` in seconds due to clock differences: 0 on one computer, undefined if unknown. */
  get latencyUncertaintyS(): number | undefined {
    const { difference } = this.clock;
    if (!difference) return undefined;
    const { uncertaintyNs, knownAtNs } = difference;
    return Number(uncertaintyNs + (knownAtNs === undefined ? 0n : driftNs(steadyNs() - knownAtNs))) / 1e9;
  }

  /** The decoded payload. @throws {DecodeError} if the data is not valid for its codec. */
  get payload(): T {
    this.decoded ??= { value: this.codecOf.decode(this.data, this.extension) as T };
    return this.decoded.value;
  }
}
