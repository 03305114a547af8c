"""Texts of nodes, groups and lines in the graph, and the line widths."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from app.core.graph.node_graph import BRIDGE_SEPARATOR, WEB_GROUP, DrawnNode, GraphGroup, GraphLine, NodeGraph
from app.core.network.topics import Topic, key_of, split_key
from app.core.networks.kinds import find_kind
from app.ui.text.nodes import cpu_text, generation_text
from app.ui.text.numbers import group_digits
from nep.i18n import _, ngettext, number, pgettext

BRIDGE_PREFIX = "bridge-"
MAX_NAMED_TOPICS = 2
"""Maximum number of topic names in a line's label; further topics are counted."""
MIN_WIDTH, MAX_WIDTH, WIDTH_STEPS = 1.25, 3.0, 7
MIN_WIDTH_BPS, WIDTH_DECADES = 100.0, 5.0
"""Bandwidth of the thinnest lines, and the decades up to the thickest: 100 B/s to 10 MB/s."""
NODE_ICONS = {
    "studio": "app-window",
    "behaviour": "blocks",
    "robot": "bot",
    "bridge": "arrow-left-right",
    "original": "plug",
    "group": "boxes",
    "program": "box",
    "page": "globe",
}

FindTopic = Callable[[str], "Topic | None"]


@dataclass(frozen=True, slots=True)
class LineStats:
    """Label, width and losses of a line.

    Attributes:
        label: Label.
        width: Width of the line in px.
        losses: Box key and loss ratio (0 to 1) of each subscriber with losses.
    """

    label: str
    width: float
    losses: tuple[tuple[str, float], ...] = ()


def node_icon(node: DrawnNode) -> str:
    """Return the name of the icon for a node's kind."""
    if node.page is not None:
        return node.page.icon
    return "camera" if node.has_pictures and node.kind == "program" else NODE_ICONS[node.kind]


def node_name(node: DrawnNode, host: str) -> str:
    """Return the displayed name of a node or collapsed group.

    For a bridge, this is only the first part of its name, without the network at the other end.

    Args:
        node: Node or group.
        host: Name of this computer.
    """
    if node.kind == "group":
        return group_name(node.key, host)
    if node.bridged_network:  # the rest of the name is painted in the bridge's right part
        return node.name.removeprefix(BRIDGE_PREFIX).rpartition(BRIDGE_SEPARATOR)[0] or node.name
    return node.name


def node_detail(node: DrawnNode) -> str:
    """Return the second line in the box of a node; "" if nothing is known about the node.

    Examples are "Python, 4.1 %", "this window", "gone for 4 s" and "41 nodes".
    """
    entry = node.entry
    if entry is None:
        return _members_text(node.member_count, node.quiet_count)
    if entry.gone_s is not None:
        return _("gone for {seconds} s").format(seconds=int(entry.gone_s))
    if node.kind == "page":
        return node.page.location if node.page is not None else _("web page")
    if node.kind == "original":
        return generation_text(entry)
    cpu = cpu_text(entry.cpu_ratio)
    if node.kind == "studio":
        return _("this window")
    if node.kind == "bridge":
        return pgettext("node", "bridge")
    if node.kind == "behaviour":
        return behaviour_detail(cpu)
    return ", ".join(filter(None, (entry.language or _network_text(node), cpu)))


def behaviour_detail(cpu: str) -> str:
    """Return the second line in the box of a behaviour; `cpu` is its CPU use as text, or ""."""
    return ", ".join(filter(None, (_("behaviour"), cpu)))


def _network_text(node: DrawnNode) -> str:
    entry = node.entry
    return generation_text(entry) if entry is not None and entry.network else ""


def _members_text(members: int, quiet: int) -> str:
    text = ngettext("{count} node", "{count} nodes", members).format(count=group_digits(members))
    if quiet < members:
        return text
    return ngettext("{count} quiet node", "{count} quiet nodes", quiet).format(count=group_digits(quiet))


def quiet_text(group: GraphGroup) -> str:
    """Format the number of quiet nodes of a group, such as "3 quiet nodes"."""
    return ngettext("{count} quiet node", "{count} quiet nodes", group.quiet_count).format(
        count=group_digits(group.quiet_count)
    )


def counts_text(graph: NodeGraph) -> str:
    """Format the numbers of nodes, topics and services, such as "7 of 9 nodes, 13 topics".

    Return "" if there are no nodes.
    """
    node_count = graph.node_count
    if not node_count:
        return ""
    shown_count = node_count - graph.hidden_quiet_count
    nodes = ngettext("{shown} of {count} node", "{shown} of {count} nodes", node_count)
    if shown_count == node_count:
        nodes = ngettext("{count} node", "{count} nodes", node_count)
    parts = [nodes.format(shown=group_digits(shown_count), count=group_digits(node_count))]
    if graph.page_count:
        pages = ngettext("{count} of them a web page", "{count} of them web pages", graph.page_count)
        parts.append(pages.format(count=group_digits(graph.page_count)))
    topics = ngettext("{count} topic", "{count} topics", graph.topic_count)
    parts.append(topics.format(count=group_digits(graph.topic_count)))
    if graph.service_count:
        services = ngettext("{count} service", "{count} services", graph.service_count)
        parts.append(services.format(count=group_digits(graph.service_count)))
    return ", ".join(parts)


