"""Tests of services under faults: dead or hung servers, restarted masters, malformed messages, forks."""

from __future__ import annotations

import os
import signal
import threading

import pytest
import zmq

import nep
from nep.backends.connection import Hybrid
from nep.masters.master import Master
from nep.protocol.requests import AddPublisher, Join, NodeRecord, PublisherRecord, derive_id, derive_node_id
from nep.protocol.service_wire import topic_of
from tests.nep.programs import eventually, running

LONG_S = 30.0
SERVER = """
    import sys, threading, nep
    node = nep.node("server")
    asked = threading.Event()
    def answer(request):
        if request == "hang":
            asked.set()
            threading.Event().wait()
        return {"pid": __import__("os").getpid()}
    server = node.new_server("/x", answer, threads=1)
    print("ready")
    asked.wait()
    print("asked")
    sys.stdin.read()
"""


@pytest.fixture
def client(master: Master):
    with nep.node("client") as node:
        yield node.new_client("/x", timeout_s=LONG_S)


def test_call_fails_when_its_server_dies_and_the_next_call_reaches_the_restarted_server(client) -> None:
    with running(SERVER) as program:
        assert program.line() == "ready"
        future = client.call_async("hang", timeout_s=None)
        assert program.line() == "asked"
        program.kill()
        with pytest.raises(nep.ServerGoneError, match="'/x'"):
            future.result(LONG_S)
    with running(SERVER) as program:  # the client finds the restarted server
        assert program.line() == "ready"
        assert client.call({}) == {"pid": program.process.pid}


def test_call_made_after_server_death_waits_for_a_new_server(client) -> None:
    with running(SERVER) as program:
        assert program.line() == "ready"
        client.call({})
    eventually(lambda: not client.is_connected)
    future = client.call_async({})
    with running(SERVER) as program:
        assert program.line() == "ready"
        assert future.result(LONG_S) == {"pid": program.process.pid}


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="there are no signals that stop")
def test_suspended_server_replies_to_pending_calls_after_resuming(client) -> None:
    with running(SERVER) as program:
        assert program.line() == "ready"
        client.call({})
        program.stop()
        with pytest.raises(nep.ServiceTimeoutError):
            client.call({}, timeout_s=4.0)  # long enough for the server to be unlisted
        future = client.call_async({})
        program.signal(signal.SIGCONT)
        assert future.result(LONG_S) == {"pid": program.process.pid}


@pytest.mark.parametrize("is_late", [False, True], ids=["before it is unlisted", "after that"])
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="there are no signals that stop")
def test_server_suspended_during_a_call_is_replaced_by_another_server(
    master: Master, client, is_late: bool
) -> None:
    with running(SERVER) as program, nep.node("other") as other:
        assert program.line() == "ready"
        waiting = client.call_async("hang", timeout_s=None)
        assert program.line() == "asked"
        program.stop()
        if is_late:
            eventually(lambda: not master.view().services["/x"].servers)
        other.new_server("/x", lambda request: ["other", request], threads=1)
        eventually(lambda: len(master.view().services["/x"].servers) == 1)  # the old server was unlisted
        # ... and the client was notified: earlier calls reach the old server, which may only be suspended.
        (server,) = master.view().services["/x"].servers
        eventually(lambda: set(client._transport._servers.values()) == set(server.endpoints[:1]))
        assert client.call(1) == ["other", 1]
        with pytest.raises(nep.ServerGoneError):  # the outcome is unknown
            waiting.result(LONG_S)
        assert client.call(2) == ["other", 2]


def test_calls_continue_while_the_master_is_unreachable() -> None:
    master = Master("127.0.0.1:0", learn_s=0.0).start()
    address = master.address
    with nep.node("server", master=address) as a, nep.node("client", master=address) as b:
        server = a.new_server("/x", lambda request: request, threads=1)
        client = b.new_client("/x", timeout_s=LONG_S)
        assert client.call(1) == 1
        master.close()
        assert client.call(2) == 2
        with Master(address):

            def are_registered() -> bool:
                info = b.graph(LONG_S).services.get("/x")
                return info is not None and (len(info.servers), len(info.clients)) == (1, 1)

            eventually(are_registered)
            assert client.call(3) == 3
            assert server.calls == 3
            server.close()
            a.new_server("/x", lambda request: "new", threads=1)

            def is_new() -> bool:
                try:
                    return client.call(4) == "new"
                except (nep.ServerGoneError, nep.RequestRefusedError):
                    return False

            eventually(is_new)


