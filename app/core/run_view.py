"""What the run bar says: the six states of Run and Stop in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from app.core.stopping import StopReport


@dataclass(frozen=True, slots=True)
class RunView:
    """Everything the run bar shows, large and compact.

    ``state`` is ``ready``, ``running``, ``paused``, ``stopping``, ``proven`` or ``unanswered``. ``result``
    stands beside Stop with its colour (``result_ok``); ``last_stop`` is the small reminder while a program
    runs; ``confirm`` are the words of the button with which a person says that the silent robot stands still.
    """

    state: str
    title: str
    detail: str
    compact: str
    can_run: bool = False
    can_pause: bool = False
    can_step: bool = False
    run_word: str = "Run"
    stop_word: str = "Stop"
    result: str | None = None
    result_ok: bool | None = None
    last_stop: str | None = None
    confirm: str | None = None
    stop_filled: bool = True


def seconds(value: float) -> str:
    """``14 s``, ``2 min 5 s``: whole seconds, as a person reads a clock."""
    whole = int(value)
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60} min {whole % 60} s"


def listed(names: Sequence[str]) -> str:
    """``Pepper``, ``Pepper and Turtle``, ``Pepper, NAO and Turtle``."""
    if len(names) <= 1:
        return "".join(names)
    return f"{', '.join(names[:-1])} and {names[-1]}"


def connected_words(names: Sequence[str]) -> str:
    """The line under Ready."""
    if not names:
        return "No robot is connected"
    return f"{listed(names)} {'is' if len(names) == 1 else 'are'} connected"


def result_words(report: StopReport) -> tuple[str, bool]:
    """``all 2 robots stopped (41 ms)`` and whether every robot that can answer did."""
    robots = report.robots
    silent = [robot for robot in robots if robot.can_confirm and not robot.answered]
    unsure = [robot for robot in robots if not robot.can_confirm]
    proven = [robot for robot in robots if robot.can_confirm and robot.answered]
    if silent:
        return f"{len(proven)} of {len(robots)} robots stopped", False
    if unsure and not proven:
        return f"stop sent; {listed([robot.name for robot in unsure])} cannot confirm", True
    if not robots:
        return "nothing to stop", True
    time_ms = max(1, round(report.elapsed_ms))
    words = (
        f"{robots[0].name} stopped ({time_ms} ms)"
        if len(robots) == 1
        else f"all {len(robots)} robots stopped ({time_ms} ms)"
    )
    if unsure:
        words = f"{listed([robot.name for robot in proven])} stopped ({time_ms} ms); "
        words += f"{listed([robot.name for robot in unsure])} cannot confirm"
    return words, True


def unanswered_words(report: StopReport) -> tuple[str, str, str, str]:
    """Title, detail, compact sentence and the confirming button for robots that did not answer a stop."""
    silent = [robot.name for robot in report.robots if robot.can_confirm and not robot.answered]
    proven = [robot for robot in report.robots if robot.can_confirm and robot.answered]
    names = listed(silent)
    stopped = ""
    if proven:
        slowest = max(1, round(max(robot.elapsed_ms or 0 for robot in proven)))
        stopped = f"{listed([robot.name for robot in proven])} stopped ({slowest} ms). "
    them = names if len(silent) <= 2 else "them"
    return (
        f"{names} did not answer",
        f"{stopped}Switch {them} off by hand.",
        f"{names} did not answer; switch {'it' if len(silent) == 1 else 'them'} off by hand",
        f"{names} {'is' if len(silent) == 1 else 'are'} still",
    )
