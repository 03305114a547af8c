"""`nep bridge`: join topics of two back ends."""

from __future__ import annotations

import itertools
import logging
import os
import shutil
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from nep.cli import interrupts
from nep.cli.options import AllowMovingOption, JsonOption
from nep.cli.screen import UNKNOWN, cells, console, padded, rate, say, show_json, write
from nep.errors import NepError
from nep.i18n import _, lazy
from nep.masters.rates import Meter
from nep.programs.bridges.bridge import Bridge, check_installed
from nep.programs.bridges.configuration import BridgeConfiguration, direction_named, join_line
from nep.programs.bridges.route import Route, RouteCounts
from nep.programs.bridges.toml_file import EXAMPLE, read_configuration
from nep.programs.robots.guard import refusal_words
from nep.programs.robots.moving import MovingTopics
from nep.text import escaped, shortened

if TYPE_CHECKING:
    from rich.console import RenderableType

_EVERY_S = 1.0
_SLICE_S = 0.1
_SETTLE_S = 1.5
_CELL = 10
_NAME_MOST = 60
_NOTES_MOST = 100
_ALWAYS = 6
"""So many of the columns are there also when they are all 0."""
_HEADS = (
    lazy("rate"),
    lazy("received"),
    lazy("sent"),
    lazy("lost"),
    lazy("thinned"),
    lazy("failed"),
    lazy("dropped"),
    lazy("waiting"),
    lazy("returned"),
)

WhatArgument = Annotated[
    list[str] | None,
    typer.Argument(
        help=_("A TOML file, or the two sides of one topic, such as zeromq:/chatter ros:/chatter."),
        metavar=_("FILE | A B"),
        show_default=False,
    ),
]
DirectionOption = Annotated[
    str,
    typer.Option(
        "--direction", metavar=_("WAY"), help=_("Which way, for one topic: 'a->b', 'b->a' or 'both'.")
    ),
]
RateOption = Annotated[
    float | None,
    typer.Option(
        "--rate",
        metavar="HZ",
        help=_("So many messages a second at most, for one topic; the newest are kept."),
        show_default=False,
    ),
]
CheckOption = Annotated[bool, typer.Option("--check", help=_("Say whether the file is right, and end."))]
ExampleOption = Annotated[bool, typer.Option("--example", help=_("Print a file to begin with, and end."))]
CountOption = Annotated[
    int, typer.Option("--count", "-n", min=0, metavar="N", help=_("End after N reports; 0 goes on."))
]


def bridge(
    what: WhatArgument = None,
    direction: DirectionOption = "both",
    rate_hz: RateOption = None,
    check: CheckOption = False,
    example: ExampleOption = False,
    count: CountOption = 0,
    allow_moving: AllowMovingOption = None,
    as_json: JsonOption = False,
) -> None:
    """Join topics of two back ends, as a file says, or one topic at once. Ctrl+C ends it.

    Messages pass as they are where both sides have the same form, else by what is in them. What a bridge has
    brought over is not brought back. Each second it shows what it has carried, what was lost before it, and
    what it left out because more came than the file allows. What moves a robot on either side is carried only
    with --allow-moving. A network that is not there is waited for.
    """
    if example:
        write(EXAMPLE)
        return
    configuration = _configuration(what or [], direction, rate_hz)
    _check_reach(configuration)
    if check:
        check_installed(configuration)
        _say_right(configuration)
        return
    interrupts.leave_when_told()
    allowed = allow_moving or ()
    _check_types(configuration, allowed)
    with _warnings() as notes, Bridge(configuration, allow_moving=allowed) as running, _published(running):
        for refusal in running.refusals(_SETTLE_S):
            raise typer.BadParameter(refusal)
        report = _report_for(running, notes, as_json=as_json)
        if not as_json:
            said = _("{name} joins a, {a}, and b, {b}; Ctrl+C ends it")
            say(said.format(name=configuration.name, a=configuration.a.network, b=configuration.b.network))
        _run(report, count)


def _configuration(what: Sequence[str], direction: str, rate_hz: float | None) -> BridgeConfiguration:
    """What the command line asks for. Raises `NepError`."""
    if len(what) == 2:
        if rate_hz is not None and not 1e-6 <= rate_hz <= 1e6:
            raise typer.BadParameter(
                _("{given:g} is none; give messages a second, such as 10").format(given=rate_hz),
                param_hint="--rate",
            )
        way = direction_named(direction)
        return join_line(*what, name=str(os.getpid()), direction=way, max_rate_hz=rate_hz or 0.0)
    if len(what) != 1:
        raise NepError(
            _("give a file, or two sides such as 'zeromq:/chatter ros:/chatter'; --example prints a file")
        )
    if direction != "both" or rate_hz is not None:
        raise NepError(_("with a file its own lines decide; leave out --direction and --rate"))
    path = Path(what[0])
    if ":" in what[0] and not path.exists():
        raise NepError(
            _("'{word}' is one side, and no file; name the other, too, such as 'ros:/chatter'").format(
                word=what[0]
            )
        )
    return read_configuration(path)


