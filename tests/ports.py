"""Free port for a program that a test starts later."""

from __future__ import annotations

import secrets
import socket
from contextlib import suppress

_FIRST, _COUNT = 20_000, 12_000


def free_port() -> int:
    """Return an unused port of the loopback interface that no connection takes in the meantime.

    Systems give outgoing connections and port 0 the higher ports. One of these can be taken by another test
    before the program binds it.
    """
    while True:
        port = _FIRST + secrets.randbelow(_COUNT)
        with suppress(OSError), socket.socket() as probe:
            probe.bind(("127.0.0.1", port))
            return port
