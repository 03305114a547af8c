/** Interface of the wires of publishers: the native one and that of the original NEP. */
import type { Encoded } from "../messages/codecs.js";

/** Wire of a publisher. */
export interface PublisherTransport {
  /** Number of messages sent or skipped, which is the seq of the newest one. */
  readonly count: number;
  readonly bytes: number;
  readonly lastStampNs: bigint | undefined;
  /** True if the topic has subscribers, with or without a hello. */
  readonly isHeard: boolean;
  /** Number of connected subscribers. */
  readonly subscribers: number;
  /** Return true if this subscriber is connected. */
  hasGreeted(subscriber: bigint): boolean;
  /** Bind at exactly these addresses of this computer. Resolves to the endpoints. */
  move(hosts: readonly string[]): Promise<string[]>;
  /** Bind or connect to one endpoint without a master. */
  attach(endpoint: string, how: "bind" | "connect"): Promise<void>;
  /** Read subscriptions now. */
  wake(): void;
  /** Count a message without sending it, because the topic has no subscribers. */
  skip(): void;
  send(encoded: Encoded, stampNs?: bigint): void;
  /** Send a bye to all subscribers. Return false if the wire has no bye. */
  sayBye(): boolean;
  /** Resolves when all messages have been passed to libzmq. */
  flush(): Promise<void>;
  /** Close; libzmq sends queued messages for at most `lingerMs`. */
  close(lingerMs?: number): void;
}
