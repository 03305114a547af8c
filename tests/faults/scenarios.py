"""Fault scenarios, one per function, with their own hosts and topics, so that several run concurrently.

Every scenario checks that each message, including the last ones, is received or counted as lost, that
none is duplicated or out of order, and that the connection recovers by itself. It returns its
measurements in seconds or messages.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from tests.faults import traffic
from tests.faults.day import WAIT_S, Day, Part, balance, is_hearing, now
from tests.nep.programs import eventually

_BEFORE_S = 0.5
"""Seconds of traffic before a fault."""
_SILENT_S = 12.0
"""Seconds in which a dead connection must be closed; the kernel's own timeout is 15 s."""
RATE = 500
"""Messages per second."""
_LARGE = 20_000
"""Size of a large message in bytes."""
Measured = dict[str, float]
Scenario = Callable[[Day, float], Measured]


def _wait(seconds: float) -> None:
    """Wait while a fault lasts."""
    threading.Event().wait(seconds)


def _back_s(subscriber: Part, since: float) -> float:
    """Wait until the subscriber receives messages again; return the seconds since ``since``."""
    eventually(is_hearing(subscriber), WAIT_S)
    return max(0.0, float(subscriber.ask("look")["back_at"]) - since)


def _begin(day: Day, name: str, size: int = 0, **more: Any) -> tuple[Part, Part]:
    """Start a publisher and a subscriber on separate hosts, with traffic between them.

    `size` is the minimum size of a message in bytes.
    """
    subscriber = day.start(traffic.subscriber, day.hosts.host(f"s-{name}"), name, **more)
    publisher = day.start(traffic.publisher, day.hosts.host(f"p-{name}"), name, rate=RATE, size=size)
    publisher.ask("go")
    eventually(is_hearing(subscriber), WAIT_S)
    _wait(_BEFORE_S)
    subscriber.ask("again")
    return publisher, subscriber


def _close(publisher: Part, subscriber: Part) -> dict[str, Any]:
    """Send more messages, close the publisher and return the counts when all messages are accounted for."""
    publisher.ask("go")
    eventually(is_hearing(subscriber), WAIT_S)
    sent = publisher.ask("end")
    return balance(sent["sent"], subscriber)


def cable_of_subscriber(day: Day, out_s: float) -> Measured:
    """Disconnect the subscriber's cable twice; the second time the last messages are sent meanwhile."""
    publisher, subscriber = _begin(day, "cable-s")
    return _cable(day, publisher, subscriber, subscriber, out_s)


def cable_of_publisher(day: Day, out_s: float) -> Measured:
    """Disconnect the publisher's cable twice; the second time the last messages are sent meanwhile."""
    publisher, subscriber = _begin(day, "cable-p")
    return _cable(day, publisher, subscriber, publisher, out_s)


def _cable(day: Day, publisher: Part, subscriber: Part, cut: Part, out_s: float) -> Measured:
    day.hosts.cable(cut.host, is_in=False)
    _wait(out_s)
    day.hosts.cable(cut.host, is_in=True)
    since = now()
    sent = publisher.ask("look")["sent"]
    # Wait for all messages: one packet queued during the outage may arrive long before the others. Until
    # all have arrived, TCP treats two outages as a single long one.
    eventually(lambda: subscriber.ask("look")["last"] >= sent, WAIT_S)
    back_s = now() - since
    day.hosts.cable(cut.host, is_in=False)
    _wait(_BEFORE_S)
    sent = publisher.ask("pause")["sent"]
    _wait(out_s)
    day.hosts.cable(cut.host, is_in=True)
    since = now()
    balance(sent, subscriber)
    told_s = now() - since
    seen = _close(publisher, subscriber)
    return {"back_s": back_s, "told_s": told_s, "lost": seen["lost"]}


