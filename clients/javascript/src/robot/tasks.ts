// Execution of a robot's tasks: order, busy policies, cancel, stop, watchdog. `stop` is executed synchronously, whatever
// is queued; commands that were received before it are not run afterwards.
import { Call, Canceled, Failed } from "./call.js";
import type { Clock } from "./clock.js";
import { type Answer, type ProgramId, Task } from "./task.js";
import { errorText, type Members } from "./text.js";
import { Watchdog } from "./watchdog.js";

export const BEAT_S = 0.5;
const STOP_ANSWER_S = 0.5;
const GRACE_S = 1;
const MAX_QUEUED = 50;
const MAX_RUNNING = 50;
const MAX_PENDING_STOPS = 2000;
const THE_STOP = "the stop function";
const STOPPED_BEFORE: Answer = { state: "canceled", error: "the robot was stopped before this started" };

export const NOTHING_RUNS = "no running task has this id";

/** Interface of the robot used by its tasks. */
export interface TasksHost {
  readonly name: string;
  readonly clock: Clock;
  readonly withinS: number;
  readonly watchdogS: number;
  /** The robot's stop function. */
  stop(): unknown;
  /** Publish the heartbeat; called twice a second while tasks run. */
  beat(notEnded: readonly string[], error: string | undefined): void;
  warn(message: string): void;
}

/** Stop without a reply yet. */
interface PendingStop {
  run: number;
  readonly limitS: number;
  readonly answer: (answer: Answer) => void;
}

export class Tasks {
  /** Number of stops so far. */
  epoch = 0;
  /** Number of internal errors that were caught. */
  errors = 0;
  private running: Task[] = [];
  private queue: Task[] = [];
  private pendingStops: PendingStop[] = [];
  private readonly watchdog: Watchdog;
  private readonly patienceS: number;
  private requestedRun = 0; // last requested run of the stop function
  private endedRun = 0;
  private isStopLate = false;
  private notStopped: string | undefined; // error of the last stop without a requester
  private nextBeatS = 0;
  private toldNotEnded = "[[],null]";
  private isTicking = false;
  private isClosed = false;
  private clearTimer: (() => void) | undefined;

  constructor(private readonly host: TasksHost) {
    this.patienceS = Math.max(STOP_ANSWER_S, host.withinS);
    this.watchdog = new Watchdog(host.watchdogS);
  }

  /**
   * Stop the robot at once and cancel all tasks.
   *
   * `answer` is called with `succeeded` once the stop function has returned and every action has ended.
   */
  stop(answer: ((answer: Answer) => void) | undefined, why = "stopped"): void {
    this.epoch++;
    const limitS = this.host.clock.now() + this.patienceS;
    for (const task of this.running) task.call?.cancel(this.survive);
    const isIdle = this.requestedRun === this.endedRun;
    if (isIdle) {
      this.requestedRun++;
      void this.runStop(this.requestedRun);
    }
    this.act(() => {
      if (answer && this.pendingStops.length < MAX_PENDING_STOPS)
        this.pendingStops.push({ run: this.requestedRun, limitS, answer });
      this.watchdog.reset();
      const ended: Answer = { state: "canceled", error: why };
      this.drop([...this.queue], ended);
      for (const task of this.running) {
        task.isStopped = true;
        task.dueS = task.ending ? task.dueS && Math.min(task.dueS, limitS) : limitS;
        task.end(ended, this.survive);
      }
    });
  }

  /** Stop the robot and wait until it stands still or the time limit expires. */
  close(): Promise<void> {
    return new Promise((resolve) => {
      const end = (answer: Answer): void => {
        this.takeUnasked(answer);
        this.isClosed = true;
        this.clearTimer?.();
        resolve();
      };
      this.stop(end, "the driver is shutting down");
    });
  }

  /** Run a task as soon as its resources are free; reject it or cancel others according to its busy policy. */
  submit(task: Task): void {
    this.act(() => this.accept(task));
  }

