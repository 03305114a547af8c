"""Tests of the gateway's alerts in the graph."""

from __future__ import annotations

import socket
import threading

import pytest

from nep.masters.master import Master
from nep.programs.gateway.attachment import GatewayAttachment

pytestmark = [pytest.mark.ports]


def test_taken_port_is_an_alert_in_the_graph_until_it_is_free(fixed_ports, tmp_path):
    waited = threading.Event()
    with socket.socket() as airplay:
        airplay.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        airplay.bind(("127.0.0.1", 7000))
        airplay.listen()
        with Master(
            "127.0.0.1:0", attachments=[GatewayAttachment(tmp_path / "map.json")], learn_s=0.0
        ) as master:
            assert [alert.id for alert in master.view().alerts] == ["port:7000"]
            airplay.close()
            for _ in range(50):
                if not master.view().alerts:
                    break
                waited.wait(0.1)
            assert master.view().alerts == ()
