"""Endpoints of publishers, `nanomsg://HOST:PORT/PORT` for messages and hellos, and the message format.

The scheme keeps subscribers over ZeroMQ from connecting. A nanomsg message is the concatenation of a native
message's parts; the payload has the size stated in the header, and the extension follows.
"""

from __future__ import annotations

import re

from nep.errors import WireError
from nep.i18n import _
from nep.protocol.wire import EXTENSION, HEADER_BYTES, LATCHED, hello_part, read_header

_ENDPOINT = re.compile(r"nanomsg://([\w.-]{1,253}):(\d{1,5})/(\d{1,5})", re.ASCII)


def endpoint(host: str, messages: int, hellos: int) -> str:
    """Return the endpoint with these two ports."""
    return f"nanomsg://{host}:{messages}/{hellos}"


def parse_endpoint(endpoint: str) -> tuple[str, str] | None:
    """Return the addresses (`HOST:PORT`) for messages and for hellos, or None for another back end."""
    found = _ENDPOINT.fullmatch(endpoint)
    if found is None or not all(0 < int(port) < 65536 for port in found.groups()[1:]):
        return None
    host, messages, hellos = found.groups()
    return f"{host}:{messages}", f"{host}:{hellos}"


def own_part(subscriber: int, topic: str) -> bytes:
    """Return the prefix of messages for this subscriber alone."""
    return hello_part(subscriber, topic) + b"\0"


def split_one(message: bytes, first: bytes, *, is_alone: bool) -> list[bytes]:
    """Return the parts after the first one: header, payload and extension; of a notice only the header.

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
            _("its header declares {size} bytes, but only {count} follow").format(
                size=header.size, count=len(body)
            ),
            len(message),
        )
    return [rest[:HEADER_BYTES], body[: header.size], body[header.size :]]
