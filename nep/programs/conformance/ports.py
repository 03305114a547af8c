"""Binding to a port that this process has just released."""

from __future__ import annotations

import threading
import time
from typing import Any

import zmq

__all__ = ["bind_again"]

_WAIT_S = 5.0


def bind_again(socket: zmq.Socket[Any], endpoint: str) -> None:
    """Bind, and retry while libzmq's thread is still closing the previous socket of the endpoint."""
    deadline = time.monotonic() + _WAIT_S
    while True:
        try:
            socket.bind(endpoint)
            return
        except zmq.ZMQError as error:
            if error.errno != zmq.EADDRINUSE or time.monotonic() >= deadline:
                raise
        threading.Event().wait(0.005)
