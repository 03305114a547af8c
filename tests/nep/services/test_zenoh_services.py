"""Tests of services over zenoh: faults, a router, and programs that use zenoh without nep."""

from __future__ import annotations

import itertools
import json
import os
import signal
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import nep
from nep.backends.zenoh import keys
from nep.backends.zenoh.library import create_handler, load_zenoh
from nep.protocol.requests import PublisherRecord, SubscriberRecord
from tests.nep.programs import eventually, running

LONG_S = 30.0
_names = itertools.count()
SERVER = """
import os, sys, threading, nep
node = nep.node("server", "zenoh", master=sys.argv[1])
def answer(request):
    if request == "hang":
        print("asked")
        threading.Event().wait()
    return {"pid": os.getpid()}
node.new_server("/x", answer, threads=2)
print("ready")
sys.stdin.read()
"""
ROUTER = """
import sys, zenoh
with zenoh.open(zenoh.Config.from_json5(sys.argv[1])):
    print("routes")
    sys.stdin.read()
"""
HEADER = struct.Struct("<BBHIQ")
"""Header of calls and replies as in docs/services.md: version, kind, codec, milliseconds, number."""

Make = Callable[..., nep.Node]


@pytest.fixture
def place() -> str:
    return f"local/services-{os.getpid()}-{next(_names)}"


@pytest.fixture
def make(place: str, patient: None) -> Iterator[Make]:
    made: list[nep.Node] = []

    def new(name: str, where: str = place) -> nep.Node:
        made.append(nep.node(name, "zenoh", master=where))
        return made[-1]

    yield new
    for node in made:
        node.close()


