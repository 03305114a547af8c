"""Test that a publisher that closes during a subscription causes no delay.

The master's reply and its notification may be processed in either order.
"""

from __future__ import annotations

import pytest

import nep
from nep.backends.zeromq.master_session import MasterSession
from nep.backends.zeromq.subscriber import NativeSubscriber
from nep.masters.master import Master
from nep.protocol.requests import FoundReply, SubscriberRecord
from tests.nep.programs import eventually


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
