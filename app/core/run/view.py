"""Contents of the run bar: texts and buttons for each state of a run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.core.robots.stop.report import STOPPING_DISPLAY_DELAY_S
from app.robots.client.stop_report import RobotStop, StopReport, StopStatus
from nep.i18n import _, format_list, lazy, ngettext, number

MAX_NAMED = 4
MAX_NAMES_LENGTH = 24
"""Maximum number of characters of robot names on the Stop button; longer names are shown only next to it."""
APPLIES_LATER_HINT = lazy("Your changes take effect at the next run")
NOTHING_TO_RUN_HINT = lazy("Drag “when started” from Events and put blocks below it")
RUN, RESUME, RESTART = lazy("Run"), lazy("Resume"), lazy("Restart")
STOP, STOPPING, STOP_AGAIN = lazy("Stop"), lazy("Stopping"), lazy("Stop again")


@dataclass(frozen=True, slots=True)
class RunState:
    """State of a run. Immutable; each event creates a new state.

    Times are in monotonic seconds. The program's clock stops while the program is paused.

    Attributes:
        state: "ready", "running", "paused", "stopping", "proven" or "unanswered"; "ready" with a
            `report` after a Stop without robots.
        motion_warnings: Reasons why robots that did not reply may be moving (`MovedRobots`).
        warning: Warning shown while the program is paused, or "".
        is_started: True if the scripts run and receive events; the process starts some tenths of a second
            earlier.
        paused_s: Total duration of all pauses.
        pause_start_s: Start of the current pause, or None.
        is_stop_repeated: True if the previous Stop is not proven.
        is_restarting: True if a program will start once this Stop is proven.
        is_edited: True if the behaviour differs from the running program.
        tried_label: Label of the tried block, or "".
        value: Value of the tried block, or None.
    """

    state: str = "ready"
    name: str = ""
    description: str = ""
    paused_at: str = ""
    warning: str = ""
    is_started: bool = True
    started_s: float = 0.0
    paused_s: float = 0.0
    pause_start_s: float | None = None
    elapsed_s: float | None = None
    stop_pressed_s: float = 0.0
    is_stop_repeated: bool = False
    is_restarting: bool = False
    is_edited: bool = False
    tried_label: str = ""
    value: str | None = None
    robots_to_stop: tuple[str, ...] = ()
    replies: tuple[RobotStop, ...] = ()
    report: StopReport | None = None
    is_finished: bool = False
    has_stopped_blocks: bool = False
    errors: Mapping[str, str] = field(default_factory=dict)
    unrunnable_program: object = (
        None  # the program that Run was pressed for, which had nothing to run, or `errors`
    )
    last_stop_text: str = ""
    last_stop_status: StopStatus = "off"
    motion_warnings: tuple[str, ...] = ()

    def elapsed(self, now: float) -> float:
        """Return the running time in seconds at ``now``, without pauses."""
        paused_s = self.paused_s
        if self.pause_start_s is not None:
            paused_s += now - self.pause_start_s
        return max(0.0, now - self.started_s - paused_s)


@dataclass(frozen=True, slots=True)
class RunView:
    """Contents of the run bar, in its large and its compact form.

    Attributes:
        is_edited: True if the running program differs from the blocks, so that Restart is suggested as
            next step.
        result: Result of a Stop, shown next to the Stop button, or None.
        result_status: Status of `result`, which determines icon and colour.
        last_stop: Reminder of the last Stop while a program is running, or None.
        last_stop_status: Status of `last_stop`, which determines icon and colour.
        confirm_label: Label of the button with which the user confirms that a robot without a reply has
            stopped, or None.
    """

    state: str
    title: str
    detail: str
    compact_text: str
    can_run: bool = False
    can_pause: bool = False
    can_step: bool = False
    can_restart: bool = False
    is_edited: bool = False
    run_label: str = RUN
    stop_label: str = STOP
    result: str | None = None
    result_status: StopStatus = "off"
    last_stop: str | None = None
    last_stop_status: StopStatus = "off"
    confirm_label: str | None = None
    is_stop_filled: bool = True
    is_slow: bool = False


def block_label(description: str, blocks: Sequence[str], labels: Mapping[str, str]) -> str:
    """Return the text that describes the block before which a program is paused.

    Args:
        description: Text of the block. If it contains a quotation, the label is returned instead.
        blocks: Ids of the paused blocks, the next one first.
        labels: Labels by block id.
    """
    if "“" not in description or not blocks:
        return description
    return labels.get(blocks[0], description)


def view_of(
    run: RunState,
    connected: Sequence[str],
    now: float,
    *,
    starting_robots: Sequence[str] = (),
    is_elsewhere: bool = False,
    is_slow: bool = False,
) -> RunView:
    """Return the contents of the run bar.

    Args:
        run: State of the run.
        connected: Names of the connected robots.
        now: Monotonic seconds.
        starting_robots: Names of the robots that are starting.
        is_elsewhere: True if the run belongs to a behaviour in another tab. The title then names that
            behaviour, and Run applies to the current tab.
        is_slow: True if blocks run with a delay.
    """
    view = replace(_view_of_state(run, connected, starting_robots, now), is_slow=is_slow)
    if run.tried_label:
        return _tried_view(view, run)
    is_named = is_elsewhere and run.name and (run.state != "ready" or _ended_without_robots(run))
    return _named_view(view, run, now) if is_named else view


def _tried_view(view: RunView, run: RunState) -> RunView:
    # Of a tried block; Run is for the whole behaviour.
    if view.state == "running":
        title = _("Trying “{block}”").format(block=run.tried_label)
        return replace(view, title=title, compact_text=title, run_label=RUN, is_edited=False)
    if view.state == "proven" or _ended_without_robots(run):
        template = _("“{block}” stopped because of an error") if run.errors else _("“{block}” was stopped")
        detail = view.detail
        if run.is_finished:
            template = _("Tried “{block}”")
            detail = _("Finished") if run.value is None else run.value
        title = template.format(block=run.tried_label)
        compact_text = view.compact_text if view.result else title
        return replace(view, title=title, detail=detail, compact_text=compact_text)
    return view


def _named_view(view: RunView, run: RunState, now: float) -> RunView:
    # With the behaviour's name, because another tab is shown.
    if view.state in {"running", "paused"}:
        is_running = view.state == "running"
        if view.is_edited:
            view = replace(
                view, is_edited=False, detail=run.description if is_running else _paused_detail(run)
            )
        view = replace(view, run_label=RUN if is_running else view.run_label)
    if view.state == "running":
        # just pressed: the previous text and the time of the run remain
        if run.state == "stopping" and run.elapsed_s is None:
            return replace(view, title=_("{name} is ready").format(name=run.name))
        if not run.is_started:
            return replace(view, title=_("{name} is starting").format(name=run.name))
        elapsed = run.elapsed_s if run.state == "stopping" and run.elapsed_s is not None else run.elapsed(now)
        return replace(
            view, title=_("{name} is running, {time}").format(name=run.name, time=duration_text(elapsed))
        )
    if view.state == "paused":
        if run.paused_at:
            template = _("{name} is paused at “{block}”")
            return replace(view, title=template.format(name=run.name, block=run.paused_at))
        return replace(view, title=_("{name} is paused").format(name=run.name))
    if view.state == "stopping":
        return replace(view, title=_("Stopping {name}").format(name=run.name))
    if view.state == "proven" or _ended_without_robots(run):
        detail = "" if run.has_stopped_blocks and not run.errors else view.detail
        return replace(view, title=_ended_title(run, run.name), detail=detail)
    return view


def _view_of_state(
    run: RunState, connected: Sequence[str], starting_robots: Sequence[str], now: float
) -> RunView:
    is_early = (
        run.state == "stopping"
        and not run.is_stop_repeated
        and now - run.stop_pressed_s < STOPPING_DISPLAY_DELAY_S
    )
    views: dict[str, Callable[[RunState, float], RunView]] = {
        "running": _running_view,
        "paused": _paused_view,
        "stopping": _early_stopping_view if is_early else _stopping_view,
        "proven": _proven_view,
        "unanswered": _unanswered_view,
    }
    if run.state in views:
        return views[run.state](run, now)
    if _ended_without_robots(run):
        return replace(_proven_view(run, now), state="ready", is_stop_filled=bool(connected))
    title, detail = _("Ready"), connected_text(connected, starting_robots)
    if run.unrunnable_program and run.errors:
        title, detail = _("Not started"), next(iter(run.errors.values()))
    elif run.unrunnable_program:
        title, detail = _("Nothing to run yet"), _(NOTHING_TO_RUN_HINT)
    return RunView(
        "ready",
        title,
        detail,
        title,
        can_run=True,
        can_step=True,
        result=run.last_stop_text if run.report is not None else None,
        is_stop_filled=bool(connected),
    )


def _ended_without_robots(run: RunState) -> bool:
    # Only the end is reported; nothing is proven.
    has_run = run.is_finished or bool(run.errors) or run.elapsed_s is not None
    return run.state == "ready" and run.report is not None and has_run


def _running_view(run: RunState, now: float) -> RunView:
    title, compact_template = _("Starting"), _("{name} is starting")
    if run.is_started:
        title, compact_template = _("Running, {time}"), _("{name} is running, {time}")
    time_text = duration_text(run.elapsed(now))
    return RunView(
        "running",
        title.format(time=time_text),
        _(APPLIES_LATER_HINT) if run.is_edited else run.description,
        compact_template.format(name=run.name, time=time_text),
        can_pause=True,
        can_step=True,
        can_restart=True,
        is_edited=run.is_edited,
        run_label=RESTART,
        last_stop=run.last_stop_text or None,
        last_stop_status=run.last_stop_status,
    )


def _paused_view(run: RunState, _now: float) -> RunView:
    return RunView(
        "paused",
        _("Paused at “{block}”").format(block=run.paused_at) if run.paused_at else _("Paused"),
        _(APPLIES_LATER_HINT) if run.is_edited and not run.warning else _paused_detail(run),
        _("{name} is paused").format(name=run.name),
        can_run=True,
        can_step=True,
        can_restart=True,
        is_edited=run.is_edited,
        run_label=RESUME,
        last_stop=run.last_stop_text or None,
        last_stop_status=run.last_stop_status,
    )


def _paused_detail(run: RunState) -> str:
    return run.warning or _("Robots and timers are paused")


def _early_stopping_view(run: RunState, now: float) -> RunView:
    # replies within 100 ms: the text does not change, only Run is disabled
    title = _("Ready")
    if run.elapsed_s is not None:
        title = _("Running, {time}").format(time=duration_text(run.elapsed_s))
    view = replace(
        _stopping_view(run, now),
        state="running",
        title=title,
        detail=run.description,
        stop_label=STOP,
        result=None,
    )
    if run.is_restarting:  # the buttons stay as they were, so that nothing flashes
        view = replace(view, can_pause=True, can_step=True, can_restart=True, run_label=RESTART)
    return view


def _stopping_view(run: RunState, now: float) -> RunView:
    # a robot that refuses, or that other programs serve too, is done only when all of it has stopped
    newest_replies = {robot.name: robot for robot in run.replies}
    stopped_names = {
        robot.name
        for robot in run.replies
        if robot.is_confirmed and not newest_replies[robot.name].is_waiting
    }
    stopped_names -= {robot.name for robot in run.replies if robot.problem}
    waiting = [name for name in run.robots_to_stop if name not in stopped_names]
    detail = result = ""
    if waiting:
        detail = _("Waiting for {robots}, {seconds} s").format(
            robots=format_list(waiting), seconds=number(now - run.stop_pressed_s, ".1f")
        )
    if run.robots_to_stop:
        result = _stopped_count_text(len(stopped_names), len(run.robots_to_stop))
    title = _("Restarting") if run.is_restarting else _(STOPPING)
    return RunView("stopping", title, detail, title, stop_label=STOPPING, result=result or None)


_END_TITLES = {
    ("stopped", False, True): lazy("Stopped after {time}"),
    ("stopped", False, False): lazy("Stopped"),
    ("stopped", True, True): lazy("{name} stopped after {time}"),
    ("stopped", True, False): lazy("{name} stopped"),
    ("problem", False, True): lazy("Stopped after {time} because of an error"),
    ("problem", False, False): lazy("Stopped because of an error"),
    ("problem", True, True): lazy("{name} stopped after {time} because of an error"),
    ("problem", True, False): lazy("{name} stopped because of an error"),
    ("finished", False, True): lazy("Finished after {time}"),
    ("finished", False, False): lazy("Finished"),
    ("finished", True, True): lazy("{name} finished after {time}"),
    ("finished", True, False): lazy("{name} finished"),
}
"""Titles by (result of the run, True if the behaviour is named, True if it ran)."""


def _proven_view(run: RunState, _now: float) -> RunView:
    report = run.report if run.report is not None and run.report.robots else None
    result = result_text(report) if report is not None else ""
    title, detail = _ended_title(run), _("It stopped at the dashed block") if run.has_stopped_blocks else ""
    if run.errors:
        detail = next(iter(run.errors.values()))
    elif run.is_finished:
        detail = _("All scripts finished")
    return RunView(
        "proven",
        title,
        detail,
        result or title,
        can_run=True,
        can_step=True,
        result=result or None,
        result_status=report.status if report is not None else "off",
    )


def _ended_title(run: RunState, name: str = "") -> str:
    kind = "problem" if run.errors else "finished" if run.is_finished else "stopped"
    template = _END_TITLES[kind, bool(name), run.elapsed_s is not None]
    return _(template).format(name=name, time=duration_text(run.elapsed_s or 0.0))


def _unanswered_view(run: RunState, now: float) -> RunView:
    if run.report is None:
        return _proven_view(run, now)
    title, detail, compact_text, confirm_label = unconfirmed_texts(run.report, run.motion_warnings)
    return RunView(
        "unanswered",
        title,
        detail,
        compact_text,
        stop_label=STOP_AGAIN,
        result=result_text(run.report),
        result_status=run.report.status,
        confirm_label=confirm_label,
    )


def duration_text(value: float) -> str:
    """Format a duration in whole seconds, such as ``14 s`` or ``2 min 5 s``."""
    seconds = int(value)
    return f"{seconds} s" if seconds < 60 else f"{seconds // 60} min {seconds % 60} s"


def connected_text(names: Sequence[str], starting_robots: Sequence[str] = ()) -> str:
    """Return the line below "Ready": the names of connected robots, or else of starting robots.

    If there are neither, the line says that no robot is connected.
    """
    if not names and starting_robots:
        template = ngettext("{robots} is starting", "{robots} are starting", len(starting_robots))
        return template.format(robots=format_list(starting_robots))
    if not names:
        return _("No robot is connected")
    template = ngettext("{robots} is connected", "{robots} are connected", len(names))
    return template.format(robots=format_list(names))


def result_text(report: StopReport) -> str:
    """Format the result of a Stop, such as ``all 2 robots stopped (41 ms)``.

    The icon next to the text depends on `StopReport.status`.
    """
    names, stopped_names = report.names, report.stopped_names
    unconfirmable_names = [robot.full_name for robot in report.robots if not robot.can_confirm]
    if report.unconfirmed_robots:
        return _stopped_count_text(len(stopped_names), len(names))
    if not names:
        return _("nothing to stop")
    if not stopped_names:
        return _("stop sent; {robots} can't confirm").format(robots=format_list(unconfirmable_names))
    time_ms = max(1, round(report.elapsed_ms))
    if unconfirmable_names:
        template = _("{robots} stopped ({elapsed} ms); {others} can't confirm")
        return template.format(
            robots=format_list(stopped_names), elapsed=time_ms, others=format_list(unconfirmable_names)
        )
    if len(names) == 1:
        return _("{robot} stopped ({elapsed} ms)").format(robot=stopped_names[0], elapsed=time_ms)
    return _("all {count} robots stopped ({elapsed} ms)").format(count=len(names), elapsed=time_ms)


def _stopped_count_text(stopped_count: int, count: int) -> str:
    if count == 1:
        return _("1 robot stopped") if stopped_count else _("Stop not confirmed")
    return _("{stopped} of {count} robots stopped").format(stopped=stopped_count, count=count)


def unconfirmed_texts(report: StopReport, motion_warnings: Sequence[str] = ()) -> tuple[str, str, str, str]:
    """Return title, detail, compact text and button label for robots that have not confirmed a Stop.

    Messages of the robots themselves ("Arm may still move: the brake is stuck") come first, unchanged.

    Args:
        report: Result of the Stop.
        motion_warnings: Reasons why robots may be moving (`RunState`).
    """
    stopped_names = report.stopped_names
    names = format_list(report.unconfirmed_names)
    listed_names = format_list(report.unconfirmed_names) if len(report.unconfirmed_names) <= 2 else _("them")
    detail = _("Switch {robots} off by hand.").format(robots=listed_names)
    if motion_warnings:
        detail = ngettext(
            "{why}. Switch {robots} off by hand if it is still moving.",
            "{why}. Switch {robots} off by hand if they are still moving.",
            len(report.unconfirmed_names),
        ).format(why="; ".join(motion_warnings[:MAX_NAMED]), robots=listed_names)
    if stopped_names:
        slowest_ms = max(robot.elapsed_ms or 0 for robot in report.robots if robot.name in stopped_names)
        detail = _("{robots} stopped ({elapsed} ms). {next_step}").format(
            robots=format_list(stopped_names), elapsed=max(1, round(slowest_ms)), next_step=detail
        )
    count, title = len(report.unconfirmed_names), _problem_text(report)
    compact_template = ngettext("{wrong}; switch it off by hand", "{wrong}; switch them off by hand", count)
    confirm_label = ngettext("{robots} isn't moving", "{robots} aren't moving", count).format(robots=names)
    if len(names) > MAX_NAMES_LENGTH:  # leave room for the sentence next to the button
        confirm_label = ngettext("It isn't moving", "They aren't moving", count)
    return title, detail, compact_template.format(wrong=title), confirm_label


def _problem_text(report: StopReport) -> str:
    # First robots' own reports, then robots to which the Stop could not be sent, then silent robots.
    refusals = [robot.problem for robot in report.unconfirmed_robots if robot.has_failed]
    unsent = [robot.problem for robot in report.unconfirmed_robots if robot.error and not robot.has_failed]
    silent_names = [robot.full_name for robot in report.unconfirmed_robots if not robot.error]
    if len(silent_names) > MAX_NAMED:
        silent_names = [
            *silent_names[:MAX_NAMED],
            _("{count} more").format(count=len(silent_names) - MAX_NAMED),
        ]
    problems = [*refusals, *unsent]
    if silent_names:
        template = ngettext("{robots} didn't reply", "{robots} didn't reply", len(silent_names))
        problems.append(template.format(robots=format_list(silent_names)))
    remaining = len(problems) - MAX_NAMED
    if remaining > 0:
        template = ngettext("{count} more may still move", "{count} more may still move", remaining)
        problems = [*problems[:MAX_NAMED], template.format(count=remaining)]
    return "; ".join(problems)


def stop_text(robot: RobotStop, clock: str) -> str:
    """Format the result of a Stop for the health panel of a robot.

    Args:
        robot: Result for the robot.
        clock: Formatted time of the Stop.
    """
    if not robot.can_confirm:
        return _("sent at {time}; this robot can't confirm").format(time=clock)
    if robot.is_confirmed:
        elapsed = max(1, round(robot.elapsed_ms or 0))
        return _("confirmed in {elapsed} ms, at {time}").format(elapsed=elapsed, time=clock)
    if robot.error:
        return _("{wrong}, at {time}").format(wrong=robot.problem, time=clock)
    if robot.program:
        return _("no reply from “{program}”, at {time}").format(program=robot.program, time=clock)
    return _("not confirmed, at {time}").format(time=clock)


def clock_text(now: time.struct_time) -> str:
    """Format a time of day, such as ``8:41``."""
    return f"{now.tm_hour}:{now.tm_min:02d}"
