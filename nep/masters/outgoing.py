"""Outgoing: what a master has to send, and what becomes of it when nodes turn out to be dead."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from nep.protocol.requests import Added, Found, Push, Renewed, Reply, Seen

__all__ = ["Outgoing", "with_hosts", "without"]


class Outgoing(NamedTuple):
    """One thing to send: a push to the node `to` (call is None), or the reply to `call` of a connection."""

    to: str
    answer: Reply | Push
    call: int | None = None


def without(answer: Reply | Push, node_ids: frozenset[str]) -> Reply | Push:
    """`answer` that expects nothing from these nodes: they turned out to be dead while it was on its way."""
    if isinstance(answer, Found) and node_ids:
        return replace(
            answer, publishers=tuple(each for each in answer.publishers if each.node_id not in node_ids)
        )
    if isinstance(answer, Added) and node_ids:
        return replace(
            answer,
            expected=tuple(each for each in answer.expected if each.node_id not in node_ids),
            hung=tuple(each for each in answer.hung if each.node_id not in node_ids),
        )
    return answer


def with_hosts(answer: Reply | Push, hosts: tuple[str, ...]) -> Reply | Push:
    """`answer` that tells at which addresses the master serves other computers."""
    if not hosts:
        return answer
    if isinstance(answer, Added | Found | Renewed):
        return replace(answer, hosts=hosts)
    if isinstance(answer, Seen):
        return replace(answer, view=replace(answer.view, listens=hosts))
    return answer
