"""Binding a port again that this process has just let go of."""

from __future__ import annotations

import threading
import time
from typing import Any

import zmq

__all__ = ["bind_again"]

_WAIT_S = 5.0


def bind_again(socket: zmq.Socket[Any], endpoint: str) -> None:
    """Bind to an endpoint whose last socket may still be closing: libzmq does that in its own thread."""
    deadline = time.monotonic() + _WAIT_S
    while True:
        try:
            socket.bind(endpoint)
            return
        except zmq.ZMQError as error:
            if error.errno != zmq.EADDRINUSE or time.monotonic() >= deadline:
                raise
        threading.Event().wait(0.005)
