"""Tests of host name resolution: infrequent lookups, in a separate thread, never in the I/O thread."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator

import pytest
import zmq

import nep
from nep.backends.zeromq.io_thread import SharedContext, shared_context
from nep.backends.zeromq.master_session import MasterSession
from nep.masters.master import Master
from nep.protocol.requests import NodeRecord
from nep.system.addresses import MasterNameResolver
from tests.nep.programs import eventually


class Book:
    """Fake resolver that replies once `may_answer` is set and records hosts and threads."""

    def __init__(self, *answers: str) -> None:
        self.answers = list(answers)
        self.asked: list[str] = []
        self.threads: list[str] = []
        self.may_answer = threading.Event()

    def look_up(self, host: str) -> str:
        self.asked.append(host)
        self.threads.append(threading.current_thread().name)
        assert self.may_answer.wait(20.0)
        answer = self.answers.pop(0)
        if not answer:
            raise OSError(-2, "Name or service not known")
        return answer


@pytest.mark.parametrize(
    ("address", "known"),
    [
        ("10.0.0.5:7780", "10.0.0.5:7780"),
        ("localhost:1", "127.0.0.1:1"),
        ("*:7", "127.0.0.1:7"),
        ("127.0.0.1:5", "127.0.0.1:5"),
    ],
)
def test_numeric_localhost_and_wildcard_addresses_need_no_name_lookup(address: str, known: str) -> None:
    book = Book()
    name = MasterNameResolver(address, lambda _known: None, book.look_up)
    name.resolve(1.0)
    assert name.address == known
    assert name.wait(0.0)
    assert book.asked == []


def test_host_name_is_resolved_again_only_after_an_interval(caplog: pytest.LogCaptureFixture) -> None:
    book, told = Book("", "", "10.0.0.5", "10.0.0.5", "10.0.0.6"), []
    book.may_answer.set()
    name = MasterNameResolver("robot:7780", told.append, book.look_up)

    def look(now: float) -> None:
        name.resolve(now)
        assert name._thread is not None
        name._thread.join(60.0)

    with caplog.at_level(logging.INFO):
        for now in (10.0, 11.0, 14.9, 15.0):
            look(now)
    assert len(book.asked) == 2
    assert [record.getMessage().partition(" (")[0] for record in caplog.records] == [
        "can't resolve the master's host name 'robot'"
    ]
    assert not name.wait(0.0)
    for now in (20.0, 25.0, 30.0):
        look(now)
    assert told == ["10.0.0.5:7780", "10.0.0.6:7780"]
    assert name.wait(0.0)


@pytest.fixture
def shared() -> Iterator[SharedContext]:
    made = shared_context()
    yield made
    made.release()


def test_unanswered_name_lookup_does_not_block_other_nodes(
    shared: SharedContext, master: Master, patient: None
) -> None:
    book = Book("127.0.0.1")
    port = master.address.rpartition(":")[2]
    with nep.node("other") as other:
        socket = shared.socket(zmq.DEALER, "a test")
        record = NodeRecord("1" * 16, "n", "host", 1)
        link = MasterSession(socket, shared.io, record, f"robot:{port}", book.look_up)
        shared.io.add(link)
        eventually(lambda: book.asked == ["robot"])
        try:
            with pytest.raises(nep.MasterUnreachable, match=r"computer 'robot'; .*IP address"):
                link.wait_for_address(0.05)
            pub, sub = other.new_pub("topic"), other.new_sub("topic")
            pub.publish(1)
            assert sub.listen(timeout_s=30.0) == (True, 1)
            book.may_answer.set()
            link.wait_for_address(30.0)
            assert "topic" in link.query_graph(30.0).topics
            assert book.threads == ["nep-name-robot"]
            assert link.endpoint == f"tcp://127.0.0.1:{port}"
        finally:
            book.may_answer.set()
            link.start_leave()
            link.close()


def test_unknown_host_of_a_direct_connection_raises_an_error_that_suggests_an_ip_address() -> None:
    with nep.node("n", master="127.0.0.1:1") as node:
        wrong = node.direct("no..computer", 9123, "many2one")
        with pytest.raises(nep.NepError, match=r"computer 'no\.\.computer'; .*IP address"):
            node.new_pub("topic", configuration=wrong)
