"""Output of the command line: tables, JSON lines, status and error messages."""

from __future__ import annotations

import errno
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from typing import IO, TYPE_CHECKING, Literal, cast

from nep.cli.values import encode_json
from nep.i18n import _
from nep.system.streams import print_error
from nep.text import escaped

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

    from nep.protocol.graph_view import Alert, TopicInfo
    from nep.system.terminal import Terminal

_COLUMN_GAP = 3
_MIN_COLUMN_WIDTH = 6
_MAX_RICH_ROWS = 200
"""Number of rows above which tables are laid out without rich, which is slow."""
_UNLIMITED_WIDTH = 10_000
UNKNOWN = "\N{EN DASH}"
"""Text shown for unknown values."""


@dataclass(frozen=True)
class TextColumn:
    """Column of a table.

    Attributes:
        heading: Heading, which is translated when the table is printed.
        justify: Alignment of the cells.
        style: Style of the cells, as for rich.
        is_folded_last: True to narrow other columns first if the table is too wide, as for numbers.
    """

    heading: str
    justify: Literal["left", "right"] = "left"
    style: str = ""
    is_folded_last: bool = False


def console(*, stderr: bool = False, out: Terminal | None = None) -> Console:
    """Return a console for coloured text. Imports rich, which is slow, on the first call.

    Args:
        stderr: True to write to stderr instead of stdout.
        out: Stream to write to instead.
    """
    console_type = _console_class()
    return console_type(stderr=stderr, file=cast("IO[str] | None", out), highlight=False, soft_wrap=True)


