"""Tests of a master that serves other computers and of address changes, both with loopback addresses."""

from __future__ import annotations

import socket
import sys
import threading
import types

import pytest
import zmq

import nep
from nep.backends.zeromq import master_session
from nep.errors import AddressInUseError, NepError, RequestRefusedError
from nep.masters.listen_addresses import check_hosts
from nep.masters.master import Master
from nep.masters.process import listen
from nep.protocol.encoding import decode_reply, encode_request
from nep.protocol.requests import Listen, RejectedReply
from nep.system.addresses import ANY_HOST, OwnAddress, has_address, own_addresses, reachable_endpoint
from tests.nep.programs import eventually

pytestmark = pytest.mark.skipif(sys.platform == "darwin", reason="macOS answers at one loopback address only")

OTHER = "127.0.0.2"
"""Loopback address that stands for another computer; no program expects the local master there."""
HERE = (OwnAddress("192.168.1.20", "wlan0"), OwnAddress("10.8.0.2", "tun0"))
WAIT_S = 30.0


@pytest.fixture
def far(master):
    """Address at which other computers reach the master."""
    listen([OTHER], master.address)
    return f"{OTHER}:{master.address.rpartition(':')[2]}"


def wait_for(node, wanted):
    """Poll the graph of a node until `wanted` is true of it, and return it."""
    pause = threading.Event()
    for _ in range(int(WAIT_S / 0.05)):
        view = node.graph(WAIT_S)
        if wanted(view):
            return view
        pause.wait(0.05)
    raise AssertionError(view)


@pytest.mark.parametrize(
    ("endpoints", "master", "chosen"),
    [
        (["tcp://127.0.0.1:1", "tcp://192.168.1.20:2"], "127.0.0.1:7780", "tcp://127.0.0.1:1"),
        (["tcp://127.0.0.1:1", "tcp://192.168.1.20:2"], "192.168.1.20:7780", "tcp://192.168.1.20:2"),
        (["tcp://127.0.0.1:1", "tcp://0.0.0.0:2"], "robot.local:7780", "tcp://robot.local:2"),
        (["tcp://192.168.1.33:2"], "127.0.0.1:7780", "tcp://192.168.1.33:2"),
        (["tcp://127.0.0.1:1"], "192.168.1.20:7780", ""),
        ([], "127.0.0.1:7780", ""),
    ],
)
def test_nearest_reachable_endpoint_is_selected(endpoints, master, chosen):
    assert reachable_endpoint(endpoints, master) == chosen


def test_only_addresses_of_this_computer_are_accepted_as_listen_addresses():
    assert check_hosts(["10.8.0.2", ANY_HOST, "10.8.0.2"], HERE) == ("10.8.0.2", ANY_HOST)
    with pytest.raises(NepError, match="'robot' isn't an IPv4 address"):
        check_hosts(["robot"], HERE)
    with pytest.raises(NepError, match=r"'192\.168\.1\.21' .*: 10\.8\.0\.2, 192\.168\.1\.20"):
        check_hosts(["192.168.1.21"], HERE)
    with pytest.raises(NepError, match="connect to a network first"):
        check_hosts(["192.168.1.21"], ())


def test_addresses_of_this_computer_exclude_loopback_and_link_local():
    assert not [own for own in own_addresses() if own.host.startswith(("127.", "169.254."))]
    assert has_address("127.0.0.1")
    assert not has_address("203.0.113.77")


def test_master_listens_on_loopback_only_until_another_address_is_configured(master):
    far = f"{OTHER}:{master.address.rpartition(':')[2]}"
    assert not nep.masters.master.is_running(far, 0.3)
    listen([OTHER], master.address)
    assert nep.masters.master.is_running(far, WAIT_S)
    assert master.view().listens == (OTHER,)
    listen([], master.address)
    assert not nep.masters.master.is_running(far, 0.3)
    assert master.view().listens == ()


def test_rejected_listen_address_leaves_current_listen_addresses_unchanged(master):
    listen([OTHER], master.address)
    with pytest.raises(RequestRefusedError, match=r"'203\.0\.113\.77' isn't an address"):
        listen(["203.0.113.77"], master.address)
    with pytest.raises(RequestRefusedError, match="'localhost' isn't an IPv4 address"):
        listen(["localhost"], master.address)
    assert master.view().listens == (OTHER,)


def test_listen_request_from_another_computer_is_rejected(far, master):
    context = zmq.Context()
    try:
        with context.socket(zmq.DEALER) as asking:
            asking.connect(f"tcp://127.0.0.9:0;{far}")  # sent from the first address to the second
            asking.send(encode_request(Listen(()), 1))
            assert asking.poll(WAIT_S * 1000)
            _call, answer = decode_reply(asking.recv())
    finally:
        context.destroy(linger=0)
    assert isinstance(answer, RejectedReply)
    assert "master's own computer" in answer.reason
    assert master.view().listens == (OTHER,)