def address_of_publisher(day: Day, _out_s: float) -> Measured:
    """Change the address of the publisher's host while it publishes."""
    publisher, subscriber = _begin(day, "addr-p")
    publisher.host.change_address("10.88.0.200")
    back_s = _back_s(subscriber, now())
    return {"back_s": back_s, "lost": _close(publisher, subscriber)["lost"]}


def address_of_subscriber(day: Day, _out_s: float) -> Measured:
    """Change the address of the subscriber's host."""
    publisher, subscriber = _begin(day, "addr-s")
    before = subscriber.host.address
    assert publisher.host.connections_to(before) == 1
    subscriber.host.change_address("10.88.0.201")
    back_s = _back_s(subscriber, now())
    # Otherwise the system buffers all later data for the old connection until it times out.
    eventually(lambda: publisher.host.connections_to(before) == 0, _SILENT_S)
    return {"back_s": back_s, "lost": _close(publisher, subscriber)["lost"]}


def address_of_wildcards(day: Day, _out_s: float) -> Measured:
    """Change the address of a subscriber with wildcards, then that of its publisher."""
    topic = "addr-w/topic"
    subscriber = day.start(traffic.subscriber, day.hosts.host("s-addr-w"), "addr-w/*")
    publisher = day.start(traffic.publisher, day.hosts.host("p-addr-w"), topic, rate=RATE)
    publisher.ask("go")
    measured = {}
    for name, part in (("subscriber_s", subscriber), ("publisher_s", publisher)):
        eventually(is_hearing(subscriber), WAIT_S)
        subscriber.ask("again")
        part.host.change_address(f"10.88.0.21{len(measured)}")
        measured[name] = _back_s(subscriber, now())
    return {**measured, "lost": _close(publisher, subscriber)["lost"]}


def subscriber_gone(day: Day, _out_s: float) -> Measured:
    """Cut the power of a subscriber's host: the other subscriber loses nothing, and the publisher notices."""
    publisher, subscriber = _begin(day, "gone-s")
    other = day.start(traffic.subscriber, day.hosts.host("s2-gone-s"), "gone-s")
    eventually(lambda: publisher.ask("look")["subscribers"] == 2, WAIT_S)
    other.host.kill()
    since = now()
    eventually(lambda: publisher.ask("look")["subscribers"] == 1, WAIT_S)
    noticed_s = now() - since
    seen = _close(publisher, subscriber)
    assert seen["lost"] == 0, seen
    return {"noticed_s": noticed_s, "lost": seen["lost"]}


def publisher_gone(day: Day, _out_s: float) -> Measured:
    """Replace a publisher's host by one with the same address and the same program."""
    publisher, subscriber = _begin(day, "gone-p")
    sent = publisher.ask("pause")["sent"]
    balance(sent, subscriber)
    publisher.host.kill()
    since = now()
    host = day.hosts.host("p2-gone-p", publisher.host.address)
    options = {"node": "publisher-p-gone-p", "after": sent}
    again = day.start(traffic.publisher, host, "gone-p", **options)
    again.ask("go")
    back_s = _back_s(subscriber, since)
    again.ask("pause")
    sent += again.ask("end")["sent"]
    return {"back_s": back_s, "lost": balance(sent, subscriber)["lost"]}


def closed_unheard(day: Day, out_s: float) -> Measured:
    """Send the last messages and close the publisher while the subscriber's cable is disconnected."""
    publisher, subscriber = _begin(day, "closed")
    day.hosts.cable(subscriber.host, is_in=False)
    _wait(_BEFORE_S)
    return _unheard(day, publisher.ask("end")["sent"], subscriber, out_s)


def killed_unheard(day: Day, out_s: float) -> Measured:
    """Cut the publisher's power while the subscriber is disconnected; the master knows the count."""
    publisher, subscriber = _begin(day, "killed")
    day.hosts.cable(subscriber.host, is_in=False)
    _wait(_BEFORE_S)
    sent = publisher.ask("pause")["sent"]
    eventually(lambda: publisher.ask("told")["sent"] == sent, WAIT_S)
    publisher.host.kill()
    return _unheard(day, sent, subscriber, out_s)


