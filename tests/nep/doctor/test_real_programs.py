"""Tests of the diagnosis of undelivered messages, with real programs and sockets on one computer."""

from __future__ import annotations

import socket
import sys
from itertools import pairwise

import psutil
import pytest

import nep
from nep.masters.master import Master
from nep.programs.doctor import collect_topic, diagnose, start_blocker, topic_findings
from nep.programs.doctor.diagnosis import CHECKS
from nep.programs.doctor.listen import probe_endpoint
from tests.nep.programs import running

SENDER = """
    import sys, nep
    node = nep.node("arm")
    publisher = node.new_pub("/arm/pose")
    publisher.publish({"x": 1})
    print("there")
    sys.stdin.read()
"""


@pytest.fixture
def own() -> str:
    """Network address of this computer; the test is skipped if it has none."""
    for addresses in psutil.net_if_addrs().values():
        for each in addresses:
            if each.family == socket.AF_INET and not each.address.startswith(("127.", "169.254.")):
                return each.address
    pytest.skip("this computer is in no network")


def port_of(address: str) -> str:
    return address.rpartition(":")[2]


def topic_found(address: str) -> list[str]:
    facts = collect_topic("/arm/pose", address)
    assert facts is not None
    return [each.id for each in topic_findings(facts) if each.severity == "error"]


def test_publisher_reachable_only_from_its_own_computer_is_reported(own: str) -> None:
    with Master("0.0.0.0:0", learn_s=0.0) as master:
        port = port_of(master.address)
        with running(SENDER, NEP_MASTER=f"127.0.0.1:{port}") as program:
            assert program.line() == "there"
            facts = collect_topic("/arm/pose", f"{own}:{port}")
            assert facts is not None
            (found,) = [each for each in topic_findings(facts) if each.severity == "error"]
    assert (found.id, facts.publishers[0].reach_failure) == ("topic:address:arm", "elsewhere")
    assert "“arm” can be reached only from its own computer" in found.sentence


def test_killed_publisher_is_unreachable(master: Master) -> None:
    with running(SENDER) as program:
        assert program.line() == "there"
        with nep.node("ear", master=master.address) as node:
            (place,) = [
                each
                for each in node.graph(30.0).topics["/arm/pose"].publishers[0].endpoints
                if each.startswith("tcp://127.")
            ]
        assert probe_endpoint(place) == ""
        program.kill()
        assert probe_endpoint(place) == "refused"


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a full queue refuses")
def test_unanswered_endpoint_is_a_timeout() -> None:
    with socket.socket() as full:
        full.bind(("127.0.0.2", 0))
        full.listen(0)
        place = full.getsockname()
        waiting = [socket.socket() for _ in range(4)]
        try:
            for each in waiting:
                each.setblocking(False)
                each.connect_ex(place)
            assert probe_endpoint(f"tcp://{place[0]}:{place[1]}") == "timeout"
        finally:
            for each in waiting:
                each.close()


def test_master_without_listen_option_is_not_reported_as_hung(master: Master, own: str) -> None:
    found = {each.id: each for each in diagnose(f"{own}:{port_of(master.address)}", "/arm/pose")}
    assert "master:hung" not in found
    assert found["master:closed"].severity == "error"
    assert f"127.0.0.1:{port_of(master.address)}" in found["master:closed"].sentence
    assert "master" in {each.id for each in diagnose(master.address)}


def test_master_cannot_be_started_at_a_network_address(master: Master, own: str) -> None:
    closed = start_blocker(f"{own}:{port_of(master.address)}")
    assert closed is not None
    assert closed.id == "master:closed"
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = probe.getsockname()[1]
    nobody = start_blocker(f"{own}:{free}")
    assert nobody is not None
    assert (nobody.id, nobody.command) == ("master:network", "")
    assert f"start at 127.0.0.1:{free}" in nobody.sentence
    assert f"127.0.0.1:{free}" in nobody.fix


def test_progress_reports_lead_to_the_same_final_result(master: Master) -> None:
    told = []
    found = diagnose(master.address, "/arm/pose", on_progress=lambda *each: told.append(each))
    done = [done for _found, done, _count in told]
    assert done == sorted(done)
    assert {count for _found, _done, count in told} == {done[-1]} == {len(CHECKS) + 1}
    ids = [{each.id for each in some} for some, _done, _count in told]
    assert all(fewer <= more for fewer, more in pairwise(ids))
    assert {each.id for each in found} == ids[-1] >= {"topic:nobody"}
    assert "topic:nobody" not in ids[-2]
    assert {each.id for each in told[0][0]} == {"versions"}
    alone = [each.id for each in diagnose(master.address)]
    assert {each for each in alone if not each.startswith("files:")} <= ids[-1]
