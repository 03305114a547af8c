"""`nep top`: live table of all topics and nodes."""

from __future__ import annotations

import enum
import itertools
import math
import shutil
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import interrupts
from nep.cli.options import JsonOption, MasterOption
from nep.cli.screen import (
    UNKNOWN,
    TextColumn,
    console,
    format_bandwidth,
    format_rate,
    format_rounded_duration,
    format_size,
    print_status,
    show_json,
    show_table,
    write,
)
from nep.cli.values import convert_ids_to_text
from nep.errors import NepError
from nep.i18n import _, lazy, ngettext
from nep.masters.process import view
from nep.protocol.graph_view import GraphView, NodeInfo, TopicInfo
from nep.protocol.topic_glob import glob_matches, is_glob
from nep.text import escaped, shortened

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.live import Live


_WAIT_SLICE_S = 0.1
_MAX_NAMES_LENGTH = 40
_FRAME_LINES = 6
"""Number of terminal lines that are not rows: two headings with rules, the summary, and a spare line."""
_MAX_NOTES = 3
"""Maximum number of problems and alerts shown above the tables."""
_NODE_ROWS_DIVISOR = 3
"""Divisor for the rows reserved for nodes: a third of all rows, plus rows that topics don't need."""


class TopicOrder(str, enum.Enum):
    """Sort order of topics: by a value, largest first, or by name."""

    RATE = "rate"
    BANDWIDTH = "bandwidth"
    LOST = "lost"
    NAME = "name"


_TOPIC_COLUMNS = (
    TextColumn(lazy("topic"), style="bold", is_folded_last=True),
    TextColumn(lazy("type")),
    TextColumn(lazy("publishers"), style="green"),
    TextColumn(lazy("rate"), "right"),
    TextColumn(lazy("bandwidth"), "right"),
    TextColumn(lazy("subscribers"), "right"),
    TextColumn(lazy("lost"), "right"),
)
_NODE_COLUMNS = (
    TextColumn(lazy("node"), style="bold", is_folded_last=True),
    TextColumn(lazy("computer")),
    TextColumn(lazy("pid"), "right"),
    TextColumn(lazy("language")),
    TextColumn(lazy("cpu"), "right"),
    TextColumn(lazy("publishes"), "right"),
    TextColumn(lazy("since"), "right"),
)


