"""Tests of connections between programs of one computer: local sockets, with TCP as the fallback."""

from __future__ import annotations

import contextlib
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import nep
from nep.backends.zeromq import bindings
from nep.masters.master import Master
from tests.nep.programs import eventually

NAMES = Path("/proc/net/unix")

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has names without files")


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("near", master=master.address) as made:
        yield made


def endpoint(node: nep.Node, topic: str) -> str:
    (publisher,) = node.graph().topics[topic].publishers
    (endpoint,) = publisher.endpoints
    return endpoint


def ends(sub: nep.Subscriber) -> list[str]:
    """Return the endpoints that a subscriber is connected to."""
    return [source.endpoint for _id, source in sub._transport._readable.sources.items()]  # type: ignore[attr-defined]


def is_bound(name: str) -> bool:
    return f"@{name.removeprefix('ipc://@')}" in NAMES.read_text().split()


@pytest.mark.parametrize("first", ["publisher", "subscriber"])
def test_local_socket_is_used_regardless_of_start_order(node: nep.Node, first: str) -> None:
    if first == "publisher":
        pub = node.new_pub("t", "string")
        sub = node.new_sub("t", "string")
    else:
        sub = node.new_sub("t", "string")
        pub = node.new_pub("t", "string")
    name = bindings.unix_socket_name(endpoint(node, "t"))
    assert ends(sub) == [name]
    pub.publish("first")
    message = sub.receive(30.0)
    assert message is not None
    assert message.payload == "first"
    assert is_bound(name)
    pub.close()
    eventually(lambda: not is_bound(name))


@pytest.mark.parametrize("msg_type", ["bytes", "image"])
def test_publishers_of_potentially_large_message_types_use_tcp(node: nep.Node, msg_type: str) -> None:
    with node.new_pub("t", msg_type), node.new_sub("t", msg_type) as sub:
        assert ends(sub) == [endpoint(node, "t")]


def test_environment_variable_disables_local_sockets(node: nep.Node, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NEP_LOCAL", "0")
    pub = node.new_pub("t", "string")
    sub = node.new_sub("t", "string")
    assert ends(sub) == [endpoint(node, "t")]
    assert not is_bound(bindings.unix_socket_name(endpoint(node, "t")))
    pub.publish("first")
    assert sub.receive(30.0) is not None


def test_tcp_is_used_where_a_sandbox_forbids_local_sockets(
    node: nep.Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    def forbidden(_self: socket.socket, _address: object) -> None:
        raise PermissionError

    monkeypatch.setattr(bindings, "_probe_results", set())
    pub = node.new_pub("t", "string")
    with monkeypatch.context() as sandbox:
        sandbox.setattr(socket.socket, "connect", forbidden)
        sub = node.new_sub("t", "string")
    assert ends(sub) == [endpoint(node, "t")]
    pub.publish("first")
    assert sub.receive(30.0) is not None


def test_local_name_taken_by_another_program_falls_back_to_tcp(
    node: nep.Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    with contextlib.ExitStack() as taken:

        def take(end: str) -> str:
            name = f"nep-taken-{end.rpartition(':')[2]}"
            holder = taken.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
            if not is_bound(name):
                holder.bind(f"\0{name}")
                holder.listen()
            return f"ipc://@{name}"

        monkeypatch.setattr(bindings, "unix_socket_name", take)
        pub = node.new_pub("t", "string")
        monkeypatch.undo()
        sub = node.new_sub("t", "string")
        assert ends(sub) == [endpoint(node, "t")]
        pub.publish("first")
        assert sub.receive(30.0) is not None


def test_only_loopback_endpoints_have_a_local_name() -> None:
    assert bindings.unix_socket_name("tcp://127.0.0.1:4711") == "ipc://@nep-4711"
    assert bindings.unix_socket_name("tcp://192.168.1.20:4711") == ""
    assert bindings.unix_socket_name("") == ""
