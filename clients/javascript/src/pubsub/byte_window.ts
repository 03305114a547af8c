/** Flow control of subscribers in bytes: libzmq limits its queues only by number of messages. */
const MIB = 2 ** 20;

/** Maximum number of bytes in flight to one subscriber. */
export const WINDOW_BYTES = 192 * MIB;
/** Minimum window that a subscriber may request. */
export const MIN_WINDOW_BYTES = 24 * MIB;
/** Number of bytes after which a subscriber is asked to acknowledge. */
export const STEP_BYTES = 12 * MIB;
/** Granularity at which the bytes are counted that libzmq holds for subscribers that don't acknowledge. */
export const BACKLOG_STEP_BYTES = MIB;
const ENTRY_BYTES = MIB;
const ASK_AGAIN_MS = 500;

/** Messages sent to one subscriber and not yet acknowledged. */
export class SendWindow {
  /** Bytes. */
  underWay = 0;
  private bound = WINDOW_BYTES;
  private readonly sentEntries: { seq: number; bytes: number }[] = [];
  private unasked = 0;
  private askedAt = -Infinity;
  private hasMissed = false;

  /** Return true if a message of this size may be sent; one larger than the window waits until a step is free. */
  hasRoom(bytes: number): boolean {
    return this.underWay <= STEP_BYTES || this.underWay + bytes <= this.bound;
  }

  /** Count bytes that were sent, up to the message `seq`. */
  sent(seq: number, bytes: number): void {
    const newest = this.sentEntries.at(-1);
    if (newest && newest.bytes + bytes <= ENTRY_BYTES) {
      newest.seq = seq;
      newest.bytes += bytes;
    } else {
      this.sentEntries.push({ seq, bytes });
    }
    this.underWay += bytes;
    this.unasked += bytes;
  }

  /** Note that a message was dropped for lack of room. */
  missed(): void {
    this.hasMissed = true;
  }

  /** Return true once when there is room again after a drop; the caller then notifies the subscriber. */
  takeMissed(): boolean {
    if (!this.hasMissed || this.underWay > STEP_BYTES) return false;
    this.hasMissed = false;
    return true;
  }

  /** Handle an acknowledgement of all messages up to `seq`, with the window that the subscriber requests. */
  read(seq: bigint, boundBytes: bigint): void {
    this.bound = Math.max(MIN_WINDOW_BYTES, Math.min(Number(boundBytes), WINDOW_BYTES));
    while (this.sentEntries.length > 0 && BigInt(this.sentEntries[0]!.seq) <= seq) {
      this.underWay -= this.sentEntries.shift()!.bytes;
    }
  }

  /** Return true if an acknowledgement should be requested now; the request is then counted as sent. */
  takeAsk(now: number, hasRoom: boolean): boolean {
    if (this.unasked < STEP_BYTES && (hasRoom || now < this.askedAt + ASK_AGAIN_MS)) return false;
    this.unasked = 0;
    this.askedAt = now;
    return true;
  }
}

/**
 * Bytes that libzmq holds for subscribers that don't acknowledge. libzmq releases a message's buffer after
 * sending it to all of them; this is noticed only when the buffer is garbage-collected, so the value is an upper
 * estimate.
 */
export class Backlog {
  private heldBytes = 0;
  private readonly registry = new FinalizationRegistry<number>((bytes) => {
    this.heldBytes -= bytes;
  });

  hasRoom(bytes: number): boolean {
    return this.heldBytes <= BACKLOG_STEP_BYTES || this.heldBytes + bytes <= WINDOW_BYTES;
  }

  /** Count bytes sent since the last call; `buffer` is the newest message of them. */
  sent(buffer: Buffer, bytes: number): void {
    this.heldBytes += bytes;
    this.registry.register(buffer, bytes);
  }
}