@cache
def _console_class() -> type[Console]:
    from rich.console import Console  # noqa: PLC0415 - 40 ms that `--json` and `--help` need not wait for

    class RaisingConsole(Console):
        """Console that raises `BrokenPipeError` on a closed pipe, as plain streams do."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError(errno.EPIPE, _("the output was closed"))

    return RaisingConsole


def json_highlighter() -> Callable[[str, str], Text]:
    """Return a function (header, body) that formats a message: header dimmed, JSON body coloured."""
    from rich.highlighter import JSONHighlighter  # noqa: PLC0415 - see `console`
    from rich.text import Text  # noqa: PLC0415

    highlight = JSONHighlighter()

    def paint(header: str, body: str) -> Text:
        painted = Text(body)
        highlight.highlight(painted)
        return Text.assemble((header, "dim"), "  ", painted)

    return paint


def show_table(columns: Sequence[TextColumn], rows: Iterable[Sequence[str]]) -> None:
    """Print a table to stdout; long cells are wrapped to fit the width of the terminal.

    If the terminal is too narrow for the columns, each row is printed as a block of lines.
    """
    columns = [replace(column, heading=_(column.heading)) for column in columns]
    is_terminal = sys.stdout.isatty()  # files and pipes have no width
    max_width = shutil.get_terminal_size().columns if is_terminal else _UNLIMITED_WIDTH
    lines = [[escaped(cell, lines=True) for cell in row] for row in rows]
    widths = _column_widths(columns, lines, max_width)
    if _total_width(widths) > max_width:
        write("".join(_record_blocks(columns, lines)))
        return
    if len(lines) > _MAX_RICH_ROWS and _cells_fit(lines, widths):
        sys.stdout.write("".join(f"{line}\n" for line in _layout_lines(columns, lines, widths)))
        return
    from rich import box  # noqa: PLC0415 - see `console`
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    out = console()
    if not is_terminal:
        out.width = max_width
    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, show_edge=False)
    for column, width in zip(columns, widths, strict=True):
        table.add_column(
            column.heading, justify=column.justify, style=column.style, overflow="fold", width=width
        )
    for row in lines:
        table.add_row(*(Text(cell, style="dim" if cell == UNKNOWN else "") for cell in row))
    out.print(table, soft_wrap=False)


def display_width(text: str) -> int:
    """Return the display width of a line in terminal cells: wide characters take two, accents none."""
    if text.isascii():
        return len(text)
    from rich.cells import cell_len  # noqa: PLC0415 - see `console`

    return cell_len(text)


def padded(text: str, width: int, justify: Literal["left", "right"] = "left") -> str:
    """Pad a text with spaces to `width` cells."""
    padding = " " * (width - display_width(text))
    return text + padding if justify == "left" else padding + text


def _total_width(widths: Sequence[int]) -> int:
    return sum(widths) + _COLUMN_GAP * (len(widths) - 1)


def _record_blocks(columns: Sequence[TextColumn], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    for row in rows:
        yield f"{row[0]}\n"
        for column, cell in zip(columns[1:], row[1:], strict=True):
            if cell != UNKNOWN:
                yield f"  {column.heading}: {', '.join(cell.splitlines())}\n"


def _cells_fit(rows: Sequence[Sequence[str]], widths: Sequence[int]) -> bool:
    return all(
        display_width(cell) <= width and "\n" not in cell
        for row in rows
        for cell, width in zip(row, widths, strict=True)
    )


def _layout_lines(
    columns: Sequence[TextColumn], rows: Sequence[Sequence[str]], widths: Sequence[int]
) -> Iterator[str]:
    gap = " " * _COLUMN_GAP

    def line(texts: Iterable[str]) -> str:
        return gap.join(
            padded(text, width, column.justify)
            for column, text, width in zip(columns, texts, widths, strict=True)
        ).rstrip()

    yield line(column.heading for column in columns)
    yield "─" * _total_width(widths)
    yield from map(line, rows)


def _column_widths(columns: Sequence[TextColumn], rows: Sequence[Sequence[str]], max_width: int) -> list[int]:
    widths = [
        max(
            display_width(line)
            for cell in (column.heading, *(row[index] for row in rows))
            for line in cell.split("\n")
        )
        for index, column in enumerate(columns)
    ]
    is_fixed = [column.is_folded_last or column.justify == "right" for column in columns]
    while _total_width(widths) > max_width:
        shrinkable = [
            index for index, width in enumerate(widths) if width > _MIN_COLUMN_WIDTH and not is_fixed[index]
        ]
        shrinkable = shrinkable or [index for index, width in enumerate(widths) if width > _MIN_COLUMN_WIDTH]
        if not shrinkable:
            break
        widths[max(shrinkable, key=lambda index: widths[index])] -= 1
    return widths


def show_alerts(alerts: Iterable[Alert], out: Terminal | None = None) -> None:
    """Print alerts with their hints to stderr."""
    from rich.text import Text  # noqa: PLC0415 - see `console`

    for alert in alerts:
        text = Text.assemble(("! ", "yellow bold"), (escaped(alert.sentence), "yellow"))
        if alert.hint:
            text.append(f"\n  {escaped(alert.hint)}", style="dim")
        with suppress(OSError):  # a closed stream is not an error
            console(stderr=True, out=out).print(text)


def print_status(message: str, out: Terminal | None = None) -> None:
    """Print a status message to stderr or `out`, ignoring write errors."""
    with suppress(OSError):  # a closed stream is not an error
        console(stderr=True, out=out).print(escaped(message), style="dim", markup=False)


def print_error_message(message: str) -> None:
    """Print an error message to stderr."""
    print_error(f"nep: {escaped(message, lines=True)}")  # plain text: unbuffered and readable for programs


def write(text: str) -> None:
    """Write text to stdout and flush."""
    sys.stdout.write(text)
    sys.stdout.flush()


def show_json(value: object) -> None:
    """Write a value to stdout as one line of UTF-8 JSON, regardless of the terminal's encoding, and flush."""
    data = encode_json(value) + b"\n"
    sys.stdout.flush()
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()


def format_rate(value_hz: float | None) -> str:
    """Format a rate in messages per second; None is shown as `UNKNOWN`."""
    if value_hz is None:
        return UNKNOWN
    return f"{value_hz:.0f} /s" if value_hz >= 100 else f"{value_hz:.1f} /s"


def format_size(value: float | None, per: str = "") -> str:
    """Format a number of bytes with a unit, followed by `per`, such as "/s".

    Returns `UNKNOWN` if the number is None.
    """
    if value is None:
        return UNKNOWN
    for unit in ("B", "kB", "MB"):
        if value < 1000:
            digits = 0 if unit == "B" or value >= 100 else 1
            return f"{value:.{digits}f} {unit}{per}"
        value /= 1000
    return f"{value:.1f} GB{per}"


def format_bandwidth(topic: TopicInfo) -> str:
    """Format a topic's bandwidth; "not subscribed" if messages are not encoded for lack of subscribers."""
    if topic.rate_hz and not topic.bandwidth_Bps and not topic.subscribers:
        return _("not subscribed")
    return format_size(topic.bandwidth_Bps, "/s")


def format_rounded_duration(seconds: float) -> str:
    """Format a duration in the largest suitable unit."""
    if seconds < 60:
        return f"{max(seconds, 0):.0f} s"
    if seconds < 3600:
        return f"{seconds / 60:.0f} min"
    if seconds < 86400:
        return f"{seconds / 3600:.1f} h"
    return f"{seconds / 86400:.1f} d"
