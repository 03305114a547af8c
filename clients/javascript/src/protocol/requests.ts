/** Requests of nodes to the master and its replies: types, encoding and decoding. */
import { WireError } from "../errors.js";
import { isMap, pack, unpack, withWideIntegers } from "../messages/packing.js";

const MAX_PROBLEM_LETTERS = 500;

/** Return a problem description truncated to the length allowed in statistics. */
export function problemText(sentence: string): string {
  return sentence.slice(0, MAX_PROBLEM_LETTERS);
}

export interface NodeRecord {
  readonly id: string;
  readonly name: string;
  readonly host: string;
  readonly pid: number;
  readonly language: string;
  readonly since_ns: bigint;
  /** Random secret that proves the id; known only to the node and its master. */
  readonly key: string;
  /** Identifies the computer; equal for programs that read the same clock. */
  readonly computer?: string;
}

export interface PublisherRecord {
  readonly id: bigint;
  readonly topic: string;
  readonly msg_type: string;
  readonly codec: string;
  readonly endpoints: readonly string[];
  readonly latched?: boolean;
  readonly number: number;
  readonly history?: number;
}

export interface SubscriberRecord {
  readonly id: bigint;
  readonly topic: string;
  readonly msg_type: string;
  readonly number: number;
  readonly pattern?: boolean;
}

export interface PublisherCount {
  readonly id: bigint;
  readonly count: bigint;
  readonly bytes: bigint;
  readonly last_seq: bigint;
  readonly last_stamp_ns?: bigint;
  readonly problem?: string;
  readonly errors?: number;
}

export interface SubscriberCount {
  readonly id: bigint;
  readonly received: bigint;
  readonly lost: bigint;
  readonly problem?: string;
}

/** A request to the master. Fields with their default value may be omitted. */
export type Request =
  | { readonly do: "publisher+"; readonly node: NodeRecord; readonly publisher: PublisherRecord }
  | { readonly do: "subscriber+"; readonly node: NodeRecord; readonly subscriber: SubscriberRecord }
  | {
      readonly do: "join";
      readonly node: NodeRecord;
      readonly epoch: bigint;
      readonly publishers: readonly PublisherRecord[];
      readonly subscribers: readonly SubscriberRecord[];
    }
  | { readonly do: "publisher-"; readonly node_id: string; readonly id: bigint; readonly last_seq: bigint }
  | { readonly do: "subscriber-"; readonly node_id: string; readonly id: bigint }
  | { readonly do: "leave"; readonly node_id: string }
  | {
      readonly do: "renew";
      readonly node_id: string;
      readonly epoch: bigint;
      readonly revision: bigint;
      readonly publishers: readonly PublisherCount[];
      readonly subscribers: readonly SubscriberCount[];
      readonly cpu_ratio?: number;
      /** Offset to the master's clock and its uncertainty, in nanoseconds; empty while unknown. */
      readonly clock?: readonly bigint[];
    }
  | {
      readonly do: "missing";
      readonly node_id: string;
      readonly publisher_id: bigint;
      readonly subscriber_ids: readonly bigint[];
    }
  | { readonly do: "ping" };

/** A publisher and its node: the data a subscriber needs to connect. */
export interface RemotePublisher {
  readonly id: bigint;
  readonly topic: string;
  readonly msgType: string;
  readonly codec: string;
  readonly endpoints: readonly string[];
  readonly history: number;
  readonly nodeId: string;
  readonly nodeName: string;
  /** Computer of the node; empty if unknown. */
  readonly computer: string;
}

/** Subscriber for whose connection a new publisher waits. */
export interface ExpectedSubscriber {
  readonly id: bigint;
  readonly nodeName: string;
}

interface FromMaster {
  /** Changes when the master is restarted. */
  readonly epoch: bigint;
  readonly revision: bigint;
}

