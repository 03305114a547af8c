"""Events of a Stop, posted to the main thread."""

from __future__ import annotations

from dataclasses import dataclass

from app.robots.client.stop_report import RobotStop, StopReport

STOPPING_DISPLAY_DELAY_S = 0.1


@dataclass(frozen=True, slots=True)
class StopCompleted:
    """Event: a Stop is complete, because all robots have replied or timed out.

    Attributes:
        number: Number of the Stop.
        report: Result of the Stop.
    """

    number: int
    report: StopReport


@dataclass(frozen=True, slots=True)
class RobotReplied:
    """Event: a robot has replied to a Stop while other replies are pending.

    Attributes:
        number: Number of the Stop.
        robot: Result for the robot.
    """

    number: int
    robot: RobotStop


@dataclass(frozen=True, slots=True)
class RobotStopped:
    """Event: the Stop of a single robot is complete. Sent while no behaviour is running.

    Attributes:
        report: Result of the Stop.
        mark: Value of `MovedRobots.mark` when the Stop started.
    """

    report: StopReport
    mark: int = 0


@dataclass(frozen=True, slots=True)
class LateReply:
    """Event: a robot replied after the timeout, or confirmed the Stop after refusing it.

    Attributes:
        number: Number of the Stop; None for the Stop of a single robot.
        report: Results of all programs of the robot.
        mark: Value of `MovedRobots.mark` when the Stop of a single robot started.
    """

    number: int | None
    report: StopReport
    mark: int = 0
