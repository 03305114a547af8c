"""Tests of calls and replies over every back end with services."""

from __future__ import annotations

import asyncio
import math
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait

import pytest

import nep
from nep.masters.master import Master
from tests.nep.meeting import BACKENDS, place_for
from tests.nep.programs import eventually

LONG_S = 30.0
Make = Callable[[str], nep.Node]


@pytest.fixture(
    params=["zeromq", "memory", "zenoh", "direct", "tcp", pytest.param("sp", marks=pytest.mark.long)]
)
def make(request: pytest.FixtureRequest, master: Master, patient: None) -> Iterator[Make]:
    """Function that creates nodes in the same network; the nodes are closed after the test.

    With "direct", "tcp" and "sp" their servers bind a fixed port, without a master.
    """
    made: list[nep.Node] = []
    backend = {"direct": "zeromq", "tcp": "zeromq", "sp": "nanomsg"}.get(request.param, request.param)
    where = place_for(backend, master.address)
    ports: dict[str, int] = {}

    def new(name: str) -> nep.Node:
        made.append(nep.node(name, backend, master=where))
        if backend != request.param:
            connect_directly(made[-1], "tcp" if request.param == "tcp" else "native", ports)
        return made[-1]

    yield new
    for node in reversed(made):  # SP's server waits a moment for clients that are still connected
        node.close()


@pytest.fixture
def registered(make: Make, request: pytest.FixtureRequest) -> Make:
    """The fixture `make` for tests that need a master or a hub: names, graphs, several servers."""
    if request.node.callspec.params["make"] not in BACKENDS:
        pytest.skip("nobody knows who is there without a master")
    return make


def connect_directly(node: nep.Node, wire: str, ports: dict[str, int]) -> None:
    """Let the node's servers and clients of a service use the same fixed port."""

    def at(service: str) -> nep.Direct:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = ports.setdefault(service, probe.getsockname()[1])
        return node.direct("127.0.0.1", port, wire=wire)

    new_server, new_client = node.new_server, node.new_client

    def server(service, callback=None, configuration=None, **more):
        return new_server(service, callback, configuration or at(service), **more)

    def client(service, configuration=None, **more):
        return new_client(service, configuration or at(service), **more)

    node.new_server, node.new_client = server, client  # type: ignore[method-assign]


@pytest.fixture
def spin() -> Iterator[Callable[[nep.Node], None]]:
    """Function that spins a node in a thread until the end of the test."""
    threads: list[tuple[nep.Node, threading.Thread]] = []

    def start(node: nep.Node) -> None:
        thread = threading.Thread(target=lambda: node.spin(LONG_S), name=f"spin-{node.name}")
        thread.start()
        threads.append((node, thread))

    yield start
    for node, thread in threads:
        node.stop_spin()
        thread.join(LONG_S)


def doubled(request):
    return {"n": 2 * request["n"]}


def test_call_is_handled_in_the_spinning_thread(make: Make, spin) -> None:
    seen = []

    def answer(request):
        seen.append(threading.current_thread().name)
        return doubled(request)

    server = make("server")
    server.new_server("/double", answer)
    spin(server)
    client = make("client").new_client("/double")
    assert client.call({"n": 21}, timeout_s=LONG_S) == {"n": 42}
    assert seen == ["spin-server"]


def test_server_threads_handle_calls_without_spin(make: Make) -> None:
    together = threading.Barrier(3)

    def answer(request):
        together.wait(LONG_S)  # requires three concurrent calls
        return doubled(request)

    server = make("server").new_server("/double", answer, threads=3)
    client = make("client").new_client("/double", timeout_s=LONG_S)
    futures = [client.call_async({"n": n}) for n in range(3)]
    assert [each.result(LONG_S) for each in futures] == [{"n": 0}, {"n": 2}, {"n": 4}]
    assert (server.calls, server.errors) == (3, 0)


def test_callback_that_returns_none_replies_with_an_empty_map(make: Make) -> None:
    make("server").new_server("/quiet", lambda request: None, threads=1)
    assert make("client").new_client("/quiet").call({}, timeout_s=LONG_S) == {}


