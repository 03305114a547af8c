"""Tests of the gateway's list of programs, and of gateways and programs that restart."""

from __future__ import annotations

import json
import os
import socket

import pytest

from tests.nep.programs import eventually

pytestmark = [pytest.mark.ports]


def is_open(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_second_node_of_the_same_name_is_listed_next_to_the_first(gateway, original, native):
    original.ask("t", node="twin", pid=os.getpid())
    assert original.ask("t", node="twin", pid=os.getppid())["state"] == "success"
    native.wait(lambda: len(native.programs) == 2)


def test_program_role_follows_its_connections(gateway, original, native):
    port = original.ask("t", "publisher", node="js")["port"]
    native.wait(lambda: [program.name for program in native.programs] == ["js"])
    with original.subscriber(port + 1, b"t"):
        native.wait(
            lambda: [link.role for program in native.programs for link in program.links] == ["subscriber"]
        )
    native.wait(lambda: not native.programs)


def test_restarted_gateway_serves_programs_without_a_new_request(gateway_at, original, new_native):
    first, second = new_native(), new_native()
    gateway = gateway_at(first)
    original.ask("other", node="other")
    port = original.ask("t", node="both")["port"]
    with original.subscriber(port + 1, b"t") as subscriber, original.publisher(port) as publisher:
        original.publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0))
        gateway.close()
        gateway_at(second)
        original.publish_until(publisher, b't {"n":2}', lambda: b't {"n":2}' in original.waiting(subscriber))
        second.wait(lambda: second.published)
        second.wait(lambda: second.subscribed)
        second.wait(lambda: {program.name for program in second.programs} == {"other", "both"})
        assert original.ask("t", "subscriber")["port"] == port


def test_http_request_to_gateway_ports_does_not_affect_connected_programs(gateway, original, native):
    port = original.ask("t", "subscriber")["port"]
    with original.subscriber(port + 1, b"t") as subscriber, original.publisher(port) as publisher:
        original.publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0))
        for _ in range(3):
            for visited in (port, port + 1, 7000):
                with socket.create_connection(("127.0.0.1", visited)) as visitor:
                    visitor.sendall(b"GET / HTTP/1.1\r\n\r\n")
        original.ask("other", node="other")
        native.wait(
            lambda: (
                {link.role for each in native.programs for link in each.links} == {"publisher", "subscriber"}
            )
        )
        publisher.send(b't {"n":2}')
        while subscriber.recv() != b't {"n":2}':
            pass


def test_nep_0546_and_0547_are_named_in_an_alert(gateway, original, native):
    port = original.ask("t", "subscriber", port=50000)["port"]
    with original.subscriber(port + 1, b"t"):
        native.wait(lambda: "0.5.4.6" in native.alerts.get("version:t:subscriber", ""))
    native.wait(lambda: "version:t:subscriber" not in native.alerts)
    with original.publisher(port) as publisher:
        original.publish_until(
            publisher,
            json.dumps('{"a":1}').encode(),
            lambda: "0.5.4.7" in native.alerts.get("version:t:publisher", ""),
        )
    native.wait(lambda: not native.alerts)
    assert not native.published


def test_abandoned_topic_keeps_its_port_but_closes_its_sockets(gateway, original, native):
    port = original.ask("t", "subscriber")["port"]
    with original.subscriber(port + 1, b"t"):
        native.wait(lambda: native.subscribed)
    native.wait(lambda: not native.programs)
    original.ask("other")
    eventually(lambda: not is_open(port))  # libzmq closes sockets in its own thread
    assert original.ask("t")["port"] == port
