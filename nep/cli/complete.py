"""What the shell offers when Tab is pressed: topics, services, types, nodes and fields that are there now.

Asked of the running master, within a fraction of a second; silent when there is none. Nothing here may
print or raise: it would land in the line that a person is typing.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator

import typer

from nep.errors import NepError
from nep.masters.process import view
from nep.messages.fields import leaves
from nep.nodes.node import Node
from nep.protocol.graph_view import GraphView
from nep.system.addresses import host_of, master_address

_ASK_S = 0.4
_ANSWER_S = 3.0
"""A busy computer may take so long until everybody had their turn; an idle one takes a few milliseconds."""
_MESSAGE_S = 0.6


def complete_topic(ctx: typer.Context, incomplete: str) -> list[str]:
    """Topics that begin so, but those that the line names already."""
    view = _view(ctx)
    given = _given(ctx)
    names = sorted(view.topics) if view is not None else []
    return [name for name in names if name.startswith(incomplete) and name not in given]


def complete_service(ctx: typer.Context, incomplete: str) -> list[str]:
    """Services that begin so."""
    view = _view(ctx)
    return sorted(each for each in view.services if each.startswith(incomplete)) if view is not None else []


def complete_type(ctx: typer.Context, incomplete: str) -> list[str]:
    """Types of topics that begin so."""
    view = _view(ctx)
    types = {topic.msg_type for topic in view.topics.values()} if view is not None else set()
    return sorted(each for each in types if each.startswith(incomplete))


def complete_service_type(ctx: typer.Context, incomplete: str) -> list[str]:
    """Types of services that begin so."""
    view = _view(ctx)
    types = {service.msg_type for service in view.services.values()} if view is not None else set()
    return sorted(each for each in types if each.startswith(incomplete))


def complete_node(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of nodes that begin so."""
    view = _view(ctx)
    names = {node.name for node in view.nodes.values()} if view is not None else set()
    return sorted(name for name in names if name.startswith(incomplete))


def complete_more(ctx: typer.Context, incomplete: str) -> list[str]:
    """What may follow a topic: fields of it (of its next message, or of the one that is kept), and topics."""
    topic = ctx.params.get("topic")
    fields = _fields(ctx, topic) if isinstance(topic, str) else ()
    return [path for path in fields if path.startswith(incomplete)] + complete_topic(ctx, incomplete)


def _given(ctx: typer.Context) -> set[str]:
    """The words that the line has already."""
    words = [ctx.params.get("topic"), *(ctx.params.get("topics") or ()), *(ctx.params.get("more") or ())]
    return {word for word in words if isinstance(word, str)}


def _master(ctx: typer.Context) -> str:
    """Raises `NepError` when none answers at the address that the line, or else the environment, names."""
    chosen = master_address(ctx.params.get("master") or ctx.find_root().params.get("master"))
    with socket.create_connection((host_of(chosen).strip("[]"), int(chosen.rpartition(":")[2])), _ASK_S):
        return chosen  # where nobody listens that is known at once; who listens gets time to answer


def _view(ctx: typer.Context) -> GraphView | None:
    try:
        return view(_master(ctx), _ANSWER_S)
    except (NepError, OSError, UnicodeError):
        return None


def _fields(ctx: typer.Context, topic: str) -> Iterator[str]:
    try:
        name = f"nep-complete-{os.getpid()}"
        with Node(name, master=_master(ctx), wait_s=_ANSWER_S) as node:
            known = node.graph(_ANSWER_S).topics.get(topic)
            if known is None or known.codec == "image":
                return
            with node.new_sub(topic, known.msg_type) as subscriber:
                message = subscriber.receive(_MESSAGE_S)
            if message is not None:
                yield from leaves(message.payload)
    except (NepError, OSError, UnicodeError):
        return
