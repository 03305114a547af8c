"""Tests of services over plain TCP: clients with only a socket, malformed frames, killed servers."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import socket
import struct
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from typing_extensions import Self

import nep
from tests.nep.programs import eventually, running

LONG_S = 30.0
SERVER = """
    import sys, threading, nep
    node = nep.node("server")
    def answer(request):
        print("asked")
        threading.Event().wait()
    node.new_server("/x", answer, node.direct("127.0.0.1", sys.argv[1], wire="tcp"), threads=1)
    print("ready")
    sys.stdin.read()
"""


@pytest.fixture
def port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def node() -> Iterator[nep.Node]:
    with nep.node("here", master="127.0.0.1:1") as made:  # no master runs there: none is needed
        yield made


class Program:
    """Client as another language implements it from docs/services.md, with only a socket."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), LONG_S)
        self.file = self.socket.makefile("rb")

    def send(self, number: int, request: object, *, version: int = 1, kind: int = 1, size: int = 0) -> None:
        payload = json.dumps(request).encode()
        head = struct.pack("<IBBHIQ", size or 16 + len(payload), version, kind, 1, 0, number)
        self.socket.sendall(head + payload)

    def receive(self) -> tuple[int, int, Any]:
        size, version, kind, codec, rest, number = struct.unpack("<IBBHIQ", self.file.read(20))
        assert (version, codec, rest) == (1, 1, 0)
        return kind, number, json.loads(self.file.read(size - 16))

    def is_ended(self) -> bool:
        return self.file.read(1) == b""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.file.close()
        self.socket.close()


def serve(node: nep.Node, port: int, threads: int = 1):
    def answer(request):
        if request == "bad":
            raise LookupError("no such joint")
        return {"heard": request}

    return node.new_server("/x", answer, node.direct("127.0.0.1", port, wire="tcp"), threads=threads)


def test_program_with_a_plain_socket_receives_replies(node: nep.Node, port: int) -> None:
    server = serve(node, port)
    with Program(port) as program, Program(port) as other:
        program.send(7, {"n": 1})
        other.send(7, "grüß")
        assert program.receive() == (2, 7, {"heard": {"n": 1}})
        assert other.receive() == (2, 7, {"heard": "grüß"})
        program.send(8, "bad")
        assert program.receive() == (3, 8, {"nep_error": "LookupError", "reason": "no such joint"})
        for number in range(300):
            program.send(number, number)
        assert [program.receive() for _ in range(300)] == [(2, n, {"heard": n}) for n in range(300)]
    assert (server.calls, server.errors, server.unreadable) == (303, 1, 0)
    assert server.endpoints == (f"tcp://127.0.0.1:{port}",)


def test_client_that_shuts_down_its_sending_side_receives_its_replies(node: nep.Node, port: int) -> None:
    go_on = threading.Event()
    node.new_server(
        "/x",
        lambda request: go_on.wait(LONG_S) and request,
        node.direct("127.0.0.1", port, wire="tcp"),
        threads=1,
    )
    with Program(port) as program:
        program.send(1, "a")
        program.send(2, "b")
        program.socket.shutdown(socket.SHUT_WR)
        go_on.set()
        assert program.receive() == (2, 1, "a")
        assert program.receive() == (2, 2, "b")
        assert program.is_ended()


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        (b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", "542393671 bytes"),
        (b"\0\0\0\0", "invalid call size: 0 bytes"),
        (struct.pack("<I", 16 + 2**26 + 1), "67108881 bytes"),
        (b"\xff" * 1000, "4294967295 bytes"),
    ],
)
def test_malformed_frame_closes_the_connection_and_is_counted(
    node: nep.Node, port: int, caplog: pytest.LogCaptureFixture, said: bytes, reason: str
) -> None:
    server = serve(node, port)
    with Program(port) as program, Program(port) as stranger:
        stranger.socket.sendall(said)
        eventually(lambda: server.unreadable == 1)
        with contextlib.suppress(ConnectionResetError):  # the server closed before reading everything
            assert stranger.is_ended()
        program.send(1, {})
        assert program.receive() == (2, 1, {"heard": {}})
    assert "malformed call to '/x' (1 so far)" in caplog.text
    assert reason in caplog.text


