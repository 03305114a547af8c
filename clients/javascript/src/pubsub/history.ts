export const MAX_HISTORY = 1000;
const MAX_HISTORY_BYTES = 64 * 2 ** 20;

/** Newest messages of a publisher for late subscribers, limited by number and bytes; always includes the newest. */
export class History {
  readonly kept: { readonly parts: Buffer[]; readonly bytes: number }[] = [];
  bytes = 0;

  constructor(private readonly limit: number) {}

  add(parts: Buffer[], bytes: number): void {
    if (this.limit === 0) return;
    this.kept.push({ parts, bytes });
    this.bytes += bytes;
    while (this.kept.length > this.limit || (this.bytes > MAX_HISTORY_BYTES && this.kept.length > 1)) {
      this.bytes -= this.kept.shift()!.bytes;
    }
  }
}
