/** What is under way to subscribers, in bytes: libzmq bounds its queues by a number of messages only. */
const MIB = 2 ** 20;

/** So much may be under way to one subscriber. */
export const WINDOW_BYTES = 192 * MIB;
/** The least that a subscriber may ask for. */
export const MIN_WINDOW_BYTES = 24 * MIB;
/** A subscriber is asked what it has read after every so many bytes. */
export const STEP_BYTES = 12 * MIB;
/** What libzmq holds for subscribers that can't be asked is noted in such steps. */
export const BACKLOG_STEP_BYTES = MIB;
const ENTRY_BYTES = MIB;
const ASK_AGAIN_MS = 500;

/** What was sent to one subscriber and is not known to be read. */
export class SendWindow {
  /** Bytes. */
  underWay = 0;
  private bound = WINDOW_BYTES;
  private readonly sentEntries: { seq: number; bytes: number }[] = [];
  private unasked = 0;
  private askedAt = -Infinity;
  private hasMissed = false;

  /** Whether a message of this size may follow; one larger than the window waits for a step. */
  hasRoom(bytes: number): boolean {
    return this.underWay <= STEP_BYTES || this.underWay + bytes <= this.bound;
  }

  /** So many bytes more are under way, up to the message `seq`. */
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

  /** There was no room for a message. */
  missed(): void {
    this.hasMissed = true;
  }

  /** Whether it has room again and does not know yet what it missed; true counts as telling. */
  takeMissed(): boolean {
    if (!this.hasMissed || this.underWay > STEP_BYTES) return false;
    this.hasMissed = false;
    return true;
  }

  /** The subscriber has read everything up to `seq`, and wants so much under way at most. */
  read(seq: bigint, boundBytes: bigint): void {
    this.bound = Math.max(MIN_WINDOW_BYTES, Math.min(Number(boundBytes), WINDOW_BYTES));
    while (this.sentEntries.length > 0 && BigInt(this.sentEntries[0]!.seq) <= seq) {
      this.underWay -= this.sentEntries.shift()!.bytes;
    }
  }

  /** Whether to ask now what it has read; true counts as asking. */
  takeAsk(now: number, hasRoom: boolean): boolean {
    if (this.unasked < STEP_BYTES && (hasRoom || now < this.askedAt + ASK_AGAIN_MS)) return false;
    this.unasked = 0;
    this.askedAt = now;
    return true;
  }
}

/**
 * What libzmq holds for those that don't tell what they have read. It lets go of a message's buffer when all
 * have it; that shows only when the buffer is collected as garbage, so this is an upper estimate.
 */
export class Backlog {
  private heldBytes = 0;
  private readonly registry = new FinalizationRegistry<number>((bytes) => {
    this.heldBytes -= bytes;
  });

  hasRoom(bytes: number): boolean {
    return this.heldBytes <= BACKLOG_STEP_BYTES || this.heldBytes + bytes <= WINDOW_BYTES;
  }

  /** So many bytes were sent since the last call; `buffer` is the newest of them. */
  sent(buffer: Buffer, bytes: number): void {
    this.heldBytes += bytes;
    this.registry.register(buffer, bytes);
  }
}
