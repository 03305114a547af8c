"""Binding of ports on 127.0.0.1 that were just released, and reservation of a closed port."""

from __future__ import annotations

import errno
import socket as sockets
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import zmq

_BIND_TIMEOUT_S = 5.0


def bind_again(socket: zmq.Socket[Any], endpoint: str) -> None:
    """Bind a socket to an endpoint that was just released.

    Retries for up to 5 s, because libzmq closes the previous socket in another thread.
    """
    retry_bind(lambda: socket.bind(endpoint))


def retry_bind(bind: Callable[[], object]) -> None:
    """Call `bind`, and retry for up to 5 s while the address is in use.

    The address may still be in use because libzmq closes sockets in another thread.
    """
    deadline = time.monotonic() + _BIND_TIMEOUT_S
    while True:
        try:
            bind()
            return
        except (OSError, zmq.ZMQError) as error:
            if error.errno not in {errno.EADDRINUSE, zmq.EADDRINUSE} or time.monotonic() >= deadline:
                raise
        threading.Event().wait(0.005)


@contextmanager
def closed_port() -> Iterator[str]:
    """Reserve a port at which connections are rejected, and yield its endpoint."""
    with sockets.socket() as reserved_socket:
        reserved_socket.bind(("127.0.0.1", 0))
        yield f"tcp://127.0.0.1:{reserved_socket.getsockname()[1]}"