  /** Cancel the matching tasks. Return an error message if none can be canceled. */
  cancel(isWanted: (task: Task) => boolean): string | undefined {
    const found = [...this.running, ...this.queue].filter(isWanted);
    if (found.length === 0) return NOTHING_RUNS;
    const stubborn = found.find((task) => this.running.includes(task) && !task.spec.isCancellable);
    if (stubborn) return `${stubborn.spec.action} can't be cancelled; it ends on its own`;
    this.act(() => {
      this.drop(found.filter((task) => this.queue.includes(task)), { state: "canceled" });
      for (const task of found) if (this.running.includes(task)) this.end(task, { state: "canceled" });
      this.startReady();
    });
    return undefined;
  }

  /** Record a sign of life of a program; `watch` starts monitoring it. */
  signOfLife(program: ProgramId, watch: boolean): void {
    this.act(() => this.watchdog.hear(program, this.host.clock.now(), watch));
  }

  /** Call a function, catch and count its errors, and handle expired deadlines. */
  act(what: () => void): void {
    try {
      what();
    } catch (error) {
      this.survive(error);
    }
    if (!this.isTicking) this.tick();
  }

  // ---- internal

  private readonly survive = (error: unknown): void => {
    this.errors++;
    this.host.warn(`${this.host.name}: ${error instanceof Error ? (error.stack ?? error.message) : errorText(error)}`);
  };

  private accept(task: Task): void {
    const { action, uses, onBusy, title } = task.spec;
    if (task.spec.epoch < this.epoch) return task.finish(STOPPED_BEFORE);
    const isClashing = (each: Task): boolean => each.spec.uses.some((used) => uses.includes(used));
    const clashing = [...this.running, ...this.queue].filter(isClashing);
    const refusal = this.refusal(onBusy === "reject" ? clashing[0] : undefined);
    if (refusal) return task.finish({ state: "failed", error: `${action}: ${refusal}` });
    const isEnded = (each: Task): boolean =>
      onBusy === "replace" && (each.spec.isCancellable || this.queue.includes(each));
    const ended = clashing.filter(isEnded);
    const waitsFor = names(clashing.filter((each) => !isEnded(each)));
    task.spec.answer({ state: "accepted", waitsFor, replaces: names(ended) });
    const replaced: Answer = { state: "canceled", error: `replaced by ${title}` };
    this.drop(ended.filter((each) => this.queue.includes(each)), replaced);
    for (const each of ended) if (this.running.includes(each)) this.end(each, replaced);
    this.queue.push(task);
    this.startReady();
  }

  /** Return the reason why new tasks are rejected, or undefined. */
  private refusal(busyWith: Task | undefined): string | undefined {
    const stopped = this.running.filter((each) => each.isStopped);
    if (this.isStopLate || stopped.some((each) => each.isAnswered)) return this.stillMoving(this.notEnded());
    if (this.isStopping || stopped.length > 0) return `${this.host.name} is stopping`;
    if (busyWith) return `${this.host.name} is busy with ${busyWith.spec.title}`;
    if (this.running.length >= MAX_RUNNING) return `${MAX_RUNNING} other actions are already running`;
    if (this.queue.length >= MAX_QUEUED) return `${MAX_QUEUED} other actions are already waiting`;
    return undefined;
  }

  private get isStopping(): boolean {
    return this.requestedRun > this.endedRun;
  }

  private notEnded(): string[] {
    const late = this.running.filter((each) => each.isAnswered).map((each) => each.spec.action);
    return this.isStopLate ? [...late, THE_STOP] : late;
  }

  private stillMoving(actions: readonly string[]): string {
    return this.mayMove(`${actions.join(", ")} ${actions.length === 1 ? "is" : "are"} still running`);
  }

  private mayMove(why: string): string {
    return `${this.host.name} may still move: ${why}`;
  }