def _check_reach(configuration: BridgeConfiguration) -> None:
    """Raises `NepError` for a network that this process cannot be in."""
    for side in (configuration.a, configuration.b):
        if side.backend.is_in_process:
            raise NepError(
                _(
                    "nodes of '{name}' meet within one program only; join them there by "
                    "nep.programs.bridges.Bridge"
                ).format(name=side.backend.name)
            )


def _check_types(configuration: BridgeConfiguration, allowed: Sequence[str]) -> None:
    """Raises `typer.BadParameter` for a topic that moves a robot whoever is there, by its type or name."""
    for topic in configuration.topics:
        for origin in topic.origins:
            end = topic.b if origin == "a" else topic.a
            refusal = refusal_words(end.name, MovingTopics().moved_by(end.name, end.msg_type), allowed)
            if refusal and not topic.is_pattern:
                raise typer.BadParameter(refusal)


def _say_right(configuration: BridgeConfiguration) -> None:
    """One line for each topic, as it was understood."""
    ways = {"a->b": "→", "b->a": "←", "both": "↔"}
    for topic in configuration.topics:
        ends = f"{topic.a.name} {ways[topic.direction]} {topic.b.name}"
        write(escaped(ends) + (f"  ≤ {topic.max_rate_hz:g} /s" if topic.max_rate_hz else "") + "\n")
    said = _("the file is right: {name} joins {a} and {b}")
    say(said.format(name=configuration.name, a=configuration.a.network, b=configuration.b.network))


# ---- what is said beside the table