def test_call_waits_for_its_server_to_start(make: Make) -> None:
    future = make("client").new_client("/later", timeout_s=LONG_S).call_async({"n": 1})
    make("server").new_server("/later", doubled, threads=1)
    assert future.result(LONG_S) == {"n": 2}


def test_concurrent_calls_of_several_clients_receive_their_replies(make: Make) -> None:
    server = make("server").new_server("/double", doubled, threads=2)
    clients = [make(f"client{n}").new_client("/double", timeout_s=LONG_S) for n in range(4)]
    futures = {each.call_async({"n": n}): n for n in range(50) for each in clients}
    assert not wait(futures, LONG_S).not_done
    assert all(future.result() == {"n": 2 * n} for future, n in futures.items())
    assert server.calls == 200


class UntellableError(Exception):
    """Exception whose text cannot be formatted."""

    def __str__(self) -> str:
        raise ZeroDivisionError


@pytest.mark.parametrize(
    ("error", "kind", "reason"),
    [
        (ZeroDivisionError("division by zero"), "ZeroDivisionError", "division by zero"),
        (KeyError(), "KeyError", ""),
        (RuntimeError("\ud800 grüß \x1b[2J" + "x" * 9000), "RuntimeError", None),
        (SystemExit(3), "SystemExit", "3"),
        (KeyboardInterrupt(), "KeyboardInterrupt", ""),
        (GeneratorExit(), "GeneratorExit", ""),
        (UntellableError(), "UntellableError", ""),
    ],
)
def test_callback_exception_raises_service_error_in_the_client(make: Make, error, kind, reason) -> None:
    def answer(request):
        if request == "again":
            return "alive"
        raise error

    server = make("server").new_server("/fails", answer, threads=1)
    client = make("client").new_client("/fails")
    with pytest.raises(nep.ServiceError) as raised:
        client.call({}, timeout_s=LONG_S)
    assert (raised.value.service, raised.value.kind) == ("/fails", kind)
    assert reason is None or raised.value.reason == reason
    assert "\x1b" not in str(raised.value)
    assert "Traceback" not in str(raised.value)
    assert (server.calls, server.errors) == (1, 1)
    assert client.call("again", timeout_s=LONG_S) == "alive"


def test_unencodable_reply_is_a_service_error(make: Make) -> None:
    make("server").new_server("/odd", lambda request: {"set": {1, 2}}, threads=1)
    with pytest.raises(nep.ServiceError) as raised:
        make("client").new_client("/odd").call({}, timeout_s=LONG_S)
    assert raised.value.kind == "EncodeError"


def test_unencodable_request_raises_in_the_call(make: Make) -> None:
    client = make("client").new_client("/odd")
    with pytest.raises(nep.EncodeError):
        client.call({"set": {1, 2}})
    with pytest.raises(nep.EncodeError):
        client.call_async({"set": {1, 2}})


@pytest.mark.parametrize("value", [{}, {"n": 0}, [1, None], "grüß", -1, 2**64 - 1, {"x": "y" * 8_000_000}])
def test_request_value_round_trip(make: Make, value: object) -> None:
    make("server").new_server("/echo", lambda request: request, threads=1)
    assert make("client").new_client("/echo").call(value, timeout_s=LONG_S) == value


def test_msgpack_calls_carry_bytes_and_nan(make: Make) -> None:
    make("server").new_server("/echo", lambda request: request, threads=1)
    client = make("client").new_client("/echo", msg_type="msgpack")
    answer = client.call({"data": b"\0\xff", "nan": math.nan}, timeout_s=LONG_S)
    assert answer["data"] == b"\0\xff"
    assert math.isnan(answer["nan"])


def test_awaited_call_does_not_block_the_event_loop(make: Make) -> None:
    go_on = threading.Event()

    def answer(request):
        assert go_on.wait(LONG_S)
        return doubled(request)

    make("server").new_server("/double", answer, threads=1)
    client = make("client").new_client("/double", timeout_s=LONG_S)

    async def program():
        async def other():
            go_on.set()

        answered, _ = await asyncio.gather(client.acall({"n": 3}), other())
        return answered

    assert asyncio.run(program()) == {"n": 6}