def test_call_reaches_a_server_despite_an_unreachable_server_of_the_same_name(master: Master, client) -> None:
    """The server that is listed first has a closed port."""
    key = "k" * 20
    node = NodeRecord(derive_node_id(key), "ghost", "", None, key=key)
    with zmq.Context() as context, context.socket(zmq.ROUTER) as hole:
        port = hole.bind_to_random_port("tcp://127.0.0.1")
    record = PublisherRecord(
        derive_id(key, 1), topic_of("/x"), "service", "service", (f"tcp://127.0.0.1:{port}",), number=1
    )
    master.submit(AddPublisher(node, record))
    with nep.node("server") as real:
        real.new_server("/x", lambda request: "real", threads=1)
        assert client.call({}) == "real"


def test_server_and_client_without_a_master_raise_master_unreachable() -> None:
    with nep.node("alone", master="127.0.0.1:1", wait_s=0.1) as node:
        with pytest.raises(nep.MasterUnreachable):
            node.new_server("/x", lambda request: request)
        with pytest.raises(nep.MasterUnreachable):
            node.new_client("/x")


@pytest.mark.parametrize(
    "parts",
    [
        [b""],
        [b"", b""],
        [b"x" * 16, b"{}"],
        [b"\1\1\1\0" + b"\0" * 12],
        [b"\1\1\1\0" + b"\0" * 12, b"{}", b"{}"],
        [b"\1\2\1\0" + b"\0" * 12, b"{}"],  # a reply instead of a call
        [b"\1\1\1\0" + b"\0" * 12, b"{oops"],  # invalid JSON: rejected
        [b"\1\1\x63\0" + b"\xff" * 12, b"{}"],  # unknown codec, largest call number
        [b"\1\1\1\0" + b"\xff" * 12, b"[" * 100_000],
    ],
)
def test_malformed_messages_do_not_stop_a_server(master: Master, client, parts) -> None:
    with nep.node("server") as node:
        server = node.new_server("/x", lambda request: request, threads=1)
        with zmq.Context() as context, context.socket(zmq.DEALER) as stranger:
            stranger.linger = 0
            stranger.connect(server.endpoints[0])
            stranger.send_multipart(parts)
            assert client.call({"n": 1}) == {"n": 1}
        assert client.call({"n": 2}) == {"n": 2}


def test_many_malformed_calls_do_not_block_the_next_valid_call(master: Master) -> None:
    with nep.node("server") as node:
        server = node.new_server("/x", lambda request: request, threads=1)
        with zmq.Context() as context, context.socket(zmq.DEALER) as stranger:
            stranger.linger = 0
            stranger.connect(server.endpoints[0])
            for _ in range(1000):
                stranger.send_multipart([b"no header", b""])
            stranger.send_multipart([b"\1\1\1\0" + b"\0" * 4 + b"\7" + b"\0" * 7, b"[1]"])
            assert stranger.poll(LONG_S * 1000)
            assert stranger.recv_multipart() == [b"\1\2\1\0" + b"\0" * 4 + b"\7" + b"\0" * 7, b"[1]"]
        assert (server.unreadable, server.calls) == (1000, 1)


@pytest.mark.parametrize(
    "answer",
    [
        [b""],
        [b"\1\2\1\0" + b"\xff" * 12, b"{}"],  # unknown call number
        [b"\1\1\1\0\0\0\0\0" + (1).to_bytes(8, "little"), b"{}"],  # a call, not a reply
        [b"\2\2\1\0\0\0\0\0" + (1).to_bytes(8, "little"), b"{}"],  # later protocol version
    ],
)
def test_malformed_or_unmatched_reply_raises_service_timeout(master: Master, client, answer) -> None:
    with _fake_server(master, lambda parts: [answer]):
        eventually(lambda: client.is_connected)
        with pytest.raises(nep.ServiceTimeoutError):
            client.call({}, timeout_s=1.0)


