"""Tests of the limit for bytes in flight, without sockets."""

from __future__ import annotations

import random

import pytest

from nep.backends.zeromq.byte_window import (
    ACK_INTERVAL_BYTES,
    MIN_WINDOW_BYTES,
    WINDOW_BYTES,
    Backlog,
    SendWindow,
)


class Held:
    """Tracked message that libzmq holds until the test sets `done`."""

    done = False


def test_bytes_in_flight_are_bounded_for_any_message_sizes() -> None:
    for seed in range(20):
        chance, window, most = random.Random(seed), SendWindow(), 0
        for seq in range(1, 3000):
            size = chance.choice([0, 1, 2**10, 2**20, 6 * 2**20, 64 * 2**20])
            if window.has_room(size):
                window.add_sent(seq, size)
            most = max(most, window.unacked_bytes)
            if chance.random() < 0.01:
                window.acknowledge(chance.randrange(seq + 1), WINDOW_BYTES)
        assert most <= WINDOW_BYTES
        window.acknowledge(3000, WINDOW_BYTES)
        assert window.unacked_bytes == 0


def test_message_larger_than_the_window_is_sent_when_little_is_in_flight() -> None:
    window = SendWindow()
    window.add_sent(1, ACK_INTERVAL_BYTES)
    assert window.has_room(WINDOW_BYTES * 2)
    window.add_sent(2, WINDOW_BYTES * 2)
    assert not window.has_room(1)
    window.acknowledge(1, WINDOW_BYTES)
    assert not window.has_room(1)
    window.acknowledge(2, WINDOW_BYTES)
    assert window.has_room(1)


@pytest.mark.parametrize("bound", [0, 1, MIN_WINDOW_BYTES, 2**64 - 1])
def test_subscriber_sets_its_window_within_limits(bound: int) -> None:
    window = SendWindow()
    window.acknowledge(0, bound)
    size, count = 2**20, 0
    while window.has_room(size):
        count += 1
        window.add_sent(count, size)
    assert count * size == max(MIN_WINDOW_BYTES, min(bound, WINDOW_BYTES))


def test_many_small_messages_need_few_window_entries() -> None:
    window = SendWindow()
    for seq in range(1, 200_000):
        window.add_sent(seq, 1000)
    assert len(window._unacked) < 250
    window.acknowledge(2**64 - 1, WINDOW_BYTES)
    assert window.unacked_bytes == 0


def test_acknowledgement_is_requested_once_per_interval_and_again_while_the_window_is_full() -> None:
    window = SendWindow()
    window.add_sent(1, ACK_INTERVAL_BYTES - 1)
    assert not window.should_request_ack(0.0, has_room=True)
    window.add_sent(2, 1)
    assert window.should_request_ack(0.0, has_room=True)
    assert not window.should_request_ack(0.1, has_room=True)
    assert not window.should_request_ack(0.1, has_room=False)
    assert window.should_request_ack(0.6, has_room=False)
    assert not window.should_request_ack(0.7, has_room=False)


def test_drop_is_notified_once_when_there_is_room_again() -> None:
    window = SendWindow()
    window.add_sent(1, WINDOW_BYTES)
    assert not window.should_notify()
    window.record_drop()
    assert not window.should_notify()
    window.acknowledge(1, WINDOW_BYTES)
    assert window.should_notify()
    assert not window.should_notify()


def test_backlog_of_unacknowledging_peers_is_counted_until_released_in_order() -> None:
    backlog, first, second = Backlog(), Held(), Held()
    backlog.add_sent(first, 100 * 2**20)
    backlog.add_sent(second, 92 * 2**20)
    assert not backlog.has_room(1)
    second.done = True
    assert not backlog.has_room(1)
    first.done = True
    assert backlog.has_room(WINDOW_BYTES)
