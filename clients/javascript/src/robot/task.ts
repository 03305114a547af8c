import type { Call } from "./call.js";
import type { Members } from "./text.js";

/** State of a command; `error` is a message for people. */
export interface Answer {
  readonly state: "accepted" | "running" | "succeeded" | "failed" | "canceled";
  readonly output?: Members;
  readonly feedback?: Members;
  readonly error?: string;
  /** Actions that must end before. */
  readonly waitsFor?: readonly string[];
  /** Actions that were canceled for it. */
  readonly replaces?: readonly string[];
}

export function isFinal({ state }: Answer): boolean {
  return state !== "accepted" && state !== "running";
}

/** Id of a program that sends commands: the name in `from` and the publisher's id; the name alone could be forged. */
export type ProgramId = string;

export function programId(name: string, publisher: bigint | undefined): ProgramId {
  return `${publisher ?? ""}:${name}`;
}

/** One requested execution of an action. */
export class Task {
  call: Call | undefined;
  /** Deadline by the robot's clock. */
  dueS: number | undefined;
  /** Final reply of a task that is being canceled, whatever its function returns. */
  ending: Answer | undefined;
  /** True once the final reply was sent, even if the function is still running. */
  isAnswered = false;
  /** True if it is being canceled by a stop of the robot. */
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
      /** True if the robot stays in motion after success (a speed), so that the watchdog must monitor the program. */
      readonly goesOn: boolean;
      /** `Tasks.epoch` at reception; the task is not run after a later stop. */
      readonly epoch: number;
    },
  ) {}

  /** Cancel the function. */
  end(how: Answer, onError: (error: unknown) => void): void {
    this.ending ??= how;
    this.call?.cancel(onError);
  }

  /** Send the final reply, once. */
  finish(answer: Answer): void {
    if (this.isAnswered) return;
    this.isAnswered = true;
    this.spec.answer(answer);
  }
}
