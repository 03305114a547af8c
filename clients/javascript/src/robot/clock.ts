/** Time of a robot, so that tests can bring their own. */
export interface Clock {
  /** Seconds that never run backwards. */
  now(): number;
  /** Call back after some seconds. Returns a function that cancels it. */
  after(seconds: number, callback: () => void): () => void;
}

/** The computer's own clock. */
export const systemClock: Clock = {
  now: () => performance.now() / 1000,
  after(seconds, callback) {
    const timer = setTimeout(callback, Math.min(seconds * 1000, 2 ** 31 - 1));
    return () => clearTimeout(timer);
  },
};

/** A clock that stands still until it is advanced. */
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

  /** Let time pass. Timers that become due fire once, earliest first. */
  advance(seconds: number): void {
    this.seconds += seconds;
    const due = [...this.timers].filter((each) => each.due <= this.seconds).sort((a, b) => a.due - b.due);
    for (const each of due) if (this.timers.delete(each)) each.callback();
  }
}
