"""Who must give signs of life: the programs for which the robot does something, or that left it in motion."""

from __future__ import annotations

from collections.abc import Collection

from app.robots.driver.task import Program, Task


class Watchdog:
    """Hears programs and bites when one falls silent for which the robot acts. It has no thread."""

    def __init__(self, patience_s: float | None) -> None:
        """`patience_s` may pass without a sign of life; None never bites."""
        self.patience_s = patience_s
        self._heard: dict[Program, float] = {}
        self._going_on: dict[str, Program] = {}  # resource -> the program that left it in motion

    def hear(self, program: Program, now: float, *, watch: bool) -> None:
        """A program said something; `watch` begins to expect more (it asked the robot to act)."""
        if self.patience_s is not None and (watch or program in self._heard):
            self._heard[program] = now

    def begins(self, task: Task) -> None:
        """What it uses is not left in motion any more: the task has it now."""
        for used in task.uses:
            self._going_on.pop(used, None)

    def ends_well(self, task: Task) -> None:
        """One that goes on (a speed) leaves what it uses in motion."""
        if task.goes_on and task.program is not None:
            self._going_on |= dict.fromkeys(task.uses, task.program)

    def reset(self) -> None:
        """The robot was stopped: nobody need be heard."""
        self._heard.clear()
        self._going_on.clear()

    def due(self) -> list[float]:
        """When to look again."""
        return [] if self.patience_s is None else [seen + self.patience_s for seen in self._heard.values()]

    def bites(self, now: float, acting: Collection[Program | None]) -> bool:
        """Whether the robot is to stop; `acting` are the programs of what runs or waits now.

        A silent program for which nothing is done is forgotten: it may have ended long ago.
        """
        if self.patience_s is None:
            return False
        silent = [name for name, seen in self._heard.items() if now - seen >= self.patience_s]
        for name in silent:
            del self._heard[name]
        return any(name in acting or name in self._going_on.values() for name in silent)
