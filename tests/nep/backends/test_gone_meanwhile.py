"""Test publishers, servers and clients that are closed while another thread uses their node."""

from __future__ import annotations

import itertools
import threading

import pytest

import nep
from nep.backends.zeromq.master_session import MasterSession
from nep.backends.zeromq.native_subscriber import NativeSubscriber
from nep.backends.zeromq.publisher import HandshakePublisher
from nep.masters.master import Master
from nep.protocol.requests import ExpectedSubscriber, FoundReply, SubscriberRecord
from tests.nep.programs import eventually


def test_wait_for_subscribers_ends_when_the_publisher_is_closed() -> None:
    changed = threading.Condition()
    publisher = HandshakePublisher(changed, {})
    missing: list[tuple[int, ...]] = []
    expected = [ExpectedSubscriber(1, "2", "vanished")]
    thread = threading.Thread(target=lambda: missing.append(publisher.wait_for(expected, 600.0)))
    thread.start()
    with changed:
        publisher.is_closed = True
    thread.join(60.0)
    assert missing == [()]


@pytest.mark.usefixtures("patient")
def test_publisher_that_closes_during_a_subscription_is_not_connected(
    master: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[FoundReply] = []
    with nep.node("goes", master=master.address) as goes, nep.node("comes", master=master.address) as comes:
        goes.new_pub("stays")
        closing = goes.new_pub("topic")

        def slow(
            self: MasterSession, record: SubscriberRecord, made: NativeSubscriber, wait_s: float | None
        ) -> FoundReply:
            """Delay the subscribing thread until the master's later messages have been processed."""
            told.append(known(self, record, made, wait_s))
            closing.close(0.0)
            eventually(lambda: not comes.graph().topics["topic"].publishers)
            comes.graph()  # returns after the master's earlier messages have been processed
            return told[-1]

        known = MasterSession.add_subscriber
        monkeypatch.setattr(MasterSession, "add_subscriber", slow)
        subscriber = comes.new_sub("topic")
        assert [each.publisher.id for each in told[0].publishers] == [closing.id]
        assert isinstance(subscriber._transport, NativeSubscriber)
        assert subscriber._transport.endpoints == ()


@pytest.mark.parametrize("kind", ["server", "client", "publisher"])
def test_node_that_closes_while_another_thread_closes_a_part_of_it_does_not_block(
    master: Master, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    node, provider = nep.node("closes", master=master.address), nep.node("provides", master=master.address)
    provider.new_server("service", str)
    client = node.new_client("service")
    eventually(lambda: client.is_connected)
    part: nep.Server | nep.Client | nep.Publisher = client
    if kind != "client":
        part = node.new_server("closing", str) if kind == "server" else node.new_pub("closing")
    is_closing, may_go_on = threading.Event(), threading.Event()
    method = "remove_subscriber" if kind == "client" else "remove_publisher"
    remove = getattr(MasterSession, method)
    calls_before = itertools.count(0 if kind == "server" else 1)  # a server is unregistered twice

    def remove_late(self: MasterSession, *args: int) -> None:
        if threading.current_thread() is thread and next(calls_before) == 1:
            is_closing.set()
            may_go_on.wait(60.0)
        remove(self, *args)

    def close_all() -> None:
        node.close()
        provider.close()  # the last node, which terminates the context

    monkeypatch.setattr(MasterSession, method, remove_late)
    errors: list[BaseException] = []
    thread = threading.Thread(target=_close_part, args=(part, errors))
    thread.start()
    assert is_closing.wait(30.0)
    closing_thread = threading.Thread(target=close_all, daemon=True)
    closing_thread.start()
    closing_thread.join(30.0)
    has_ended = not closing_thread.is_alive()
    may_go_on.set()
    thread.join(30.0)
    assert has_ended, "the node waits for the sockets of the other thread"
    assert errors == []
    with nep.node("new", master=master.address) as new:  # in a new context
        eventually(lambda: "closes" not in {each.name for each in new.graph().nodes.values()})


def _close_part(part: nep.Server | nep.Client | nep.Publisher, errors: list[BaseException]) -> None:
    try:
        part.close()
    except BaseException as error:  # noqa: BLE001 - reported by the test's thread
        errors.append(error)
