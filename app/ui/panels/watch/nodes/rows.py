"""Rows of the nodes table: the nodes, and the topics below each expanded node."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace

from app.core.network.nodes import NodeEntry
from app.core.network.topics import key_of
from app.core.networks.kinds import find_kind
from app.ui.text.nodes import cpu_text, generation_text
from app.ui.text.numbers import age_text
from app.ui.widgets.table.model import Cell, Column, Order
from nep.i18n import _, lazy, pgettext, plazy
from nep.protocol.graph_view import BRIDGES_TOPIC
from nep.protocol.topic_pattern import is_pattern

PUBLISHES, SUBSCRIBES = lazy("publishes"), lazy("subscribes")
INDENT = 19
UNSUPPORTED_VERSIONS = frozenset({"0.5.4.6", "0.5.4.7"})
UNSUPPORTED_TEXT = lazy(
    "NEP {version} isn't supported: other versions can't decode its messages. Install 0.5.4.8 or 0.5.4.5."
)
ORIGINAL_LIMITS_TEXT = lazy(
    "A program that uses {nep}. It sends no sequence numbers or time stamps, so losses and "
    "message ages are unknown."
)
NETWORK_LIMITS_TEXT = lazy(
    "A node of {network}. This network doesn't report the process, start time and CPU use of nodes."
)
ORIGINAL_TEXT = lazy("original NEP")
BRIDGE_TEXT = lazy(
    "A bridge that forwards topics between this network and others. {topic} reports how many "
    "messages were forwarded and lost."
)
VERSION_TEXTS = {"A": lazy("original NEP up to 0.5.4.5"), "B": lazy("original NEP 0.5.4.8")}


@dataclass(frozen=True, slots=True)
class NodeRow:
    """Row of a node, or of one of its topics.

    Attributes:
        node: Node of the row.
        is_expanded: True if the node is expanded.
        direction: `PUBLISHES` or `SUBSCRIBES` for a topic; "" for a node.
        topic: Name of the topic; "" for a node.
        rate: Returns the formatted rate of a topic by key.
    """

    node: NodeEntry
    is_expanded: bool = False
    direction: str = ""
    topic: str = ""
    rate: Callable[[str], str] | None = None

    @property
    def key(self) -> str:
        """Key that identifies the row across updates of the table."""
        return f"{self.node.key} {self.direction} {self.topic}"

    @property
    def is_pattern(self) -> bool:
        """True for a subscription to a pattern instead of a single topic."""
        return self.direction == SUBSCRIBES and is_pattern(self.topic)

    @property
    def topic_key(self) -> str:
        """Key of the topic, including its network."""
        return key_of(self.node.network, self.topic)


def rows_of(
    nodes: Iterable[NodeEntry],
    expanded_keys: Collection[str],
    order: Order[NodeRow],
    rate: Callable[[str], str],
) -> list[NodeRow]:
    """Return the rows of the table, sorted.

    Args:
        nodes: Nodes to show.
        expanded_keys: Keys of expanded nodes, which are followed by the rows of their topics.
        order: Sort order of the nodes.
        rate: Returns the formatted rate of a topic by key.
    """
    rows: list[NodeRow] = []
    for row in order.sort([NodeRow(node, node.key in expanded_keys) for node in nodes]):
        rows.append(row)
        if row.is_expanded:
            node = row.node
            rows += [
                NodeRow(node, direction=PUBLISHES, topic=topic, rate=rate) for topic in node.published_topics
            ]
            rows += [
                NodeRow(node, direction=SUBSCRIBES, topic=topic, rate=rate)
                for topic in node.subscribed_topics
            ]
    return rows


def limits_text(node: NodeEntry) -> str:
    """Describe the limitations of an original program or of another network, or the purpose of a bridge.

    Return "" for all other native nodes, and for networks that report statistics.
    """
    kind = find_kind(node.network)
    if kind is not None:
        return "" if kind.reports_stats else _(NETWORK_LIMITS_TEXT).format(network=kind.product_name)
    if node.is_bridge:
        return _(BRIDGE_TEXT).format(topic=BRIDGES_TOPIC)
    if node.generation in UNSUPPORTED_VERSIONS:
        return _(UNSUPPORTED_TEXT).format(version=node.generation)
    if not node.is_original:
        return ""
    return _(ORIGINAL_LIMITS_TEXT).format(nep=_(VERSION_TEXTS.get(node.generation, ORIGINAL_TEXT)))


def no_parameters_reason(node: NodeEntry) -> str:
    """Return the reason why a node has no parameters.

    Return "" if the node has some, is gone, or is a program of the original NEP.
    """
    if node.has_parameters or node.is_original or node.gone_s is not None:
        return ""
    kind = find_kind(node.network)
    if kind is not None and not kind.reports_stats:
        return _("Parameters of nodes on {network} can't be read.").format(network=kind.product_name)
    return _("This node has no parameters. Programs declare them with {call}.").format(
        call="node.parameters.declare"
    )


def details_text(node: NodeEntry) -> str:
    """Format name, computer, process and start time of a node in one line.

    The line replaces columns that don't fit into a narrow table.
    """
    parts = [node.name]
    if node.host:
        is_local = node.host == platform.node()
        parts.append(_("on this computer") if is_local else _("on {host}").format(host=node.host))
    if node.pid is not None:
        parts.append(_("pid {number}").format(number=node.pid))
    if node.language:
        parts.append(node.language)
    if node.since_ns:
        clock = time.strftime("%H:%M:%S", time.localtime(node.since_ns / 1e9))
        parts.append(_("running since {clock}").format(clock=clock))
    return ", ".join(parts)


def _text_role(row: NodeRow, role: str) -> str:
    return role if row.node.gone_s is None and not row.node.is_stale else "textDisabled"


def name_cell(row: NodeRow) -> Cell:
    """Return the cell with a node's name and arrow, bold while the node is new; topics are indented."""
    is_gone = row.node.gone_s is not None
    if row.topic:
        return Cell(
            row.topic,
            role=_text_role(row, "text"),
            mono=True,
            is_struck_out=is_gone,
            indent=INDENT,
            elide_middle=True,
        )
    chip = pgettext("node", "new") if row.node.is_new and not is_gone else None
    icon = "chevron-down" if row.is_expanded else "chevron-right"
    return Cell(
        row.node.name, icon, _text_role(row, "text"), bold=bool(chip), is_struck_out=is_gone, chip=chip
    )