@pytest.mark.parametrize(
    ("kind", "codec", "data", "error"),
    [
        (2, 1, b"{oops", nep.DecodeError),
        (2, 99, b"{}", nep.DecodeError),
        (3, 1, b"{oops", nep.ServiceError),
        (3, 1, b"[]", nep.ServiceError),
        (3, 1, b'{"nep_error":7,"reason":{"a":1}}', nep.ServiceError),
        (4, 1, b"", nep.RequestRefusedError),
    ],
)
def test_reply_with_undecodable_payload_or_error_raises_a_nep_error(
    master: Master, client, kind, codec, data, error
) -> None:
    def answer(parts):
        return [[bytes([1, kind, codec, 0, 0, 0, 0, 0]) + parts[0][8:], data]]

    with _fake_server(master, answer), pytest.raises(error):
        client.call({})


def test_duplicate_reply_is_counted_as_late(master: Master, client) -> None:
    def answer(parts):
        return [[bytes([1, 2, 1, 0, 0, 0, 0, 0]) + parts[0][8:], b"1"]] * 2

    with _fake_server(master, answer):
        assert client.call({}) == 1
        eventually(lambda: client.late == 1)


class _fake_server:  # noqa: N801 - it reads as a function
    """Server of "/x" that replies to each call with the result of `answers` for its parts."""

    def __init__(self, master: Master, answers) -> None:
        self._answers = answers
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.ROUTER)
        self._socket.linger = 0
        endpoint = f"tcp://127.0.0.1:{self._socket.bind_to_random_port('tcp://127.0.0.1')}"
        key = "f" * 20
        node = NodeRecord(derive_node_id(key), "fake", "", None, key=key)
        record = PublisherRecord(
            derive_id(key, 1), topic_of("/x"), "service", "service", (endpoint,), number=1
        )
        master.submit(Join(node, 0, (record,), managed=True))  # without a lease
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fake-server")

    def _run(self) -> None:
        while not self._over.is_set():
            if self._socket.poll(20):
                route, *parts = self._socket.recv_multipart()
                for each in self._answers(parts):
                    self._socket.send_multipart([route, *each])

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_exc: object) -> None:
        self._over.set()
        self._thread.join(LONG_S)
        self._socket.close()
        self._context.term()


def test_calls_beyond_the_server_queue_are_rejected(master: Master) -> None:
    with nep.node("server") as a, nep.node("one") as one, nep.node("two") as two:
        server = a.new_server("/full", lambda request: request)  # calls stay queued: no spin
        calls = [
            client.call_async(n, timeout_s=LONG_S)
            for client in (one.new_client("/full"), two.new_client("/full"))
            for n in range(600)
        ]
        eventually(lambda: server.refused == 200)
        refused = [each for each in calls if each.done()]
        eventually(lambda: sum(each.done() for each in calls) == 200)
        with pytest.raises(nep.RequestRefusedError, match=r"'/full' .*too many"):
            next(each for each in calls if each.done()).result()
        assert len(refused) <= 200
        stopper = threading.Thread(target=lambda: a.spin(LONG_S), name="spin")
        stopper.start()
        eventually(lambda: all(each.done() for each in calls))
        a.stop_spin()
        stopper.join(LONG_S)
        assert server.calls == 1000


def test_oversized_request_or_reply_raises(master: Master) -> None:
    with nep.node("server") as a, nep.node("client") as b:
        a.new_server("/big", lambda n: b"x" * n, threads=1)
        client = b.new_client("/big", msg_type="msgpack", timeout_s=LONG_S)
        most = 64 * 2**20
        with pytest.raises(nep.NepError, match=r"67108869 bytes.* 67108864"):
            client.call(b"x" * most)
        with pytest.raises(nep.ServiceError, match=r"67108869 bytes.* 67108864"):
            client.call(most)
        assert client.call(2) == b"xx"


