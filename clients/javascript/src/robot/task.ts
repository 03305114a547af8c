import type { Call } from "./call.js";
import type { Members } from "./text.js";

/** How a command stands; `error` is a sentence for people. */
export interface Answer {
  readonly state: "accepted" | "running" | "succeeded" | "failed" | "canceled";
  readonly output?: Members;
  readonly feedback?: Members;
  readonly error?: string;
  /** Actions that are done first. */
  readonly waitsFor?: readonly string[];
  /** Actions that were ended for it. */
  readonly replaces?: readonly string[];
}

export function isFinal({ state }: Answer): boolean {
  return state !== "accepted" && state !== "running";
}

/** Who asks a robot to act: the name in `from` and the publisher it came from, which only together can't be forged. */
export type ProgramId = string;

export function programId(name: string, publisher: bigint | undefined): ProgramId {
  return `${publisher ?? ""}:${name}`;
}

/** One thing that a robot is asked to do. */
export class Task {
  call: Call | undefined;
  /** When it is overdue, by the robot's clock. */
  dueS: number | undefined;
  /** What will be answered, whatever the function does: it was told to end. */
  ending: Answer | undefined;
  /** Its final answer was given, also while its function goes on. */
  isAnswered = false;
  /** A stop of the robot told it to end. */
  isStopped = false;

  constructor(
    readonly spec: {
      readonly id: string;
      readonly action: string;
      readonly title: string;
      readonly run: (call: Call) => Promise<Members>;
      readonly answer: (answer: Answer) => void;
      readonly uses: readonly string[];
      readonly onBusy: "queue" | "replace" | "reject";
      readonly timeoutS: number | undefined;
      readonly isCancellable: boolean;
      readonly program: ProgramId | undefined;
      readonly publisher: bigint | undefined;
      /** It stays in motion when it has succeeded (a speed): its program must go on to live. */
      readonly goesOn: boolean;
      /** `Tasks.epoch` when it was received: it is not run after a later stop. */
      readonly epoch: number;
    },
  ) {}

  /** Ask the function to end. */
  end(how: Answer, onError: (error: unknown) => void): void {
    this.ending ??= how;
    this.call?.cancel(onError);
  }

  /** Give the final answer, once. */
  finish(answer: Answer): void {
    if (this.isAnswered) return;
    this.isAnswered = true;
    this.spec.answer(answer);
  }
}