def generation_cell(row: NodeRow) -> Cell:
    """Return the cell with a node's kind (native, original, bridge), or a topic's direction and rate."""
    if row.topic:
        rate = row.rate(row.topic_key) if row.rate is not None and row.direction == PUBLISHES else ""
        text = _("publishes {rate}/s").format(rate=rate) if rate else _(row.direction)
        if row.is_pattern:
            text = _("all matching topics")
        return Cell(text, role=_text_role(row, "textTertiary"))
    if row.node.is_bridge:
        return Cell(pgettext("node", "bridge"), "arrow-left-right", _text_role(row, "textSecondary"))
    if row.node.generation in UNSUPPORTED_VERSIONS:
        return Cell(generation_text(row.node), "triangle-alert", _text_role(row, "warn"))
    icon = "plug" if row.node.is_original else "waypoints" if row.node.network else None
    return Cell(generation_text(row.node), icon, _text_role(row, "textSecondary"))


def cpu_cell(row: NodeRow) -> Cell:
    """Return the cell with a node's CPU load, the time since it left, or "not reported"; empty for topics."""
    kind = find_kind(row.node.network)
    if row.topic or row.node.gone_s is not None or kind is None or kind.reports_stats:
        return _node_cell(_cpu_text)(row)
    if row.node.cpu_ratio is not None:
        return _node_cell(_cpu_text)(row)
    return Cell(pgettext("figure", "not reported"), role=_text_role(row, "textTertiary"))


