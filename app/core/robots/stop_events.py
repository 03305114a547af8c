"""What the threads of a stop post into the mailbox."""

from __future__ import annotations

from dataclasses import dataclass

from app.core.robots.stop_report import RobotStop, StopReport


@dataclass(frozen=True, slots=True)
class StopDone:
    """Every robot was told to stop, and answered or not."""

    number: int
    report: StopReport


@dataclass(frozen=True, slots=True)
class RobotAnswered:
    """One robot answered while others are waited for."""

    number: int
    robot: RobotStop


@dataclass(frozen=True, slots=True)
class OneStopped:
    """One robot was told to stop while nothing ran."""

    report: StopReport


@dataclass(frozen=True, slots=True)
class LateAnswer:
    """A robot answered when it was not waited for any more, or stands still after it had said no.

    ``number`` is that of the stop; None for one robot's.
    """

    number: int | None
    robot: RobotStop