  private startReady(): void {
    const taken = new Set(this.running.flatMap((each) => each.spec.uses));
    for (const task of [...this.queue]) {
      if (!task.spec.uses.some((each) => taken.has(each))) {
        this.queue.splice(this.queue.indexOf(task), 1);
        this.begin(task);
      }
      for (const each of task.spec.uses) taken.add(each); // also for a waiting task, so that no other overtakes it
    }
  }

  private begin(task: Task): void {
    const report = (feedback: Members): void =>
      this.act(() => {
        if (!task.isAnswered) task.spec.answer({ state: "running", feedback });
      });
    task.call = new Call(task.spec.action, this.host.clock, report);
    this.running.push(task);
    if (task.spec.timeoutS !== undefined) task.dueS = this.host.clock.now() + task.spec.timeoutS;
    this.watchdog.begins(task);
    task.spec.answer({ state: "running" });
    void this.work(task, task.call);
  }

  private async work(task: Task, call: Call): Promise<void> {
    await null; // start the function in a later turn, so that a stop can precede it
    let done: Answer;
    try {
      if (call.canceled) throw new Canceled();
      done = { state: "succeeded", output: await task.spec.run(call) };
    } catch (error) {
      done = this.failed(task, call, error);
    }
    this.act(() => this.ended(task, done));
  }

  private failed(task: Task, call: Call, error: unknown): Answer {
    const isAbort = call.canceled && error instanceof Error && error.name === "AbortError";
    if (error instanceof Canceled || isAbort) return { state: "canceled" };
    if (error instanceof Failed) return { state: "failed", error: errorText(error) };
    this.host.warn(`${this.host.name}: ${task.spec.action} failed. ${(error as Error)?.stack ?? errorText(error)}`);
    return { state: "failed", error: `${task.spec.action} failed: ${errorText(error)}` };
  }

  private ended(task: Task, done: Answer): void {
    this.running.splice(this.running.indexOf(task), 1);
    if (done.state === "succeeded" && !task.ending) this.watchdog.endsWell(task);
    if (task.isStopped && !this.isStopping) {
      // It may have moved the robot after the stop, so the stop function is called again.
      this.isStopLate = task.isAnswered;
      this.requestedRun++;
      for (const each of this.pendingStops) each.run = this.requestedRun;
      void this.runStop(this.requestedRun);
    }
    task.finish(task.ending && done.state !== "failed" ? task.ending : done);
    this.startReady();
    this.settle();
  }

  // ---- the stop function

  private async runStop(run: number): Promise<void> {
    let error: string | undefined;
    const stop = async (): Promise<unknown> => this.host.stop(); // converts a synchronous exception to a rejection
    try {
      await stop();
    } catch (problem) {
      if (!(problem instanceof Failed)) this.host.warn(`${this.host.name}: the stop function failed. ${errorText(problem)}`);
      const why = problem instanceof Failed ? errorText(problem) : `the stop command failed: ${errorText(problem)}`;
      error = this.mayMove(why);
    }
    this.act(() => this.stopEnded(run, error));
  }

  private stopEnded(run: number, error: string | undefined): void {
    this.endedRun = run;
    this.isStopLate = false;
    if (error === undefined) {
      this.notStopped = undefined;
      this.settle();
      return;
    }
    const failed: Answer = { state: "failed", error };
    const waiting = this.takePending((each) => each.run <= run);
    if (waiting.length === 0) this.takeUnasked(failed);
    else if (this.notStopped !== undefined) this.notStopped = error;
    for (const each of waiting) each.answer(failed);
  }

  /** Reply to the stops whose run of the stop function has ended, once no task runs. */
  private settle(): void {
    if (this.running.length > 0) return;
    for (const each of this.takePending(({ run }) => run <= this.endedRun)) each.answer({ state: "succeeded" });
  }