def _unheard(day: Day, sent: int, subscriber: Part, out_s: float) -> Measured:
    _wait(out_s)
    day.hosts.cable(subscriber.host, is_in=True)
    since = now()
    balance(sent, subscriber)
    told_s = now() - since
    _wait(out_s)  # data that the system delivers late for an ended program is no longer lost
    return {"told_s": told_s, "lost": balance(sent, subscriber)["lost"]}


def lossy_1(day: Day, out_s: float) -> Measured:
    """Drop 1 % of all packets at the subscriber's cable in both directions."""
    return _lossy(day, out_s, 0.01)


def lossy_10(day: Day, out_s: float) -> Measured:
    """Drop 10 % of all packets at the subscriber's cable in both directions."""
    return _lossy(day, out_s, 0.1)


def _lossy(day: Day, out_s: float, ratio: float) -> Measured:
    publisher, subscriber = _begin(day, f"lossy{ratio:.0%}".strip("%"))
    hosts = (publisher.host, subscriber.host)
    before = sum(host.resent() for host in hosts)

    def resent() -> int:
        return sum(host.resent() for host in hosts) - before

    day.hosts.lose(subscriber.host, ratio)
    _wait(out_s)
    eventually(lambda: resent() > 0, WAIT_S)  # at 100 packets/s and 1 %, the first loss takes a while
    silent_s, count = subscriber.ask("look")["silent_s"], resent()
    return {"lost": _close(publisher, subscriber)["lost"], "silent_s": silent_s, "resent": count}


_SLOW_S = 100 / RATE
"""Processing time per message in seconds, 100 times too long for the rate."""
_ROOM = 10


def slow_all(day: Day, out_s: float) -> Measured:
    """Subscribe with a queue of 10 messages and a processing time 100 times too long."""
    publisher, subscriber = _begin(day, "slow-all", work_s=_SLOW_S, max_messages=_ROOM)
    _wait(out_s)
    sent = publisher.ask("end")["sent"]
    seen = balance(sent, subscriber)
    assert seen["last"] == sent, "the newest are kept"
    assert seen["lost"] > sent / 2, seen
    return {"sent": sent, "lost": seen["lost"]}


def slow_latest(day: Day, out_s: float) -> Measured:
    """Subscribe to the newest message only, with a processing time 100 times too long: no backlog grows."""
    publisher, subscriber = _begin(day, "slow-new", work_s=_SLOW_S, keep="latest")
    _wait(out_s)
    sent = publisher.ask("end")["sent"]
    eventually(lambda: subscriber.ask("look")["last"] == sent, WAIT_S)
    seen = subscriber.ask("look")
    assert (seen["received"], seen["lost"], seen["backwards"], seen["twice"]) == (sent, 0, 0, 0), seen
    assert seen["read"] + seen["skipped"] == sent, seen
    return {"sent": sent, "lost": 0, "replaced": sent - seen["read"]}


def held(day: Day, out_s: float) -> Measured:
    """Suspend a subscriber while more is sent to it than the kernel buffers."""
    publisher, subscriber = _begin(day, "held", size=_LARGE)
    subscriber.hold(is_held=True)
    _wait(out_s)
    subscriber.hold(is_held=False)
    back_s = _back_s(subscriber, now())
    return {"back_s": back_s, "lost": _close(publisher, subscriber)["lost"]}


def held_for_long(day: Day, _out_s: float) -> Measured:
    """Suspend a subscriber until its connection times out."""
    return held(day, 25.0)