def test_incomplete_call_at_end_of_connection_is_counted(node: nep.Node, port: int) -> None:
    server = serve(node, port)
    with Program(port) as stranger:
        stranger.send(1, {}, size=100)
    eventually(lambda: server.unreadable == 1)
    assert server.calls == 0


def test_malformed_calls_are_counted_and_the_next_call_receives_a_reply(node: nep.Node, port: int) -> None:
    server = serve(node, port)
    with Program(port) as program:
        for _ in range(250):
            program.send(1, {}, version=9)
            program.send(1, {}, kind=2)
        program.send(5, {})
        assert program.receive() == (2, 5, {"heard": {}})
    assert (server.unreadable, server.calls) == (500, 1)


def test_undecodable_request_is_rejected(node: nep.Node, port: int) -> None:
    serve(node, port)
    with Program(port) as program:
        program.socket.sendall(struct.pack("<IBBHIQ", 21, 1, 1, 1, 0, 3) + b"{oops")
        kind, number, told = program.receive()
        assert (kind, number, told["nep_error"]) == (4, 3, "")
        assert "can't decode" in told["reason"]


def test_call_fails_when_its_server_is_killed_and_the_next_call_reaches_a_new_server(
    node: nep.Node, port: int
) -> None:
    client = node.new_client("/x", node.direct("127.0.0.1", port, wire="tcp"), timeout_s=None)
    with running(SERVER, str(port)) as program:
        assert program.line() == "ready"
        future = client.call_async({})
        assert program.line() == "asked"
        program.kill()
        with pytest.raises(nep.ServerGoneError):
            future.result(LONG_S)
    future = client.call_async({"n": 1})
    serve(node, port)  # the client finds the new server
    assert future.result(LONG_S) == {"heard": {"n": 1}}


@pytest.mark.parametrize(
    ("said", "error"),
    [
        (b"\xff\xff\xff\xff", nep.ServerGoneError),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", nep.ServerGoneError),
        (struct.pack("<IBBHIQ", 16, 1, 1, 1, 0, 1), nep.ServiceTimeoutError),  # a call, not a reply
        (struct.pack("<IBBHIQ", 16, 1, 2, 1, 0, 99), nep.ServiceTimeoutError),  # unknown call number
        (struct.pack("<IBBHIQ", 16, 1, 2, 1, 0, 1), nep.DecodeError),
    ],
)
def test_malformed_or_unmatched_plain_tcp_reply_raises_a_nep_error(
    node: nep.Node, port: int, said, error
) -> None:
    with socket.create_server(("127.0.0.1", port)) as listener:
        client = node.new_client("/x", node.direct("127.0.0.1", port, wire="tcp"))
        eventually(lambda: client.is_connected)
        future = client.call_async({}, timeout_s=1.0 if error is nep.ServiceTimeoutError else LONG_S)
        listener.settimeout(LONG_S)
        connected, _address = listener.accept()
        with connected:
            connected.settimeout(LONG_S)
            assert connected.recv(22, socket.MSG_WAITALL)[20:] == b"{}"
            connected.sendall(said)
            with pytest.raises(error):
                future.result(LONG_S)


def test_reply_sent_just_before_connection_close_is_received(node: nep.Node, port: int) -> None:
    with socket.create_server(("127.0.0.1", port)) as listener:
        listener.settimeout(LONG_S)
        at = node.direct("127.0.0.1", port, wire="tcp")
        for _ in range(20):
            client = node.new_client("/x", at, timeout_s=LONG_S)
            future = client.call_async({})
            connected, _address = listener.accept()
            with connected:
                connected.settimeout(LONG_S)
                head = connected.recv(22, socket.MSG_WAITALL)
                connected.sendall(struct.pack("<IBBHI", 19, 1, 2, 1, 0) + head[12:20] + b"[1]")
            assert future.result(LONG_S) == [1]
            client.close()


