"""`nep topic`: list, inspect, print, measure and publish topics."""

from __future__ import annotations

from dataclasses import asdict

import typer

from nep.cli.echo import echo
from nep.cli.hz_bw import bw, delay, hz
from nep.cli.network import BackendOption, query_graph
from nep.cli.options import JsonOption, MasterOption
from nep.cli.publish import publish
from nep.cli.screen import (
    UNKNOWN,
    TextColumn,
    format_bandwidth,
    format_rate,
    print_status,
    show_alerts,
    show_json,
    show_table,
)
from nep.cli.topic_info import find, info, show_type
from nep.cli.typer_texts import TranslatedGroup
from nep.cli.values import convert_ids_to_text
from nep.i18n import _, lazy
from nep.protocol.graph_view import GraphView, TopicInfo
from nep.text import escaped

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup,
    no_args_is_help=True,
    help=_("List topics, print or measure their messages, and publish to them."),
)
app.command("echo")(echo)
app.command("pub")(publish)
app.command("hz")(hz)
app.command("bw")(bw)
app.command("delay")(delay)
app.command("info")(info)
app.command("type")(show_type)
app.command("find")(find)
_COLUMNS = (
    TextColumn(lazy("topic"), style="bold", is_folded_last=True),
    TextColumn(lazy("type")),
    TextColumn(lazy("publishers"), style="green"),
    TextColumn(lazy("subscribers"), style="cyan"),
    TextColumn(lazy("rate"), "right"),
    TextColumn(lazy("bandwidth"), "right"),
    TextColumn(lazy("lost"), "right"),
)


@app.command("list")
def list_topics(
    master: MasterOption = None, backend: BackendOption = None, as_json: JsonOption = False
) -> None:
    """List topics with their publishers, subscribers and rates."""
    graph = query_graph(master, backend)
    topics = [graph.topics[name] for name in sorted(graph.topics)]
    if as_json:
        show_json(convert_ids_to_text([asdict(topic) for topic in topics]))
        return
    if topics:
        show_table(_COLUMNS, [_row(graph, topic) for topic in topics])
    else:
        print_status(_("no topics; start a program that publishes or subscribes"))
    show_alerts(graph.alerts)


def _row(graph: GraphView, topic: TopicInfo) -> tuple[str, ...]:
    return (
        escaped(topic.name),
        escaped(topic.msg_type),
        _node_names(graph, [each.node_id for each in topic.publishers]),
        _node_names(graph, [each.node_id for each in topic.subscribers]),
        format_rate(topic.rate_hz),
        format_bandwidth(topic),
        UNKNOWN if topic.lost is None else str(topic.lost),
    )


def _node_names(graph: GraphView, node_ids: list[str]) -> str:
    nodes = [graph.nodes[each] for each in node_ids if each in graph.nodes]
    has_originals = any(node.generation not in {"native", "gateway"} for node in nodes)
    names = [node.name for node in nodes if not (has_originals and node.generation == "gateway")]
    return "\n".join(dict.fromkeys(map(escaped, names))) or UNKNOWN
