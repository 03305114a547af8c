"""What became of a stop, robot by robot, and the words for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from nep.i18n import _

STOPPING_SHOWN_AFTER_S = 0.1
StopStatus = Literal["ok", "off", "error"]
"""How a stop is shown everywhere: the green check is only for ``ok``."""


@dataclass(frozen=True)
class RobotStop:
    """What became of one robot's stop.

    ``answered``: its own program said that it stands still. ``refused``: that said that it does not, and why
    (``error``). ``error`` without ``refused``: it could not be told. ``can_confirm`` is False for robots that
    never answer a stop (RIZE), and for programs that only listen to a robot's commands. ``program`` names
    another program than the robot's own that serves its commands; ``node`` is the id of the program
    that answered. ``waits`` says that other programs of the same robot had not answered yet when this was
    told. ``is_pending``: it is told as soon as it is connected. ``waited_ms`` is how long the command waited
    until then.
    """

    name: str
    answered: bool
    elapsed_ms: float | None
    can_confirm: bool = True
    error: str = ""
    refused: bool = False
    program: str = ""
    waits: bool = False
    node: str = ""
    waited_ms: float = 0.0
    is_pending: bool = False

    @property
    def who(self) -> str:
        """The robot's name, and the program's when it is not the robot's own."""
        return f"{self.name} (“{self.program}”)" if self.program else self.name

    @property
    def wrong(self) -> str:
        """What is wrong, without a full stop: "Pepper did not answer"; nothing when it stopped."""
        if self.answered or not self.can_confirm:
            return ""
        if self.program and self.refused:
            return _("{error} (from “{program}”)").format(error=self.error, program=self.program)
        return self.error or _("{robot} did not respond").format(robot=self.who)

    @property
    def sentence(self) -> str:
        """In words: "Pepper stopped (41 ms)"."""
        if self.answered and self.waited_ms:
            words = _("{robot} stopped ({elapsed} ms; it was not connected for {waited} ms of them)")
            return words.format(
                robot=self.who, elapsed=f"{self.elapsed_ms or 0:.0f}", waited=f"{self.waited_ms:.0f}"
            )
        if self.answered:
            return _("{robot} stopped ({elapsed} ms)").format(
                robot=self.who, elapsed=f"{self.elapsed_ms or 0:.0f}"
            )
        if self.program and not self.can_confirm:
            return _("{robot} also receives the commands and can't confirm").format(robot=self.who)
        if not self.can_confirm:
            return _("{robot}: Stop sent; this robot can't confirm").format(robot=self.name)
        return _("{wrong}. Switch it off by hand.").format(wrong=self.wrong)

    @property
    def status(self) -> StopStatus:
        """``ok`` when it answered, ``off`` when it can't confirm, else ``error``."""
        return "off" if not self.can_confirm else "ok" if self.answered else "error"


@dataclass(frozen=True)
class StopReport:
    """All robots' stops; ``elapsed_ms`` from the call to the last answer.

    ``strangers``: whoever answered in a robot's name and is not that robot, as (robot, program).
    """

    robots: tuple[RobotStop, ...]
    elapsed_ms: float
    strangers: tuple[tuple[str, str], ...] = ()

    @property
    def proven(self) -> bool:
        """Whether there was a robot to stop, and every one that can confirm has."""
        return bool(self.robots) and not self.unproven

    @property
    def status(self) -> StopStatus:
        """``ok`` only for a complete proof: every robot said itself that it stands still.

        ``off`` when nobody refused or was silent, but a robot can't confirm, or there was none to stop.
        """
        if self.unproven:
            return "error"
        return "ok" if self.robots and set(self.names) == set(self.still) else "off"

    @property
    def unproven(self) -> tuple[RobotStop, ...]:
        """Those that should have said that they stand still and did not."""
        return tuple(robot for robot in self.robots if robot.can_confirm and not robot.answered)

    @property
    def silent(self) -> tuple[str, ...]:
        """The robots that are not proven to stand still, each once."""
        return tuple(dict.fromkeys(robot.name for robot in self.unproven))

    @property
    def by_name(self) -> Mapping[str, RobotStop]:
        """What became of each robot: the worst of what its own and other programs that serve it said."""
        worst: dict[str, RobotStop] = {}
        for robot in self.robots:
            before = worst.get(robot.name)
            if before is None or (robot.wrong and not (before.wrong and not before.program)):
                worst[robot.name] = robot
        return worst

    def programs(self, name: str) -> frozenset[str]:
        """The programs of a robot that proved its stop, by node id."""
        return frozenset(robot.node for robot in self.robots if robot.name == name and robot.answered)

    @property
    def names(self) -> tuple[str, ...]:
        """The robots, each once, however many programs serve one."""
        return tuple(dict.fromkeys(robot.name for robot in self.robots))

    @property
    def still(self) -> tuple[str, ...]:
        """The robots that are proven to stand still: all of their programs that must answer said so."""
        silent = self.silent
        said = (robot.name for robot in self.robots if robot.can_confirm and robot.answered)
        return tuple(dict.fromkeys(name for name in said if name not in silent))

    def with_asked(self, names: Iterable[str], why: str = "") -> StopReport:
        """The same, and a line for each of these robots that has none: it was not reached."""
        there = {robot.name for robot in self.robots}
        missing = [not_reached(name, why) for name in dict.fromkeys(names) if name not in there]
        return replace(self, robots=(*self.robots, *missing)) if missing else self

    def with_late(self, late: RobotStop) -> StopReport:
        """The same with what a robot said too late."""
        lines = ((robot.name, robot.program) for robot in self.robots)
        if (late.name, late.program) not in lines:
            return self
        same = (late.name, late.program)
        robots = (late if (robot.name, robot.program) == same else robot for robot in self.robots)
        return replace(self, robots=tuple(robots), elapsed_ms=max(self.elapsed_ms, late.elapsed_ms or 0.0))


def not_reached(name: str, why: str = "") -> RobotStop:
    """The line of a robot that could not be told to stop, and why."""
    words = _("Stop was not sent to {robot}: {why}") if why else _("Stop was not sent to {robot}")
    return RobotStop(name, False, None, error=words.format(robot=name, why=why))


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
    """One robot was told to stop while nothing ran, when the ledger was at ``mark`` (`MovedRobots.mark`)."""

    report: StopReport
    mark: int = 0


@dataclass(frozen=True, slots=True)
class LateAnswer:
    """A robot answered when it was not waited for any more, or stands still after it had said no.

    ``number`` is that of the stop; None for one robot's, which began at ``mark``.
    """

    number: int | None
    robot: RobotStop
    mark: int = 0