def test_connections_beyond_the_limit_are_closed(
    node: nep.Node, port: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("nep.backends.zeromq.services.tcp_server._MAX_PEERS", 2)
    serve(node, port)
    with Program(port) as one, Program(port) as two:
        for each in (one, two):
            each.send(1, {})
            each.receive()
        with Program(port) as three:
            assert three.is_ended()
        two.send(2, {})
        assert two.receive()[:2] == (2, 2)
    assert "rejected a client of '/x' (1 so far)" in caplog.text
    eventually(lambda: _is_answered(port))


def _is_answered(port: int) -> bool:
    """Return True if the server accepts another connection and replies."""
    with Program(port) as program:
        try:
            program.send(1, {})
            return program.receive()[0] == 2
        except (OSError, struct.error):
            return False


def test_client_with_too_many_unread_replies_is_logged_and_does_not_block_other_clients(
    node: nep.Node, port: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("nep.backends.zeromq.services.tcp_server._MAX_UNREAD_BYTES", 10_000_000)
    caplog.set_level(logging.WARNING)
    answer = {"x": "y" * 4_000_000}
    server = node.new_server(
        "/x", lambda _request: answer, node.direct("127.0.0.1", port, wire="tcp"), threads=1
    )
    with Program(port) as lazy, Program(port) as other:
        for number in range(20):
            lazy.send(number, {})
        eventually(lambda: server.calls == 20)
        other.send(1, {})
        assert other.receive() == (2, 1, answer)
        assert lazy.receive() == (2, 0, answer)
    assert "the client doesn't read its replies" in caplog.text


def test_client_without_a_server_does_not_connect_to_itself(
    node: nep.Node, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system may assign a socket the very port that it connects to, if no process listens there."""

    class OwnPort(socket.socket):
        def connect_ex(self, address):
            self.bind(address)
            return super().connect_ex(address)

    monkeypatch.setattr("nep.backends.zeromq.services.tcp_stream.socket.socket", OwnPort)
    client = node.new_client("/x", node.direct("127.0.0.1", port, wire="tcp"))
    with pytest.raises(nep.NoServerError):
        client.call({}, timeout_s=1.0)
    assert not client.is_connected


def test_port_in_use_and_invalid_addresses_are_rejected(node: nep.Node, port: int) -> None:
    server = serve(node, port)
    with pytest.raises(nep.AddressInUseError, match="in use by another program"):
        serve(node, port)
    server.close()
    server.close()
    serve(node, port)
    with pytest.raises(nep.AddressInUseError, match=rf"'192\.0\.2\.1:{port}' .*address of this computer"):
        node.new_server("/y", print, node.direct("192.0.2.1", port, wire="tcp"))
    with pytest.raises(nep.NepError):
        node.new_client("/y", node.direct("*", port, wire="tcp"))


def test_plain_tcp_is_rejected_for_topics(node: nep.Node, port: int) -> None:
    at = node.direct("127.0.0.1", port, wire="tcp")
    for make in (
        lambda: node.new_pub("t", "json", at),
        lambda: node.new_sub("t", "json", at),
        lambda: node.new_callback("t", "json", print, at),
    ):
        with pytest.raises(nep.NepError, match=r"TCP .*wire='tcp'"):
            make()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_fork_closes_services_in_the_child_and_not_in_the_parent(node: nep.Node, port: int) -> None:
    server = serve(node, port)
    client = node.new_client("/x", node.direct("127.0.0.1", port, wire="tcp"), timeout_s=LONG_S)
    assert client.call(1) == {"heard": 1}
    child = os.fork()
    if child == 0:
        code = 1
        try:
            client.call(2)
        except nep.ClosedError:
            code = 0 if server.is_closed and client.is_closed else 2
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert client.call(3) == {"heard": 3}
    server.close()
    eventually(lambda: not client.is_connected)
