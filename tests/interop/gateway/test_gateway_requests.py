"""Tests of the gateway's replies to requests and of the ports that it binds."""

from __future__ import annotations

import json
import os
import socket

import pytest
import zmq

from nep.programs.gateway.request_server import Ports

pytestmark = [pytest.mark.ports]


def test_reply_has_the_original_shape_and_ports_from_9000_up(gateway, original):
    first = original.ask_raw(
        b'{"node":"n1","topic":"t1","mode":"many2many","socket":"publisher","pid":1,"msg_type":"json"}'
    )
    assert first == (
        b'{"topic":"t1","port":9000,"mode":"many2many","ip":"127.0.0.1","socket":"publisher","state":"success"}'
    )
    assert original.ask("t2")["port"] == 9002
    assert original.ask("t1", "subscriber")["port"] == 9000


def test_each_framing_of_a_topic_has_its_own_port_pair(gateway, original):
    assert original.ask("t", port=7000)["port"] != original.ask("t", port=50000)["port"]
    assert (
        original.ask("t", port=50000, msg_type="dictionary")["port"] == original.ask("t", port=7000)["port"]
    )


@pytest.mark.parametrize("port", [7000, 50000])
@pytest.mark.parametrize(
    "bad",
    [
        b"",
        b"hello",
        b"\xff\xfe\x00",
        b"{}",
        b"[]",
        b"null",
        b'{"node":"n"}',
        b'{"node":"n","topic":7,"socket":"publisher"}',
        b'{"node":"n","topic":"t","socket":"telephone"}',
        b'{"node":"n","topic":"t","socket":"publisher","mode":"all"}',
        b'{"node":"n","topic":"t","socket":"publisher","mode":["many2many"]}',
        b'{"node":"n","topic":"t","socket":"publisher","msg_type":{}}',
        b"{" * 50_000,
        b'"' + b"x" * 3_000_000 + b'"',
    ],
    ids=range(14),
)
def test_invalid_requests_receive_a_reply_and_the_gateway_survives(gateway, original, bad, port):
    assert json.loads(original.ask_raw(bad, port))["state"] == "failure"
    assert original.ask("fine", port=port)["state"] == "success"


def test_multipart_requests_and_early_disconnects_do_not_stop_the_gateway(gateway, original):
    with original.socket(zmq.REQ) as asking:
        asking.connect("tcp://127.0.0.1:7000")
        asking.send_multipart([b'{"node":"n",', b'"topic":"t","socket":"publisher"}'])
        assert json.loads(asking.recv())["state"] == "success"
    with original.socket(zmq.REQ) as leaving:
        leaving.connect("tcp://127.0.0.1:7000")
        leaving.send(b"{}")
    for _ in range(20):  # regression: clients that left early made the next reply get lost
        with original.socket(zmq.DEALER) as odd:
            odd.connect("tcp://127.0.0.1:7000")
            odd.send(b"no envelope")
        assert original.ask("t")["state"] == "success"


def test_unknown_keys_unknown_language_and_text_pid_are_accepted(gateway, original):
    assert original.ask("t", pid="4711", colour="green")["state"] == "success"
    assert original.ask("t", pid="none", language="Rust")["state"] == "success"


def test_client_and_server_share_a_port_without_translation(gateway, original, native):
    answer = original.ask("s", "server")
    assert "mode" not in answer
    assert original.ask("s", "client", port=50000)["port"] == answer["port"]
    with original.socket(zmq.REP) as server, original.socket(zmq.REQ) as client:
        server.bind(f"tcp://127.0.0.1:{answer['port']}")
        client.connect(f"tcp://127.0.0.1:{answer['port']}")
        client.send(b"ping")
        server.send(server.recv())
        assert client.recv() == b"ping"
    assert not native.published


def test_broadcast_lists_topics_with_their_nodes_after_requests(gateway, original):
    with original.subscriber(7777, b"master") as tool:
        for number in range(100):
            original.ask(f"t{number % 3}", node="n1")
            if tool.poll(50):
                break
        frame = tool.recv()
        assert frame.startswith(b"master {")
        topics = json.loads(frame[7:])
        assert topics["t0"]["nodes"] == {"n1": {"socket": "publisher", "pid": os.getpid(), "ip": "127.0.0.1"}}


def test_taken_port_raises_an_alert_and_is_served_once_it_is_free(fixed_ports, gateway_at, original, native):
    with socket.socket() as airplay:
        airplay.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        airplay.bind(("127.0.0.1", 7000))
        airplay.listen()
        gateway_at()
        assert "using port 7000" in native.alerts["port:7000"]
        assert original.ask("t", port=50000)["state"] == "success"
    native.wait(lambda: "port:7000" not in native.alerts)
    assert original.ask("t", port=7000)["state"] == "success"


def test_taken_port_pair_is_skipped(fixed_ports, gateway, original):
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", 9001))
        other.listen()
        assert original.ask("t")["port"] == 9002


def test_only_the_loopback_address_is_bound(gateway, original):
    import psutil

    original.ask("t")
    listening = [
        each.laddr for each in psutil.Process().net_connections("tcp") if each.status == psutil.CONN_LISTEN
    ]
    assert {7000, 50000, 7777, 9000, 9001} <= {address.port for address in listening}
    assert {address.ip for address in listening} == {"127.0.0.1"}


def test_gateway_with_disabled_ports_does_not_listen_on_port_7000(gateway_at):
    gateway_at(ports=Ports(0, 0, 0))
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", 7000)) != 0