/** A reply or push of the master. */
export type Answer = FromMaster &
  (
    | { readonly is: "done" | "probe" | "seen" }
    | {
        readonly is: "added";
        readonly expected: ExpectedSubscriber[];
        readonly hung: ExpectedSubscriber[];
        readonly hosts: string[];
      }
    | {
        readonly is: "found";
        readonly publishers: RemotePublisher[];
        readonly hosts: string[];
        readonly pattern: boolean;
      }
    | {
        readonly is: "renewed";
        readonly again: boolean;
        readonly topics: { readonly topic: string; readonly publishers: RemotePublisher[] }[];
        readonly lastSeqs: ReadonlyMap<bigint, bigint>;
        readonly hosts: string[];
        readonly nextS: number;
        /** Times at which the master received the renewal and replied to it, by its clock. */
        readonly times: readonly bigint[];
        /** By node: the offset from its clock to this node's clock, and the uncertainty. */
        readonly clocks: ReadonlyMap<string, readonly bigint[]>;
      }
    | { readonly is: "refused"; readonly reason: string; readonly code: string }
    | {
        readonly is: "publisher+";
        readonly publisher: RemotePublisher;
        /** Whether the publisher is new, so that its first message has seq 1. */
        readonly isNew: boolean;
      }
    | {
        readonly is: "publisher-";
        readonly id: bigint;
        readonly topic: string;
        readonly isClosed: boolean;
        readonly lastSeq: bigint;
      }
  );

/** Return the body of a request. */
export function encodeRequest(request: Request, call: number): Buffer {
  const { do: name, ...what } = request;
  return pack(withWideIntegers({ do: name, call, what }));
}

/** Decode a reply (`call` as in its request) or a push (`call` 0). @throws {WireError} */
export function decodeAnswer(body: Buffer): { call: number; answer: Answer } {
  let envelope: unknown;
  try {
    envelope = unpack(body);
  } catch (error) {
    throw new WireError("msgpack", `The reply is not valid msgpack: ${String(error)}`);
  }
  if (!isMap(envelope)) throw new WireError("map", "The reply is not a map.");
  const fields = new Fields(isMap(envelope["what"]) ? envelope["what"] : {}, "what");
  const call = envelope["re"];
  const answer = readAnswer(String(envelope["is"]), fields);
  if (!answer || (typeof call !== "number" && call !== undefined)) {
    throw new WireError("answer", `"${String(envelope["is"])}" is not a reply of this version.`);
  }
  return { call: call ?? 0, answer };
}

function readAnswer(name: string, what: Fields): Answer | undefined {
  const common = { epoch: what.integer("epoch", 0n), revision: what.integer("revision", 0n) };
  switch (name) {
    case "done":
    case "probe":
    case "seen":
      return { is: name, ...common };
    case "added":
      return {
        is: name,
        ...common,
        expected: what.maps("expected").map(readExpected),
        hung: what.maps("hung").map(readExpected),
        hosts: what.texts("hosts"),
      };
    case "found":
      return {
        is: name,
        ...common,
        publishers: what.maps("publishers").map(readRemote),
        hosts: what.texts("hosts"),
        pattern: what.flag("pattern"),
      };
    case "renewed":
      return {
        is: name,
        ...common,
        again: what.flag("again"),
        topics: what
          .maps("topics")
          .map((each) => ({ topic: each.text("topic"), publishers: each.maps("publishers").map(readRemote) })),
        lastSeqs: what.integers("last_seqs"),
        hosts: what.texts("hosts"),
        nextS: what.number("next_s", 1),
        times: what.integerList("times"),
        clocks: what.integerLists("clocks"),
      };
    case "refused":
      return { is: name, ...common, reason: what.text("reason"), code: what.text("code", "") };
    case "publisher+":
      return { is: name, ...common, publisher: readRemote(what.map("publisher")), isNew: what.flag("is_new") };
    case "publisher-":
      return {
        is: name,
        ...common,
        id: what.integer("id"),
        topic: what.text("topic"),
        isClosed: what.flag("is_closed"),
        lastSeq: what.integer("last_seq", 0n),
      };
    default:
      return undefined;
  }
}

