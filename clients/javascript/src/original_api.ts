// Exports of nep-js 0.1.1 other than Node, with the same names and argument order.
import type { Configuration, OriginalConfiguration } from "./configuration.js";
import { NepError } from "./errors.js";
import { Node } from "./node.js";
import type { Publisher } from "./pubsub/publisher.js";
import type { Subscriber } from "./pubsub/subscriber.js";
import type { Client } from "./services/client.js";

const MASTER_PORT = 7000;

const nodes = new Map<string, Node>();

/** Return the node with this name, shared by the classes below. */
function nodeNamed(name: string): Node {
  let node = nodes.get(name);
  if (!node || node.isClosed) {
    node = new Node(name);
    nodes.set(name, node);
  }
  return node;
}

/** Publisher with the interface of nep-js 0.1.1. New programs use {@link Node.publisher}. */
export class publisher<T = unknown> {
  private readonly inner: Publisher<T>;

  constructor(
    node: string,
    readonly topic: string,
    readonly msg_type = "json",
    conf?: Configuration | OriginalConfiguration,
    _version?: number,
  ) {
    this.inner = nodeNamed(node).new_pub<T>(topic, msg_type, conf);
  }

  publish(message: T): void {
    this.inner.publish(message);
  }

  close(): void {
    void this.inner.close();
  }
}

/** Subscriber with the interface of nep-js 0.1.1. New programs use {@link Node.subscribe}. */
export class subscriber<T = unknown> {
  private readonly inner: Subscriber<T>;

  constructor(
    node: string,
    readonly topic: string,
    readonly msg_type: string,
    callback: (payload: T) => void,
    conf?: Configuration | OriginalConfiguration,
    _version?: number,
  ) {
    this.inner = nodeNamed(node).new_sub<T>(topic, msg_type, callback, conf);
  }

  close(): void {
    void this.inner.close();
  }
}

/** Service client with the interface of nep-js 0.1.1, where it never worked. Use {@link Node.client} instead. */
export class client<Request = unknown, Answer = unknown> {
  private readonly inner: Client<Request, Answer>;

  constructor(
    readonly topic: string,
    node: string,
    private readonly callback: (answer: Answer) => void,
  ) {
    this.inner = nodeNamed(node).client<Request, Answer>(topic);
  }

  /** Call the service; the callback receives the reply. A failed call is logged, as in nep-js 0.1.1. */
  send_info(message: Request): void {
    this.inner.call(message).then(this.callback, (error: unknown) => console.error(error));
  }

  close(): void {
    void this.inner.close();
  }
}

/** REQ socket of `zeromq/v5-compat`, as passed to `masterRegister`. */
export interface Requester {
  connect(address: string): unknown;
  on(event: "message", listener: (message: Buffer) => void): unknown;
  send(message: string): unknown;
}

/** Reply of an original master to a registration. */
export interface OriginalRegistration {
  readonly ip: string;
  readonly port: number;
}

/**
 * Register the program's own sockets with an original master, or with the gateway of `nep master`.
 *
 * @throws {NepError} if `requester` is not a socket of `zeromq/v5-compat`.
 */
export function masterRegister(
  node: string,
  topic: string,
  master_ip: string,
  master_port: number | string | undefined,
  socket: string,
  mode: string,
  pid: number | string,
  callback: (registration: OriginalRegistration) => void,
  data_type: string,
  requester: Requester,
): void {
  if (typeof requester?.on !== "function") {
    throw new NepError(
      'masterRegister needs require("zeromq/v5-compat").socket("req") as its last argument. ' +
        `To publish or subscribe, write new nep.Node("${node}").new_pub("${topic}", "${data_type}") or new_sub instead.`,
    );
  }
  requester.connect(`tcp://${master_ip}:${master_port ?? MASTER_PORT}`);
  requester.on("message", (answer) => callback(JSON.parse(answer.toString()) as OriginalRegistration));
  requester.send(JSON.stringify({ node, topic, mode, socket, pid, msg_type: data_type }));
}
