"""Tests of programs written for the original module: its names work, or the error names the replacement."""

from __future__ import annotations

import ipaddress
import socket
import threading
import traceback

import pytest

import nep
from tests.nep.meeting import place_for

LONG_S = 30.0


@pytest.fixture
def port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.parametrize("transport", ["ZMQ", "POSIX", "socket"])
def test_client_calls_a_server_at_a_fixed_port(port: int, transport: str) -> None:
    requests: list[object] = []

    def serve() -> None:
        with nep.server("127.0.0.1", port, transport) as server:
            for _number in range(2):
                requests.append(server.listen_info(LONG_S))
                server.send_info({"answer": len(requests)})

    thread = threading.Thread(target=serve)
    thread.start()
    with nep.client("127.0.0.1", str(port), transport, timeout_s=LONG_S) as client:
        for number in (1, 2):
            client.send_info({"question": number})
            assert client.listen_info() == {"answer": number}
    thread.join(LONG_S)
    assert requests == [{"question": 1}, {"question": 2}]


def test_missing_server_raises_no_server_error_with_its_address(port: int) -> None:
    with nep.client("127.0.0.1", port, timeout_s=0.01) as client:
        client.send_info({})
        with pytest.raises(nep.NoServerError, match=f"check the address '127.0.0.1:{port}'"):
            client.listen_info()


def test_plain_tcp_node_supports_services_only(port: int) -> None:
    with nep.node("arm", "TCP") as node:
        address = node.direct("127.0.0.1", port)
        node.new_server("/move", lambda request: request, address, threads=1)
        assert node.new_client("/move", address, timeout_s=LONG_S).call({"x": 1}) == {"x": 1}
        for wrong in (
            lambda: node.new_pub("/t"),
            lambda: node.new_sub("/t"),
            lambda: node.new_server("/move"),
            lambda: node.new_client("/move"),
            node.graph,
        ):
            with pytest.raises(nep.NepError, match="plain TCP"):
                wrong()


@pytest.mark.parametrize("names", [("send_json", "listen_json"), ("sendJson", "listenDictionary")])
def test_messages_are_exchanged_with_original_method_names(names: tuple[str, str]) -> None:
    with nep.node("both", "memory", master=place_for("memory", "")) as node:
        words, poses = node.new_sub("/words", "string"), node.new_sub("/poses", "json")
        node.new_pub("/words", "string").send_string("hello")
        getattr(node.new_pub("/poses", "json", node.broker("many2many")), names[0])({"x": 1})
        assert words.listen_string(True) == (True, "hello")
        assert getattr(poses, names[1])(True) == (True, {"x": 1})
        assert poses.listen_json() == (False, {})


def test_original_helper_functions_return_the_ip_address_and_convert_json(tmp_path) -> None:
    assert ipaddress.ip_address(nep.getMyIP())
    assert nep.json2dict(nep.dict2json({"a": [1, None]})) == {"a": [1, None]}
    file = tmp_path / "a.json"
    file.write_text('{"b": 2}')
    assert nep.read_json(file) == {"b": 2}


@pytest.mark.parametrize("name", ["publisher", "subscriber", "nepmaster", "masterRegister", "getFiles"])
def test_removed_name_raises_attribute_error_that_links_the_migration_guide(name: str) -> None:
    with pytest.raises(AttributeError, match=r"docs/original-nep\.md") as raised:
        getattr(nep, name)
    shown = "".join(traceback.format_exception(raised.value))
    assert "Did you mean" not in shown