def test_cancelled_awaited_call_discards_its_reply(make: Make) -> None:
    came, go_on = threading.Event(), threading.Event()

    def answer(_request: object) -> dict[str, object]:
        came.set()
        go_on.wait(LONG_S)
        return {}

    server = make("server").new_server("/slow", answer, threads=1)
    client = make("client").new_client("/slow", timeout_s=LONG_S)

    async def program():
        waiting = asyncio.ensure_future(client.acall({}))
        assert await asyncio.to_thread(came.wait, LONG_S)
        waiting.cancel()
        with pytest.raises(asyncio.CancelledError):
            await waiting

    asyncio.run(program())
    go_on.set()
    eventually(lambda: server.calls == 1 and client.late == 1)


def test_future_of_a_call_can_be_cancelled(make: Make) -> None:
    client = make("client").new_client("/nobody", timeout_s=None)
    future = client.call_async({})
    assert future.cancel()
    assert future.cancelled()


def test_blocking_done_callback_of_a_future_does_not_block_other_calls(make: Make) -> None:
    is_added, go_on = threading.Event(), threading.Event()

    def echo(request: object) -> object:
        is_added.wait(LONG_S)  # a callback that is added later is called in this thread
        return request

    make("server").new_server("/echo", echo, threads=1)
    client, other = (make(name).new_client("/echo", timeout_s=LONG_S) for name in ("a", "b"))
    future: Future[object] = client.call_async(1)
    future.add_done_callback(lambda _ended: go_on.wait(LONG_S))
    is_added.set()
    assert other.call(2) == 2
    assert client.call(3) == 3
    go_on.set()
    assert future.result(LONG_S) == 1


