"""Fixtures with a web server and clients that send raw operations."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from websockets.sync.client import ClientConnection, connect

import nep
from nep.masters.master import Master
from nep.programs.web import WebServer, WebSettings


@pytest.fixture
def node(master: Master, patient: None) -> Iterator[nep.Node]:
    """Python node that exchanges messages with pages."""
    with nep.node("python", master=master.address) as node:
        yield node


@pytest.fixture
def server(master: Master) -> Iterator[WebServer]:
    """Server with default options on a free port."""
    with WebServer(WebSettings(port=0, master=master.address)) as running:
        yield running


class Peer:
    """Client that sends and receives operations."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection

    def send(self, op: str, /, **fields: object) -> None:
        self.connection.send(json.dumps({"op": op, **fields}))

    def receive(self, op: str, timeout_s: float = 30.0) -> dict[str, object]:
        """Return the next operation of this kind; skip others."""
        while True:
            got = json.loads(self.connection.recv(timeout_s))
            if got["op"] == op:
                return got

    def refusal(self, op: str, /, **fields: object) -> str:
        """Send an operation that is rejected; return the message of the status."""
        self.send(op, **fields)
        return str(self.receive("status")["msg"])

    def call(self, service: str, /, **args: object) -> dict[str, object]:
        """Call a service and return its response."""
        self.send("call_service", id=f"call {service}", service=service, args=args)
        answer = self.receive("service_response")
        assert answer["id"] == f"call {service}"
        return answer


@pytest.fixture
def open_page(server: WebServer) -> Iterator[Callable[..., Peer]]:
    """Function that connects to the server; its options are those of `websockets`."""
    with ExitStack() as opened:
        yield lambda **options: Peer(opened.enter_context(connect(server.url, **options)))


@pytest.fixture
def page(open_page: Callable[..., Peer]) -> Peer:
    """Connected page."""
    return open_page()