def top(
    pattern: Annotated[
        str,
        typer.Argument(
            metavar=_("PATTERN"),
            help=_(
                "Show only topics that match a pattern such as '/robot/**', or whose name contains this text."
            ),
            show_default=False,
        ),
    ] = "",
    order: Annotated[
        TopicOrder, typer.Option("--sort", help=_("Sort topics by this column."), case_sensitive=False)
    ] = TopicOrder.RATE,
    every_s: Annotated[
        float,
        typer.Option(
            "--every", min=0.2, max=3600.0, metavar=_("SECONDS"), help=_("Interval between updates.")
        ),
    ] = 1.0,
    count: Annotated[
        int, typer.Option("--count", "-n", min=0, metavar="N", help=_("Exit after N tables (0: never)."))
    ] = 0,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show a live table of all topics and nodes, updated every second until Ctrl+C.

    The values are those that publishers and subscribers report to the master; no topic is subscribed to.
    Files and pipes get one table after another. If the master goes down, the command waits for it.
    """
    graph = view(master)  # fail at once: the address may be wrong
    printer = _GraphPrinter(pattern, order)
    show: Callable[[GraphView, str], None]
    with _open_screen(as_json=as_json) as live:
        if as_json:
            show = printer.show_json
        elif live is None:
            show = printer.show_plain
        else:
            show = _LiveTables(printer, live).show
        _run(graph, show, every_s, count, master)


def _run(
    graph: GraphView, show: Callable[[GraphView, str], None], every_s: float, count: int, master: str | None
) -> None:
    never, started, problem = threading.Event(), time.monotonic(), ""
    for number in itertools.count(1):
        show(graph, problem)
        if number == count:
            return
        due = started + number * every_s
        if due < time.monotonic() - every_s:  # suspended computer or slow master
            started, due = time.monotonic() - number * every_s, time.monotonic()
        while (remaining_s := due - time.monotonic()) > 0:
            never.wait(
                min(remaining_s, _WAIT_SLICE_S)
            )  # in slices: Ctrl+C does not interrupt a wait on Windows
        try:
            graph, problem = view(master), ""
        except NepError as error:  # keep showing the last figures, below the reason
            problem = str(error)


def _open_screen(*, as_json: bool) -> AbstractContextManager[Live | None]:
    if as_json or not sys.stdout.isatty():
        return nullcontext(None)
    from rich.live import Live  # noqa: PLC0415 - only a terminal needs it

    interrupts.exit_on_termination()  # exit through cleanup, which restores the terminal
    out: Console = console()
    out.soft_wrap = False
    return Live(console=out, screen=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)


# ---- output


def _sort_key(value: float | None) -> float:
    return -1.0 if value is None or math.isnan(value) else value


def _matches(name: str, pattern: str) -> bool:
    return glob_matches(pattern, name) if is_glob(pattern) else pattern.casefold() in name.casefold()


def topic_rows(graph: GraphView, pattern: str = "", order: TopicOrder = TopicOrder.RATE) -> list[TopicInfo]:
    """Return the topics whose names match `pattern`, sorted by `order` and then by name."""
    matching = sorted(
        (topic for topic in graph.topics.values() if _matches(topic.name, pattern)),
        key=lambda each: each.name,
    )
    sort_values: Mapping[TopicOrder, Callable[[TopicInfo], float | None]] = {
        TopicOrder.RATE: lambda each: each.rate_hz,
        TopicOrder.BANDWIDTH: lambda each: each.bandwidth_Bps,
        TopicOrder.LOST: lambda each: each.lost,
    }
    if order in sort_values:
        matching.sort(key=lambda each: _sort_key(sort_values[order](each)), reverse=True)
    return matching


def node_rows(graph: GraphView) -> list[tuple[NodeInfo, float | None]]:
    """Return the nodes and their total publishing rates in Hz, sorted by decreasing CPU usage."""
    rates_hz: dict[str, float] = {}
    for topic in graph.topics.values():
        for publisher in topic.publishers:
            if publisher.rate_hz is not None:
                rates_hz[publisher.node_id] = rates_hz.get(publisher.node_id, 0.0) + publisher.rate_hz
    nodes = sorted(graph.nodes.values(), key=lambda node: (-_sort_key(node.cpu_ratio), node.name, node.id))
    return [(node, rates_hz.get(node.id)) for node in nodes]


@dataclass
class _GraphPrinter:
    """Printer of filtered graph snapshots as JSON or plain tables."""

    pattern: str
    order: TopicOrder

    def show_json(self, graph: GraphView, problem: str) -> None:
        if problem:
            print_status(problem)
            return
        plain_graph = graph.to_plain()
        names = {topic.name for topic in topic_rows(graph, self.pattern)}
        topics = [each for each in plain_graph["topics"] if each["name"] in names]  # type: ignore[attr-defined]  # a list
        record = {
            "stamp_ns": time.time_ns(),
            "topics": topics,
            "nodes": plain_graph["nodes"],
            "alerts": plain_graph["alerts"],
        }
        show_json(convert_ids_to_text(record))

    def show_plain(self, graph: GraphView, problem: str) -> None:
        if problem:
            print_status(problem)
            return
        write(f"{self.summary(graph)}\n")
        topics = topic_rows(graph, self.pattern, self.order)
        show_table(_TOPIC_COLUMNS, [self.topic_cells(graph, each) for each in topics])
        write("\n")
        show_table(_NODE_COLUMNS, [self.node_cells(*each) for each in node_rows(graph)])
        write("\n")

    def summary(self, graph: GraphView) -> str:
        rates = [each.rate_hz for each in graph.topics.values() if each.rate_hz is not None]
        bandwidths = [each.bandwidth_Bps for each in graph.topics.values() if each.bandwidth_Bps is not None]
        lost = [each.lost for each in graph.topics.values() if each.lost is not None]
        parts = [
            ngettext("{count} node", "{count} nodes", len(graph.nodes)).format(count=len(graph.nodes)),
            ngettext("{count} topic", "{count} topics", len(graph.topics)).format(count=len(graph.topics)),
            format_rate(sum(rates) if rates else None),
            format_size(sum(bandwidths) if bandwidths else None, "/s"),
            ngettext("{count} lost", "{count} lost", sum(lost)).format(count=sum(lost)) if lost else "",
        ]
        return " · ".join(part for part in parts if part)

    def topic_cells(self, graph: GraphView, topic: TopicInfo) -> tuple[str, ...]:
        names = [graph.nodes[each.node_id].name for each in topic.publishers if each.node_id in graph.nodes]
        return (
            escaped(topic.name),
            escaped(topic.msg_type),
            shortened(escaped(", ".join(dict.fromkeys(names))), _MAX_NAMES_LENGTH) or UNKNOWN,
            format_rate(topic.rate_hz),
            format_bandwidth(topic),
            str(len(topic.subscribers)),
            UNKNOWN if topic.lost is None else str(topic.lost),
        )

    def node_cells(self, node: NodeInfo, published_hz: float | None) -> tuple[str, ...]:
        return (
            escaped(node.name),
            escaped(node.host) or UNKNOWN,
            UNKNOWN if node.pid is None else str(node.pid),
            escaped(node.language) or UNKNOWN,
            UNKNOWN if node.cpu_ratio is None else f"{100 * node.cpu_ratio:.0f} %",
            format_rate(published_hz),
            format_rounded_duration(time.time() - node.since_ns / 1e9) if node.since_ns else UNKNOWN,
        )


class _LiveTables:
    """Full-screen tables, truncated to the terminal's height. Loss counts that have increased are yellow."""

    def __init__(self, printer: _GraphPrinter, live: Live) -> None:
        self._printer, self._live = printer, live
        self._lost: dict[str, int] = {}

    def show(self, graph: GraphView, problem: str) -> None:
        from rich.console import Group  # noqa: PLC0415 - only a terminal needs it
        from rich.text import Text  # noqa: PLC0415

        topics, nodes = topic_rows(graph, self._printer.pattern, self._printer.order), node_rows(graph)
        notes = [Text(f"! {problem}", "yellow")] if problem else []
        notes += [Text(f"! {escaped(alert.sentence)}", "yellow", no_wrap=True) for alert in graph.alerts]
        max_rows = max(2, shutil.get_terminal_size().lines - _FRAME_LINES - len(notes[:_MAX_NOTES]))
        max_nodes = max(min(len(nodes), max_rows // _NODE_ROWS_DIVISOR), max_rows - len(topics))
        shown_topics, shown_nodes = topics[: max_rows - min(len(nodes), max_nodes)], nodes[:max_nodes]
        parts: list[RenderableType] = [Text(self._printer.summary(graph), "dim", no_wrap=True)]
        parts += notes[:_MAX_NOTES]
        rows = [self._printer.topic_cells(graph, each) for each in shown_topics]
        rows_with_losses = {
            index
            for index, each in enumerate(shown_topics)
            if (each.lost or 0) > self._lost.get(each.name, each.lost or 0)
        }
        parts.append(_create_table(_TOPIC_COLUMNS, rows, len(topics) - len(shown_topics), rows_with_losses))
        rows = [self._printer.node_cells(*each) for each in shown_nodes]
        parts.append(_create_table(_NODE_COLUMNS, rows, len(nodes) - len(shown_nodes), set()))
        self._lost = {each.name: each.lost for each in topics if each.lost is not None}
        self._live.update(Group(*parts), refresh=True)


def _create_table(
    columns: Sequence[TextColumn],
    rows: Sequence[Sequence[str]],
    hidden_count: int,
    rows_with_losses: set[int],
) -> RenderableType:
    from rich import box  # noqa: PLC0415 - only a terminal needs it
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, show_edge=False)
    for number, column in enumerate(columns):
        heading = (
            _(column.heading) if number or hidden_count <= 0 else f"{_(column.heading)} (+{hidden_count})"
        )
        is_number = column.justify == "right"
        table.add_column(
            heading, justify=column.justify, style=column.style, no_wrap=True,
            overflow="ellipsis", min_width=len(heading) if is_number else None,
        )  # fmt: skip
    for index, row in enumerate(rows):
        texts = [Text(cell, style="dim" if cell == UNKNOWN else "") for cell in row]
        if index in rows_with_losses:
            texts[-1].stylize("yellow bold")
        table.add_row(*texts)
    return table
