/** Clock of a robot, replaceable in tests. */
export interface Clock {
  /** Return the monotonic time in seconds. */
  now(): number;
  /** Call a function after some seconds. Returns a function that cancels the call. */
  after(seconds: number, callback: () => void): () => void;
}

/** Monotonic clock of the computer. */
export const systemClock: Clock = {
  now: () => performance.now() / 1000,
  after(seconds, callback) {
    const timer = setTimeout(callback, Math.min(seconds * 1000, 2 ** 31 - 1));
    return () => clearTimeout(timer);
  },
};

/** Clock that only changes when it is advanced. */
export class ManualClock implements Clock {
  private seconds = 100;
  private readonly timers = new Set<{ readonly due: number; readonly callback: () => void }>();

  now(): number {
    return this.seconds;
  }

  after(seconds: number, callback: () => void): () => void {
    if (seconds <= 0) {
      const immediate = setImmediate(callback);
      return () => clearImmediate(immediate);
    }
    const timer = { due: this.seconds + seconds, callback };
    this.timers.add(timer);
    return () => this.timers.delete(timer);
  }

  /** Advance the time. Timers that become due fire once, earliest first. */
  advance(seconds: number): void {
    this.seconds += seconds;
    const due = [...this.timers].filter((each) => each.due <= this.seconds).sort((a, b) => a.due - b.due);
    for (const each of due) if (this.timers.delete(each)) each.callback();
  }
}