@pytest.fixture(scope="module")
def routed() -> Iterator[str]:
    """Address of a zenoh router."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    told = {
        "mode": "router",
        "listen": {"endpoints": [endpoint]},
        "scouting": {"multicast": {"enabled": False}},
    }
    with running(ROUTER, json.dumps(told)) as router:
        router.line()
        yield endpoint


@pytest.fixture
def stranger(routed: str) -> Iterator[Any]:
    """Session of a program that uses zenoh without nep."""
    told = {
        "mode": "client",
        "connect": {"endpoints": [routed]},
        "scouting": {"multicast": {"enabled": False}},
    }
    with load_zenoh().open(load_zenoh().Config.from_json5(json.dumps(told))) as session:
        yield session


# ---- server crashes


def test_call_fails_when_its_server_dies_and_the_next_call_reaches_the_restarted_server(
    make: Make, place: str
) -> None:
    client = make("client").new_client("/x", timeout_s=LONG_S)
    with running(SERVER, place) as program:
        program.line()
        future = client.call_async("hang", timeout_s=None)
        assert program.line() == "asked"
        assert client.call({}) == {"pid": program.process.pid}
        program.kill()
        with pytest.raises(nep.ServerGoneError, match="'/x'"):
            future.result(LONG_S)
    eventually(lambda: not client.is_connected)
    waiting = client.call_async({})
    with running(SERVER, place) as program:  # the client finds the restarted server
        program.line()
        assert waiting.result(LONG_S) == {"pid": program.process.pid}


def test_calls_succeed_and_server_death_is_reported_through_a_router(make: Make, routed: str) -> None:
    client = make("client", routed).new_client("/x", timeout_s=LONG_S)
    with running(SERVER, routed) as program:
        program.line()
        future = client.call_async("hang", timeout_s=None)
        assert program.line() == "asked"
        assert client.call({}) == {"pid": program.process.pid}
        viewer = make("viewer", routed)

        def is_seen() -> bool:
            service = viewer.graph().services.get("/x")
            return service is not None and (len(service.servers), len(service.clients)) == (1, 1)

        eventually(is_seen)
        program.kill()
        with pytest.raises(nep.ServerGoneError):
            future.result(LONG_S)


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="there are no signals that stop")
def test_suspended_server_replies_to_pending_calls_after_resuming(make: Make, place: str) -> None:
    client = make("client").new_client("/x", timeout_s=LONG_S)
    with running(SERVER, place) as program:
        program.line()
        assert client.call({}) == {"pid": program.process.pid}
        program.stop()
        with pytest.raises(nep.ServiceTimeoutError, match=r"0\.3 s.*'/x'"):
            client.call({}, timeout_s=0.3)
        future = client.call_async({})
        program.signal(signal.SIGCONT)
        assert future.result(LONG_S) == {"pid": program.process.pid}
        eventually(lambda: client.late == 1)


# ---- programs with plain zenoh, as described in docs/zenoh.md


def asked(session: Any, key: str, header: bytes | None, data: bytes | None) -> list[tuple[bytes, bytes]]:
    """Call a server; return header and payload of each reply."""
    replies = session.get(key, payload=data, attachment=header, timeout=LONG_S)
    return [(reply.ok.attachment.to_bytes(), reply.ok.payload.to_bytes()) for reply in replies]


def test_zenoh_program_calls_a_nep_server(make: Make, routed: str, stranger: Any) -> None:
    def answer(request):
        return 1 / request["n"]

    server = make("server", routed).new_server("/inverse", answer, threads=1)
    (key,) = server.endpoints
    call = HEADER.pack(1, 1, 1, 0, 7)
    assert asked(stranger, key, call, b'{"n": 2}') == [(HEADER.pack(1, 2, 1, 0, 7), b"0.5")]
    ((header, said),) = asked(stranger, key, call, b'{"n": 0}')
    assert HEADER.unpack(header)[:3] == (1, 3, 1)
    assert json.loads(said)["nep_error"] == "ZeroDivisionError"
    ((header, said),) = asked(stranger, key, call, b"{oops")
    assert HEADER.unpack(header)[1] == 4
    assert (server.calls, server.errors, server.refused) == (2, 1, 1)


@pytest.mark.parametrize(
    "header",
    [None, b"", bytes(15), bytes(17), bytes(16), HEADER.pack(1, 2, 1, 0, 7), HEADER.pack(2, 1, 1, 0, 7)],
)
def test_malformed_call_is_counted_without_reply(make: Make, place: str, header: bytes | None) -> None:
    node = make("server")
    server = node.new_server("/x", lambda request: request, threads=1)
    (session,) = node._transport._sessions.values()
    assert asked(session._zenoh, server.endpoints[0], header, b"{}") == []
    assert (server.unreadable, server.calls) == (1, 0)
    assert make("client").new_client("/x").call({"n": 2}, timeout_s=LONG_S) == {"n": 2}


def test_nep_client_calls_a_zenoh_program(
    make: Make, routed: str, stranger: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nep.backends.zenoh.services._TOKEN_DELAY_S", 0.05)
    seen = []

    def answer(query) -> None:
        version, kind, codec, limit_ms, number = HEADER.unpack(query.attachment.to_bytes())
        seen.append((version, kind, codec, 0 < limit_ms <= LONG_S * 1000))
        request = json.loads(query.payload.to_bytes())
        with query:
            if request == "nonsense":
                query.reply(key, b"{}", attachment=bytes(16))
            elif request == "twice":
                query.reply(key, b"1", attachment=HEADER.pack(1, 2, 1, 0, number))
                query.reply(key, b"2", attachment=HEADER.pack(1, 2, 1, 0, number))
            elif request == "error":
                query.reply_err(b"zenoh's own")
            elif request != "nothing":
                query.reply(key, query.payload, attachment=HEADER.pack(1, 2, 1, 0, number))

    key = "nep/v1/serve/%2Fecho/0000000000000001/00000000000000ab"
    client = make("client", routed).new_client("/echo", timeout_s=LONG_S)
    assert not client.is_connected
    queryable = stranger.declare_queryable(key, create_handler(answer))
    token = stranger.liveliness().declare_token("nep/v1/live/someone/srv/ab/%2Fecho/1")
    assert client.call({"n": 1}) == {"n": 1}
    for what in ("nothing", "nonsense", "error"):  # not reported as a server that has ended
        with pytest.raises(nep.NepError, match=f"'/echo' .*'{key}'"):
            client.call(what)
    assert client.call("twice") == 1
    eventually(lambda: client.late == 1)
    assert set(seen) == {(1, 1, 1, True)}
    token.undeclare()
    eventually(lambda: not client.is_connected)
    queryable.undeclare()


def test_all_clients_call_the_first_of_several_servers(make: Make) -> None:
    for number in range(3):
        make(f"server {number}").new_server("/x", lambda _request, said=number: said, threads=1)
    clients = [make(f"client {number}").new_client("/x", timeout_s=LONG_S) for number in range(2)]
    assert [client.call({}) for client in clients for _ in range(3)] == [0] * 6


def test_survey_reaches_all_respondents(make: Make) -> None:
    for number in range(3):
        make(f"respondent {number}").new_respondent(
            "/who", lambda question, said=number: [said, 1 / question], threads=1
        )
    surveyor = make("surveyor").new_surveyor("/who", LONG_S * 1000)
    eventually(lambda: surveyor.respondents == 3)
    assert sorted(surveyor.ask(2)) == [[0, 0.5], [1, 0.5], [2, 0.5]]
    assert surveyor.ask(0) == []
    assert surveyor.failures == 3


def test_node_calls_its_own_server(make: Make) -> None:
    node = make("both")
    node.new_server("/x", lambda request: request, threads=1)
    assert node.new_client("/x", timeout_s=LONG_S).call([1]) == [1]


def test_wildcard_subscription_receives_no_service_calls(make: Make) -> None:
    node = make("node")
    sub = node.new_sub("**")
    node.new_server("/x", lambda request: request, threads=1)
    assert node.new_client("/x", timeout_s=LONG_S).call(1) == 1
    pub = node.new_pub("/x")
    pub.publish(2)
    assert sub.listen(timeout_s=LONG_S) == (True, 2)
    assert set(node.graph().topics) == {"/x"}


def test_direct_servers_and_clients_are_rejected(make: Make) -> None:
    node = make("node")
    for made in (node.new_server, node.new_client):
        with pytest.raises(nep.NepError, match=r"'zenoh' .*direct connections"):
            made("/x", configuration=node.direct(port=7000))


# ---- keys and forks


@pytest.mark.parametrize("word", ["/x", "%", "a/b", "*", "é 漢", "x" * 180])
def test_service_token_round_trip(word: str) -> None:
    endpoint = keys.service_key(word, 2**63, 2**64 - 1)
    server = PublisherRecord(2**64 - 1, f"nep.service:{word}", "service", "service", (endpoint,))
    client = SubscriberRecord(1, f"nep.service:{word}", "service")
    assert keys.parse_token(keys.server_key("n", server)) == ("n", server)
    assert keys.parse_token(keys.client_key("n", client)) == ("n", client)


@pytest.mark.parametrize(
    "words",
    [
        "srv",
        "srv/1",
        "srv/1/x",
        "srv/0/x/1",
        "srv/1/x/0",
        "srv/1/%/1",
        "srv/1/x/-1",
        f"srv/1/x/{2**64:x}",
        "srv/1/x/1/more",
        "cli/1",
        "cli/0/x",
        "cli/1/%",
        "cli/1/x/more",
        "pub/1/nep.service%3Ax/service/service/plain",  # would sort before all servers
        "sub/1/nep.service%3Ax/service",
    ],
)
def test_invalid_service_token_is_not_parsed(words: str) -> None:
    assert keys.parse_token(f"nep/v1/live/n/{words}") is None


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks here")
def test_services_are_closed_in_a_forked_child(place: str) -> None:
    code = f"""
    import os, sys, nep
    def say(it):
        os.write(1, (str(it) + "\\n").encode())
    node = nep.node("parent", "zenoh", master={place!r})
    server = node.new_server("/x", lambda request: request, threads=1)
    slow = node.new_server("/slow", lambda request: node.stop_spin() or request)
    client = node.new_client("/x", timeout_s=30.0)
    waiting = node.new_client("/slow", timeout_s=30.0).call_async(2)
    while not node._services.queues[0]._calls:
        pass
    child = os.fork()
    if child == 0:
        try:
            client.call(1)
        except nep.ClosedError as error:
            say(error)
        server.close()
        node.close()
        sys.exit(7)
    say(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    say(client.call("fine"))
    node.spin(30.0)
    say(waiting.result(30.0))
    node.close()
    """
    with running(code) as program:
        assert "client of '/x' belongs to the parent process" in program.line()
        assert [program.line() for _ in range(3)] == ["7", "fine", "2"]


def test_closing_a_node_during_concurrent_calls_raises_closed_error(make: Make) -> None:
    make("server").new_server("/x", lambda request: request, threads=2)
    node = make("caller")
    client = node.new_client("/x", timeout_s=LONG_S)
    errors: list[BaseException] = []

    def call() -> None:
        try:
            while True:
                client.call("x" * 100)
        except nep.NepError as error:
            errors.append(error)

    threads = [threading.Thread(target=call, name=f"caller {n}") for n in range(4)]
    for thread in threads:
        thread.start()
    eventually(lambda: client._transport.counts().received > 20)
    node.close()
    for thread in threads:
        thread.join(LONG_S)
    assert len(errors) == 4
    assert all(isinstance(each, nep.ClosedError) for each in errors)
