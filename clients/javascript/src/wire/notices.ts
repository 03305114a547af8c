import { decodeUtf8 } from "./utf8.js";

/** Content of a hello filter: the subscriber, its topic and the message forms that it reads. */
export interface Hello {
  readonly subscriber: bigint;
  readonly topic: string;
  /** 0: three parts only; 1: also one part; 2: also acknowledges messages; 3: also reads batches. */
  readonly level: 0 | 1 | 2 | 3;
}

/** Acknowledgement: the subscriber has read all messages of a publisher up to `seq`. */
export interface Read {
  readonly subscriber: bigint;
  readonly publisher: bigint;
  readonly seq: bigint;
  /** Maximum number of bytes in flight that the subscriber accepts. */
  readonly boundBytes: bigint;
}

/** Acceptance of a publisher's offer of shared memory. */
export interface Shares {
  readonly subscriber: bigint;
  readonly publisher: bigint;
  readonly generation: bigint;
}

const HELLO = /^\xffhello([123]?)\/([0-9a-fA-F]{16})\//;
const READ = /^\xffread\/([0-9a-fA-F]{16})\/([0-9a-fA-F]{16})\/([0-9a-fA-F]{16})\/([0-9a-fA-F]{16})$/;
const SHARES = /^\xffshares\/([0-9a-fA-F]{16})\/([0-9a-fA-F]{16})\/([0-9a-fA-F]{16})$/;

function hex(value: bigint): string {
  return value.toString(16).padStart(16, "0");
}

function prefixed(text: string): Buffer {
  return Buffer.concat([Buffer.from([0xff]), Buffer.from(text, "utf8")]);
}

/** Return the hello filter of a subscriber, which is also the first part of messages sent to it alone. */
export function helloPart(hello: Hello): Buffer {
  return prefixed(`hello${hello.level || ""}/${hex(hello.subscriber)}/${hello.topic}`);
}

/** Parse a hello filter; return undefined for other filters. */
export function parseHello(part: Buffer): Hello | undefined {
  const match = HELLO.exec(part.toString("latin1", 0, 32));
  if (!match) return undefined;
  try {
    const topic = decodeUtf8(part.subarray(match[0].length));
    return { subscriber: BigInt(`0x${match[2]}`), topic, level: Number(match[1]) as Hello["level"] };
  } catch {
    return undefined;
  }
}

/** Return the filter that acknowledges messages. */
export function readPart(read: Read): Buffer {
  return prefixed(`read/${[read.subscriber, read.publisher, read.seq, read.boundBytes].map(hex).join("/")}`);
}

/** Parse an acknowledgement; return undefined for other filters. */
export function parseRead(part: Buffer): Read | undefined {
  const numbers = parseNumbers(READ, part);
  if (!numbers) return undefined;
  const [subscriber, publisher, seq, boundBytes] = numbers;
  return { subscriber: subscriber!, publisher: publisher!, seq: seq!, boundBytes: boundBytes! };
}

/** Return the filter that accepts an offer of shared memory. */
export function sharesPart(shares: Shares): Buffer {
  return prefixed(`shares/${[shares.subscriber, shares.publisher, shares.generation].map(hex).join("/")}`);
}

/** Parse the acceptance of an offer; return undefined for other filters. */
export function parseShares(part: Buffer): Shares | undefined {
  const numbers = parseNumbers(SHARES, part);
  if (!numbers) return undefined;
  const [subscriber, publisher, generation] = numbers;
  return { subscriber: subscriber!, publisher: publisher!, generation: generation! };
}

function parseNumbers(pattern: RegExp, part: Buffer): bigint[] | undefined {
  if (part.length > 80) return undefined;
  const match = pattern.exec(part.toString("latin1"));
  return match ? match.slice(1).map((digits) => BigInt(`0x${digits}`)) : undefined;
}