def group_note(group: GraphGroup) -> str:
    """Return the note next to a group's name: the address of its computer, or the number of web pages."""
    return group_digits(group.member_count) if group.key == WEB_GROUP else group.address


def group_name(key: str, host: str) -> str:
    """Return the displayed name of a group; `host` is the name of this computer."""
    kind, _colon, name = key.partition(":")
    if kind == "network":
        network_kind = find_kind(name)
        return network_kind.product_name if network_kind is not None else name
    if kind == "web":
        return _("Web pages")
    if kind == "robot":
        return name or _("No robot")
    return _("This computer") if name == host else name or _("Unknown computer")


def line_stats(
    line: GraphLine, topic_of: FindTopic, call_rates_hz: Mapping[str, float], box_of: Callable[[str], str]
) -> LineStats:
    """Return label, width and losses of a line.

    Args:
        line: Line to describe.
        topic_of: Returns a topic by key, or None.
        call_rates_hz: Calls per second, by name of the service; may be incomplete.
        box_of: Returns the key of the box that shows a node, or "" if the node is not drawn.
    """
    names = line_name(line.topics)
    if line.kind == "service":
        rates_hz = [call_rates_hz[name] for name in line.topics if name in call_rates_hz]
        return LineStats(f"{names} {short_rate(sum(rates_hz))}" if rates_hz else names, MIN_WIDTH)
    topics = [topic for name in line.topics if (topic := topic_of(name)) is not None]
    rates = [hz for topic in topics if (hz := finite_or_none(topic.rate_hz)) is not None]
    rate = short_rate(sum(rates)) if rates else ""
    bandwidth = sum(finite_or_none(topic.bandwidth_Bps) or 0.0 for topic in topics)
    return LineStats(f"{names} {rate}".rstrip(), line_width(bandwidth), _losses(topics, box_of))


def _losses(topics: Sequence[Topic], box_of: Callable[[str], str]) -> tuple[tuple[str, float], ...]:
    # The worst loss ratio of the line's topics, for each subscriber.
    loss_by_box: dict[str, float] = {}
    for topic in topics:
        for subscriber in topic.info.subscribers if topic.info is not None else ():
            box = box_of(key_of(topic.network, subscriber.node_id)) if subscriber.lost else ""
            if box and subscriber.lost:
                ratio = subscriber.lost / (subscriber.lost + max(0, subscriber.received or 0))
                loss_by_box[box] = max(loss_by_box.get(box, 0.0), ratio)
    return tuple(sorted(loss_by_box.items()))


def finite_or_none(value: float | None) -> float | None:
    """Return the value if it is finite, else None."""
    return value if value is not None and math.isfinite(value) else None


def line_name(topics: Sequence[str]) -> str:
    """Return the names of a line's first topics, and the number of further topics.

    At most `MAX_NAMED_TOPICS` topics are named, for example "/scan /odom and 3 more".
    """
    names = " ".join(split_key(topic)[1] for topic in topics[:MAX_NAMED_TOPICS])
    omitted_count = len(topics) - MAX_NAMED_TOPICS
    return (
        _("{names} and {count} more").format(names=names, count=omitted_count) if omitted_count > 0 else names
    )


def short_rate(rate_hz: float) -> str:
    """Format a rate such as "52/s", "0.5/s" or "2/min"; rates below 0.5 per minute are "0/s"."""
    if rate_hz >= 9.95:
        return f"{group_digits(round(rate_hz))}/s"
    if rate_hz >= 0.095:
        return f"{number(rate_hz, '.1f')}/s"
    return f"{round(rate_hz * 60)}/min" if rate_hz * 60 >= 0.5 else "0/s"


def line_width(bytes_per_s: float) -> float:
    """Return the line width in px for a bandwidth.

    Widths have few steps, so that small changes of the bandwidth cause no repaint.
    """
    if not bytes_per_s > MIN_WIDTH_BPS:
        return MIN_WIDTH
    ratio = min(1.0, math.log10(bytes_per_s / MIN_WIDTH_BPS) / WIDTH_DECADES)
    return MIN_WIDTH + (MAX_WIDTH - MIN_WIDTH) * round(ratio * WIDTH_STEPS) / WIDTH_STEPS


def percent_text(ratio: float) -> str:
    """Format a ratio (0 to 1) as a percentage, such as "0.7 %" or "12 %"."""
    return number(ratio, ".1%").replace("%", " %")
