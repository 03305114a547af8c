"""Where a publisher is reached: `nanomsg://HOST:PORT/PORT`, its messages first, then where it is greeted.

The scheme keeps ZeroMQ's subscribers away. And where the parts of a native message lie in one of nanomsg's:
one behind the other, the extension behind as many bytes of payload as the header says.
"""

from __future__ import annotations

import re

from nep.errors import WireError
from nep.i18n import _
from nep.protocol.wire import EXTENSION, HEADER_BYTES, LATCHED, hello_part, read_header

__all__ = ["endpoint", "own_part", "places_of", "split_one"]

_ENDPOINT = re.compile(r"nanomsg://([\w.-]{1,253}):(\d{1,5})/(\d{1,5})", re.ASCII)


def endpoint(host: str, messages: int, hellos: int) -> str:
    """The endpoint with these two ports."""
    return f"nanomsg://{host}:{messages}/{hellos}"


def places_of(endpoint: str) -> tuple[str, str] | None:
    """`HOST:PORT` of its messages and `HOST:PORT` for hellos; None for an endpoint of another back end."""
    found = _ENDPOINT.fullmatch(endpoint)
    if found is None or not all(0 < int(port) < 65536 for port in found.groups()[1:]):
        return None
    host, messages, hellos = found.groups()
    return f"{host}:{messages}", f"{host}:{hellos}"


def own_part(subscriber: int, topic: str) -> bytes:
    """What a message for this subscriber alone begins with."""
    return hello_part(subscriber, topic) + b"\0"


def split_one(message: bytes, first: bytes, *, is_alone: bool) -> list[bytes]:
    """What follows the first part, in parts: header, payload and extension, or for a notice the header alone.

    Raises `WireError`.
    """
    rest = message[len(first) :]
    header = read_header(rest[:HEADER_BYTES])
    body = rest[HEADER_BYTES:]
    if is_alone and not body and not header.flags & LATCHED:
        return [rest]
    if not header.flags & EXTENSION:
        return [rest[:HEADER_BYTES], body]
    if header.size > len(body):
        raise WireError(
            _("its header promises {size} bytes, there are {count}").format(
                size=header.size, count=len(body)
            ),
            len(message),
        )
    return [rest[:HEADER_BYTES], body[: header.size], body[header.size :]]
