"""What the shell offers when Tab is pressed: the topics, nodes and fields that are there now.

Asked of the running master, within a fraction of a second; silent when there is none. Nothing here may
print or raise: it would land in the line that a person is typing.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import typer

from nep.cli.fields import leaves
from nep.cli.graphs import look
from nep.errors import NepError
from nep.graph import GraphView
from nep.nodes import Node

_ASK_S = 0.4
_MESSAGE_S = 0.6


def complete_topic(ctx: typer.Context, incomplete: str) -> list[str]:
    """Topics that begin so, but those that the line names already."""
    view = _view(ctx)
    given = ctx.params.get("topics") or ()
    names = sorted(view.topics) if view is not None else []
    return [name for name in names if name.startswith(incomplete) and name not in given]


def complete_node(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of nodes that begin so."""
    view = _view(ctx)
    names = {node.name for node in view.nodes.values()} if view is not None else set()
    return sorted(name for name in names if name.startswith(incomplete))


def complete_field(ctx: typer.Context, incomplete: str) -> list[str]:
    """Fields of the topic that the line names: those of the next message, or of the one that is kept."""
    topic = ctx.params.get("topic")
    if not isinstance(topic, str):
        return []
    return [path for path in _fields(ctx, topic) if path.startswith(incomplete)]


def _view(ctx: typer.Context) -> GraphView | None:
    try:
        return look(ctx.params.get("master"), _ASK_S)
    except (NepError, OSError):
        return None


def _fields(ctx: typer.Context, topic: str) -> Iterator[str]:
    try:
        name = f"nep-complete-{os.getpid()}"
        with Node(name, master=ctx.params.get("master"), wait_s=_ASK_S) as node:
            known = node.graph(_ASK_S).topics.get(topic)
            if known is None or known.codec == "image":
                return
            with node.new_sub(topic, known.msg_type) as subscriber:
                message = subscriber.receive(_MESSAGE_S)
            if message is not None:
                yield from leaves(message.payload)
    except (NepError, OSError):
        return
