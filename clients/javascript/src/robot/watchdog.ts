import type { ProgramId, Task } from "./task.js";

/** Notices when a program falls silent for which the robot acts. */
export class Watchdog {
  private readonly heard = new Map<ProgramId, number>();
  private readonly inMotion = new Map<string, ProgramId>(); // resource → the program that left it in motion

  /** @param patienceS May pass without a sign of life. */
  constructor(readonly patienceS: number) {}

  /** A program said something; `watch` begins to expect more. */
  hear(program: ProgramId, now: number, watch: boolean): void {
    if (watch || this.heard.has(program)) this.heard.set(program, now);
  }

  /** A task took over what it uses. */
  begins({ spec }: Task): void {
    for (const each of spec.uses) this.inMotion.delete(each);
  }

  /** A task succeeded; one that goes on leaves in motion what it uses. */
  endsWell({ spec }: Task): void {
    if (spec.goesOn && spec.program !== undefined)
      for (const each of spec.uses) this.inMotion.set(each, spec.program);
  }

  /** The robot was stopped: no program has to be heard. */
  reset(): void {
    this.heard.clear();
    this.inMotion.clear();
  }

  /** When to look again. */
  due(): number[] {
    return [...this.heard.values()].map((at) => at + this.patienceS);
  }

  /** Forget silent programs; whether the robot has to stop because it acts for one of them. */
  bites(now: number, acting: readonly (ProgramId | undefined)[]): boolean {
    const silent = [...this.heard].filter(([, at]) => now - at >= this.patienceS).map(([program]) => program);
    for (const each of silent) this.heard.delete(each);
    const moving = [...this.inMotion.values()];
    return silent.some((each) => acting.includes(each) || moving.includes(each));
  }
}