def test_ctrl_c_in_a_callback_ends_spin_and_fails_the_call(master: Master) -> None:
    def answer(_request):
        raise KeyboardInterrupt

    with nep.node("server") as a, nep.node("client") as b:
        a.new_server("/x", answer)
        future = b.new_client("/x").call_async({}, timeout_s=LONG_S)
        with pytest.raises(KeyboardInterrupt):
            a.spin(LONG_S)
        with pytest.raises(nep.ServiceError, match="KeyboardInterrupt"):
            future.result(LONG_S)


@pytest.mark.usefixtures("patient")
def test_timers_and_messages_are_handled_between_calls(master: Master) -> None:
    with nep.node("server") as a, nep.node("client") as b:
        ticks, heard = [], []
        a.new_timer(0.01, lambda: ticks.append(1))
        a.new_callback("topic", "json", heard.append)
        a.new_server("/x", lambda request: request)
        spinner = threading.Thread(target=lambda: a.spin(LONG_S), name="spin")
        spinner.start()
        pub, client = b.new_pub("topic"), b.new_client("/x", timeout_s=LONG_S)
        for n in range(50):
            pub.publish(n)
            assert client.call(n) == n
        eventually(lambda: len(heard) == 50 and len(ticks) > 2)
        a.stop_spin()
        spinner.join(LONG_S)


def test_spin_wakes_for_a_new_server_and_for_each_call(
    master: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Waits take an hour here, so a lost wake-up would leave a call without a reply."""
    monkeypatch.setattr("nep.nodes.work.WAIT_SLICE_S", 3600.0)
    with nep.node("server") as a, nep.node("client") as b:
        spinner = threading.Thread(target=a.spin, name="spin")
        spinner.start()  # before any server exists
        eventually(lambda: a._transport._thread_waits)  # no wake-up is lost after the first wait
        a.new_server("/x", lambda request: request)
        client = b.new_client("/x", timeout_s=LONG_S)
        assert [client.call(n) for n in range(300)] == list(range(300))
        a.stop_spin()
        spinner.join(LONG_S)
        assert not spinner.is_alive()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_fork_closes_services_in_the_child_and_not_in_the_parent(master: Master) -> None:
    with nep.node("server") as a, nep.node("client") as b:
        server = a.new_server("/x", lambda request: request, threads=1)
        client = b.new_client("/x", timeout_s=LONG_S)
        assert client.call(1) == 1
        child = os.fork()
        if child == 0:
            code = 1
            try:
                client.call(2)
            except nep.ClosedError:
                code = 0 if server.is_closed and client.is_closed else 2
            finally:
                server.close()
                client.close()
                os._exit(code)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert client.call(3) == 3


def test_program_exits_without_closing_services(master: Master) -> None:
    program = """
        import nep
        node = nep.node("forgetful")
        node.new_server("/x", lambda request: request, threads=2)
        node.new_server("/unspun", lambda request: request)
        client = node.new_client("/x", timeout_s=30)
        node.new_respondent("/who", lambda question: question, threads=1)
        waiting = node.new_client("/unspun").call_async({}, timeout_s=None)
        print(client.call(1), node.new_surveyor("/who", 30_000).ask(2), client.call_async(3).result(30))
    """
    with running(program, NEP_MASTER=master.address) as forgetful:
        assert forgetful.end() == ("1 [2] 3\n", "")
        assert forgetful.process.returncode == 0
    eventually(lambda: not master.view().services)


def test_server_and_client_use_the_master_of_their_configuration(master: Master) -> None:
    with Master("127.0.0.1:0", learn_s=0.0) as other, nep.node("a") as a, nep.node("b") as b:
        there = Hybrid(other.address)
        a.new_server("/x", lambda request: "there", there, threads=1)
        assert b.new_client("/x", there, timeout_s=LONG_S).call({}) == "there"
        assert "/x" not in b.graph().services