class _Notes(logging.Handler):
    """Warnings of the library, until the table has room for them; without one they are said at once."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.kept: deque[str] | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """See `logging.Handler`."""
        if self.kept is None:
            say(record.getMessage())
        else:
            self.kept.append(record.getMessage())

    def taken(self) -> Iterator[str]:
        """What was kept."""
        while self.kept:
            yield self.kept.popleft()


@contextmanager
def _warnings() -> Iterator[_Notes]:
    notes, logger = _Notes(), logging.getLogger("nep")
    logger.addHandler(notes)
    try:
        yield notes
    finally:
        logger.removeHandler(notes)


@contextmanager
def _published(running: Bridge) -> Iterator[None]:
    """Both nodes publish the library's warnings as log records, for `nep log` and Studio's Console."""
    logger = logging.getLogger("nep")
    handlers = [side.node.log_handler for side in running.sides.values()]
    for each in handlers:
        logger.addHandler(each)
    try:
        yield
    finally:
        for each in handlers:
            logger.removeHandler(each)


# ---- the report


class _Row(NamedTuple):
    """One route: its name, its figures in the order of `_HEADS`, and why something went wrong with it."""

    name: str
    figures: tuple[str, ...]
    problem: str


class _Report:
    """What the routes carry, read each second."""

    def __init__(self, running: Bridge) -> None:
        self._running = running
        self._meters: dict[Route, Meter] = {}
        names = [running.configuration.side(side).backend.name for side in ("a", "b")]
        self._sides: Mapping[str, str] = dict(zip("ab", names if names[0] != names[1] else "ab", strict=True))

    def begin(self) -> None:
        """Before the first report."""

    def show(self) -> None:
        """Report."""
        raise NotImplementedError

    def end(self) -> None:
        """Report for the last time."""
        self.show()

    def rows(self) -> list[_Row]:
        """All routes."""
        return [self._row(route, route.counts()) for route in self._running.routes]

    def rate_hz(self, route: Route, counts: RouteCounts) -> float | None:
        """Messages a second that it carries."""
        meter = self._meters.setdefault(route, Meter())
        meter.add(time.monotonic(), counts.sent, counts.bytes)
        rates = meter.rates()
        return None if rates is None else rates[0]

    def _row(self, route: Route, counts: RouteCounts) -> _Row:
        origin, end = route.origin, route.end
        topics = origin.topic if origin.topic == end.topic else f"{origin.topic} → {end.topic}"
        name = f"{self._sides[origin.side]} → {self._sides[end.side]}  {escaped(topics)}"
        numbers = (
            counts.received, counts.sent, counts.lost, counts.thinned, counts.failed, counts.dropped,
            counts.waiting, counts.returned,
        )  # fmt: skip
        figures = (UNKNOWN if each is None else str(each) for each in numbers)
        return _Row(name, (rate(self.rate_hz(route, counts)), *figures), _problem(route, counts))


def _problem(route: Route, counts: RouteCounts) -> str:
    if route.rival:
        return _("the bridge '{name}' carries it; end one of the two").format(name=escaped(route.rival))
    return escaped(route.trouble or counts.problem)


class _JsonReport(_Report):
    """One JSON text a second, as on `/nep/bridges`, with rates."""

    def show(self) -> None:
        status = self._running.status()
        rates = [self.rate_hz(route, route.counts()) for route in self._running.routes]
        routes = status["routes"]
        told = [
            {**each, "rate_hz": rate_hz}
            for each, rate_hz in zip(routes if isinstance(routes, list) else [], rates, strict=False)
        ]
        show_json({"stamp_ns": time.time_ns(), **status, "routes": told})


class _PlainReport(_Report):
    """Lines of those routes whose figures have changed, for a file or a program."""

    def __init__(self, running: Bridge) -> None:
        super().__init__(running)
        self._shown: dict[str, tuple[str, ...]] = {}
        self._width = 0

    def show(self) -> None:
        rows = self.rows()
        width = max([0, *(cells(row.name) for row in rows)])
        lines = []
        if width > self._width:
            self._width = width
            lines.append(self._line(_("topic"), [_(head) for head in _HEADS]))
        for row in rows:
            counts = row.figures[1:]
            if self._shown.get(row.name) != counts:
                self._shown[row.name] = counts
                lines.append(self._line(row.name, row.figures))
        if lines:
            write("".join(f"{line}\n" for line in lines))

    def _line(self, name: str, figures: Sequence[str]) -> str:
        return padded(name, self._width) + "".join(
            padded(figure, max(_CELL, cells(figure) + 1), "right") for figure in figures
        )


class _LiveReport(_Report):
    """A table that each report takes the place of; what is said beside it stands above."""

    def __init__(self, running: Bridge, notes: _Notes) -> None:
        from rich.live import Live  # noqa: PLC0415 - only a terminal needs it

        super().__init__(running)
        self._notes = notes
        out = console()
        out.soft_wrap = False
        self._live = Live(console=out, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)

    def begin(self) -> None:
        self._live.start()
        self._notes.kept = deque(maxlen=_NOTES_MOST)
        self.show()

    def show(self) -> None:
        from rich.text import Text  # noqa: PLC0415 - see above

        for note in self._notes.taken():
            self._live.console.print(Text(escaped(note), "yellow"))
        self._live.update(self._table(), refresh=True)

    def end(self) -> None:
        try:
            self.show()
        finally:
            self._live.stop()
            self._notes.kept = None

    def _table(self) -> RenderableType:
        from rich import box  # noqa: PLC0415 - see above
        from rich.console import Group  # noqa: PLC0415
        from rich.table import Table  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        rows = self.rows()
        most = max(1, shutil.get_terminal_size().lines - 6)
        rows, left = rows[:most], len(rows) - most
        used = [
            at for at in range(len(_HEADS)) if at < _ALWAYS or any(row.figures[at] != "0" for row in rows)
        ]
        table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, show_edge=False)
        table.add_column(_("topic"), style="bold", overflow="fold")  # it gives way, numbers never do
        for at in used:
            table.add_column(_(_HEADS[at]), justify="right", no_wrap=True)
        for row in rows:
            table.add_row(Text(shortened(row.name, _NAME_MOST)), *(row.figures[at] for at in used))
        below = [Text(f"! {row.name}: {row.problem}", "yellow", no_wrap=True) for row in rows if row.problem]
        if left > 0:
            below.append(Text(_("and {count} more topics").format(count=left), "dim"))
        return Group(table, *below[: max(1, most - len(rows) + 1)])


def _report_for(running: Bridge, notes: _Notes, *, as_json: bool) -> _Report:
    if as_json:
        return _JsonReport(running)
    return _LiveReport(running, notes) if sys.stdout.isatty() else _PlainReport(running)


def _run(report: _Report, count: int) -> None:
    """Report each second until Ctrl+C, or `count` times."""
    never, started = threading.Event(), time.monotonic()
    try:
        report.begin()
        for number in itertools.count(1):
            while (left := started + number * _EVERY_S - time.monotonic()) > 0:
                never.wait(min(left, _SLICE_S))  # in slices: Windows does not interrupt a wait for Ctrl+C
            if number == count:
                return
            report.show()
    finally:
        report.end()
