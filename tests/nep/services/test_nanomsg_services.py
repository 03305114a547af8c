"""Tests of services over nanomsg without a master: REQ and REP as in pynng, nanocat and the original nep."""

from __future__ import annotations

import json
import os
import shutil
import socket
import struct
import subprocess
import threading
from collections.abc import Iterator

import pytest

import nep
from nep.masters.master import Master
from tests.nep.programs import eventually, running
from tests.nep.services.forking import check_fork

pynng = pytest.importorskip("pynng")
LONG_S = 30.0
needs_nanocat = pytest.mark.skipif(
    shutil.which("nanocat") is None, reason="nanocat is missing (Debian: nanomsg-utils)"
)
SERVER = """
    import os, sys, threading, nep
    node = nep.node("server", "nanomsg", master="127.0.0.1:1")
    def answer(request):
        if request == "hang":
            print("asked")
            threading.Event().wait()
        return {"pid": os.getpid()}
    node.new_server("/x", answer, node.direct("127.0.0.1", int(sys.argv[1]), wire=sys.argv[2]), threads=2)
    print("ready")
    sys.stdin.read()
"""
HEADER = struct.Struct("<BBHIQ")


@pytest.fixture
def port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture
def node() -> Iterator[nep.Node]:
    with nep.node("here", "nanomsg", master="127.0.0.1:1") as made:
        yield made


# ---- other programs


@needs_nanocat
def test_nanocat_calls_a_nep_server(node: nep.Node, port: int) -> None:
    seen = []
    server = node.new_server(
        "/x", lambda request: seen.append(request) or {"n": 2}, node.direct("127.0.0.1", port), threads=1
    )
    for request, answer in (('{"n":1}', '{"n":2}'), ("{oops", '{"nep_error":""')):
        asked = ["nanocat", "--req", "--connect-local", str(port), "--data", request, "--raw"]
        said = subprocess.run(
            [*asked, "--recv-timeout", "30"], check=False, capture_output=True, text=True, timeout=LONG_S
        )
        assert said.stdout.startswith(answer)
    assert seen == [{"n": 1}]
    assert (server.calls, server.refused) == (1, 1)


@needs_nanocat
def test_nep_client_calls_a_nanocat_server(node: nep.Node, port: int) -> None:
    client = node.new_client("/x", node.direct("127.0.0.1", port), timeout_s=LONG_S)
    told = ["nanocat", "--rep", "--bind-local", str(port), "--data", '{"cat":1}', "--raw"]
    with subprocess.Popen(told, stdout=subprocess.PIPE) as cat:
        assert client.call({"n": 1}) == {"cat": 1}
        assert cat.stdout is not None
        assert cat.stdout.read(7) == b'{"n":1}'
        assert [each.result(LONG_S) for each in [client.call_async({}) for _ in range(5)]] == [{"cat": 1}] * 5
        cat.terminate()


def test_pynng_calls_and_serves_with_the_nep_header(node: nep.Node, port: int) -> None:
    at = node.direct("127.0.0.1", port, wire="native")
    with (
        node.new_server("/half", lambda n: n / 2, at, threads=1) as server,
        pynng.Req0(dial=f"tcp://127.0.0.1:{port}", recv_timeout=30_000) as theirs,
    ):
        assert server.endpoints == (f"tcp://127.0.0.1:{port}",)
        theirs.send(HEADER.pack(1, 1, 1, 0, 7) + b"3")
        assert theirs.recv() == HEADER.pack(1, 2, 1, 0, 7) + b"1.5"
        theirs.send(HEADER.pack(1, 1, 1, 0, 8) + b'"x"')
        said = theirs.recv()
        assert said[:16] == HEADER.pack(1, 3, 1, 0, 8)
        assert json.loads(said[16:])["nep_error"] == "TypeError"
    with pynng.Rep0(recv_timeout=30_000) as theirs:
        theirs.listen(f"tcp://127.0.0.1:{port}")
        client = node.new_client("/half", at, timeout_s=LONG_S)
        future = client.call_async(5)
        asked = theirs.recv()
        number = HEADER.unpack(asked[:16])[4]
        theirs.send(HEADER.pack(1, 2, 1, 0, number) + b"2.5")
        assert future.result(LONG_S) == 2.5
        future = client.call_async(5)
        theirs.recv()
        theirs.send(b"nonsense")
        with pytest.raises(nep.NepError, match=r"two parts.* 16 bytes"):
            future.result(LONG_S)


@pytest.mark.parametrize(
    "said", [b"", b"x", bytes(15), bytes(16), HEADER.pack(1, 2, 1, 0, 1), bytes(8_000_000)]
)
def test_malformed_call_is_counted(node: nep.Node, port: int, said: bytes) -> None:
    at = node.direct("127.0.0.1", port, wire="native")
    server = node.new_server("/x", lambda request: request, at, threads=1)
    with pynng.Req0(dial=f"tcp://127.0.0.1:{port}") as theirs:
        theirs.send(said)
        eventually(lambda: server.unreadable == 1)
    assert node.new_client("/x", at, timeout_s=LONG_S).call([1]) == [1]
    assert server.calls == 1


