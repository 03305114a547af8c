"""The form on the wire of what nodes and the master say. Pure functions; the specification is `docs/wire.md`.

A body is one msgpack map. Requests carry `do` (what is asked) and `call` (a number that the reply repeats as
`re`); replies and pushes carry `is`; `what` holds the fields.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from nep.errors import WireError
from nep.messages.packing import pack_surely, unpack, unpack_bounded, unpack_first
from nep.protocol.plain import read, write
from nep.protocol.requests import (
    Added,
    AddPublisher,
    AddSubscriber,
    Done,
    Found,
    Join,
    Leave,
    Listen,
    Look,
    Ping,
    Probe,
    PublisherCame,
    PublisherGone,
    Push,
    Refused,
    RemovePublisher,
    RemoveSubscriber,
    Renew,
    Renewed,
    Reply,
    ReportMissing,
    Request,
    Seen,
)
from nep.system.garbage import collecting_later

_REQUESTS: Mapping[str, type[Request]] = {
    "join": Join,
    "publisher+": AddPublisher,
    "subscriber+": AddSubscriber,
    "publisher-": RemovePublisher,
    "subscriber-": RemoveSubscriber,
    "leave": Leave,
    "renew": Renew,
    "missing": ReportMissing,
    "listen": Listen,
    "look": Look,
    "ping": Ping,
}
_ANSWERS: Mapping[str, type[Reply | Push]] = {
    "done": Done,
    "added": Added,
    "found": Found,
    "renewed": Renewed,
    "seen": Seen,
    "refused": Refused,
    "publisher+": PublisherCame,
    "publisher-": PublisherGone,
    "probe": Probe,
}
_REQUEST_NAMES = {kind: name for name, kind in _REQUESTS.items()}
_ANSWER_NAMES = {kind: name for name, kind in _ANSWERS.items()}

_LARGE_BYTES = 50_000
_SMALL_BYTES = 4096
_LISTS_MAX, _LONGEST = 50_000, 20_000
"""A request has fewer lists and maps, and none is longer: a node that joins has 5 000 records at most."""
_VIEW_BEGINS = b"\x83\xa2is\xa4seen\xa2re"
"""How an answer with a graph begins that `ViewPacker` made."""


class Asked(NamedTuple):
    """A request as it came in: the number to repeat, and the request or the sentence why it is none."""

    call: int
    request: Request | str


def encode_request(request: Request, call: int) -> bytes:
    """The body of a request."""
    return pack_surely({"do": _REQUEST_NAMES[type(request)], "call": call, "what": write(request)})


def decode_request(body: bytes) -> Asked:
    """The request in a body; never raises, so that every sender gets an answer."""
    call = 0
    try:
        if len(body) < _SMALL_BYTES:
            envelope = _envelope(body, unpack)
        else:
            envelope = _envelope(body, lambda body: unpack_bounded(body, _LISTS_MAX, _LONGEST))
        number = envelope.get("call", 0)
        # Negative ones are those of the master's own process: nobody else may take their replies.
        call = number if type(number) is int and number >= 0 else 0
        name = envelope.get("do")
        kind = _REQUESTS.get(name) if isinstance(name, str) else None
        if kind is None:
            raise WireError(f"'{name}' is no request of this version")
        return Asked(call, read(kind, envelope.get("what", {})))
    except WireError as error:
        return Asked(call, error.reason)


def encode_answer(answer: Reply | Push, call: int = 0) -> bytes:
    """The body of a reply to `call`, or of a push."""
    return pack_surely({"is": _ANSWER_NAMES[type(answer)], "re": call, "what": write(answer)})


def call_of_view(body: bytes) -> int | None:
    """The number of the call that a body answers with a graph; None when it is another answer, or unusual.

    It takes no time, while decoding a graph of thousands of topics takes a tenth of a second.
    """
    if not body.startswith(_VIEW_BEGINS):
        return None
    try:
        number = unpack_first(body[len(_VIEW_BEGINS) : len(_VIEW_BEGINS) + 9])
    except ValueError:
        return None
    return number if isinstance(number, int) and number > 0 else None


def decode_answer(body: bytes) -> tuple[int, Reply | Push]:
    """(call, answer) in a body; call is 0 for a push. Raises `WireError`."""
    if len(body) < _LARGE_BYTES:
        return _decode_answer(body)
    with collecting_later():
        return _decode_answer(body)


def _decode_answer(body: bytes) -> tuple[int, Reply | Push]:
    envelope = _envelope(body, unpack)
    name, call = envelope.get("is"), envelope.get("re", 0)
    kind = _ANSWERS.get(name) if isinstance(name, str) else None
    if kind is None or not isinstance(call, int):
        raise WireError(f"'{name}' is no answer of this version")
    return call, read(kind, envelope.get("what", {}))


def _envelope(body: bytes, unpack_it: Callable[[bytes], object]) -> Mapping[str, object]:
    try:
        value = unpack_it(body)
    except ValueError as error:
        raise WireError(f"the body is no msgpack: {error}", len(body)) from error
    if not isinstance(value, dict):
        raise WireError("the body is no map", len(body))
    return value
