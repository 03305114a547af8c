"""Another program's socket at the master's address: questions to the master end in time."""

from __future__ import annotations

import pytest
import zmq

from nep.errors import MasterUnreachable
from nep.masters.process import view


@pytest.mark.parametrize("kind", [zmq.PUB, zmq.REP, zmq.PULL, zmq.PAIR])
def test_a_socket_of_another_kind_is_no_master(kind: int) -> None:
    with zmq.Context() as context, context.socket(kind) as other:
        other.setsockopt(zmq.LINGER, 0)
        port = other.bind_to_random_port("tcp://127.0.0.1")
        with pytest.raises(MasterUnreachable):
            view(f"127.0.0.1:{port}", timeout_s=1.5)
