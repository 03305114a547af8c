"""`nep node`: the programs that are there."""

from __future__ import annotations

import time
from dataclasses import asdict

import typer

from nep.cli.options import JsonOption, MasterOption
from nep.cli.screen import UNKNOWN, TextColumn, duration, say, show_alerts, show_json, show_table
from nep.cli.typer_words import TranslatedGroup
from nep.i18n import _, lazy
from nep.masters.process import view
from nep.protocol.graph_view import GraphView, NodeInfo
from nep.text import escaped

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup, no_args_is_help=True, help=_("The programs that are there.")
)
_COLUMNS = (
    TextColumn(lazy("node"), style="bold", is_whole=True),
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
"""When there are services."""
_WIRES = {
    "native": lazy("native"),
    "A": "NEP ≤ 0.5.4.5",
    "B": "NEP 0.5.4.8",
    "0.5.4.6": lazy("0.5.4.6, not served"),
    "0.5.4.7": lazy("0.5.4.7, not served"),
}


@app.command("list")
def list_nodes(master: MasterOption = None, as_json: JsonOption = False) -> None:
    """List all nodes, with what they publish, subscribe, serve and call."""
    graph = view(master)
    nodes = sorted(graph.nodes.values(), key=lambda node: (node.generation != "native", node.name, node.id))
    if as_json:
        show_json(
            [{**asdict(node), **_topics_of(graph, node), **_services_of(graph, node)} for node in nodes]
        )
        return
    if nodes and graph.services:
        rows = [(*_row(graph, node), *_service_cells(graph, node)) for node in nodes]
        show_table((*_COLUMNS, *_SERVICE_COLUMNS), rows)
    elif nodes:
        show_table(_COLUMNS, [_row(graph, node) for node in nodes])
    else:
        say(_("no nodes yet; they appear as soon as a program makes one"))
    show_alerts(graph.alerts)


def _row(graph: GraphView, node: NodeInfo) -> tuple[str, ...]:
    topics = _topics_of(graph, node)
    return (
        escaped(node.name),
        escaped(node.language) or UNKNOWN,
        escaped(_(wire) if (wire := _WIRES.get(node.generation)) else node.generation),
        str(node.pid) if node.pid is not None else UNKNOWN,
        duration(time.time() - node.since_ns / 1e9) if node.since_ns else UNKNOWN,
        UNKNOWN if node.cpu_ratio is None else f"{100 * node.cpu_ratio:.0f} %",
        "\n".join(map(escaped, topics["publishes"])) or UNKNOWN,
        "\n".join(map(escaped, topics["subscribes"])) or UNKNOWN,
    )


def _topics_of(graph: GraphView, node: NodeInfo) -> dict[str, list[str]]:
    topics = graph.topics.values()
    heard = [each.name for each in topics if any(one.node_id == node.id for one in each.subscribers)]
    wide = graph.patterns.values()
    heard += [each.name for each in wide if any(one.node_id == node.id for one in each.subscribers)]
    return {
        "publishes": [each.name for each in topics if any(one.node_id == node.id for one in each.publishers)],
        "subscribes": sorted(set(heard)),
    }


def _service_cells(graph: GraphView, node: NodeInfo) -> tuple[str, ...]:
    services = _services_of(graph, node)
    return tuple("\n".join(map(escaped, services[role])) or UNKNOWN for role in ("serves", "calls"))


def _services_of(graph: GraphView, node: NodeInfo) -> dict[str, list[str]]:
    services = graph.services.values()
    return {
        "serves": [each.name for each in services if any(one.node_id == node.id for one in each.servers)],
        "calls": [each.name for each in services if any(one.node_id == node.id for one in each.clients)],
    }