# ---- failures


@pytest.mark.parametrize("wire", [pytest.param("original", marks=pytest.mark.long), "native"])
def test_call_fails_when_its_server_dies_and_the_next_call_reaches_the_restarted_server(
    node: nep.Node, port: int, wire: str
) -> None:
    client = node.new_client("/x", node.direct("127.0.0.1", port, wire=wire), timeout_s=LONG_S)
    with running(SERVER, str(port), wire) as program:
        program.line()
        future = client.call_async("hang", timeout_s=None)
        assert program.line() == "asked"
        assert client.call({}) == {"pid": program.process.pid}
        program.kill()
        with pytest.raises(nep.ServerGoneError, match="'/x'"):
            future.result(LONG_S)
    with running(SERVER, str(port), wire) as program:  # the client finds the restarted server
        program.line()
        assert client.call({}) == {"pid": program.process.pid}


def test_server_exceptions_are_sent_as_replies_on_the_original_wire(node: nep.Node, port: int) -> None:
    def answer(request):
        raise LookupError("no map")

    at = node.direct("127.0.0.1", port)
    node.new_server("/x", answer, at, threads=1)
    client = node.new_client("/x", at, timeout_s=LONG_S)
    with pytest.raises(nep.ServiceError, match="LookupError: no map"):
        client.call({})
    with pytest.raises(nep.NoServerError, match=r"no server for '/y' within 0\.1 s"):
        node.new_client("/y", node.direct("127.0.0.1", 1)).call({}, timeout_s=0.1)


def test_client_that_does_not_read_does_not_block_other_clients(
    node: nep.Node, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client requests large replies and reads none."""
    monkeypatch.setattr("nep.backends.nanomsg.direct_services._REPLY_TIMEOUT_MS", 1000)
    at = node.direct("127.0.0.1", port)
    node.new_server("/big", lambda n: "x" * n, at, threads=2)
    with socket.create_connection(("127.0.0.1", port)) as rude:
        rude.sendall(b"\0SP\0\0\x30\0\0")
        for number in range(3):
            rude.sendall(struct.pack(">QI", 11, 2**31 + number) + b"9000000")
        client = node.new_client("/big", at, timeout_s=LONG_S)
        assert client.call(3) == "xxx"


def test_threads_of_timed_out_calls_are_bounded(node: nep.Node, port: int) -> None:
    go_on = threading.Event()
    at = node.direct("127.0.0.1", port, wire="native")
    node.new_server("/x", lambda _request: go_on.wait(LONG_S), at, threads=1)
    client = node.new_client("/x", at)
    eventually(lambda: client.is_connected)
    futures = [client.call_async(n, timeout_s=0.2) for n in range(150)]
    for future in futures:
        with pytest.raises(nep.WaitTimeoutError):
            future.result(LONG_S)
    eventually(lambda: len(client._transport._threads) <= 101)
    go_on.set()
    assert client.call(0, timeout_s=LONG_S) is True
    eventually(lambda: not client._transport._threads)


def test_nanomsg_services_reject_ports_in_use_non_json_codecs_and_closed_nodes(
    node: nep.Node, port: int
) -> None:
    at = node.direct("127.0.0.1", port)
    with node.new_server("/x", lambda request: request, at), pytest.raises(nep.AddressInUseError):
        node.new_server("/x", lambda request: request, at)
    with pytest.raises(nep.NepError, match=r"JSON.*msg_type.*wire='native'"):
        node.new_client("/x", at, msg_type="msgpack")
    node.close()
    for make in (node.new_server, node.new_client):
        with pytest.raises(nep.ClosedError):
            make("/x", configuration=at)


def test_nanomsg_and_zeromq_nodes_call_each_other_through_the_master(master: Master) -> None:
    with (
        nep.node("a", "nanomsg", master=master.address) as a,
        nep.node("b", "zeromq", master=master.address) as b,
    ):
        a.new_server("/a", lambda request: ["a", request], threads=1)
        b.new_server("/b", lambda request: ["b", request], threads=1)
        assert b.new_client("/a").call(1, timeout_s=LONG_S) == ["a", 1]
        assert a.new_client("/b").call(2, timeout_s=LONG_S) == ["b", 2]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks here")
def test_node_is_closed_in_a_forked_child(port: int) -> None:
    check_fork(
        "nep.node('parent', 'nanomsg', master='127.0.0.1:1')",
        f"node.direct('127.0.0.1', {port}, wire='native')",
    )


def test_program_exits_without_closing_services(port: int) -> None:
    code = f"""
    import threading, nep
    node = nep.node("forgetful", "nanomsg", master="127.0.0.1:1")
    at = node.direct("127.0.0.1", {port}, wire="native")
    node.new_server("/x", lambda request: threading.Event().wait(), at, threads=1)
    client = node.new_client("/x", at)
    client.call_async(1, timeout_s=None)
    print("ends")
    """
    with running(code) as program:
        out, err = program.end()
        assert out == "ends\n"
        assert err == ""
        assert program.process.returncode == 0
