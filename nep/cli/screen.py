"""How the command line looks: tables for people, lines of JSON for programs, sentences for errors."""

from __future__ import annotations

import errno
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from typing import IO, TYPE_CHECKING, Literal, cast

from nep.cli.values import json_of
from nep.i18n import _
from nep.system.streams import tell
from nep.text import escaped

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

    from nep.protocol.graph_view import Alert, TopicInfo
    from nep.system.terminal import Terminal

_GAP = 3
_NARROWEST = 6
_LONG = 200
"""A table of more rows is laid out without rich."""
_ENDLESS = 10_000
UNKNOWN = "\N{EN DASH}"
"""What stands where nothing is known."""


@dataclass(frozen=True)
class TextColumn:
    """One column of a table: its head, its side, and how it is coloured."""

    head: str
    justify: Literal["left", "right"] = "left"
    style: str = ""
    is_whole: bool = False
    """Never folded, however narrow the terminal: others give way. Numbers never are."""


def console(*, stderr: bool = False, out: Terminal | None = None) -> Console:
    """A console for coloured text, on `out` if it is given; rich is loaded when the first one is made."""
    made = _console_class()
    return made(stderr=stderr, file=cast("IO[str] | None", out), highlight=False, soft_wrap=True)


@cache
def _console_class() -> type[Console]:
    from rich.console import Console  # noqa: PLC0415 - 40 ms that `--json` and `--help` need not wait for

    class OpenConsole(Console):
        """Tells of a reader that has left as every stream does."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError(errno.EPIPE, _("nobody reads the output any more"))

    return OpenConsole


def json_painter() -> Callable[[str, str], Text]:
    """A function that colours a message: its head dim, its body as JSON."""
    from rich.highlighter import JSONHighlighter  # noqa: PLC0415 - see `console`
    from rich.text import Text  # noqa: PLC0415

    highlight = JSONHighlighter()

    def paint(head: str, body: str) -> Text:
        painted = Text(body)
        highlight.highlight(painted)
        return Text.assemble((head, "dim"), "  ", painted)

    return paint


def show_table(columns: Sequence[TextColumn], rows: Iterable[Sequence[str]]) -> None:
    """A table on the standard output."""
    columns = [replace(column, head=_(column.head)) for column in columns]
    is_terminal = sys.stdout.isatty()  # else a file or a program: nothing to fold for
    room = shutil.get_terminal_size().columns if is_terminal else _ENDLESS
    lines = [[escaped(cell, lines=True) for cell in row] for row in rows]
    widths = _widths(columns, lines, room)
    if _total(widths) > room:
        write("".join(_blocks(columns, lines)))
        return
    if len(lines) > _LONG and _fit(lines, widths):
        sys.stdout.write("".join(f"{line}\n" for line in _laid_out(columns, lines, widths)))
        return
    from rich import box  # noqa: PLC0415 - see `console`
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    out = console()
    if not is_terminal:
        out.width = room
    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, show_edge=False)
    for column, width in zip(columns, widths, strict=True):
        table.add_column(
            column.head, justify=column.justify, style=column.style, overflow="fold", width=width
        )
    for row in lines:
        table.add_row(*(Text(cell, style="dim" if cell == UNKNOWN else "") for cell in row))
    out.print(table, soft_wrap=False)


def cells(text: str) -> int:
    """How many cells of a terminal a line takes: two for letters of the East and emoji, none for accents."""
    if text.isascii():
        return len(text)
    from rich.cells import cell_len  # noqa: PLC0415 - see `console`

    return cell_len(text)


def padded(text: str, width: int, justify: Literal["left", "right"] = "left") -> str:
    """The text with spaces, so that it takes `width` cells."""
    room = " " * (width - cells(text))
    return text + room if justify == "left" else room + text


def _total(widths: Sequence[int]) -> int:
    """How wide a table of these columns is."""
    return sum(widths) + _GAP * (len(widths) - 1)


def _blocks(columns: Sequence[TextColumn], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """The rows one below the other, for a terminal too narrow for a table; what is not known is left out."""
    for row in rows:
        yield f"{row[0]}\n"
        for column, cell in zip(columns[1:], row[1:], strict=True):
            if cell != UNKNOWN:
                yield f"  {column.head}: {', '.join(cell.splitlines())}\n"


def _fit(rows: Sequence[Sequence[str]], widths: Sequence[int]) -> bool:
    return all(
        cells(cell) <= width and "\n" not in cell
        for row in rows
        for cell, width in zip(row, widths, strict=True)
    )


def _laid_out(
    columns: Sequence[TextColumn], rows: Sequence[Sequence[str]], widths: Sequence[int]
) -> Iterator[str]:
    """The lines of a long table that needs no folding; rich takes a millisecond for each."""
    gap = " " * _GAP

    def line(texts: Iterable[str]) -> str:
        return gap.join(
            padded(text, width, column.justify)
            for column, text, width in zip(columns, texts, widths, strict=True)
        ).rstrip()

    yield line(column.head for column in columns)
    yield "─" * _total(widths)
    yield from map(line, rows)


def _widths(columns: Sequence[TextColumn], rows: Sequence[Sequence[str]], room: int) -> list[int]:
    """How wide each column may be: what it needs, or less where others than whole ones have to give way."""
    widths = [
        max(cells(line) for cell in (column.head, *(row[at] for row in rows)) for line in cell.split("\n"))
        for at, column in enumerate(columns)
    ]
    kept = [column.is_whole or column.justify == "right" for column in columns]
    while _total(widths) > room:
        giving = [at for at, width in enumerate(widths) if width > _NARROWEST and not kept[at]]
        giving = giving or [at for at, width in enumerate(widths) if width > _NARROWEST]
        if not giving:
            break
        widths[max(giving, key=lambda at: widths[at])] -= 1
    return widths


def show_alerts(alerts: Iterable[Alert], out: Terminal | None = None) -> None:
    """What is wrong at present, under a table."""
    from rich.text import Text  # noqa: PLC0415 - see `console`

    for alert in alerts:
        text = Text.assemble(("! ", "yellow bold"), (escaped(alert.sentence), "yellow"))
        if alert.hint:
            text.append(f"\n  {escaped(alert.hint)}", style="dim")
        with suppress(OSError):  # nobody reads it
            console(stderr=True, out=out).print(text)


def say(sentence: str, out: Terminal | None = None) -> None:
    """A sentence beside the results, on the standard error stream or `out`."""
    with suppress(OSError):  # nobody reads it
        console(stderr=True, out=out).print(escaped(sentence), style="dim", markup=False)


def say_error(sentence: str) -> None:
    """What went wrong, on the standard error stream."""
    tell(f"nep: {escaped(sentence, lines=True)}")  # no rich: it is shown at once and programs can read it


def write(text: str) -> None:
    """Text on the standard output, at once."""
    sys.stdout.write(text)
    sys.stdout.flush()


def show_json(value: object) -> None:
    """One JSON text on one line, at once: UTF-8, whatever the terminal has."""
    data = json_of(value) + b"\n"
    sys.stdout.flush()
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()


def rate(value_hz: float | None) -> str:
    """Messages a second."""
    if value_hz is None:
        return UNKNOWN
    return f"{value_hz:.0f} /s" if value_hz >= 100 else f"{value_hz:.1f} /s"


def size(value: float | None, per: str = "") -> str:
    """Bytes with a unit that leaves at most four digits; `per` such as "/s" follows it."""
    if value is None:
        return UNKNOWN
    for unit in ("B", "kB", "MB"):
        if value < 1000:
            digits = 0 if unit == "B" or value >= 100 else 1
            return f"{value:.{digits}f} {unit}{per}"
        value /= 1000
    return f"{value:.1f} GB{per}"


def bandwidth(topic: TopicInfo) -> str:
    """Bytes a second; messages that nobody subscribes are not encoded, so their size is unknown."""
    if topic.rate_hz and not topic.bandwidth_Bps and not topic.subscribers:
        return _("not subscribed")
    return size(topic.bandwidth_Bps, "/s")


def duration(seconds: float) -> str:
    """How long, in the unit that a person would say."""
    if seconds < 60:
        return f"{max(seconds, 0):.0f} s"
    if seconds < 3600:
        return f"{seconds / 60:.0f} min"
    if seconds < 86400:
        return f"{seconds / 3600:.1f} h"
    return f"{seconds / 86400:.1f} d"