  private takePending(isTaken: (pending: PendingStop) => boolean): PendingStop[] {
    const taken = this.pendingStops.filter(isTaken);
    this.pendingStops = this.pendingStops.filter((each) => !isTaken(each));
    return taken;
  }

  /** Handle the result of a stop without a requester: a failure is reported in heartbeats. */
  private readonly takeUnasked = (answer: Answer): void => {
    if (answer.state !== "failed") return;
    if (answer.error !== this.notStopped) this.host.warn(answer.error ?? "");
    this.notStopped = answer.error;
  };

  // ---- time

  private tick(): void {
    if (this.isClosed) return;
    this.isTicking = true;
    for (const step of [this.endOverdue, this.answerLateStops, this.watchPrograms, this.tellBeat])
      this.act(() => step.call(this));
    this.isTicking = false;
    this.clearTimer?.();
    const due = this.nextDue();
    this.clearTimer =
      due === undefined
        ? undefined
        : this.host.clock.after(Math.max(0, due - this.host.clock.now()), () => this.act(() => undefined));
  }

  private nextDue(): number | undefined {
    const due = [...this.running.map((each) => each.dueS), ...this.pendingStops.map((each) => each.limitS)];
    due.push(...this.watchdog.due());
    if (this.hasToTell) due.push(this.nextBeatS);
    const found = due.filter((each) => each !== undefined);
    return found.length > 0 ? found.reduce((least, each) => Math.min(least, each)) : undefined;
  }

  private get hasToTell(): boolean {
    return this.running.length + this.queue.length > 0 || this.isStopping || this.notStopped !== undefined;
  }

  private endOverdue(): void {
    const now = this.host.clock.now();
    for (const task of [...this.running]) if (task.dueS !== undefined && now >= task.dueS) this.overdue(task);
  }

  private overdue(task: Task): void {
    const { action, timeoutS } = task.spec;
    if (!task.ending) {
      this.end(task, { state: "failed", error: `${action} took longer than ${timeoutS} s` });
      return;
    }
    task.dueS = undefined;
    const why = task.isStopped || !task.ending.error ? "" : ` (${task.ending.error})`;
    task.finish({ state: "failed", error: `${this.stillMoving([action])}${why}` });
  }

  private answerLateStops(): void {
    const now = this.host.clock.now();
    const late = this.takePending((each) => now >= each.limitS);
    if (late.some((each) => each.run > this.endedRun)) this.isStopLate = true;
    for (const each of late) each.answer({ state: "failed", error: this.stillMoving(this.notEnded()) });
  }

  private watchPrograms(): void {
    const acting = [...this.running, ...this.queue].map((each) => each.spec.program);
    if (this.watchdog.bites(this.host.clock.now(), acting))
      this.stop(this.takeUnasked, `its program hasn't responded for ${this.watchdog.patienceS} s`);
  }

  private tellBeat(): void {
    const now = this.host.clock.now();
    let [actions, error]: [string[], string | undefined] = [this.notEnded(), undefined];
    if (actions.length > 0) error = this.stillMoving(actions);
    else if (this.notStopped !== undefined) [actions, error] = [[THE_STOP], this.notStopped];
    const told = JSON.stringify([actions, error]);
    if (!(this.hasToTell && now >= this.nextBeatS) && told === this.toldNotEnded) return;
    this.nextBeatS = now + BEAT_S;
    this.toldNotEnded = told;
    this.host.beat(actions, error);
  }

  private end(task: Task, how: Answer): void {
    if (task.ending) return;
    task.end(how, this.survive);
    task.dueS = this.host.clock.now() + GRACE_S;
  }

  private drop(tasks: readonly Task[], how: Answer): void {
    this.queue = this.queue.filter((each) => !tasks.includes(each));
    for (const each of tasks) each.finish(how);
  }
}

function names(tasks: readonly Task[]): string[] {
  return [...new Set(tasks.map((each) => each.spec.action))];
}
