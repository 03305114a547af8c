"""Renewals, quickly: what every node sends every second is taken over and answered as it comes.

No values are made of it. What is unusual is left to the way of all requests, which says what is wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from nep.masters.registry import Census, Member, as_ratio
from nep.messages.packing import pack_surely, unpack, unpack_bounded
from nep.protocol.requests import RENEW_S, Renew

__all__ = ["RenewalSaid", "is_renewal", "read_renewal", "renewed_body", "same_ids", "take_over"]

_BEGINS = b"\x83\xa2do\xa5renew"
"""How our own renewals begin. Another order of the fields is as right, and takes the usual way."""

_SMALL_BYTES, _LISTS_MAX = 4096, 20_000
_Counts = Sequence[Mapping[str, Any]]


class RenewalSaid(NamedTuple):
    """A renewal as it came: of `publishers` and `subscribers` nothing is known but that they are lists."""

    call: int
    node_id: str
    epoch: int
    revision: int
    publishers: _Counts
    subscribers: _Counts
    cpu_ratio: float | None


def is_renewal(body: bytes) -> bool:
    """Whether a body seems to be one of our own renewals: it is worth `read_renewal`."""
    return body.startswith(_BEGINS)


def read_renewal(body: bytes) -> RenewalSaid | None:
    """The renewal in a body; None when it is none, or an unusual one."""
    if not body.startswith(_BEGINS):
        return None
    try:
        envelope: Any = (
            unpack_bounded(body, _LISTS_MAX, _LISTS_MAX) if len(body) > _SMALL_BYTES else unpack(body)
        )
        what = envelope["what"]
        said = RenewalSaid(
            envelope["call"],
            what["node_id"],
            what["epoch"],
            what["revision"],
            what.get("publishers", ()),
            what.get("subscribers", ()),
            what.get("cpu_ratio"),
        )
    except (ValueError, LookupError, TypeError, AttributeError):
        return None
    numbers = type(said.call) is type(said.epoch) is type(said.revision) is int
    is_usual = numbers and said.call >= 0 and type(said.node_id) is str
    is_usual = is_usual and type(said.cpu_ratio) in {float, type(None)}
    is_usual = is_usual and {type(said.publishers), type(said.subscribers)} <= {list, tuple}
    return said if is_usual else None


def same_ids(member: Member, request: Renew) -> bool:
    """Whether a renewal tells of just the publishers and subscribers that are registered."""
    return {each.id for each in request.publishers} == set(member.publishers) and {
        each.id for each in request.subscribers
    } == set(member.subscribers)


def take_over(census: Census, member: Member, said: RenewalSaid, now: float) -> bool:
    """Take over the statistics of a node; whether all of it was usual."""
    try:
        return _take_over(census, member, said, now)
    except (LookupError, TypeError, AttributeError):  # a field or a publisher is missing, or no map
        return False


def _take_over(census: Census, member: Member, said: RenewalSaid, now: float) -> bool:
    publishers, subscribers = member.publishers, member.subscribers
    if len(said.publishers) != len(publishers) or len(said.subscribers) != len(subscribers):
        return False
    for counts in said.publishers:
        publisher = publishers[counts["id"]]
        count, size_bytes, last_seq = counts["count"], counts["bytes"], counts["last_seq"]
        stamp_ns, problem = counts.get("last_stamp_ns"), counts.get("problem", "")
        if not type(count) is type(size_bytes) is type(last_seq) is int:
            return False
        if (stamp_ns is not None and type(stamp_ns) is not int) or type(problem) is not str:
            return False
        census.counted(publisher, count, size_bytes, now)
        census.reached(publisher, last_seq, stamp_ns)
        if problem != publisher.problem:
            census.troubled(publisher, problem)
    for seen in said.subscribers:
        received, lost, problem = seen["received"], seen["lost"], seen.get("problem", "")
        if {type(received), type(lost)} - {int, type(None)} or type(problem) is not str:
            return False
        census.seen(subscribers[seen["id"]], received, lost, problem)
    member.renewed_at, member.cpu_ratio = now, as_ratio(said.cpu_ratio)
    if member.hung:
        member.hung.clear()
    return True


def renewed_body(
    call: int,
    epoch: int,
    revision: int,
    last_seqs: Mapping[int, int],
    hosts: tuple[str, ...],
    next_s: float = RENEW_S,
) -> bytes:
    """The body of a `Renewed` with which nothing has changed."""
    what: dict[str, object] = {"epoch": epoch, "revision": revision, "last_seqs": last_seqs}
    if hosts:
        what["hosts"] = hosts
    if next_s != RENEW_S:
        what["next_s"] = next_s
    return pack_surely({"is": "renewed", "re": call, "what": what})
