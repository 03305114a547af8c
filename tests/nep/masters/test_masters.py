"""Tests of the master as a thread: robustness, attachments and the end of its life."""

from __future__ import annotations

import os
import sys
import threading

import pytest
import zmq

import nep
from nep.masters.master import Master, is_running
from nep.messages.packing import pack
from nep.protocol import encoding
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    DoneReply,
    Join,
    Leave,
    NodeRecord,
    Ping,
    PublisherCount,
    PublisherRecord,
    RejectedReply,
    Renew,
    RenewedReply,
)
from tests.nep.programs import eventually, running

ORIGINAL = NodeRecord("original-1", "old", "host", 1, "JavaScript", "A")


class Attached:
    """Attachment that records its events."""

    def __init__(self, fails: bool = False) -> None:
        self.events: list[str] = []
        self.views: list[GraphView] = []
        self.fails = fails

    def start(self, master: Master) -> None:
        self.events.append("start")
        assert isinstance(master.submit(Ping()), DoneReply)
        if self.fails:
            raise nep.AddressInUseError("127.0.0.1:7000")

    def changed(self, view: GraphView) -> None:
        self.views.append(view)
        if self.fails:
            raise RuntimeError("an attachment that breaks")

    def close(self) -> None:
        self.events.append("close")


def test_malformed_requests_receive_an_error_and_the_master_survives(master: Master) -> None:
    context = zmq.Context()
    socket = context.socket(zmq.DEALER)
    socket.setsockopt(zmq.LINGER, 0)
    socket.connect(f"tcp://{master.address}")
    bad = [
        [b""],
        [b"\xff\xff"],
        [b"", b"", b""],
        [b"x" * 100_000],
        [pack(None)],
        [pack({"do": "fly", "call": 3})],
        [pack({"do": "renew", "call": 3, "what": [1]})],
        [encoding.encode_request(Leave(ORIGINAL.id), 3)],
        [encoding.encode_request(Join(ORIGINAL, managed=True), 3)],
    ]
    master.submit(Join(ORIGINAL, managed=True))
    try:
        for parts in bad:
            socket.send_multipart(parts)
            assert socket.poll(60_000)
            _call, answer = encoding.decode_reply(socket.recv())
            assert isinstance(answer, RejectedReply)
            assert answer.reason
    finally:
        socket.close()
        context.term()
    assert is_running(master.address, 30.0)
    assert ORIGINAL.id in master.view().nodes


def test_invalid_call_number_is_decoded_as_0(master: Master) -> None:
    asked = encoding.decode_request(pack({"do": "ping", "call": -1}))
    assert asked == encoding.ReceivedRequest(0, Ping())
    assert encoding.decode_request(pack({"do": "ping", "call": True})).call == 0


def test_socket_of_another_type_does_not_crash_the_master(master: Master) -> None:
    context = zmq.Context()
    for kind in (zmq.REQ, zmq.PUB, zmq.REP):
        socket = context.socket(kind)
        socket.setsockopt(zmq.LINGER, 0)
        socket.connect(f"tcp://{master.address}")
        if kind != zmq.REP:
            socket.send(b"{}")
        socket.close()
    context.term()
    assert is_running(master.address, 30.0)


def test_second_master_on_an_address_raises_address_in_use_error(master: Master) -> None:
    with pytest.raises(nep.AddressInUseError, match="in use by another program"):
        Master(master.address).start()


def test_is_running_is_true_only_while_the_master_runs() -> None:
    with Master("127.0.0.1:0") as master:
        address = master.address
        assert is_running(address, 30.0)
    assert not is_running(address, 0.1)


def test_attachment_is_started_receives_graph_changes_and_is_closed() -> None:
    attached = Attached()
    with Master("127.0.0.1:0", attachments=[attached], learn_s=0.0) as master:
        with nep.node("n", master=master.address) as node:
            node.new_pub("topic")
            eventually(lambda: any("topic" in view.topics for view in attached.views))
        eventually(lambda: attached.views[-1].nodes == {})
    assert attached.events == ["start", "close"]


def test_attachment_that_fails_to_start_aborts_the_start() -> None:
    fine, broken = Attached(), Attached(fails=True)
    master = Master("127.0.0.1:0", attachments=[fine, broken])
    with pytest.raises(nep.AddressInUseError):
        master.start()
    assert (fine.events, broken.events) == (["start", "close"], ["start"])
    assert not is_running(master.address, 0.1)


def test_attachment_that_raises_does_not_stop_the_master(caplog: pytest.LogCaptureFixture) -> None:
    attached = Attached()
    with Master("127.0.0.1:0", attachments=[attached], learn_s=0.0) as master:
        attached.fails = True
        with nep.node("n", master=master.address) as node:
            node.new_pub("topic")
            eventually(lambda: bool(attached.views))
        assert is_running(master.address, 30.0)
    assert "an attachment of the master failed" in caplog.text


def test_original_nodes_can_be_registered_in_process(master: Master) -> None:
    record = PublisherRecord(5, "old/topic", "json", "json")
    assert not isinstance(master.submit(Join(ORIGINAL, 0, (record,), managed=True)), RejectedReply)
    renew = Renew(ORIGINAL.id, master.epoch, 0, (PublisherCount(5, 3, 30, 0),))
    assert isinstance(master.submit(renew), RenewedReply)
    with nep.node("n") as node:
        view = node.graph()
        assert (view.nodes[ORIGINAL.id].generation, view.nodes[ORIGINAL.id].language) == ("A", "JavaScript")
        assert view.topics["old/topic"].publishers[0].count == 3
        node.new_sub("old/topic")  # no endpoint to connect to, so no wait
    master.submit(Leave(ORIGINAL.id))
    eventually(lambda: master.view().nodes == {})


def test_request_to_a_closed_master_raises_closed_error(master: Master) -> None:
    master.close()
    master.close()
    with pytest.raises(nep.ClosedError):
        master.submit(Ping())
    assert master.wait(0.0)


def test_concurrent_submits_from_many_threads_receive_replies(master: Master) -> None:
    replies: list[object] = []
    threads = [
        threading.Thread(target=lambda: replies.extend(master.submit(Ping()) for _ in range(50)))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [type(each) for each in replies] == [DoneReply] * 200


SLEEPER = "import sys; print('up'); sys.stdin.read()"
NODE = """
import nep, sys
with nep.node("stranger") as node:
    node.new_pub("topic")
    print("up")
    sys.stdin.readline()
"""


def test_master_exits_with_its_owner_when_no_other_node_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    with running(SLEEPER) as owner:
        owner.line()
        with Master("127.0.0.1:0", owner_pid=owner.process.pid, learn_s=0.0) as master:
            monkeypatch.setenv("NEP_MASTER", master.address)
            with running(NODE) as stranger:
                stranger.line()
                owner.kill()
                assert not master.wait(1.0)
                stranger.say("")
                stranger.end()
                assert master.wait(30.0)


def test_master_owned_by_its_own_process_does_not_exit_early() -> None:
    with Master("127.0.0.1:0", owner_pid=os.getpid()) as master:
        assert not master.wait(0.6)


@pytest.mark.skipif(sys.platform == "win32", reason="needs the POSIX meaning of kill")
def test_failed_master_process_raises_master_unreachable(tmp_path: object) -> None:
    with Master("127.0.0.1:0") as probe:
        address = probe.address
    with pytest.raises(nep.MasterUnreachable):
        nep.start_process(address, command=[sys.executable, "-c", "raise SystemExit(3)"], timeout_s=5.0)
