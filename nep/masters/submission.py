"""Submission: a request to the master from inside its process, and the reply to it."""

from __future__ import annotations

import threading

from nep.protocol.requests import Reply, Request

__all__ = ["Submission"]


class Submission:
    """`done` is set with the reply, or without one when the master has ended."""

    def __init__(self, request: Request) -> None:
        self.request = request
        self.done = threading.Event()
        self.reply: Reply | None = None