@pytest.mark.usefixtures("patient")
def test_nodes_on_two_computers_exchange_all_messages_from_the_first(far, master):
    with nep.node("near") as near, nep.node("far", master=far) as away:
        heard_far, heard_near = away.new_sub("to_far"), near.new_sub("to_near")
        to_far, to_near = near.new_pub("to_far"), away.new_pub("to_near")
        for number in range(40):
            to_far.publish(number)
            to_near.publish(number)
        assert [heard_far.listen(True, timeout_s=WAIT_S)[1] for _ in range(40)] == list(range(40))
        assert [heard_near.listen(True, timeout_s=WAIT_S)[1] for _ in range(40)] == list(range(40))
        view = near.graph()
        hosts = {
            name: {
                endpoint.rpartition(":")[0].removeprefix("tcp://")
                for endpoint in topic.publishers[0].endpoints
            }
            for name, topic in view.topics.items()
        }
        assert hosts["to_far"] == {"127.0.0.1", OTHER}
        assert to_far.missing == to_near.missing == ()


def test_existing_publishers_advertise_a_new_listen_address(master):
    with nep.node("near") as near:
        pub = near.new_pub("t", latched=True)
        pub.publish("before")
        listen([OTHER], master.address)
        wait_for(near, lambda view: len(view.topics["t"].publishers[0].endpoints) == 2)
        with nep.node("far", master=f"{OTHER}:{master.address.rpartition(':')[2]}") as away:
            assert away.new_sub("t").listen(True, timeout_s=WAIT_S) == (True, "before")
        listen([], master.address)
        wait_for(near, lambda view: len(view.topics["t"].publishers[0].endpoints) == 1)


@pytest.mark.usefixtures("patient")
def test_publisher_is_received_after_its_computer_changes_address(far, master, monkeypatch):
    address = ["127.0.0.3"]
    monkeypatch.setattr(master_session, "local_address_towards", lambda _master: address[0])
    with nep.node("near") as near, nep.node("far", master=far) as away:
        sub = near.new_sub("t")
        pub = away.new_pub("t")
        pub.publish("on the first address")
        assert sub.listen(True, timeout_s=WAIT_S) == (True, "on the first address")
        address[0] = "127.0.0.4"
        wait_for(
            near, lambda view: "127.0.0.4" in str([each.endpoints for each in view.topics["t"].publishers])
        )
        eventually(lambda: pub.publish("is it there?") is None and sub.listen(timeout_s=0.1)[0])
        pub.publish("on the second")
        heard = iter(lambda: sub.receive(WAIT_S), None)
        assert any(message.payload == "on the second" for message in heard)
        assert "127.0.0.3" not in str(near.graph().topics["t"].publishers)
        address[0] = None  # master unreachable: the known address is kept
        pub.publish("still")
        assert sub.listen(True, timeout_s=WAIT_S) == (True, "still")


def test_lost_listen_address_raises_an_alert_until_the_address_returns():
    here = [HERE]
    bound = []

    class Router:
        def bind(self, endpoint):
            bound.append(endpoint)

        def unbind(self, endpoint):
            bound.remove(endpoint)

    listening = nep.masters.listen_addresses.ListenAddresses(Router(), 7780, lambda: here[0])
    listening.serve(["192.168.1.20"])
    assert bound == ["tcp://192.168.1.20:7780"]
    assert listening.refresh() == ()
    here[0] = HERE[1:]
    (alert,) = listening.refresh()
    assert "192.168.1.20" in alert.sentence
    assert "10.8.0.2" in alert.hint
    assert bound == []
    here[0] = HERE
    assert listening.refresh() == ()
    assert bound == ["tcp://192.168.1.20:7780"]
    listening.serve([ANY_HOST])
    assert sorted(bound) == ["tcp://10.8.0.2:7780", "tcp://192.168.1.20:7780"]
    here[0] = HERE[:1]
    assert listening.refresh() == ()
    assert bound == ["tcp://192.168.1.20:7780"]


def test_failed_bind_of_one_address_unbinds_all():
    bound = []

    class Router:
        def bind(self, endpoint):
            if bound:
                raise zmq.ZMQError(zmq.EADDRINUSE)
            bound.append(endpoint)

        def unbind(self, endpoint):
            bound.remove(endpoint)

    listening = nep.masters.listen_addresses.ListenAddresses(Router(), 7780, lambda: HERE)
    with pytest.raises(AddressInUseError):
        listening.serve([own.host for own in HERE])
    assert (bound, listening.hosts) == ([], ())


def test_loopback_link_local_and_down_interfaces_are_excluded_from_listen_addresses(monkeypatch):
    def address(host):
        return types.SimpleNamespace(family=socket.AF_INET, address=host)

    found = {
        "lo": "127.0.0.1",
        "eth1": "169.254.7.7",
        "eth0": "192.168.1.20",
        "down0": "10.0.0.9",
        "tun0": "10.8.0.2",
    }
    monkeypatch.setattr(
        "psutil.net_if_addrs", lambda: {name: [address(host)] for name, host in found.items()}
    )
    monkeypatch.setattr(
        "psutil.net_if_stats", lambda: {name: types.SimpleNamespace(isup=name != "down0") for name in found}
    )
    assert own_addresses() == (OwnAddress("192.168.1.20", "eth0"), OwnAddress("10.8.0.2", "tun0"))


def test_port_in_use_is_rejected_with_its_address(master):
    port = master.address.rpartition(":")[2]
    with Master(f"{OTHER}:{port}", learn_s=0.0), pytest.raises(RequestRefusedError, match=OTHER):
        listen([OTHER], master.address)
    assert master.view().listens == ()