function readExpected(each: Fields): ExpectedSubscriber {
  return { id: each.integer("id"), nodeName: each.text("node_name") };
}

function readRemote(each: Fields): RemotePublisher {
  const record = each.map("publisher");
  return {
    id: record.integer("id"),
    topic: record.text("topic"),
    msgType: record.text("msg_type"),
    codec: record.text("codec"),
    endpoints: record.texts("endpoints"),
    history: Number(record.integer("history", 0n)),
    nodeId: each.text("node_id"),
    nodeName: each.text("node_name"),
    computer: each.text("computer", ""),
  };
}

/** Typed access to a decoded map; throws `WireError` that names the field. */
class Fields {
  constructor(
    private readonly values: Record<string, unknown>,
    private readonly path: string,
  ) {}

  text(name: string, fallback?: string): string {
    return this.typed(name, fallback, (value) => typeof value === "string");
  }

  number(name: string, fallback: number): number {
    const value = this.typed<number | bigint>(
      name,
      fallback,
      (each) => typeof each === "number" || typeof each === "bigint",
    );
    return Number(value);
  }

  integer(name: string, fallback?: bigint): bigint {
    const value = this.typed<number | bigint>(
      name,
      fallback,
      (each) => typeof each === "bigint" || Number.isInteger(each),
    );
    return BigInt(value);
  }

  flag(name: string): boolean {
    return this.typed(name, false, (value) => typeof value === "boolean");
  }

  map(name: string): Fields {
    return new Fields(this.typed<Record<string, unknown>>(name, undefined, isMap), `${this.path}.${name}`);
  }

  maps(name: string): Fields[] {
    return this.list(name).map((each, index) => {
      if (!isMap(each)) throw this.misfit(`${name}.${index}`);
      return new Fields(each, `${this.path}.${name}.${index}`);
    });
  }

  texts(name: string): string[] {
    const values = this.list(name);
    if (!values.every((each) => typeof each === "string")) throw this.misfit(name);
    return values;
  }

  integers(name: string): Map<bigint, bigint> {
    const values = this.typed<Record<string, unknown>>(name, {}, isMap);
    const found = new Map<bigint, bigint>();
    for (const [key, value] of Object.entries(values)) {
      if (!/^\d{1,20}$/.test(key) || (typeof value !== "bigint" && !Number.isInteger(value))) throw this.misfit(name);
      found.set(BigInt(key), BigInt(value as number | bigint));
    }
    return found;
  }

  integerList(name: string): bigint[] {
    return this.asIntegers(name, this.list(name));
  }

  integerLists(name: string): Map<string, bigint[]> {
    const values = this.typed<Record<string, unknown>>(name, {}, isMap);
    return new Map(Object.entries(values).map(([key, value]) => [key, this.asIntegers(name, value)]));
  }

  private asIntegers(name: string, values: unknown): bigint[] {
    const isRight = Array.isArray(values) && values.every((each) => typeof each === "bigint" || Number.isInteger(each));
    if (!isRight) throw this.misfit(name);
    return (values as (number | bigint)[]).map(BigInt);
  }

  private list(name: string): unknown[] {
    return this.typed<unknown[]>(name, [], Array.isArray);
  }

  private typed<T>(name: string, fallback: T | undefined, isRight: (value: unknown) => boolean): T {
    const value = this.values[name];
    if (value === undefined && fallback !== undefined) return fallback;
    if (value === undefined) throw new WireError("field-missing", `"${this.path}.${name}" is missing.`);
    if (!isRight(value)) throw this.misfit(name);
    return value as T;
  }

  private misfit(name: string): WireError {
    return new WireError("field-type", `"${this.path}.${name}" has the wrong type.`);
  }
}