def narrow(day: Day, out_s: float) -> Measured:
    """Limit the bandwidth to a hundredth of what is sent, then remove the limit."""
    publisher, subscriber = _begin(day, "narrow", size=10 * _LARGE)
    day.hosts.narrow(subscriber.host, 10 * _LARGE * RATE * 8 / 1e6 / 100)
    _wait(out_s)
    sent = publisher.ask("pause")["sent"]
    day.hosts.narrow(subscriber.host, 0)
    since = now()
    balance(sent, subscriber)
    told_s = now() - since
    return {"told_s": told_s, "lost": _close(publisher, subscriber)["lost"], "sent": sent}


def calls(day: Day, out_s: float) -> Measured:
    """Disconnect a client that calls: each call gets a reply or raises, and none is executed twice."""
    server = day.start(traffic.server, day.hosts.host("p-calls"), "calls")
    client = day.start(traffic.client, day.hosts.host("s-calls"), "calls")
    client.ask("go")
    eventually(lambda: client.ask("look")["ends"].get("answered", 0) > 10, WAIT_S)
    day.hosts.cable(client.host, is_in=False)
    eventually(lambda: bool(set(client.ask("look")["ends"]) - {"answered"}), WAIT_S)
    _wait(max(0.0, out_s - 1.0))
    day.hosts.cable(client.host, is_in=True)
    back_s = _answered_again_s(client)
    server.host.change_address("10.88.0.202")
    moved_s = _answered_again_s(client)
    client.host.change_address("10.88.0.203")
    _answered_again_s(client)
    seen = client.ask("pause")
    assert sum(seen["ends"].values()) == seen["calls"], seen
    assert seen["wrong"] == 0
    done = server.ask("look")
    assert done["twice"] == 0
    assert seen["ends"]["answered"] <= done["done"] <= seen["calls"], (done, seen)
    return {"back_s": back_s, "moved_s": moved_s, "failed": seen["calls"] - seen["ends"]["answered"]}


def _answered_again_s(client: Part) -> float:
    """Wait until a call made from now on gets a reply; return the seconds until that call started."""
    since = now()
    eventually(lambda: client.ask("look")["answered_from"] > since, WAIT_S)
    return float(client.ask("look")["answered_from"]) - since


SIDE_BY_SIDE = (
    cable_of_subscriber,
    cable_of_publisher,
    address_of_publisher,
    address_of_subscriber,
    publisher_gone,
    closed_unheard,
    killed_unheard,
    lossy_1,
    lossy_10,
    slow_all,
    slow_latest,
    held,
    calls,
)


ALONE = (subscriber_gone, address_of_wildcards, held_for_long, narrow)
"""Scenarios that take long or send many bytes."""


def master_again(day: Day, out_s: float) -> Measured:
    """Kill the master and start a new one without any state."""
    publisher, subscriber = _begin(day, "master")
    day.master.kill()
    _wait(out_s)
    later = day.begin_master(day.master.host)
    return _with_another_master(day, publisher, subscriber, later)


def master_moved(day: Day, out_s: float) -> Measured:
    """Cut the power of the master's host; another host with its address starts a master without any state."""
    publisher, subscriber = _begin(day, "master")
    day.master.host.kill()
    _wait(out_s)
    later = day.begin_master(day.hosts.host("m2", day.master.host.address))
    return _with_another_master(day, publisher, subscriber, later)


def _with_another_master(day: Day, publisher: Part, subscriber: Part, began: float) -> Measured:
    """Check that no message was lost and that a new subscriber finds the earlier publisher."""
    late = day.start(traffic.subscriber, day.hosts.host("late"), "master")
    found_s = now() - began
    sent = publisher.ask("pause")["sent"]
    seen = balance(sent, subscriber)
    assert seen["lost"] == 0, seen
    heard = late.ask("look")["read"]
    publisher.ask("go")
    eventually(lambda: late.ask("look")["read"] > heard, WAIT_S)
    sent = publisher.ask("end")["sent"]
    assert balance(sent, subscriber)["lost"] == 0
    return {"found_s": found_s, "lost": 0}