def test_call_without_a_server_raises_no_server_error_with_a_suggestion(
    registered: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nep.patterns.services.client._SERVICE_QUERY_TIMEOUT_S", LONG_S)
    registered("server").new_server("/arm/move", doubled, threads=1)
    client = registered("client").new_client("/arm/mov")
    with pytest.raises(
        nep.NoServerError, match=r"no server for '/arm/mov' within 0\.1 s; did you mean '/arm/m"
    ):
        client.call({}, timeout_s=0.1)
    with pytest.raises(nep.NoServerError, match="no server for"):
        asyncio.run(client.acall({}, timeout_s=0.1))
    with pytest.raises(nep.WaitTimeoutError, match="'nep service list' shows all services"):
        client.call_async({}, timeout_s=0).result(LONG_S)


def test_slow_server_raises_service_timeout_and_its_late_reply_is_discarded(make: Make) -> None:
    go_on = threading.Event()
    server = make("server").new_server("/slow", lambda request: go_on.wait(LONG_S) and {}, threads=1)
    client = make("client").new_client("/slow")
    eventually(lambda: client.is_connected)
    with pytest.raises(nep.ServiceTimeoutError, match=r"0\.2 s.*'/slow'"):
        client.call({}, timeout_s=0.2)
    go_on.set()
    eventually(lambda: client.late == 1)
    assert client.call({}, timeout_s=LONG_S) == {}
    assert server.calls + server.refused == 2  # a busy server may have rejected the first as late


def test_timed_out_calls_are_not_executed(make: Make, spin) -> None:
    seen = []
    node = make("server")
    server = node.new_server("/tired", seen.append)
    client = make("client").new_client("/tired")
    eventually(lambda: client.is_connected)
    with pytest.raises(nep.ServiceTimeoutError):
        client.call("late", timeout_s=0.3)
    # Its time limit starts on arrival, possibly after the client's timeout.
    eventually(lambda: any(call.is_late for call in node._services.queues[0]._calls))
    spin(node)
    assert client.call("in time", timeout_s=LONG_S) == {}
    assert seen == ["in time"]
    assert (server.calls, server.refused) == (1, 1)


def test_closing_server_rejects_queued_calls_and_fails_the_running_call(make: Make) -> None:
    node = make("server")
    server = node.new_server("/closes", doubled)  # calls stay queued: no spin
    client = make("client").new_client("/closes", timeout_s=LONG_S)
    eventually(lambda: client.is_connected)
    future = client.call_async({})
    assert node._services.queues[0].pop(LONG_S) is not None  # running when the server closes
    waiting = client.call_async({})
    eventually(lambda: len(node._services.queues[0]._calls) == 1)
    server.close()
    with pytest.raises(nep.RequestRefusedError, match="'/closes' is closing"):
        waiting.result(LONG_S)
    with pytest.raises(nep.ServerGoneError):
        future.result(LONG_S)


def test_closing_server_rejects_every_queued_call(make: Make) -> None:
    """Clients must learn that none of these calls was executed, not that their result is unknown."""
    node = make("server")
    server = node.new_server("/closes", doubled)  # calls stay queued: no spin
    clients = [make(f"client {n}").new_client("/closes", timeout_s=LONG_S) for n in range(4)]
    futures = [client.call_async({"text": "x" * 10_000}) for client in clients for _ in range(100)]
    eventually(lambda: len(node._services.queues[0]._calls) == 400)
    server.close()
    assert server.refused == 400
    for future in futures:
        with pytest.raises(nep.RequestRefusedError, match="'/closes' is closing"):
            future.result(LONG_S)


def test_closing_server_finishes_its_running_call(registered: Make) -> None:
    has_waiting_calls, go_on = threading.Event(), threading.Event()

    def answer(request):
        has_waiting_calls.set()
        assert go_on.wait(LONG_S)
        return request

    first = registered("first").new_server("/x", answer, threads=1)
    client = registered("client").new_client("/x", timeout_s=LONG_S)
    future = client.call_async("first")
    assert has_waiting_calls.wait(LONG_S)
    registered("second").new_server("/x", lambda _request: "second", threads=1)
    closer = threading.Thread(target=lambda: first.close(LONG_S), name="closer")
    closer.start()
    viewer = registered("viewer")
    eventually(lambda: len(viewer.graph().services["/x"].servers) == 1)
    go_on.set()
    assert future.result(LONG_S) == "first"

    def is_second() -> bool:
        try:
            return client.call("next") == "second"
        except nep.RequestRefusedError:  # the client isn't notified of the change yet
            return False

    eventually(is_second)
    closer.join(LONG_S)
    assert (first.calls, first.errors) == (1, 0)


def test_closing_node_finishes_running_calls_of_its_servers(make: Make) -> None:
    has_waiting_calls = threading.Event()
    node = make("server")

    def answer(_request):
        has_waiting_calls.set()
        eventually(lambda: node._services._servers[0]._transport.calls.is_closed)
        return "answered"

    node.new_server("/x", answer, threads=1)
    future = make("client").new_client("/x", timeout_s=LONG_S).call_async({})
    assert has_waiting_calls.wait(LONG_S)
    node.close()
    assert future.result(LONG_S) == "answered"


def test_closing_client_ends_its_calls(make: Make) -> None:
    client = make("client").new_client("/nobody", timeout_s=None)
    errors: list[BaseException] = []

    def call() -> None:
        try:
            client.call({})
        except nep.NepError as error:
            errors.append(error)

    caller = threading.Thread(target=call, name="caller")
    caller.start()
    future = client.call_async({})
    eventually(lambda: len(client._transport._calls) == 2)
    client.close()
    client.close()
    caller.join(LONG_S)
    assert isinstance(errors[0], nep.ClosedError)
    with pytest.raises(nep.ClosedError):
        future.result(LONG_S)
    with pytest.raises(nep.ClosedError, match="client of '/nobody' is closed"):
        client.call({})


def test_closing_node_closes_its_servers_and_clients(make: Make) -> None:
    a, b = make("a"), make("b")
    server = a.new_server("/x", doubled, threads=2)
    client = b.new_client("/x", timeout_s=None)
    assert client.call({"n": 1}) == {"n": 2}
    future = b.new_client("/nobody", timeout_s=None).call_async({})
    b.close()
    a.close()
    assert server.is_closed
    assert client.is_closed
    with pytest.raises(nep.ClosedError):
        future.result(LONG_S)
    with pytest.raises(nep.ClosedError):
        b.new_client("/x")
    with pytest.raises(nep.ClosedError):
        a.new_server("/x")


def test_callback_can_close_its_server_and_call_other_services(make: Make) -> None:
    node = make("server")
    inner = make("inner").new_client("/double", timeout_s=LONG_S)
    make("other").new_server("/double", doubled, threads=1)
    box = []

    def answer(request):
        answered = inner.call(request)
        threading.Thread(target=box[0].close, name="closer").start()
        return answered

    box.append(node.new_server("/outer", answer, threads=1))
    assert make("client").new_client("/outer").call({"n": 4}, timeout_s=LONG_S) == {"n": 8}
    eventually(lambda: box[0].is_closed)


def test_callback_that_calls_its_own_single_threaded_server_times_out(make: Make) -> None:
    """A service that calls itself needs a second thread; with one, the call times out and calls continue."""
    node = make("server")
    inner = make("inner").new_client("/self", timeout_s=0.3)
    server = node.new_server("/self", lambda deep: inner.call(deep - 1) if deep else "done", threads=1)
    client = make("client").new_client("/self", timeout_s=LONG_S)
    eventually(lambda: inner.is_connected)
    with pytest.raises(nep.ServiceError, match=r"ServiceTimeoutError: .*0\.3 s.*'/self'"):
        client.call(1)
    assert client.call(0) == "done"
    assert server.errors == 1
    node.new_server("/two", lambda deep: two.call(deep - 1) if deep else "done", threads=2)
    two = make("two").new_client("/two", timeout_s=LONG_S)
    assert two.call(1) == "done"


def test_fifty_concurrent_clients_receive_their_replies(make: Make) -> None:
    server = make("server").new_server("/echo", lambda request: request, threads=4)
    node = make("callers")
    clients = [node.new_client("/echo", timeout_s=LONG_S) for _ in range(50)]
    futures = [(n, client.call_async(n)) for client in clients for n in range(20)]
    assert all(future.result(LONG_S) == n for n, future in futures)
    assert (server.calls, server.errors, server.refused) == (1000, 0, 0)


def test_listen_info_and_send_info_alternate_and_raise_when_called_out_of_order(make: Make) -> None:
    server = make("server").new_server("/x")
    client = make("client").new_client("/x", timeout_s=LONG_S)
    assert server.listen_info(timeout_s=0) is None
    with pytest.raises(nep.NepError, match="'listen_info'"):
        server.send_info({})
    with pytest.raises(nep.NepError, match="'send_info'"):
        client.listen_info()
    client.send_info({"a": 1})
    with pytest.raises(nep.NepError, match="'listen_info'"):
        client.send_info({"a": 2})
    assert server.listen_info() == {"a": 1}
    with pytest.raises(nep.NepError, match="'send_info'"):
        server.listen_info()
    with pytest.raises(nep.EncodeError):
        server.send_info({1, 2})
    server.send_info({"b": 2})
    assert client.listen_info() == {"b": 2}


def test_second_server_raises_an_alert_and_takes_over(registered: Make) -> None:
    first = registered("first").new_server("/x", lambda request: "first", threads=1)
    client = registered("client").new_client("/x", timeout_s=LONG_S)
    assert client.call({}) == "first"
    second = registered("second").new_server("/x", lambda request: "second", threads=1)
    viewer = registered("viewer")
    alerts = {each.id: each for each in viewer.graph().alerts}
    assert "has 2 servers: “first”, “second”" in alerts["service:/x"].sentence
    assert client.call({}) == "first"
    first.close()

    def is_second() -> bool:
        try:
            return client.call({}) == "second"
        except (nep.ServerGoneError, nep.RequestRefusedError):  # the call still reached the first server
            return False

    eventually(is_second)
    eventually(lambda: "service:/x" not in {each.id for each in viewer.graph().alerts})
    assert second.calls >= 1


def test_services_are_listed_in_the_graph_apart_from_topics(registered: Make) -> None:
    a, b = registered("a"), registered("b")
    server = a.new_server("/x", lambda request: 1 / 0 if request == "bad" else request, threads=1)
    client = b.new_client("/x", timeout_s=LONG_S)
    assert client.call(1) == 1
    with pytest.raises(nep.ServiceError):
        client.call("bad")

    def seen() -> bool:
        info = b.graph().services["/x"]
        return (info.calls, info.errors, info.clients[0].answered) == (2, 1, 2)

    eventually(seen)
    graph = b.graph()
    assert not graph.topics
    info = graph.services["/x"]
    assert [each.node_id for each in info.servers] == [a.id]
    assert [each.node_id for each in info.clients] == [b.id]
    assert info.servers[0].endpoints
    server.close()
    client.close()
    eventually(lambda: not b.graph().services)


@pytest.mark.parametrize("name", ["", "a b", "x{", "\x07", "x" * 189, "nep.service:/x", 7, None])
def test_invalid_service_name_is_rejected(make: Make, name) -> None:
    node = make("node")
    with pytest.raises(nep.BadTopicError):
        node.new_server(name, doubled)
    with pytest.raises(nep.BadTopicError):
        node.new_client(name)


def test_callback_that_returns_futures_replies_in_any_order(make: Make) -> None:
    promised: list[Future[object]] = [Future(), Future(), Future()]
    make("server").new_server("/later", lambda request: promised[request["n"]], threads=1)
    client = make("client").new_client("/later", timeout_s=LONG_S)
    calls = [client.call_async({"n": number}) for number in range(3)]
    eventually(lambda: all(each._done_callbacks for each in promised))
    promised[2].set_result({"answer": 2})
    assert calls[2].result(LONG_S) == {"answer": 2}
    promised[1].set_exception(ValueError("no luck"))
    promised[0].set_result(object())
    for call, reason in ((calls[1], "no luck"), (calls[0], "object")):
        with pytest.raises(nep.ServiceError, match=reason):
            call.result(LONG_S)


def test_service_name_of_maximum_length_can_be_called(make: Make) -> None:
    name = "x" * 188
    make("server").new_server(name, doubled, threads=1)
    assert make("client").new_client(name).call({"n": 1}, timeout_s=LONG_S) == {"n": 2}


def test_topics_in_the_service_namespace_are_rejected(make: Make) -> None:
    with pytest.raises(nep.BadTopicError, match=r"'nep\.service:/x'.*'nep\.service:'"):
        make("node").new_pub("nep.service:/x")
    with pytest.raises(nep.BadTopicError, match=r"'nep\.service:/x'.*'nep\.service:'"):
        make("node").new_sub("nep.service:/x")


@pytest.mark.parametrize(
    "wrong",
    [
        {"timeout_s": -1},
        {"timeout_s": math.nan},
        {"timeout_s": "soon"},
        {"msg_type": ""},
        {"msg_type": "image"},
        {"configuration": "here"},
    ],
)
def test_invalid_client_arguments_are_rejected(make: Make, wrong) -> None:
    with pytest.raises((ValueError, nep.NepError)):
        make("node").new_client("/x", **wrong)


def test_invalid_server_arguments_are_rejected(make: Make) -> None:
    node = make("node")
    for wrong in ({"threads": -1}, {"threads": 1.5}, {"threads": True}):
        with pytest.raises(ValueError, match="threads"):
            node.new_server("/x", doubled, **wrong)
    with pytest.raises(ValueError, match="'threads' requires a callback"):
        node.new_server("/x", threads=1)
    with pytest.raises(ValueError, match="callback"):
        node.new_server("/x", "no function")
    with pytest.raises(ValueError, match="timeout_s"):
        node.new_client("/x").call({}, timeout_s=-0.1)


def test_calls_beyond_the_client_limit_are_rejected(make: Make) -> None:
    client = make("client").new_client("/nobody", timeout_s=None)
    for _ in range(1000):
        client.call_async({})
    with pytest.raises(nep.NepError, match=r"1000 .*'/nobody'"):
        client.call_async({})


def test_coroutine_callback_is_rejected_by_server_and_respondent(master: Master) -> None:
    async def answer(request: object) -> object:
        return request

    with nep.node("server", master=master.address) as node:
        for make in (node.new_server, node.new_respondent):
            with pytest.raises(ValueError, match=r"callback .*coroutine function"):
                make("a", answer)
