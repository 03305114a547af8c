"""A web server, and connections to it that speak the protocol by hand."""

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
def node(master: Master) -> Iterator[nep.Node]:
    """A node in Python that pages talk to."""
    with nep.node("python", master=master.address) as node:
        yield node


@pytest.fixture
def server(master: Master) -> Iterator[WebServer]:
    """A server as it is without options, at a free port."""
    with WebServer(WebSettings(port=0, master=master.address)) as running:
        yield running


class Peer:
    """A page: sends operations, and receives others."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection

    def send(self, op: str, /, **fields: object) -> None:
        self.connection.send(json.dumps({"op": op, **fields}))

    def receive(self, op: str, timeout_s: float = 30.0) -> dict[str, object]:
        """The next operation of this kind; others are skipped."""
        while True:
            got = json.loads(self.connection.recv(timeout_s))
            if got["op"] == op:
                return got

    def refusal(self, op: str, /, **fields: object) -> str:
        """The sentence of the status that answers an operation."""
        self.send(op, **fields)
        return str(self.receive("status")["msg"])

    def call(self, service: str, /, **args: object) -> dict[str, object]:
        """The answer of a service."""
        self.send("call_service", id=f"call {service}", service=service, args=args)
        answer = self.receive("service_response")
        assert answer["id"] == f"call {service}"
        return answer


@pytest.fixture
def open_page(server: WebServer) -> Iterator[Callable[..., Peer]]:
    """Connects to the server; options are those of `websockets`."""
    with ExitStack() as opened:
        yield lambda **options: Peer(opened.enter_context(connect(server.url, **options)))


@pytest.fixture
def page(open_page: Callable[..., Peer]) -> Peer:
    """A page that is connected."""
    return open_page()
