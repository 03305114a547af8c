"""Functions of the threads that stop a program and its robots. Results are posted to the mailbox."""

from __future__ import annotations

from collections.abc import Callable

from app.core.faults import log_errors
from app.core.robots.stop.report import LateReply, RobotReplied, RobotStopped, StopCompleted
from app.core.robots.stop.stopper import RobotStopper, stop_and_report
from app.core.run.runner import Runner
from app.robots.client.stop_report import RobotStop, StopReport

PostEvent = Callable[[object], None]


def stop_program(
    post_event: PostEvent,
    number: int,
    runner: Runner | None,
    stopper: RobotStopper | None,
    names: tuple[str, ...],
    program_key: str | None,
    *,
    is_for_all: bool,
) -> None:
    """Stop a program and its robots. Blocks until all robots have replied or timed out.

    Args:
        post_event: Callback for the results.
        number: Number of the Stop, included in the events.
        runner: Runner of the program, or None.
        stopper: Connections to the robots, or None.
        names: Names of the robots to stop.
        program_key: See `app.core.robots.stop.stopper.RobotStopper.stop_all`.
        is_for_all: See `app.core.robots.stop.stopper.RobotStopper.stop_all`.
    """

    def on_reply(robot: RobotStop) -> None:
        post_event(RobotReplied(number, robot))

    def on_late_reply(report: StopReport) -> None:
        post_event(LateReply(number, report))

    if runner is not None:
        if stopper is not None:
            with log_errors(
                "send Stop to the robots at once"
            ):  # sent again below, also to robots without `program_key`
                stopper.send_stop(program_key=program_key)
        with log_errors("stop the program"):
            runner.stop()
    report = stop_and_report(
        stopper,
        names,
        on_answer=on_reply,
        program_key=program_key,
        on_late=on_late_reply,
        is_for_all=is_for_all,
    )
    post_event(StopCompleted(number, report))


def stop_robot(post_event: PostEvent, stopper: RobotStopper | None, name: str, mark: int) -> None:
    """Stop one robot. Blocks until the robot has replied or timed out.

    Args:
        post_event: Callback for the result.
        stopper: Connections to the robots, or None.
        name: Name of the robot.
        mark: Value of `MovedRobots.mark` when the Stop started.
    """

    def on_late_reply(report: StopReport) -> None:
        post_event(LateReply(None, report, mark))

    post_event(RobotStopped(stop_and_report(stopper, (name,), on_late=on_late_reply), mark))
