"""Shell completion of topics, services, types, nodes and fields of the running master.

Queries the master with short time limits and returns nothing if no master replies. Must never print or raise,
because the output would appear in the line that is being typed.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator

import typer

from nep.errors import NepError
from nep.masters.process import view
from nep.messages.codecs import content_of
from nep.messages.fields import leaf_paths
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from nep.system.addresses import host_of, master_address

_CONNECT_TIMEOUT_S = 0.4
_REPLY_TIMEOUT_S = 3.0
"""Time limit of a reply for a busy computer, in seconds; normally a master replies within milliseconds."""
_MESSAGE_TIMEOUT_S = 0.6


def complete_topic(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the topics that start with `incomplete` and are not on the command line yet."""
    view = _query_graph(ctx)
    arguments = _given_arguments(ctx)
    names = sorted(view.topics) if view is not None else []
    return [name for name in names if name.startswith(incomplete) and name not in arguments]


def complete_service(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the services that start with `incomplete`."""
    view = _query_graph(ctx)
    return sorted(each for each in view.services if each.startswith(incomplete)) if view is not None else []


def complete_type(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the topic types that start with `incomplete`."""
    view = _query_graph(ctx)
    types = {topic.msg_type for topic in view.topics.values()} if view is not None else set()
    return sorted(each for each in types if each.startswith(incomplete))


def complete_service_type(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the service types that start with `incomplete`."""
    view = _query_graph(ctx)
    types = {service.msg_type for service in view.services.values()} if view is not None else set()
    return sorted(each for each in types if each.startswith(incomplete))


def complete_node(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the names of nodes that start with `incomplete`."""
    view = _query_graph(ctx)
    names = {node.name for node in view.nodes.values()} if view is not None else set()
    return sorted(name for name in names if name.startswith(incomplete))


def complete_field_or_topic(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return completions after a topic: fields of its next or latched message, and further topics."""
    topic = ctx.params.get("topic")
    fields = _fields(ctx, topic) if isinstance(topic, str) else ()
    return [path for path in fields if path.startswith(incomplete)] + complete_topic(ctx, incomplete)


def _given_arguments(ctx: typer.Context) -> set[str]:
    values = [ctx.params.get("topic"), *(ctx.params.get("topics") or ()), *(ctx.params.get("more") or ())]
    return {value for value in values if isinstance(value, str)}


def _reachable_master(ctx: typer.Context) -> str:
    address = master_address(ctx.params.get("master") or ctx.find_root().params.get("master"))
    with socket.create_connection(
        (host_of(address).strip("[]"), int(address.rpartition(":")[2])), _CONNECT_TIMEOUT_S
    ):
        return address  # a closed port fails at once; an open one gets the full reply timeout


def _query_graph(ctx: typer.Context) -> GraphView | None:
    try:
        return view(_reachable_master(ctx), _REPLY_TIMEOUT_S)
    except (NepError, OSError, UnicodeError):
        return None


def _fields(ctx: typer.Context, topic: str) -> Iterator[str]:
    try:
        name = f"nep-complete-{os.getpid()}"
        with Node(name, master=_reachable_master(ctx), wait_s=_REPLY_TIMEOUT_S) as node:
            topic_info = node.graph(_REPLY_TIMEOUT_S).topics.get(topic)
            if topic_info is None or content_of(topic_info.codec) == "image":
                return
            with node.new_sub(topic, topic_info.msg_type) as subscriber:
                message = subscriber.receive(_MESSAGE_TIMEOUT_S)
            if message is not None:
                yield from leaf_paths(message.payload)
    except (NepError, OSError, UnicodeError):
        return
