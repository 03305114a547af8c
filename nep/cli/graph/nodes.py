"""`nep node`: list and inspect running nodes."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from nep.cli.complete import complete_node
from nep.cli.network import BackendOption, query_graph
from nep.cli.options import JsonOption, MasterOption
from nep.cli.screen import (
    UNKNOWN,
    TextColumn,
    format_rounded_duration,
    print_status,
    show_alerts,
    show_json,
    show_table,
    write,
)
from nep.cli.topics.topic_wait import suggestion
from nep.cli.typer_texts import TranslatedGroup
from nep.cli.values import service_type_text
from nep.errors import NepError
from nep.i18n import _, lazy
from nep.protocol.graph_view import GraphView, NodeInfo, to_plain
from nep.text import escaped, quotable

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup, no_args_is_help=True, help=_("List the running nodes and inspect one.")
)
_COLUMNS = (
    TextColumn(lazy("node"), style="bold", is_folded_last=True),
    TextColumn(lazy("language")),
    TextColumn(lazy("wire")),
    TextColumn(lazy("pid"), "right"),
    TextColumn(lazy("since"), "right"),
    TextColumn(lazy("cpu"), "right"),
    TextColumn(lazy("publishes"), style="green"),
    TextColumn(lazy("subscribes"), style="cyan"),
)
_SERVICE_COLUMNS = (
    TextColumn(lazy("serves"), style="green"),
    TextColumn(lazy("calls"), style="cyan"),
)
"""Columns that are added if there are services."""
_WIRE_NAMES = {
    "native": lazy("native"),
    "A": "NEP ≤ 0.5.4.5",
    "B": "NEP 0.5.4.8",
    "0.5.4.6": lazy("0.5.4.6 (not supported)"),
    "0.5.4.7": lazy("0.5.4.7 (not supported)"),
}


@app.command("list")
def list_nodes(
    master: MasterOption = None, backend: BackendOption = None, as_json: JsonOption = False
) -> None:
    """List nodes with their topics and services."""
    graph = query_graph(master, backend)
    nodes = sorted(graph.nodes.values(), key=lambda node: (node.generation != "native", node.name, node.id))
    if as_json:
        show_json(
            [{**to_plain(node), **_topics_of(graph, node), **_services_of(graph, node)} for node in nodes]
        )
        return
    if nodes and graph.services:
        rows = [(*_row(graph, node), *_service_cells(graph, node)) for node in nodes]
        show_table((*_COLUMNS, *_SERVICE_COLUMNS), rows)
    elif nodes:
        show_table(_COLUMNS, [_row(graph, node) for node in nodes])
    else:
        print_status(_("no nodes; start a program that creates one"))
    show_alerts(graph.alerts)


@app.command("info")
def info(
    node: Annotated[
        str,
        typer.Argument(
            metavar=_("NODE"),
            help=_("Name or id of the node."),
            show_default=False,
            autocompletion=complete_node,
        ),
    ],
    master: MasterOption = None,
    backend: BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print information about a node: its program, and its topics and services with their types."""
    graph = query_graph(master, backend)
    matching_nodes = [
        node_info for node_info in graph.nodes.values() if node in {node_info.name, node_info.id}
    ]
    if not matching_nodes:
        message = _("no node '{node}'; {meant}'nep node list' shows all nodes")
        hint = suggestion(node, [node_info.name for node_info in graph.nodes.values()])
        raise NepError(message.format(node=quotable(node), meant=hint))
    matching_nodes.sort(key=lambda each: each.id)
    if as_json:
        show_json([_record(graph, node_info) for node_info in matching_nodes])
        return
    for number, node_info in enumerate(matching_nodes):
        write(("\n" if number else "") + _description(graph, node_info))
    show_alerts(alert for alert in graph.alerts if alert.id.partition(":")[2] == node)


def _record(graph: GraphView, node: NodeInfo) -> dict[str, object]:
    topics = {
        role: {name: _topic_type(graph, name) for name in names}
        for role, names in _topics_of(graph, node).items()
    }
    services = {
        role: {name: graph.services[name].msg_type for name in names}
        for role, names in _services_of(graph, node).items()
    }
    return {**to_plain(node), **topics, **services}


def _description(graph: GraphView, node: NodeInfo) -> str:
    language, wire, pid, since, cpu = _row(graph, node)[1:6]
    properties = (
        (_("node"), escaped(node.name)),
        (_("id"), node.id),
        (_("computer"), escaped(node.host) or UNKNOWN),
        (_("pid"), pid),
        (_("language"), language),
        (_("wire"), wire),
        (_("since"), since),
        (_("cpu"), cpu),
    )
    topics, services = _topics_of(graph, node), _services_of(graph, node)
    sections = (
        (_("publishes"), [(name, escaped(_topic_type(graph, name))) for name in topics["publishes"]]),
        (_("subscribes"), [(name, escaped(_topic_type(graph, name))) for name in topics["subscribes"]]),
        (_("serves"), [(name, service_type_text(graph.services[name])) for name in services["serves"]]),
        (_("calls"), [(name, service_type_text(graph.services[name])) for name in services["calls"]]),
    )
    lines = [f"{heading}: {value}" for heading, value in properties]
    for heading, entries in sections:
        lines.append(f"{heading}:" if entries else f"{heading}: {UNKNOWN}")
        lines += [f"  {escaped(name)}: {kind}" for name, kind in entries]
    return "".join(f"{line}\n" for line in lines)


def _topic_type(graph: GraphView, name: str) -> str:
    topic_info = graph.topics.get(name) or graph.patterns.get(name)
    return topic_info.msg_type if topic_info is not None else ""


def _row(graph: GraphView, node: NodeInfo) -> tuple[str, ...]:
    topics = _topics_of(graph, node)
    return (
        escaped(node.name),
        escaped(node.language) or UNKNOWN,
        escaped(_(wire) if (wire := _WIRE_NAMES.get(node.generation)) else node.generation),
        str(node.pid) if node.pid is not None else UNKNOWN,
        format_rounded_duration(time.time() - node.since_ns / 1e9) if node.since_ns else UNKNOWN,
        UNKNOWN if node.cpu_ratio is None else f"{100 * node.cpu_ratio:.0f} %",
        "\n".join(map(escaped, topics["publishes"])) or UNKNOWN,
        "\n".join(map(escaped, topics["subscribes"])) or UNKNOWN,
    )


def _topics_of(graph: GraphView, node: NodeInfo) -> dict[str, list[str]]:
    topics = graph.topics.values()
    subscribed = [
        each.name for each in topics if any(endpoint.node_id == node.id for endpoint in each.subscribers)
    ]
    patterns = graph.patterns.values()
    subscribed += [
        each.name for each in patterns if any(endpoint.node_id == node.id for endpoint in each.subscribers)
    ]
    return {
        "publishes": [
            each.name for each in topics if any(endpoint.node_id == node.id for endpoint in each.publishers)
        ],
        "subscribes": sorted(set(subscribed)),
    }


def _service_cells(graph: GraphView, node: NodeInfo) -> tuple[str, ...]:
    services = _services_of(graph, node)
    return tuple("\n".join(map(escaped, services[role])) or UNKNOWN for role in ("serves", "calls"))


def _services_of(graph: GraphView, node: NodeInfo) -> dict[str, list[str]]:
    services = graph.services.values()
    return {
        "serves": [
            each.name for each in services if any(endpoint.node_id == node.id for endpoint in each.servers)
        ],
        "calls": [
            each.name for each in services if any(endpoint.node_id == node.id for endpoint in each.clients)
        ],
    }
