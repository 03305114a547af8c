"""Tests of every direction between native programs and the published packages of the original NEP."""

from __future__ import annotations

import pytest

pytestmark = [pytest.mark.ports, pytest.mark.interop, pytest.mark.timeout(300)]

KINDS = ("native", "0.5.3.5", "0.5.4.5", "0.5.4.8", "nep-js")
MESSAGES = 40


def datum(kind, number):
    return {
        "from": kind,
        "n": number,
        "message": 'Grüße  aus 日本 😀, with  spaces, "quotes" and a \\ backslash',
        "list": [1, -2.5, None, True, "x"],
        "inner": {"a b": ""},
    }


def text(kind, number):
    return f'{kind} {number} Grüße  aus 日本 😀 with  spaces and "quotes"'


@pytest.fixture(autouse=True)
def master_is_calm(peers, master):
    """Check after each test that the master has printed no traceback."""
    yield
    assert "Traceback" not in master.printed, master.printed


class Room:
    """One publisher and one subscriber of each kind of program on the same topic."""

    def __init__(self, peers, kinds, topic, msg_type, master):
        self.master = master
        self.subscribers = {kind: peers.start(kind, "subscriber", topic, msg_type) for kind in kinds}
        self.publishers = {kind: peers.start(kind, "publisher", topic, msg_type) for kind in kinds}
        for program in (*self.subscribers.values(), *self.publishers.values()):
            program.wait_ready()

    def warm_up(self, make):
        """Publish until every subscriber receives from every publisher.

        Subscribers of the original NEP join late.
        """
        for kind, publisher in self.publishers.items():
            for number in range(-1, -50, -1):
                publisher.tell(make(kind, number))
                if all(each.hears(make(kind, number), 0.3) for each in self.subscribers.values()):
                    break
            else:
                heard = {to: len(each.got) for to, each in self.subscribers.items()}
                printed = [
                    each.printed[-900:] for each in (self.master, publisher, *self.subscribers.values())
                ]
                pytest.fail(f"{kind} is not heard by everybody: {heard} {printed}")

    def publish(self, make, first=0, count=MESSAGES):
        """Publish from all programs in turn, and wait for each message.

        The original NEP keeps only the newest message.
        """
        for number in range(first, first + count):
            for kind, publisher in self.publishers.items():
                publisher.tell(make(kind, number))
                for to, subscriber in self.subscribers.items():
                    assert subscriber.hears(make(kind, number)), f"{to} misses {number} from {kind}"

    def assert_each_once(self, make, first=0, count=MESSAGES):
        """Check that every subscriber received every message of every publisher exactly once."""
        for kind in self.publishers:
            for to, subscriber in self.subscribers.items():
                got = subscriber.got
                times = [got.count(make(kind, number)) for number in range(first, first + count)]
                assert times == [1] * count, f"{kind} to {to}"


def test_json_is_exchanged_in_every_direction(peers, master):
    room = Room(peers, KINDS, "matrix", "json", master)
    room.warm_up(datum)
    room.publish(datum)
    room.assert_each_once(datum)


def test_strings_are_exchanged_in_every_direction(peers, master):
    room = Room(peers, KINDS[:4], "words", "string", master)
    room.warm_up(text)
    room.publish(text)
    room.assert_each_once(text)
