"""Tests of connections to subscribers on other computers; tests/faults covers how stale ones are closed."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zmq

from nep.backends.zeromq.sockets import RemoteConnection, enable_keep_alive
from nep.backends.zeromq.subscriptions import Subscriptions
from nep.protocol.wire import hello_part

pytestmark = pytest.mark.skipif(os.name != "posix", reason="elsewhere numbers of sockets are none of files")
WANTED, GONE = b"\1", b"\0"


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Both ends of a TCP connection."""
    with ExitStack() as stack:
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        near = stack.enter_context(socket.create_connection(listener.getsockname()))
        far = stack.enter_context(listener.accept()[0])
        far.settimeout(20.0)
        yield near, far


def test_connection_is_shut_down_only_if_its_peer_is_unchanged(
    ends: tuple[socket.socket, socket.socket],
) -> None:
    near, far = ends
    peer = near.getpeername()
    RemoteConnection(near.fileno(), (peer[0], peer[1] + 1)).close()
    near.sendall(b"!")
    assert far.recv(1) == b"!", "its number belongs to another one by now"
    RemoteConnection(near.fileno(), peer).close()
    assert far.recv(1) == b""


@pytest.mark.parametrize("kind", ["closed", "file", "pipe"])
def test_descriptor_that_is_no_longer_a_connection_is_ignored(kind: str) -> None:
    ours, theirs = os.pipe()
    with Path(os.devnull).open("rb") as file:
        fd = {"closed": ours, "file": file.fileno(), "pipe": theirs}[kind]
        if kind == "closed":
            os.close(ours)
        RemoteConnection(fd, ("10.0.0.1", 5)).close()
    for each in {ours, theirs} - ({ours} if kind == "closed" else set()):
        os.close(each)


ENDED: list[int] = []


class Connection(RemoteConnection):
    def close(self) -> None:
        ENDED.append(self.fd)


def test_hello_over_another_connection_closes_the_previous_one() -> None:
    ENDED.clear()
    subscriptions = Subscriptions("t", 7)
    one, two = (Connection(number, ("10.0.0.1", number)) for number in (1, 2))
    hello = hello_part(5, "t", reads_batches=True)
    for connection in (one, one, two):
        assert (
            subscriptions.handle_event(WANTED + hello, 0, lambda connection=connection: connection) == hello
        )
    assert ENDED == [1]
    subscriptions.handle_event(GONE + hello, 0)
    subscriptions.handle_event(WANTED + hello, 0, lambda: one)
    subscriptions.handle_event(WANTED + hello_part(6, "t", reads_batches=True), 0, lambda: two)
    assert ENDED == [1], "one that left, and another subscriber's"
    subscriptions.handle_event(WANTED + hello_part(5, "other", reads_batches=True), 0, lambda: two)
    assert ENDED == [1], "no hello to this publisher"


def test_only_connections_to_other_computers_use_keep_alive() -> None:
    with zmq.Context() as context, context.socket(zmq.XPUB) as socket_:
        seen = []
        for host in ("127.0.0.1", "0.0.0.0", "127.0.0.1"):
            enable_keep_alive(socket_, f"tcp://{host}:*")
            seen.append((socket_.getsockopt(zmq.TCP_KEEPALIVE), socket_.getsockopt(zmq.TCP_MAXRT)))
            enable_keep_alive(socket_, "tcp://0.0.0.0:*", has_silence_check=True)
            seen.append((socket_.getsockopt(zmq.TCP_KEEPALIVE), socket_.getsockopt(zmq.TCP_MAXRT)))
    assert seen == [(-1, 0), (1, 0), (1, 15_000), (1, 0), (-1, 0), (1, 0)]
