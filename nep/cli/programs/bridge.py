"""`nep bridge`: forward topics between two back ends."""

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
from nep.cli.screen import (
    UNKNOWN,
    console,
    display_width,
    format_rate,
    padded,
    print_status,
    show_json,
    write,
)
from nep.errors import NepError
from nep.i18n import _, lazy, ngettext
from nep.masters.rates import TrafficMeter
from nep.programs.bridges.bridge import Bridge, check_installed
from nep.programs.bridges.configuration import (
    BridgeConfiguration,
    configuration_from_arguments,
    parse_direction,
)
from nep.programs.bridges.route import Route, RouteCounts
from nep.programs.bridges.toml_file import EXAMPLE, read_configuration
from nep.programs.robots.guard import denial_text
from nep.programs.robots.moving import MovingTopics
from nep.text import escaped, shortened

if TYPE_CHECKING:
    from rich.console import RenderableType

_REPORT_PERIOD_S = 1.0
_WAIT_SLICE_S = 0.1
_ROBOT_DISCOVERY_S = 1.5
_CELL_WIDTH = 10
_MAX_NAME_WIDTH = 60
_MAX_WARNINGS = 100
_MIN_COLUMNS = 6
"""Number of leading columns that are shown even if all their values are 0."""
_HEADINGS = (
    lazy("rate"),
    lazy("received"),
    lazy("sent"),
    lazy("lost"),
    lazy("throttled"),
    lazy("failed"),
    lazy("dropped"),
    lazy("waiting"),
    lazy("returned"),
)

FileOrEndsArgument = Annotated[
    list[str] | None,
    typer.Argument(
        help=_("A TOML file, or the two ends of one topic, such as zeromq:/chatter ros:/chatter."),
        metavar=_("FILE | A B"),
        show_default=False,
    ),
]
DirectionOption = Annotated[
    str,
    typer.Option(
        "--direction", metavar=_("DIRECTION"), help=_("Direction for one topic: 'a->b', 'b->a' or 'both'.")
    ),
]
RateOption = Annotated[
    float | None,
    typer.Option(
        "--rate",
        metavar="HZ",
        help=_("For one topic: forward at most HZ messages per second and drop older ones."),
        show_default=False,
    ),
]
CheckOption = Annotated[bool, typer.Option("--check", help=_("Validate the file and exit."))]
ExampleOption = Annotated[bool, typer.Option("--example", help=_("Print an example file and exit."))]
CountOption = Annotated[
    int, typer.Option("--count", "-n", min=0, metavar="N", help=_("Exit after N reports (0: never)."))
]


def bridge(
    file_or_ends: FileOrEndsArgument = None,
    direction: DirectionOption = "both",
    rate_hz: RateOption = None,
    check: CheckOption = False,
    example: ExampleOption = False,
    count: CountOption = 0,
    allow_moving: AllowMovingOption = None,
    as_json: JsonOption = False,
) -> None:
    """Forward topics between two back ends until Ctrl+C, as configured in a file or for one topic.

    Messages are forwarded unchanged if both back ends use the same encoding, else they are converted.
    Forwarded messages aren't sent back. Once a second a table shows what was forwarded, lost and dropped
    because of a rate limit. Topics that move a robot are forwarded only with --allow-moving. If a network is
    down, the bridge waits for it.
    """
    if example:
        write(EXAMPLE)
        return
    configuration = _configuration(file_or_ends or [], direction, rate_hz)
    _check_not_in_process(configuration)
    if check:
        check_installed(configuration)
        _show_configuration(configuration)
        return
    interrupts.exit_on_termination()
    allowed = allow_moving or ()
    _check_types(configuration, allowed)
    with (
        _print_warnings() as warning_handler,
        Bridge(configuration, allow_moving=allowed) as running_bridge,
        _publish_log(running_bridge),
    ):
        for reason in running_bridge.denial_reasons(_ROBOT_DISCOVERY_S):
            raise typer.BadParameter(reason)
        report = _report_for(running_bridge, warning_handler, as_json=as_json)
        if not as_json:
            template = _("{name}: forwarding between a ({a}) and b ({b}); press Ctrl+C to stop")
            print_status(
                template.format(name=configuration.name, a=configuration.a.network, b=configuration.b.network)
            )
        _run(report, count)


