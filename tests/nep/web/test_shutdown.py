"""Tests of the end of the server and of `nep web` while clients are connected."""

from __future__ import annotations

import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

import nep
from nep.masters.master import Master
from nep.programs.web import WebServer
from tests.nep.programs import eventually, running
from tests.nep.web.conftest import Peer
from tests.nep.web.test_command import COMMAND

_BIG = "x" * 500_000


@contextmanager
def page_that_never_reads(url: str, node: nep.Node) -> Iterator[ClientConnection]:
    """Connect a page whose connection is full: the server can't even send it a close frame."""
    publisher = node.new_pub("/big", "string")
    with connect(url, max_queue=1) as stuck, connect(url) as quick:
        for each in (stuck, quick):
            Peer(each).send("subscribe", topic="/big", queue_length=1)
        eventually(lambda: publisher.subscribers == 2)
        for _number in range(60):
            publisher.publish(_BIG)
            Peer(quick).receive("publish")
        yield stuck
        stuck.socket.shutdown(socket.SHUT_RDWR)


def close_code(connection: ClientConnection) -> int | None:
    try:
        while True:
            connection.recv(30)
    except ConnectionClosed as closed:
        return None if closed.rcvd is None else closed.rcvd.code


def test_unresponsive_connections_do_not_delay_shutdown(server: WebServer, node: nep.Node) -> None:
    with (
        page_that_never_reads(server.url, node),
        socket.create_connection(("127.0.0.1", server.port)),  # no handshake
        connect(server.url) as page,
    ):
        eventually(lambda: len(server.pages) == 3)
        server.close()
        assert server.wait(0)
        assert close_code(page) == 1001
    assert server.problem is None
    assert server.pages == ()


def test_page_that_never_reads_can_be_disconnected(server: WebServer, node: nep.Node) -> None:
    with page_that_never_reads(server.url, node):
        eventually(lambda: len(server.pages) == 2)
        server.disconnect(server.pages[0].id)
        eventually(lambda: len(server.page_names) == 1)


@contextmanager
def connected(count: int) -> Iterator[tuple[str, list[ClientConnection], object]]:
    """Start `nep web` with `count` clients, half of them with Foxglove's protocol."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = str(probe.getsockname()[1])
    with running(COMMAND, "web", "--port", port, "--foxglove") as program, ExitStack() as opened:
        url = program.line().split()[-1]
        protocols = (None, ["foxglove.websocket.v1"])
        clients = [
            opened.enter_context(connect(url, subprotocols=protocols[number % 2])) for number in range(count)
        ]
        for each in clients[::2]:
            Peer(each).send("subscribe", topic="/small", type="std_msgs/String")
            assert Peer(each).refusal("nothing")
        for each in clients[1::2]:
            assert "serverInfo" in str(each.recv(30))
        yield url, clients, program


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_terminated_command_closes_every_page(master: Master, node: nep.Node) -> None:
    with connected(20) as (url, clients, program), page_that_never_reads(url, node):
        program.signal(signal.SIGTERM)
        assert {close_code(each) for each in clients} == {1001}
        out, err = program.end()
    assert (program.process.returncode, err) == (0, "")
    assert "22 connections" in out


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_interrupted_command_closes_every_page(master: Master) -> None:
    with connected(4) as (_url, clients, program):
        program.signal(signal.SIGINT)
        assert {close_code(each) for each in clients} == {1001}
        _out, err = program.end()
    assert (program.process.returncode, err) == (130, "")
