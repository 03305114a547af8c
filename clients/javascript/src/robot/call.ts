import type { Clock } from "./clock.js";
import { checkSendable } from "./text.js";

/** Error thrown by waits of an action that is canceled. Release resources and let it propagate. */
export class Canceled extends Error {
  override readonly name = "Canceled";
}

/** Error to throw when an action fails, with a message for the user: `new Failed("no ball in sight")`. */
export class Failed extends Error {
  override readonly name = "Failed";
}

/** One execution of an action. */
export class Call {
  private readonly controller = new AbortController();
  private readonly callbacks = new Set<() => void>();

  /** @internal */
  constructor(
    readonly action: string,
    private readonly clock: Clock,
    private readonly report: (values: Record<string, unknown>) => void,
  ) {}

  /** Signal that is aborted when the action is canceled, for `fetch`, `timers/promises` and others. */
  get signal(): AbortSignal {
    return this.controller.signal;
  }

  /** True if the action is canceled. */
  get canceled(): boolean {
    return this.controller.signal.aborted;
  }

  /** Call a function once when the action is canceled, at once if it already is. Returns a function that removes it. */
  onCancel(callback: () => void): () => void {
    if (this.canceled) callback();
    else this.callbacks.add(callback);
    return () => this.callbacks.delete(callback);
  }

  /** Wait for some seconds; rejects with {@link Canceled} as soon as the action is canceled. */
  wait(seconds: number): Promise<void> {
    const waited = new Promise<void>((resolve, reject) => {
      if (this.canceled) {
        reject(new Canceled());
        return;
      }
      const remove = this.onCancel(() => {
        clear();
        reject(new Canceled());
      });
      const clear = this.clock.after(seconds, () => {
        remove();
        resolve();
      });
    });
    waited.catch(() => undefined); // avoids an unhandled rejection if it isn't awaited
    return waited;
  }

  /**
   * Wait until a condition is met. Return false if it isn't met within `forS` seconds.
   *
   * @param condition Evaluated every `everyS` seconds.
   * @throws {Canceled} as soon as the action is canceled.
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

  /** Report the progress of the action. @throws {Canceled} if it is canceled. */
  feedback(values: Record<string, unknown>): void {
    if (this.canceled) throw new Canceled();
    this.last(values);
  }

  /** Report the final progress of the action, even if it is canceled. */
  last(values: Record<string, unknown>): void {
    checkSendable(values);
    this.report({ ...values });
  }

  /** @internal Cancel the action. Errors of callbacks are passed to `onError`. */
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