def _configuration(file_or_ends: Sequence[str], direction: str, rate_hz: float | None) -> BridgeConfiguration:
    if len(file_or_ends) == 2:
        if rate_hz is not None and not 1e-6 <= rate_hz <= 1e6:
            raise typer.BadParameter(
                _("{given:g} isn't a valid rate; use messages per second, such as 10").format(given=rate_hz),
                param_hint="--rate",
            )
        parsed_direction = parse_direction(direction)
        return configuration_from_arguments(
            *file_or_ends, name=str(os.getpid()), direction=parsed_direction, max_rate_hz=rate_hz or 0.0
        )
    if len(file_or_ends) != 1:
        raise NepError(
            _("specify a file or two ends, such as 'zeromq:/chatter ros:/chatter'; --example prints a file")
        )
    if direction != "both" or rate_hz is not None:
        raise NepError(_("--direction and --rate can't be used with a file; set them in the file"))
    path = Path(file_or_ends[0])
    if ":" in file_or_ends[0] and not path.exists():
        raise NepError(
            _("'{word}' is only one end of the bridge; add the other one, such as 'ros:/chatter'").format(
                word=file_or_ends[0]
            )
        )
    return read_configuration(path)


def _check_not_in_process(configuration: BridgeConfiguration) -> None:
    for side in (configuration.a, configuration.b):
        if side.backend.is_in_process:
            raise NepError(
                _(
                    "the back end '{name}' connects nodes of one program only; use "
                    "nep.programs.bridges.Bridge in that program"
                ).format(name=side.backend.name)
            )


def _check_types(configuration: BridgeConfiguration, allowed: Sequence[str]) -> None:
    # Rejects topics that move a robot by their type or name, even if no robot is connected.
    for topic in configuration.topics:
        for origin in topic.origins:
            end = topic.b if origin == "a" else topic.a
            reason = denial_text(end.name, MovingTopics().robots_moved_by(end.name, end.msg_type), allowed)
            if reason and not topic.is_pattern:
                raise typer.BadParameter(reason)


def _show_configuration(configuration: BridgeConfiguration) -> None:
    arrows = {"a->b": "→", "b->a": "←", "both": "↔"}
    for topic in configuration.topics:
        route_text = f"{topic.a.name} {arrows[topic.direction]} {topic.b.name}"
        write(escaped(route_text) + (f"  ≤ {topic.max_rate_hz:g} /s" if topic.max_rate_hz else "") + "\n")
    template = _("the file is valid: {name} connects {a} and {b}")
    print_status(
        template.format(name=configuration.name, a=configuration.a.network, b=configuration.b.network)
    )


# ---- warnings above the table


