import { type Codec } from "./codecs.js";
import type { Extension } from "../wire/extension.js";

/** A received message. */
export class Message<T = unknown> {
  private decoded: { readonly value: T } | undefined;

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
  ) {}

  /** `json`, `string`, `bytes`, `msgpack` or `image`. */
  get codec(): string {
    return this.codecOf.name;
  }

  /** When it was published, by the publisher's clock. */
  get date(): Date {
    return new Date(Number(this.stampNs / 1_000_000n));
  }

  /** The decoded payload. @throws {DecodeError} if it is none of its codec. */
  get payload(): T {
    this.decoded ??= { value: this.codecOf.decode(this.data, this.extension) as T };
    return this.decoded.value;
  }
}
