import type { Clock } from "./clock.js";
import { checkSendable } from "./text.js";

/** Thrown where an action waits when it is to end. Let it pass, after putting away what it holds. */
export class Canceled extends Error {
  override readonly name = "Canceled";
}

/** Throw it when an action can't be done; people see its sentence: `new Failed("no ball in sight")`. */
export class Failed extends Error {
  override readonly name = "Failed";
}

/** One run of an action. */
export class Call {
  private readonly controller = new AbortController();
  private readonly callbacks = new Set<() => void>();

  /** @internal */
  constructor(
    readonly action: string,
    private readonly clock: Clock,
    private readonly report: (values: Record<string, unknown>) => void,
  ) {}

  /** Aborted once the action is to end; for `fetch`, `timers/promises` and all else that takes a signal. */
  get signal(): AbortSignal {
    return this.controller.signal;
  }

  /** Whether the action is to end. */
  get canceled(): boolean {
    return this.controller.signal.aborted;
  }

  /** Call back once, as soon as the action is to end; at once if it is already. Returns a function that undoes it. */
  onCancel(callback: () => void): () => void {
    if (this.canceled) callback();
    else this.callbacks.add(callback);
    return () => this.callbacks.delete(callback);
  }

  /** Wait; rejects with {@link Canceled} as soon as the action is to end. */
  wait(seconds: number): Promise<void> {
    const waited = new Promise<void>((resolve, reject) => {
      if (this.canceled) {
        reject(new Canceled());
        return;
      }
      const forget = this.onCancel(() => {
        clear();
        reject(new Canceled());
      });
      const clear = this.clock.after(seconds, () => {
        forget();
        resolve();
      });
    });
    waited.catch(() => undefined); // not awaited: no unhandled rejection
    return waited;
  }

  /**
   * Wait until a condition is true (true) or `forS` seconds are over (false); look every `everyS` seconds.
   *
   * @throws {Canceled} as soon as the action is to end.
   */
  async until(
    condition: () => boolean,
    { forS, everyS = 1 / 30 }: { readonly forS?: number; readonly everyS?: number } = {},
  ): Promise<boolean> {
    const limit = forS === undefined ? Infinity : this.clock.now() + forS;
    while (!condition()) {
      if (this.clock.now() >= limit) return false;
      await this.wait(everyS);
    }
    return true;
  }

  /** Tell how far the action is. @throws {Canceled} when it is to end. */
  feedback(values: Record<string, unknown>): void {
    if (this.canceled) throw new Canceled();
    this.last(values);
  }

  /** Tell how far the action came, also when it is canceled. */
  last(values: Record<string, unknown>): void {
    checkSendable(values);
    this.report({ ...values });
  }

  /** @internal End the action. Errors of callbacks are passed to `onError`. */
  cancel(onError: (error: unknown) => void): void {
    const callbacks = [...this.callbacks];
    this.callbacks.clear();
    for (const each of [...callbacks, () => this.controller.abort()]) {
      try {
        each();
      } catch (error) {
        onError(error);
      }
    }
  }
}
