"""`nep service`: list, inspect and call services."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nep.cli.complete import complete_service, complete_service_type
from nep.cli.graph_text import count_text, node_list, node_text, plain_with_names
from nep.cli.json_input import decode_text, parse_json
from nep.cli.network import BackendOption, open_node, query_graph
from nep.cli.options import JsonOption, MasterOption, check_duration
from nep.cli.screen import (
    UNKNOWN,
    TextColumn,
    format_size,
    print_status,
    show_alerts,
    show_json,
    show_table,
    write,
)
from nep.cli.topics.publish import read_file
from nep.cli.topics.topic_wait import suggestion
from nep.cli.typer_texts import TranslatedGroup
from nep.cli.values import convert_ids_to_text, format_payload, service_type_text
from nep.errors import NepError
from nep.i18n import _, lazy
from nep.protocol.graph_view import GraphView, ServiceInfo, to_plain
from nep.protocol.service_wire import check_service
from nep.text import escaped, quotable

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup,
    no_args_is_help=True,
    help=_("List, inspect and call services."),
)
_TIMEOUT_S = 5.0
_COLUMNS = (
    TextColumn(lazy("service"), style="bold", is_folded_last=True),
    TextColumn(lazy("servers"), style="green"),
    TextColumn(lazy("clients"), style="cyan"),
    TextColumn(lazy("answered"), "right"),
    TextColumn(lazy("errors"), "right"),
)
_INFO_COLUMNS = (
    TextColumn(lazy("node"), style="bold", is_folded_last=True),
    TextColumn(lazy("role")),
    TextColumn(lazy("answered"), "right"),
    TextColumn(lazy("errors"), "right"),
    TextColumn(lazy("size"), "right"),
    TextColumn(lazy("address")),
)
_ServiceArgument = Annotated[
    str,
    typer.Argument(
        metavar=_("NAME"),
        help=_("Name of the service."),
        show_default=False,
        autocompletion=complete_service,
    ),
]


@app.command("list")
def list_services(
    master: MasterOption = None, backend: BackendOption = None, as_json: JsonOption = False
) -> None:
    """List services with their servers and clients."""
    graph = query_graph(master, backend)
    services = [graph.services[name] for name in sorted(graph.services)]
    if as_json:
        show_json(convert_ids_to_text([to_plain(each) for each in services]))
        return
    if services:
        show_table(_COLUMNS, [_row(graph, each) for each in services])
    else:
        print_status(_("no services; start a program that has a server or a client"))
    show_alerts(each for each in graph.alerts if each.id.startswith("service:"))


@app.command("info")
def info(
    service: _ServiceArgument,
    master: MasterOption = None,
    backend: BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print information about a service: its type, servers and clients."""
    graph = query_graph(master, backend)
    service_info = _find_service(service, graph)
    if as_json:
        show_json(convert_ids_to_text(plain_with_names(graph, service_info, "servers", "clients")))
        return
    for heading, value in (
        (_("service"), escaped(service_info.name)),
        (_("type"), service_type_text(service_info)),
        (_("answered"), str(service_info.calls)),
        (_("errors"), str(service_info.errors)),
    ):
        write(f"{heading}: {value}\n")
    write("\n")
    show_table(_INFO_COLUMNS, _rows(graph, service_info))
    show_alerts(each for each in graph.alerts if each.id == f"service:{service}")


@app.command("type")
def show_type(
    service: _ServiceArgument,
    master: MasterOption = None,
    backend: BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print the type of a service."""
    service_info = _find_service(service, query_graph(master, backend))
    if as_json:
        show_json({"service": service_info.name, "msg_type": service_info.msg_type})
    else:
        write(f"{service_type_text(service_info)}\n")


@app.command("find")
def find(
    msg_type: Annotated[
        str,
        typer.Argument(
            metavar=_("TYPE"),
            help=_("Type to search for."),
            show_default=False,
            autocompletion=complete_service_type,
        ),
    ],
    master: MasterOption = None,
    backend: BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """List services of a type."""
    graph = query_graph(master, backend)
    names = sorted(name for name, each in graph.services.items() if each.msg_type == msg_type)
    if as_json:
        show_json(names)
    elif names:
        write("".join(f"{escaped(name)}\n" for name in names))
    else:
        types = sorted({each.msg_type for each in graph.services.values()})
        template = _(
            "no service has the type '{msg_type}'; {meant}'nep service type NAME' shows a service's type"
        )
        print_status(template.format(msg_type=quotable(msg_type), meant=suggestion(msg_type, types)))


@app.command("call")
def call(
    service: _ServiceArgument,
    request: Annotated[
        str,
        typer.Argument(
            metavar="JSON",
            help=_("Request as JSON (default: an empty object); @FILE reads it from a file."),
            show_default=False,
        ),
    ] = "{}",
    timeout_s: Annotated[
        float | None,
        typer.Option(
            "--timeout",
            metavar=_("SECONDS"),
            help=_("Maximum time to wait for a server and its reply (default: {seconds:g}).").format(
                seconds=_TIMEOUT_S
            ),
            show_default=False,
            callback=check_duration,
        ),
    ] = None,
    master: MasterOption = None,
    backend: BackendOption = None,
    as_json: JsonOption = False,
) -> None:
    """Call a service and print its reply."""
    payload = _parse_request(request)
    with open_node("nep-service-call", master, backend) as node:
        client = node.new_client(service, timeout_s=_TIMEOUT_S if timeout_s is None else timeout_s)
        reply = client.call(payload)
    if as_json:
        show_json(reply)
    else:
        write(f"{format_payload(reply, in_full=True)}\n")


def _parse_request(text: str) -> object:
    if not text.startswith("@"):
        return parse_json(text)
    file = text[1:]
    return parse_json(decode_text(read_file(Path(file), "json"), file), file=file)


def _find_service(service: str, graph: GraphView) -> ServiceInfo:
    service_info = graph.services.get(service)
    if service_info is None:
        check_service(service)
        template = _("no service '{service}'; {meant}'nep service list' shows all services")
        raise NepError(template.format(service=service, meant=suggestion(service, list(graph.services))))
    return service_info


def _row(graph: GraphView, service: ServiceInfo) -> tuple[str, ...]:
    return (
        escaped(service.name),
        node_list(graph, (each.node_id for each in service.servers)),
        node_list(graph, (each.node_id for each in service.clients)),
        str(service.calls) if service.servers else UNKNOWN,
        str(service.errors) if service.servers else UNKNOWN,
    )


def _rows(graph: GraphView, service: ServiceInfo) -> list[tuple[str, ...]]:
    servers = [
        (
            node_text(graph, each.node_id),
            _("serves"),
            str(each.calls),
            str(each.errors),
            format_size(each.bytes),
            "\n".join(map(escaped, each.endpoints)) or UNKNOWN,
        )
        for each in service.servers
    ]
    clients = [
        (
            node_text(graph, each.node_id),
            _("calls"),
            count_text(each.answered),
            count_text(each.failed),
            UNKNOWN,
            UNKNOWN,
        )
        for each in service.clients
    ]
    return [*servers, *sorted(clients)]  # calls go to the first server
