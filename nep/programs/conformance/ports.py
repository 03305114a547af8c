"""Ports of 127.0.0.1: binding to a port that was just released, and reserving a closed port."""

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
    """Bind a socket, retrying while libzmq's thread is still closing the previous socket of the endpoint."""
    retry_bind(lambda: socket.bind(endpoint))


def retry_bind(bind: Callable[[], object]) -> None:
    """Call `bind`, retrying while libzmq's thread is still closing the previous socket of the endpoint."""
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
    """Reserve a port at which connections are rejected; yields its endpoint."""
    with sockets.socket() as held:
        held.bind(("127.0.0.1", 0))
        yield f"tcp://127.0.0.1:{held.getsockname()[1]}"
