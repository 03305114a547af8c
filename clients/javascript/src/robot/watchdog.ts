import type { ProgramId, Task } from "./task.js";

/** Watchdog that detects when a program that commands the robot becomes silent. */
export class Watchdog {
  private readonly heard = new Map<ProgramId, number>();
  private readonly inMotion = new Map<string, ProgramId>(); // resource → the program that left it in motion

  /** @param patienceS Maximum seconds between signs of life. */
  constructor(readonly patienceS: number) {}

  /** Record a sign of life of a program; `watch` starts monitoring it. */
  hear(program: ProgramId, now: number, watch: boolean): void {
    if (watch || this.heard.has(program)) this.heard.set(program, now);
  }

  /** Handle the start of a task, which takes over its resources. */
  begins({ spec }: Task): void {
    for (const each of spec.uses) this.inMotion.delete(each);
  }

  /** Handle the success of a task; one with `goesOn` leaves its resources in motion. */
  endsWell({ spec }: Task): void {
    if (spec.goesOn && spec.program !== undefined)
      for (const each of spec.uses) this.inMotion.set(each, spec.program);
  }

  /** Stop monitoring all programs, after a stop of the robot. */
  reset(): void {
    this.heard.clear();
    this.inMotion.clear();
  }

  /** Return the times at which programs become overdue. */
  due(): number[] {
    return [...this.heard.values()].map((at) => at + this.patienceS);
  }

  /** Remove overdue programs. Return true if the robot acts for one of them and must stop. */
  bites(now: number, acting: readonly (ProgramId | undefined)[]): boolean {
    const silent = [...this.heard].filter(([, at]) => now - at >= this.patienceS).map(([program]) => program);
    for (const each of silent) this.heard.delete(each);
    const moving = [...this.inMotion.values()];
    return silent.some((each) => acting.includes(each) || moving.includes(each));
  }
}