def _node_cell(cell: Callable[[NodeEntry], str], role: str = "text") -> Callable[[NodeRow], Cell]:
    return lambda row: Cell() if row.topic else Cell(cell(row.node), role=_text_role(row, role))


def _cpu_text(node: NodeEntry) -> str:
    return (
        cpu_text(node.cpu_ratio)
        if node.gone_s is None
        else _("gone for {seconds} s").format(seconds=int(node.gone_s))
    )


def _since_text(node: NodeEntry) -> str:
    if not node.since_ns or node.gone_s is not None:
        return ""
    return age_text(max(0.0, time.time() - node.since_ns / 1e9))


def _name_tip(row: NodeRow) -> str:
    if not row.topic:
        return details_text(row.node)
    if row.is_pattern:
        template = _("{node} subscribes to all topics that match {pattern}")
        return template.format(node=row.node.name, pattern=row.topic)
    template = (
        _("{node} publishes {topic}") if row.direction == PUBLISHES else _("{node} subscribes to {topic}")
    )
    return template.format(node=row.node.name, topic=row.topic)


def _generation_tip(row: NodeRow) -> str:
    if row.topic:
        return _name_tip(row)
    if row.node.network:
        return limits_text(row.node) or _("On {network}").format(network=generation_text(row.node))
    text = _("Uses nep: messages have sequence numbers and time stamps, and losses are counted")
    return limits_text(row.node) or text


def _cpu_tip(row: NodeRow) -> str:
    kind = find_kind(row.node.network)
    if kind is not None and row.node.cpu_ratio is None:
        return limits_text(row.node)
    return _("Share of one processor core used by the process in the last second")


COLUMNS: tuple[Column[NodeRow], ...] = (
    Column(
        "node", lazy("Node"), 108, name_cell,
        lambda r: r.node.name.casefold(), stretch=True, tip=_name_tip,
    ),
    Column(
        "generation", lazy("Kind"), 116, generation_cell,
        lambda r: (r.node.network, r.node.is_bridge, r.node.is_original, r.node.generation),
        tip=_generation_tip,
    ),
    Column(
        "language", plazy("of a program", "Language"), 78, _node_cell(lambda n: n.language, "textSecondary"),
        lambda r: r.node.language, hide_order=4,
    ),
    Column(
        "host", lazy("Host"), 110, _node_cell(lambda n: n.host, "textSecondary"),
        lambda r: r.node.host, hide_order=3,
    ),
    Column(
        "pid", lazy("PID"), 66, _node_cell(lambda n: str(n.pid) if n.pid is not None else ""),
        lambda r: r.node.pid, is_numeric=True, hide_order=5,
    ),
    Column("cpu", lazy("CPU"), 66, cpu_cell, lambda r: r.node.cpu_ratio, is_numeric=True, tip=_cpu_tip),
    Column(
        "publishes", lazy("Publishes"), 80, _node_cell(lambda n: str(len(n.published_topics))),
        lambda r: len(r.node.published_topics), is_numeric=True, hide_order=1,
    ),
    Column(
        "subscribes", lazy("Subscribes"), 86, _node_cell(lambda n: str(len(n.subscribed_topics))),
        lambda r: len(r.node.subscribed_topics), is_numeric=True, hide_order=2,
    ),
    Column(
        "since", lazy("Uptime"), 62, _node_cell(_since_text),
        lambda r: r.node.since_ns, is_numeric=True, hide_order=6,
    ),
)  # fmt: skip


def columns(is_own: Callable[[NodeEntry], bool]) -> tuple[Column[NodeRow], ...]:
    """Return the columns of the table.

    Args:
        is_own: Returns True for Studio's own nodes, which are never shown as new.
    """

    def node_name_cell(row: NodeRow) -> Cell:
        cell = name_cell(row)
        return replace(cell, bold=False, chip=None) if cell.chip and is_own(row.node) else cell

    return (replace(COLUMNS[0], cell=node_name_cell), *COLUMNS[1:])
