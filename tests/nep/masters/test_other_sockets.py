"""Tests of another program's socket at the master's address: requests time out, nodes find a later master."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Thread

import pytest
import zmq

import nep
from nep.errors import MasterUnreachable
from nep.masters.master import Master
from nep.masters.process import view


@contextmanager
def foreign_socket(kind: int) -> Iterator[tuple[str, Callable[[], object]]]:
    """Address of another program's ZeroMQ socket, and a function that waits for a client's disconnection."""
    with zmq.Context() as context, context.socket(kind) as other:
        other.setsockopt(zmq.LINGER, 0)
        port = other.bind_to_random_port("tcp://127.0.0.1")
        with other.get_monitor_socket(zmq.EVENT_DISCONNECTED) as monitor:
            yield f"127.0.0.1:{port}", monitor.recv_multipart
            other.disable_monitor()


@pytest.mark.parametrize("kind", [zmq.PUB, zmq.REP, zmq.PULL, zmq.PAIR])
def test_request_to_a_socket_of_another_program_times_out(kind: int) -> None:
    with foreign_socket(kind) as (address, _wait), pytest.raises(MasterUnreachable):
        view(address, timeout_s=0.6)


def test_node_connects_to_a_master_that_replaces_another_socket_at_its_address() -> None:
    with foreign_socket(zmq.PUB) as (address, wait_for_disconnection):
        node = nep.node("early", master=address, wait_s=None)
        registering = Thread(target=node.new_pub, args=("topic",), daemon=True)
        registering.start()
        wait_for_disconnection()
    with Master(address):
        registering.join(30)
        assert "topic" in view(address, 30.0).topics
        node.close()
