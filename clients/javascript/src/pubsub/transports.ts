/** What publishers and subscribers need from the wire they use: the native one, or that of the original NEP. */
import type { Encoded } from "../messages/codecs.js";

/** A publisher's side. */
export interface PublisherTransport {
  /** Messages sent or skipped: the seq of the newest one. */
  readonly count: number;
  readonly bytes: number;
  readonly lastStampNs: bigint | undefined;
  /** Whether the topic has subscribers, with or without a hello. */
  readonly isHeard: boolean;
  /** Number of connected subscribers. */
  readonly subscribers: number;
  /** Whether this subscriber is connected. */
  hasGreeted(subscriber: bigint): boolean;
  /** Be bound at these hosts of this computer and no others. Returns the endpoints. */
  move(hosts: readonly string[]): Promise<string[]>;
  /** Bind or connect at one endpoint, without a master. */
  attach(endpoint: string, how: "bind" | "connect"): Promise<void>;
  /** Read subscriptions now. */
  wake(): void;
  /** Count a message without sending it: the topic has no subscribers. */
  skip(): void;
  send(encoded: Encoded, stampNs?: bigint): void;
  /** Announce the end to all subscribers. Returns false if the wire has no bye. */
  sayBye(): boolean;
  /** Resolves when everything is handed to libzmq. */
  flush(): Promise<void>;
  /** Close; libzmq sends what it holds for at most `lingerMs`. */
  close(lingerMs?: number): void;
}
