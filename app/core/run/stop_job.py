"""Functions for the threads that stop a program and its robots; results are posted to the mailbox."""

from __future__ import annotations

from collections.abc import Callable

from app.core.faults import log_errors
from app.core.robots.stop.report import LateReply, RobotReplied, RobotStop, RobotStopped, StopDone
from app.core.robots.stop.stopper import RobotStopper, stop_and_report
from app.core.run.runner import Runner

PostEvent = Callable[[object], None]


def stop_program(
    post_event: PostEvent,
    number: int,
    runner: Runner | None,
    stopper: RobotStopper | None,
    names: tuple[str, ...],
    ends: str | None,
    *,
    is_for_all: bool,
) -> None:
    """Stop a program and its robots; blocks until the robots have replied or timed out.

    Args:
        post_event: Receives the results.
        number: Identifies the Stop in the posted events.
        runner: Runner of the program.
        names: Robots to stop.
        ends: As in `app.core.robots.stop.stopper.RobotStopper.stop_all`.
        is_for_all: As in `app.core.robots.stop.stopper.RobotStopper.stop_all`.
    """

    def on_reply(robot: RobotStop) -> None:
        post_event(RobotReplied(number, robot))

    def on_late_reply(robot: RobotStop) -> None:
        post_event(LateReply(number, robot))

    if runner is not None:
        if stopper is not None:
            with log_errors(
                "send Stop to the robots at once"
            ):  # sent again below, also to robots without `ends`
                stopper.send_stop(ends=ends)
        with log_errors("stop the program"):
            runner.stop()
    report = stop_and_report(
        stopper, names, on_answer=on_reply, ends=ends, on_late=on_late_reply, is_for_all=is_for_all
    )
    post_event(StopDone(number, report))


def stop_robot(post_event: PostEvent, stopper: RobotStopper | None, name: str, mark: int) -> None:
    """Stop one robot; blocks until it has replied or timed out.

    ``mark`` is the value of `MovedRobots.mark` when the Stop started.
    """

    def on_late_reply(robot: RobotStop) -> None:
        post_event(LateReply(None, robot, mark))

    post_event(RobotStopped(stop_and_report(stopper, (name,), on_late=on_late_reply), mark))