class _WarningHandler(logging.Handler):
    """Log handler that prints the library's warnings, or buffers them while a live table is shown."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.buffered: deque[str] | None = None

    def emit(self, record: logging.LogRecord) -> None:
        if self.buffered is None:
            print_status(record.getMessage())
        else:
            self.buffered.append(record.getMessage())

    def pop_all(self) -> Iterator[str]:
        while self.buffered:
            yield self.buffered.popleft()


@contextmanager
def _print_warnings() -> Iterator[_WarningHandler]:
    warning_handler, logger = _WarningHandler(), logging.getLogger("nep")
    logger.addHandler(warning_handler)
    try:
        yield warning_handler
    finally:
        logger.removeHandler(warning_handler)


@contextmanager
def _publish_log(running_bridge: Bridge) -> Iterator[None]:
    logger = logging.getLogger("nep")
    handlers = [side.node.log_handler for side in running_bridge.sides.values()]
    for handler in handlers:
        logger.addHandler(handler)
    try:
        yield
    finally:
        for handler in handlers:
            logger.removeHandler(handler)


# ---- the report


class _Row(NamedTuple):
    """Row of the report.

    Attributes:
        name: Name of the route.
        cells: Formatted counts in the order of `_HEADINGS`.
        problem: Problem of the route, or "".
    """

    name: str
    cells: tuple[str, ...]
    problem: str


class _Report:
    """Report of the counts of all routes, printed once a second."""

    def __init__(self, running_bridge: Bridge) -> None:
        self._bridge = running_bridge
        self._meters: dict[Route, TrafficMeter] = {}
        names = [running_bridge.configuration.side(side).backend.name for side in ("a", "b")]
        self._sides: Mapping[str, str] = dict(zip("ab", names if names[0] != names[1] else "ab", strict=True))

    def start(self) -> None: ...

    def show(self) -> None:
        raise NotImplementedError

    def stop(self) -> None:
        self.show()

    def rows(self) -> list[_Row]:
        return [self._row(route, route.counts()) for route in self._bridge.routes]

    def rate_hz(self, route: Route, counts: RouteCounts) -> float | None:
        meter = self._meters.setdefault(route, TrafficMeter())
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
        cells = (UNKNOWN if each is None else str(each) for each in numbers)
        return _Row(name, (format_rate(self.rate_hz(route, counts)), *cells), _problem_text(route, counts))


def _problem_text(route: Route, counts: RouteCounts) -> str:
    if route.rival:
        return _("the bridge '{name}' also forwards this topic; stop one of the bridges").format(
            name=escaped(route.rival)
        )
    return escaped(route.connection_problem or counts.problem)


class _JsonReport(_Report):
    """Report as one JSON line per second: the status as published on `/nep/bridges`, with rates."""

    def show(self) -> None:
        status = self._bridge.status()
        rates = [self.rate_hz(route, route.counts()) for route in self._bridge.routes]
        routes = status["routes"]
        routes_with_rates = [
            {**each, "rate_hz": rate_hz}
            for each, rate_hz in zip(routes if isinstance(routes, list) else [], rates, strict=False)
        ]
        show_json({"stamp_ns": time.time_ns(), **status, "routes": routes_with_rates})


class _PlainReport(_Report):
    """Report for a file or a pipe: prints only routes whose counts have changed."""

    def __init__(self, running_bridge: Bridge) -> None:
        super().__init__(running_bridge)
        self._last_counts: dict[str, tuple[str, ...]] = {}
        self._width = 0

    def show(self) -> None:
        rows = self.rows()
        width = max([0, *(display_width(row.name) for row in rows)])
        lines = []
        if width > self._width:
            self._width = width
            lines.append(self._line(_("topic"), [_(heading) for heading in _HEADINGS]))
        for row in rows:
            counts = row.cells[1:]
            if self._last_counts.get(row.name) != counts:
                self._last_counts[row.name] = counts
                lines.append(self._line(row.name, row.cells))
        if lines:
            write("".join(f"{line}\n" for line in lines))

    def _line(self, name: str, cells: Sequence[str]) -> str:
        return padded(name, self._width) + "".join(
            padded(cell, max(_CELL_WIDTH, display_width(cell) + 1), "right") for cell in cells
        )


class _LiveReport(_Report):
    """Report as a table that is redrawn in place; warnings are printed above the table."""

    def __init__(self, running_bridge: Bridge, warning_handler: _WarningHandler) -> None:
        from rich.live import Live  # noqa: PLC0415 - only a terminal needs it

        super().__init__(running_bridge)
        self._warning_handler = warning_handler
        out = console()
        out.soft_wrap = False
        self._live = Live(console=out, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)

    def start(self) -> None:
        self._live.start()
        self._warning_handler.buffered = deque(maxlen=_MAX_WARNINGS)
        self.show()

    def show(self) -> None:
        from rich.text import Text  # noqa: PLC0415 - see above

        for note in self._warning_handler.pop_all():
            self._live.console.print(Text(escaped(note), "yellow"))
        self._live.update(self._table(), refresh=True)

    def stop(self) -> None:
        try:
            self.show()
        finally:
            self._live.stop()
            self._warning_handler.buffered = None

    def _table(self) -> RenderableType:
        from rich import box  # noqa: PLC0415 - see above
        from rich.console import Group  # noqa: PLC0415
        from rich.table import Table  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        rows = self.rows()
        max_rows = max(1, shutil.get_terminal_size().lines - 6)
        rows, hidden_count = rows[:max_rows], len(rows) - max_rows
        shown_columns = [
            column
            for column in range(len(_HEADINGS))
            if column < _MIN_COLUMNS or any(row.cells[column] != "0" for row in rows)
        ]
        table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, show_edge=False)
        table.add_column(_("topic"), style="bold", overflow="fold")  # only the name is folded, never numbers
        for column in shown_columns:
            table.add_column(_(_HEADINGS[column]), justify="right", no_wrap=True)
        for row in rows:
            table.add_row(
                Text(shortened(row.name, _MAX_NAME_WIDTH)), *(row.cells[column] for column in shown_columns)
            )
        footer_lines = [
            Text(f"! {row.name}: {row.problem}", "yellow", no_wrap=True) for row in rows if row.problem
        ]
        if hidden_count > 0:
            template = ngettext("and {count} more topic", "and {count} more topics", hidden_count)
            footer_lines.append(Text(template.format(count=hidden_count), "dim"))
        return Group(table, *footer_lines[: max(1, max_rows - len(rows) + 1)])


def _report_for(running_bridge: Bridge, warning_handler: _WarningHandler, *, as_json: bool) -> _Report:
    if as_json:
        return _JsonReport(running_bridge)
    return (
        _LiveReport(running_bridge, warning_handler) if sys.stdout.isatty() else _PlainReport(running_bridge)
    )


def _run(report: _Report, count: int) -> None:
    never, started = threading.Event(), time.monotonic()
    try:
        report.start()
        for number in itertools.count(1):
            while (remaining_s := started + number * _REPORT_PERIOD_S - time.monotonic()) > 0:
                never.wait(
                    min(remaining_s, _WAIT_SLICE_S)
                )  # in slices: Ctrl+C does not interrupt a wait on Windows
            if number == count:
                return
            report.show()
    finally:
        report.stop()
