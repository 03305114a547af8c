"""Tests of ROS 2's conventions with other vendors' DDS.

Run by test_ros2.py in a separate network namespace.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from contextlib import AbstractContextManager
from itertools import count, islice
from pathlib import Path

import pytest

import nep
from tests.nep.backends.ros2_programs import (  # noqa: F401 - fixtures
    Make,
    a_domain_for_each_test,
    all_are_patient,
    knows,
    making,
)
from tests.nep.programs import Program, eventually, running

DUST = "needs another vendor's DDS: pip install dust-dds==0.15.0"
Start = Callable[..., AbstractContextManager[Program]]
"""Function that starts a peer, given `hear` or `say`, a topic and optionally `latched`."""


@pytest.fixture(scope="module")
def fast_dds(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Path of the compiled peer that uses Fast DDS."""
    made = tmp_path_factory.mktemp("fast_dds") / "peer"
    source = Path(__file__).with_name("fastdds_peer.cpp")
    command = ["g++", "-std=c++17", str(source), "-o", str(made), "-lfastrtps", "-lfastcdr"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-5000:]
    return str(made)


@pytest.fixture(params=["dust-dds", "fast-dds"])
def start(request: pytest.FixtureRequest) -> Start:
    if request.param == "dust-dds":
        pytest.importorskip("dust_dds", reason=DUST)
        code = Path(__file__).with_name("dust_peer.py").read_text(encoding="utf-8")
        return lambda *words: running(code, *words)
    peer = request.getfixturevalue("fast_dds")
    return lambda *words: running("import os, sys; os.execv(sys.argv[1], sys.argv[1:])", peer, *words)


def test_other_vendor_receives_messages_from_nep(make: Make, start: Start) -> None:
    with start("hear", "rt/chatter") as other:
        assert other.line() == "ready"
        pub = make("a").new_pub("/chatter", "std_msgs/msg/String")
        assert other.line() == "matched"
        eventually(lambda: pub.subscribers == 1)
        for word in ("grüß", "", "gott"):
            pub.publish({"data": word})
        assert [other.line() for _ in range(3)] == ["grüß", "", "gott"]
        pub.close()


def test_nep_receives_messages_from_other_vendor(make: Make, start: Start) -> None:
    """Messages before discovery is complete may be lost, so the first ones are repeated."""
    node = make("a")
    text, data = node.new_sub("chatter", "std_msgs/String"), node.new_sub("chatter", "json")
    with start("say", "rt/chatter") as other:
        assert other.line() == "ready"
        for sub in (text, data):
            while not sub.listen(timeout_s=0.2)[0]:
                other.say("0")
        for number in (1, 2, 3):
            other.say(str(number))

        def three(sub: nep.Subscriber, nothing: object) -> list[object]:
            heard = (sub.listen(timeout_s=60.0)[1] for _ in count())
            return list(islice((each for each in heard if each != nothing), 3))

        assert three(data, 0) == [1, 2, 3]
        assert three(text, {"data": "0"}) == [{"data": "1"}, {"data": "2"}, {"data": "3"}]
        view = node.graph()
        (publisher,) = view.topics["chatter"].publishers
        assert view.nodes[publisher.node_id].name.startswith("dds/")


def test_late_subscriber_of_other_vendor_receives_the_latched_message(make: Make, start: Start) -> None:
    pub = make("a").new_pub("map", "std_msgs/msg/String", latched=True)
    pub.publish({"data": "old"})
    pub.publish({"data": "last"})
    with start("hear", "rt/map", "latched") as other:
        assert [other.line() for _ in range(3)] == ["ready", "matched", "last"]
        pub.publish({"data": "new"})
        assert other.line() == "new"
        pub.close()


def test_late_nep_subscriber_receives_the_latched_message_of_other_vendor(make: Make, start: Start) -> None:
    with start("say", "rt/map", "latched") as other:
        assert other.line() == "ready"
        other.say("last")
        sub = make("a").new_sub("map", "string")
        message = sub.receive(60.0)
        assert message is not None
        assert (message.payload, message.is_latched) == ("last", True)
        assert not sub.listen(timeout_s=0.2)[0]
