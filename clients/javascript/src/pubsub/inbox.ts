import type { Message } from "../messages/message.js";

/** Queue of messages, limited by number and bytes, that drops the oldest one when it is full. */
export class Inbox {
  private messages: (Message | undefined)[] = [];
  private head = 0;
  private bytes = 0;

  /** @param keepsAll false: keep only the newest message; a replaced message is not counted as dropped. */
  constructor(
    private readonly keepsAll: boolean,
    private readonly maxMessages: number,
    private readonly maxBytes: number,
  ) {}

  get length(): number {
    return this.messages.length - this.head;
  }

  /** Add a message. Return the number of messages dropped for it. */
  put(message: Message): number {
    this.messages.push(message);
    this.bytes += message.data.length;
    let dropped = 0;
    const maxMessages = this.keepsAll ? this.maxMessages : 1;
    while (this.length > maxMessages || (this.bytes > this.maxBytes && this.length > 1)) {
      this.take();
      if (this.keepsAll) dropped++;
    }
    return dropped;
  }

  take(): Message | undefined {
    const message = this.messages[this.head];
    if (!message) return undefined;
    this.messages[this.head++] = undefined;
    this.bytes -= message.data.length;
    if (this.head > 1000 && this.head * 2 > this.messages.length) {
      this.messages = this.messages.slice(this.head);
      this.head = 0;
    }
    return message;
  }

  clear(): void {
    this.messages = [];
    this.head = 0;
    this.bytes = 0;
  }
}
