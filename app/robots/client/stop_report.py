"""Results of a Stop for each robot, and their description for the user."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from nep.i18n import _

StopStatus = Literal["ok", "off", "error"]
"""Status of a Stop as shown in the window. Only ``ok`` has a green check mark."""


@dataclass(frozen=True)
class RobotStop:
    """Result of a Stop for one program of a robot.

    Attributes:
        is_confirmed: True if the program confirmed that the robot has stopped.
        elapsed_ms: Time until the reply; None without a reply.
        can_confirm: False for robots that never reply to a Stop (RIZE), and for programs that only
            subscribe to a robot's commands.
        error: Reason why the robot has not stopped (if `has_failed`) or why the Stop could not be sent, or
            "".
        has_failed: True if the program reported that the robot has not stopped.
        program: Name of the program if it is not the robot's own, else "".
        is_waiting: True if replies of other programs of the robot are pending.
        node: Id of the node that replied.
        waited_ms: Time until the robot was connected.
        is_pending: True if the Stop is sent once the robot is connected.
    """

    name: str
    is_confirmed: bool
    elapsed_ms: float | None
    can_confirm: bool = True
    error: str = ""
    has_failed: bool = False
    program: str = ""
    is_waiting: bool = False
    node: str = ""
    waited_ms: float = 0.0
    is_pending: bool = False

    @property
    def full_name(self) -> str:
        """Name of the robot, followed by the name of the program if that is not the robot's own."""
        return f"{self.name} (“{self.program}”)" if self.program else self.name

    @property
    def problem(self) -> str:
        """Problem without a full stop, such as "Pepper didn't reply".

        "" if the robot stopped or can't confirm a Stop.
        """
        if self.is_confirmed or not self.can_confirm:
            return ""
        if self.program and self.has_failed:
            return _("{error} (from “{program}”)").format(error=self.error, program=self.program)
        return self.error or _("{robot} didn't reply").format(robot=self.full_name)

    @property
    def message(self) -> str:
        """Result as a sentence, such as "Pepper stopped (41 ms)"."""
        if self.is_confirmed and self.waited_ms:
            template = _("{robot} stopped ({elapsed} ms, including {waited} ms without a connection)")
            return template.format(
                robot=self.full_name, elapsed=f"{self.elapsed_ms or 0:.0f}", waited=f"{self.waited_ms:.0f}"
            )
        if self.is_confirmed:
            return _("{robot} stopped ({elapsed} ms)").format(
                robot=self.full_name, elapsed=f"{self.elapsed_ms or 0:.0f}"
            )
        if self.program and not self.can_confirm:
            return _("{robot} also receives the commands and can't confirm").format(robot=self.full_name)
        if not self.can_confirm:
            return _("{robot}: Stop sent; this robot can't confirm").format(robot=self.name)
        return _("{wrong}. Switch it off by hand.").format(wrong=self.problem)

    @property
    def status(self) -> StopStatus:
        """Status: ``ok`` if confirmed, ``off`` if the robot can't confirm, else ``error``."""
        return "off" if not self.can_confirm else "ok" if self.is_confirmed else "error"


@dataclass(frozen=True)
class StopReport:
    """Results of a Stop for all robots.

    Attributes:
        elapsed_ms: Time from the call to the last reply.
        impostors: Programs that replied in the name of a robot without serving it, as (robot, program).
    """

    robots: tuple[RobotStop, ...]
    elapsed_ms: float
    impostors: tuple[tuple[str, str], ...] = ()

    @property
    def is_confirmed(self) -> bool:
        """True if there was a robot to stop, and every robot that can confirm a Stop has done so."""
        return bool(self.robots) and not self.unconfirmed_robots

    @property
    def status(self) -> StopStatus:
        """Overall status: ``ok`` only if every robot has confirmed.

        ``error`` if a robot refused or failed to reply; ``off`` if a robot can't confirm or there was
        no robot.
        """
        if self.unconfirmed_robots:
            return "error"
        return "ok" if self.robots and set(self.names) == set(self.stopped_names) else "off"

    @property
    def unconfirmed_robots(self) -> tuple[RobotStop, ...]:
        """Results of the robots that can confirm a Stop but did not."""
        return tuple(robot for robot in self.robots if robot.can_confirm and not robot.is_confirmed)

    @property
    def unconfirmed_names(self) -> tuple[str, ...]:
        """Names of the robots that did not confirm, without duplicates."""
        return tuple(dict.fromkeys(robot.name for robot in self.unconfirmed_robots))

    @property
    def results_by_robot(self) -> Mapping[str, RobotStop]:
        """Worst result of each robot among all its programs, by the robot's name."""
        worst: dict[str, RobotStop] = {}
        for robot in self.robots:
            previous = worst.get(robot.name)
            if previous is None or (robot.problem and not (previous.problem and not previous.program)):
                worst[robot.name] = robot
        return worst

    def confirmed_programs(self, name: str) -> frozenset[str]:
        """Return the node ids of the programs of a robot that confirmed the Stop."""
        return frozenset(robot.node for robot in self.robots if robot.name == name and robot.is_confirmed)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the robots, without duplicates."""
        return tuple(dict.fromkeys(robot.name for robot in self.robots))

    @property
    def stopped_names(self) -> tuple[str, ...]:
        """Names of the robots that are proven to have stopped, because all their programs confirmed."""
        unconfirmed = self.unconfirmed_names
        confirmed = (robot.name for robot in self.robots if robot.can_confirm and robot.is_confirmed)
        return tuple(dict.fromkeys(name for name in confirmed if name not in unconfirmed))

    def with_unreached(self, names: Iterable[str], reason: str = "") -> StopReport:
        """Return the report with a result added for each of these robots that is missing from it.

        Args:
            names: Names of the robots that should have been stopped.
            reason: Reason why the missing robots were not reached.
        """
        reported_names = {robot.name for robot in self.robots}
        unreached = [
            unreached_result(name, reason) for name in dict.fromkeys(names) if name not in reported_names
        ]
        return replace(self, robots=(*self.robots, *unreached)) if unreached else self

    def with_late_reply(self, late: StopReport) -> StopReport:
        """Return the report with the results of robots replaced that replied after the time limit.

        Args:
            late: Results of all programs of these robots; robots that this report lacks are ignored.
        """
        names = set(late.names) & set(self.names)
        if not names:
            return self
        robots: dict[str, list[RobotStop]] = {name: [] for name in self.names}
        for report in (self, late):
            for robot in report.robots:
                if robot.name in robots and (robot.name in names) == (report is late):
                    robots[robot.name].append(robot)
        return replace(
            self,
            robots=tuple(robot for each in robots.values() for robot in each),
            elapsed_ms=max(self.elapsed_ms, late.elapsed_ms),
        )


def unreached_result(name: str, reason: str = "") -> RobotStop:
    """Return the result for a robot to which the Stop could not be sent.

    Args:
        name: Name of the robot.
        reason: Reason.
    """
    template = _("Stop wasn't sent to {robot}: {why}") if reason else _("Stop wasn't sent to {robot}")
    return RobotStop(name, False, None, error=template.format(robot=name, why=reason))
