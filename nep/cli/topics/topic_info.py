"""`nep topic info`, `type` and `find`: details and type of a topic, and topics with a given type."""

from __future__ import annotations

from typing import Annotated

import typer

from nep.cli.complete import complete_topic, complete_type
from nep.cli.graph_text import count_text, node_text, plain_with_names
from nep.cli.network import BackendOption, query_graph
from nep.cli.options import JsonOption, MasterOption
from nep.cli.screen import (
    UNKNOWN,
    TextColumn,
    format_bandwidth,
    format_rate,
    format_size,
    print_status,
    show_alerts,
    show_json,
    show_table,
    write,
)
from nep.cli.topics.topic_wait import suggestion
from nep.cli.values import convert_ids_to_text
from nep.errors import NepError
from nep.i18n import _, lazy
from nep.protocol.graph_view import GraphView, TopicInfo
from nep.protocol.wire import check_topic
from nep.text import escaped

TopicArgument = Annotated[
    str,
    typer.Argument(
        metavar=_("TOPIC"),
        help=_("Topic to inspect."),
        show_default=False,
        autocompletion=complete_topic,
    ),
]
TypeArgument = Annotated[
    str,
    typer.Argument(
        metavar=_("TYPE"), help=_("Type to search for."), show_default=False, autocompletion=complete_type
    ),
]
_COLUMNS = (
    TextColumn(lazy("node"), style="bold", is_folded_last=True),
    TextColumn(lazy("role")),
    TextColumn(lazy("messages"), "right"),
    TextColumn(lazy("rate"), "right"),
    TextColumn(lazy("bandwidth"), "right"),
    TextColumn(lazy("lost"), "right"),
)


def info(
    topic: TopicArgument,
    master: MasterOption = None,
    backend: BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print information about a topic: its type, publishers and subscribers."""
    graph = query_graph(master, backend)
    topic_info = _find_topic(topic, graph)
    if as_json:
        show_json(convert_ids_to_text(plain_with_names(graph, topic_info, "publishers", "subscribers")))
        return
    is_latched = any(each.latched for each in topic_info.publishers)
    for heading, value in (
        (_("topic"), escaped(topic_info.name)),
        (_("type"), escaped(topic_info.msg_type)),
        (_("codec"), escaped(topic_info.codec)),
        (_("latched"), _("yes") if is_latched else _("no")),
        (_("rate"), format_rate(topic_info.rate_hz)),
        (_("bandwidth"), format_bandwidth(topic_info)),
        (_("lost"), count_text(topic_info.lost)),
    ):
        write(f"{heading}: {value}\n")
    write("\n")
    show_table(_COLUMNS, _rows(graph, topic_info))
    show_alerts(each for each in graph.alerts if each.id.partition(":")[2] == topic)


def show_type(
    topic: TopicArgument,
    master: MasterOption = None,
    backend: BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print the type of a topic."""
    topic_info = _find_topic(topic, query_graph(master, backend))
    if as_json:
        show_json({"topic": topic_info.name, "msg_type": topic_info.msg_type, "codec": topic_info.codec})
    else:
        write(f"{escaped(topic_info.msg_type)}\n")


def find(
    msg_type: TypeArgument,
    master: MasterOption = None,
    backend: BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """List topics of a type."""
    graph = query_graph(master, backend)
    names = sorted(name for name, each in graph.topics.items() if each.msg_type == msg_type)
    if as_json:
        show_json(names)
    elif names:
        write("".join(f"{escaped(name)}\n" for name in names))
    else:
        types = sorted({each.msg_type for each in graph.topics.values()})
        template = _("no topic has the type '{msg_type}'; {meant}'nep topic list' shows all types")
        print_status(template.format(msg_type=msg_type, meant=suggestion(msg_type, types)))


def _find_topic(topic: str, graph: GraphView) -> TopicInfo:
    topic_info = graph.topics.get(check_topic(topic))
    if topic_info is None and topic in graph.patterns:
        template = _(
            "'{topic}' is a pattern, not a topic; 'nep node list' shows the nodes that subscribe to it"
        )
        raise NepError(template.format(topic=topic))
    if topic_info is None:
        template = _("no topic '{topic}'; {meant}'nep topic list' shows all topics")
        raise NepError(template.format(topic=topic, meant=suggestion(topic, list(graph.topics))))
    return topic_info


def _rows(graph: GraphView, topic: TopicInfo) -> list[tuple[str, ...]]:
    publishers = [
        (
            node_text(graph, each.node_id),
            _("publishes"),
            str(each.count),
            format_rate(each.rate_hz),
            format_size(each.bandwidth_Bps, "/s"),
            UNKNOWN,
        )
        for each in topic.publishers
    ]
    subscribers = [
        (
            node_text(graph, each.node_id),
            _("subscribes"),
            count_text(each.received),
            UNKNOWN,
            UNKNOWN,
            count_text(each.lost),
        )
        for each in topic.subscribers
    ]
    return [*sorted(publishers), *sorted(subscribers)]
