"""Tests of the gateway's alerts in the graph."""

from __future__ import annotations

import socket

import pytest

from nep.masters.master import Master
from nep.programs.gateway.attachment import GatewayAttachment
from tests.nep.programs import eventually

pytestmark = [pytest.mark.ports]


def test_taken_port_is_an_alert_in_the_graph_until_it_is_free(fixed_ports, tmp_path):
    with socket.socket() as airplay:
        airplay.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        airplay.bind(("127.0.0.1", 7000))
        airplay.listen()
        with Master(
            "127.0.0.1:0", attachments=[GatewayAttachment(tmp_path / "map.json")], learn_s=0.0
        ) as master:
            assert [alert.id for alert in master.view().alerts] == ["port:7000"]
            airplay.close()
            eventually(lambda: master.view().alerts == ())
