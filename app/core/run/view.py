"""What the run bar says: the six states of Run and Stop in plain words, made from the state of a run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.core.robots.stop_report import STOPPING_SHOWN_AFTER_S, RobotStop, StopReport
from nep.i18n import listed

MOST_NAMED = 4
WIDEST_NAMES = 24
"""Longer names of robots are not repeated on the button beside the sentence that has them."""
NOTHING = "Take “when started” from Events and hang blocks below it"


@dataclass(frozen=True, slots=True)
class RunState:
    """Where the run is, as a value: what happens makes another one.

    ``state`` is ready, running, paused, stopping, proven or unanswered. ``warning`` is what a person should
    know before a paused program goes on. Times are monotonic seconds; the program's clock stands while it is
    paused (``held_s``, ``pause_began_s``). ``again``: the stop before this one is not proven.
    """

    state: str = "ready"
    name: str = ""
    says: str = ""
    paused_at: str = ""
    warning: str = ""
    started_s: float = 0.0
    held_s: float = 0.0
    pause_began_s: float | None = None
    elapsed_s: float | None = None
    pressed_s: float = 0.0
    again: bool = False
    asked: tuple[str, ...] = ()
    answered: tuple[RobotStop, ...] = ()
    report: StopReport | None = None
    finished: bool = False
    dashed: bool = False
    errors: Mapping[str, str] = field(default_factory=dict)
    nothing_in: object = None  # the program that Run was pressed for and that had nothing to run
    last_words: str = ""

    def elapsed(self, now: float) -> float:
        """Seconds that the program has run, pauses left out."""
        held = self.held_s
        if self.pause_began_s is not None:
            held += now - self.pause_began_s
        return max(0.0, now - self.started_s - held)


@dataclass(frozen=True, slots=True)
class RunView:
    """Everything the run bar shows, large and compact.

    ``result`` stands beside Stop with its colour (``result_ok``); ``last_stop`` is the small reminder while a
    program runs; ``confirm`` are the words of the button with which a person says that a silent robot is
    still.
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
    slow: bool = False


def place_of(says: str, blocks: Sequence[str], labels: Mapping[str, str]) -> str:
    """The block at which a program is held: in words, or its name when they hold a quotation."""
    if "“" not in says or not blocks:
        return says
    return labels.get(blocks[0], says)


def view_of(
    run: RunState, connected: Sequence[str], now: float, *, elsewhere: bool = False, slow: bool = False
) -> RunView:
    """The run bar for this state, the names of the connected robots, and the time; ``slow``: slow motion.

    ``elsewhere``: the run belongs to a behaviour whose tab does not show, so the title names it.
    """
    view = replace(_view(run, connected, now), slow=slow)
    return _named(view, run) if elsewhere and run.name and run.state != "ready" else view


def _named(view: RunView, run: RunState) -> RunView:
    """The same with the behaviour's name, for when another one's blocks are to be seen."""
    if view.state == "running":
        return replace(view, title=f"{run.name} runs{view.title.removeprefix('Running')}")
    if view.state == "paused":
        return replace(view, title=f"{run.name} is {view.title[:1].lower()}{view.title[1:]}")
    if view.state == "stopping":
        return replace(view, title=f"Stopping {run.name}")
    if view.state == "proven":
        detail = "" if run.dashed and not run.errors else view.detail
        return replace(view, title=f"{run.name} {view.title[:1].lower()}{view.title[1:]}", detail=detail)
    return view


def _view(run: RunState, connected: Sequence[str], now: float) -> RunView:
    early = run.state == "stopping" and not run.again and now - run.pressed_s < STOPPING_SHOWN_AFTER_S
    views: dict[str, Callable[[RunState, float], RunView]] = {
        "running": _running,
        "paused": _paused,
        "stopping": _stopping_early if early else _stopping,
        "proven": _proven,
        "unanswered": _unanswered,
    }
    if run.state in views:
        return views[run.state](run, now)
    title = "Nothing to run yet" if run.nothing_in else "Ready"
    return RunView(
        "ready",
        title,
        NOTHING if run.nothing_in else connected_words(connected),
        title,
        can_run=True,
        can_step=True,
        stop_filled=bool(connected),
    )


def _running(run: RunState, now: float) -> RunView:
    time_words = seconds(run.elapsed(now))
    return RunView(
        "running",
        f"Running, {time_words}",
        run.says,
        f"{run.name} runs, {time_words}",
        can_pause=True,
        can_step=True,
        last_stop=run.last_words or None,
    )


def _paused(run: RunState, _now: float) -> RunView:
    return RunView(
        "paused",
        f"Paused at “{run.paused_at}”" if run.paused_at else "Paused",
        run.warning or "Robots hold still; the clock stands",
        f"{run.name} is paused",
        can_run=True,
        can_step=True,
        run_word="Go on",
        last_stop=run.last_words or None,
    )


def _stopping_early(run: RunState, now: float) -> RunView:
    # an answer within 100 ms is no state of its own: the words of before stay, only Run can't be pressed
    title = f"Running, {seconds(run.elapsed_s)}" if run.elapsed_s is not None else "Ready"
    return replace(
        _stopping(run, now), state="running", title=title, detail=run.says, stop_word="Stop", result=None
    )


