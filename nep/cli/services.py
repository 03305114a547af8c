"""`nep service`: who serves and who calls, and calling by hand."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from nep.cli.complete import complete_service
from nep.cli.json_input import parse_json, text_of
from nep.cli.options import JsonOption, MasterOption, checked_time
from nep.cli.publish import read_file
from nep.cli.screen import UNKNOWN, TextColumn, say, show_alerts, show_json, show_table, size, write
from nep.cli.topic_wait import meant
from nep.cli.typer_words import TranslatedGroup
from nep.cli.values import ids_as_text, presented
from nep.errors import NepError
from nep.i18n import _, lazy
from nep.masters.process import view
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView, ServiceInfo
from nep.protocol.service_wire import check_service
from nep.text import escaped

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup,
    no_args_is_help=True,
    help=_("Who answers calls: list the services, look into one, call it."),
)
_TIMEOUT_S = 5.0
_COLUMNS = (
    TextColumn(lazy("service"), style="bold", is_whole=True),
    TextColumn(lazy("servers"), style="green"),
    TextColumn(lazy("clients"), style="cyan"),
    TextColumn(lazy("answered"), "right"),
    TextColumn(lazy("errors"), "right"),
)
_INFO_COLUMNS = (
    TextColumn(lazy("node"), style="bold", is_whole=True),
    TextColumn(lazy("what it does")),
    TextColumn(lazy("answered"), "right"),
    TextColumn(lazy("errors"), "right"),
    TextColumn(lazy("size"), "right"),
    TextColumn(lazy("address")),
)
_ServiceArgument = Annotated[
    str,
    typer.Argument(
        metavar=_("NAME"),
        help=_("The service."),
        show_default=False,
        autocompletion=complete_service,
    ),
]


_BackendOption = Annotated[
    str | None,
    typer.Option(
        "--backend",
        metavar=_("NAME"),
        help=_("Look there, where no master is asked: 'zenoh', 'ros2', 'ros'. ADDRESS is then its place."),
        show_default=False,
    ),
]
_MASTER_VARIABLE = "NEP_MASTER"


@app.command("list")
def list_services(
    master: MasterOption = None, backend: _BackendOption = None, as_json: JsonOption = False
) -> None:
    """List all services, with who serves and calls them."""
    graph = _view(master, backend)
    services = [graph.services[name] for name in sorted(graph.services)]
    if as_json:
        show_json(ids_as_text([asdict(each) for each in services]))
        return
    if services:
        show_table(_COLUMNS, [_row(graph, each) for each in services])
    else:
        say(_("no services yet; they appear as soon as a program makes a server or a client"))
    show_alerts(each for each in graph.alerts if each.id.startswith("service:"))


@app.command("info")
def info(
    service: _ServiceArgument,
    master: MasterOption = None,
    backend: _BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what is known of a service: each node that serves or calls it."""
    graph = _view(master, backend)
    found = _found(service, graph)
    if as_json:
        show_json(ids_as_text(_record(graph, found)))
        return
    for head, value in (
        (_("service"), escaped(found.name)),
        (_("answered"), str(found.calls)),
        (_("errors"), str(found.errors)),
    ):
        write(f"{head}: {value}\n")
    write("\n")
    show_table(_INFO_COLUMNS, _rows(graph, found))
    show_alerts(each for each in graph.alerts if each.id == f"service:{service}")


@app.command("call")
def call(
    service: _ServiceArgument,
    request: Annotated[
        str,
        typer.Argument(
            metavar="JSON",
            help=_("What to ask: JSON; @FILE takes it from a file. An empty map when nothing is said."),
            show_default=False,
        ),
    ] = "{}",
    timeout_s: Annotated[
        float | None,
        typer.Option(
            "--timeout",
            metavar=_("SECONDS"),
            help=_("How long to wait for a server and its answer; {seconds:g} when nothing is said.").format(
                seconds=_TIMEOUT_S
            ),
            show_default=False,
            callback=checked_time,
        ),
    ] = None,
    master: MasterOption = None,
    backend: _BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """Call a service, and write its answer."""
    asked = _request(request)
    with _node("nep-service-call", master, backend) as node:
        client = node.new_client(service, timeout_s=_TIMEOUT_S if timeout_s is None else timeout_s)
        answer = client.call(asked)
    if as_json:
        show_json(answer)
    else:
        write(f"{presented(answer, whole=True)}\n")


def _node(name: str, master: str | None, backend: str | None) -> Node:
    """A node over the back end. Raises `UnknownBackendError`, `BackendUnavailableError`."""
    name = f"{name}-{os.getpid()}"
    if backend is None:
        return Node(name, master=master)
    is_said = master is not None and master != os.environ.get(_MASTER_VARIABLE)
    return Node(name, backend, master=master if is_said else None)


def _view(master: str | None, backend: str | None) -> GraphView:
    """Who is there. Raises `MasterUnreachable`, and as `_node` does."""
    if backend is None:
        return view(master)
    with _node("nep-service", master, backend) as node:
        return node.graph()


def _request(text: str) -> object:
    """The value that is meant. Raises `NepError`."""
    if not text.startswith("@"):
        return parse_json(text)
    file = text[1:]
    return parse_json(text_of(read_file(Path(file), "json"), file), file=file)


def _found(service: str, graph: GraphView) -> ServiceInfo:
    """What is known of it. Raises `BadTopicError`, and `NepError` when nobody has it."""
    found = graph.services.get(service)
    if found is None:
        check_service(service)
        said = _("nobody serves or calls '{service}'; {meant}'nep service list' shows all services")
        raise NepError(said.format(service=service, meant=meant(service, list(graph.services))))
    return found


def _row(graph: GraphView, service: ServiceInfo) -> tuple[str, ...]:
    return (
        escaped(service.name),
        _names(graph, [each.node_id for each in service.servers]),
        _names(graph, [each.node_id for each in service.clients]),
        str(service.calls) if service.servers else UNKNOWN,
        str(service.errors) if service.servers else UNKNOWN,
    )


def _names(graph: GraphView, node_ids: list[str]) -> str:
    names = [escaped(graph.nodes[each].name) for each in node_ids if each in graph.nodes]
    return "\n".join(dict.fromkeys(names)) or UNKNOWN


def _record(graph: GraphView, service: ServiceInfo) -> dict[str, object]:
    """As `nep service list --json` has it, with the names of the nodes."""
    record: dict[str, object] = asdict(service)
    for role, members in (("servers", service.servers), ("clients", service.clients)):
        record[role] = [{**asdict(each), "node": _name(graph, each.node_id)} for each in members]
    return record


def _rows(graph: GraphView, service: ServiceInfo) -> list[tuple[str, ...]]:
    servers = [
        (
            escaped(_name(graph, each.node_id) or UNKNOWN),
            _("serves"),
            str(each.calls),
            str(each.errors),
            size(each.bytes),
            "\n".join(map(escaped, each.endpoints)) or UNKNOWN,
        )
        for each in service.servers
    ]
    clients = [
        (
            escaped(_name(graph, each.node_id) or UNKNOWN),
            _("calls"),
            _count(each.answered),
            _count(each.failed),
            UNKNOWN,
            UNKNOWN,
        )
        for each in service.clients
    ]
    return [*servers, *sorted(clients)]  # the first server is the one that is called


def _name(graph: GraphView, node_id: str) -> str | None:
    """The node's name; None when it has just left."""
    node = graph.nodes.get(node_id)
    return None if node is None else node.name


def _count(value: int | None) -> str:
    return UNKNOWN if value is None else str(value)
