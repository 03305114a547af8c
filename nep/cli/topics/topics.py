"""`nep topic`: list, inspect, print, measure and publish topics."""

from __future__ import annotations

import typer

from nep.cli.graph_text import count_text, node_list
from nep.cli.network import BackendOption, query_graph
from nep.cli.options import JsonOption, MasterOption
from nep.cli.screen import (
    TextColumn,
    format_bandwidth,
    format_rate,
    print_status,
    show_alerts,
    show_json,
    show_table,
)
from nep.cli.topics.echo import echo
from nep.cli.topics.hz_bw import bw, delay, hz
from nep.cli.topics.publish import publish
from nep.cli.topics.topic_info import find, info, show_type
from nep.cli.typer_texts import TranslatedGroup
from nep.cli.values import convert_ids_to_text
from nep.i18n import _, lazy
from nep.protocol.graph_view import GraphView, TopicInfo, to_plain
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
        show_json(convert_ids_to_text([to_plain(topic) for topic in topics]))
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
        node_list(graph, (each.node_id for each in topic.publishers)),
        node_list(graph, (each.node_id for each in topic.subscribers)),
        format_rate(topic.rate_hz),
        format_bandwidth(topic),
        count_text(topic.lost),
    )