def _stopping(run: RunState, now: float) -> RunView:
    # one that refuses, or that somebody else serves too, is done only when all of it has stopped
    newest = {robot.name: robot for robot in run.answered}
    done = {robot.name for robot in run.answered if robot.answered and not newest[robot.name].waits}
    done -= {robot.name for robot in run.answered if robot.wrong}
    waiting = [name for name in run.asked if name not in done]
    detail = f"Waiting for {listed(waiting)}, {now - run.pressed_s:.1f} s" if waiting else ""
    result = f"{len(done)} of {len(run.asked)} robots stopped" if run.asked else None
    return RunView("stopping", "Stopping", detail, "Stopping", stop_word="Stopping", result=result)


def _proven(run: RunState, _now: float) -> RunView:
    words, good = result_words(run.report) if run.report is not None and run.report.robots else ("", True)
    after = f" after {seconds(run.elapsed_s)}" if run.elapsed_s is not None else ""
    title, detail = f"Stopped{after}", "The dashed outline shows where" if run.dashed else ""
    if run.errors:
        title, detail = f"Stopped by a problem{after}", next(iter(run.errors.values()))
    elif run.finished:
        title, detail = f"Finished{after}", "Every script came to its end"
    return RunView(
        "proven", title, detail, words or title, True, False, True, result=words or None, result_ok=good
    )


def _unanswered(run: RunState, now: float) -> RunView:
    if run.report is None:
        return _proven(run, now)
    title, detail, compact, confirm = unanswered_words(run.report)
    words, _ = result_words(run.report)
    return RunView(
        "unanswered",
        title,
        detail,
        compact,
        stop_word="Stop again",
        result=words,
        result_ok=False,
        confirm=confirm,
    )


def seconds(value: float) -> str:
    """``14 s``, ``2 min 5 s``: whole seconds, as a person reads a clock."""
    whole = int(value)
    return f"{whole} s" if whole < 60 else f"{whole // 60} min {whole % 60} s"


def connected_words(names: Sequence[str]) -> str:
    """The line under Ready."""
    if not names:
        return "No robot is connected"
    return f"{listed(names)} {'is' if len(names) == 1 else 'are'} connected"


def result_words(report: StopReport) -> tuple[str, bool]:
    """``all 2 robots stopped (41 ms)`` and whether every robot that can answer did."""
    names, still = report.names, report.still
    unsure = [robot.who for robot in report.robots if not robot.can_confirm]
    if report.unproven:
        return f"{len(still)} of {len(names)} robots stopped", False
    if not names:
        return "no robot to stop", True
    if not still:
        return f"stop sent; {_cannot_confirm(unsure)}", True
    time_ms = max(1, round(report.elapsed_ms))
    everyone = f"{still[0]} stopped" if len(names) == 1 else f"all {len(names)} robots stopped"
    if unsure:
        return f"{listed(still)} stopped ({time_ms} ms); {_cannot_confirm(unsure)}", True
    return f"{everyone} ({time_ms} ms)", True


def _cannot_confirm(names: Sequence[str]) -> str:
    return f"{listed(names)} cannot confirm"


def unanswered_words(report: StopReport) -> tuple[str, str, str, str]:
    """Title, detail, compact sentence and the confirming button when robots are not proven to stand still.

    What a robot said itself ("Arm may still move: the brake is stuck") comes first, in its own words.
    """
    still = report.still
    names = listed(report.silent)
    stopped = ""
    if still:
        slowest = max(robot.elapsed_ms or 0 for robot in report.robots if robot.name in still)
        stopped = f"{listed(still)} stopped ({max(1, round(slowest))} ms). "
    them = names if len(report.silent) <= 2 else "them"
    is_one = len(report.silent) == 1
    if len(names) > WIDEST_NAMES:  # the sentence beside the button must have room
        names = "It" if is_one else "They"
    title = _wrong_words(report)
    return (
        title,
        f"{stopped}Switch {them} off by hand.",
        f"{title}; switch {'it' if is_one else 'them'} off by hand",
        f"{names} {'is' if is_one else 'are'} still",
    )


def _wrong_words(report: StopReport) -> str:
    """What is wrong with those that are not proven: what they said, who could not be told, who is silent."""
    told = [robot.wrong for robot in report.unproven if robot.refused]
    untold = [robot.wrong for robot in report.unproven if robot.error and not robot.refused]
    silent = [robot.who for robot in report.unproven if not robot.error]
    if len(silent) > MOST_NAMED:
        silent = [*silent[:MOST_NAMED], f"{len(silent) - MOST_NAMED} more"]
    wrong = [*told, *untold, *([f"{listed(silent)} did not answer"] if silent else [])]
    more = [f"{len(wrong) - MOST_NAMED} more may still move"] if len(wrong) > MOST_NAMED else []
    return "; ".join([*wrong[:MOST_NAMED], *more])


def stop_words(robot: RobotStop, clock: str) -> str:
    """What one robot did with a stop, for its health: ``answered in 41 ms, at 8:40``."""
    if not robot.can_confirm:
        return f"sent at {clock}; this robot cannot confirm"
    if robot.answered:
        return f"answered in {max(1, round(robot.elapsed_ms or 0))} ms, at {clock}"
    if robot.error:
        return f"{robot.wrong}, at {clock}"
    if robot.program:
        return f"“{robot.program}” has not answered, at {clock}"
    return f"not answered, at {clock}"


def stops_by_name(report: StopReport) -> Mapping[str, RobotStop]:
    """What became of each robot: the worst of what its own and other programs that serve it said."""
    worst: dict[str, RobotStop] = {}
    for robot in report.robots:
        before = worst.get(robot.name)
        if before is None or (robot.wrong and not (before.wrong and not before.program)):
            worst[robot.name] = robot
    return worst


def clock_words(now: time.struct_time) -> str:
    """``8:41``."""
    return f"{now.tm_hour}:{now.tm_min:02d}"
