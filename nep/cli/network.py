"""Nodes and graph snapshots for commands, through the master or the back end given by `--backend`."""

from __future__ import annotations

import os
from typing import Annotated

import typer
from msgspec.structs import replace

from nep.i18n import _
from nep.masters.process import view
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from nep.system.addresses import MASTER_VARIABLE
from nep.system.arguments import check_type_name


def _check_backend(value: str | None) -> str | None:
    try:
        return None if value is None else check_type_name("--backend", value)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


BackendOption = Annotated[
    str | None,
    typer.Option(
        "--backend",
        metavar=_("NAME"),
        help=_(
            "Use this back end instead of the master: 'zenoh', 'ros2', 'ros'. --master then specifies "
            "its address."
        ),
        show_default=False,
        callback=_check_backend,
    ),
]


def open_command_node(command: str, master: str | None, backend: str | None = None) -> Node:
    """Open a node for one run of a topic command. The process id makes its name unique."""
    return open_node(f"nep-topic-{command}", master, backend)


def open_node(name: str, master: str | None, backend: str | None = None) -> Node:
    """Open a node whose name ends with the process id.

    NEP_MASTER is used for the default back end only. Raises `UnknownBackendError` if `backend` doesn't
    exist, and `BackendUnavailableError` if a package that it needs is not installed.
    """
    name = f"{name}-{os.getpid()}"
    if backend is None:
        return Node(name, master=master)
    is_given = master is not None and master != os.environ.get(MASTER_VARIABLE)
    return Node(name, backend, master=master if is_given else None)


def query_graph(master: str | None, backend: str | None = None) -> GraphView:
    """Return the graph without the querying node.

    Raises `MasterUnreachable` if no master replies, and the exceptions of `open_node`.
    """
    if backend is None:
        return view(master)
    with open_node("nep-graph", master, backend) as node:
        graph = node.graph()
    return replace(graph, nodes={id: each for id, each in graph.nodes.items() if id != node.id})
